"""Figures by matplotlib, which is imported when the first one is drawn. They are given arrays and names, not results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._innovant import InnovantError
from .frames import Array, unit_of, without_unit

#: 95 % of the chi-square law with two degrees of freedom: radius of an ellipse in standard deviations, squared.
ELLIPSE_95 = 5.991464547107979
#: Half the width of a 95 % interval of a normal variable, in standard deviations.
NORMAL_95 = 1.959963984540054
#: Half the width of a 99 % interval of a normal variable, in standard deviations.
NORMAL_99 = 2.5758293035489004
#: Corners of an ellipse as it is drawn.
CORNERS = 73
COLOURS = ("#1f6feb", "#d1570a", "#1a7f37", "#8250df", "#bf3989", "#6e7781")
#: Recorded signals are wide and grey: a simulation on top of them hides nothing.
MEASURED = {"color": "#8c959f", "linewidth": 2.2}
AXIS = "#24292f"
BAND = {"alpha": 0.2, "linewidth": 0}
#: A band that reaches further below the smallest magnitude than this factor is cut off: down to zero, a logarithmic axis
#: would show nothing else.
DEEPEST_BAND = 30.0


#: Axes over less than this factor, two decades, have labels at 1, 2 and 5.
FEW_DECADES = 100.0


class Curve(NamedTuple):
    """A frequency response between two channels, named by their headers."""

    input: str
    output: str
    magnitude: Array
    phase: Array
    """In degrees, without jumps by a turn."""
    magnitude_95: Array | None
    """Frequencies x 2."""
    phase_95: Array | None

    @property
    def name(self) -> str:
        """Output / input."""
        return f"{without_unit(self.output)} / {without_unit(self.input)}"

    @property
    def unit(self) -> str:
        """Unit of the magnitude; empty if that of a channel is not known."""
        of, by = unit_of(self.output), unit_of(self.input)
        return "" if not (of and by) else f"{of}/({by})" if any(sign in by for sign in "./* ") else f"{of}/{by}"


class Run(NamedTuple):
    """A simulation of the recordings, as it is drawn beside them."""

    name: str
    outputs: Sequence[Array]
    """One array of samples x outputs for each recording."""
    fit_percent: Sequence[float]
    """One for each output."""


class Correlation(NamedTuple):
    """A correlation function of residuals with its 99 % bounds."""

    title: str
    lags: Sequence[int]
    values: Sequence[float] | Array
    bounds_99: Sequence[float] | Array


class Law(NamedTuple):
    """A static law as the recording shows it, with standard deviations, and the law that was fitted."""

    variable: str
    value_name: str
    at: Sequence[float]
    value: Sequence[float]
    std: Sequence[float]
    fitted: Sequence[float]
    title: str


# -- axes


def pyplot() -> Any:
    """matplotlib.pyplot, or an error that says how to install it."""
    try:
        import matplotlib.pyplot
    except ImportError as error:
        raise ImportError(f"plots need matplotlib ({error}): pip install matplotlib") from None
    return matplotlib.pyplot


def grid(
    ax: Any, rows: int, columns: int, needs: str, size: tuple[float, float], **options: Any
) -> NDArray[Any]:
    """Axes to draw into, rows x columns: new ones, those that were given, or those of a figure that was given."""
    plt = pyplot()
    if ax is None:
        figure = plt.figure(figsize=size, layout="constrained")
        return figure.subplots(rows, columns, squeeze=False, **options)
    if hasattr(ax, "subplots"):
        return ax.subplots(rows, columns, squeeze=False, **options)
    given = np.array(ax, dtype=object).reshape(-1)
    if not all(hasattr(one, "plot") for one in given):
        raise InnovantError(f"ax is {type(ax).__name__}; expected matplotlib Axes, an array of them, or a Figure")
    if given.size != rows * columns:
        raise InnovantError(
            f"ax holds {given.size} Axes; this plot needs {rows * columns}, {rows} x {columns}: {needs}"
        )
    return given.reshape(rows, columns)


def _with_unit(name: str, header: str) -> str:
    unit = unit_of(header)
    return f"{name} [{unit}]" if unit else name


# -- frequency responses, steps, roots


def bode(
    curves: Sequence[Sequence[Curve]],
    hertz: Array,
    nyquist: float | None,
    ax: Any,
    label: str | None,
    decibels: bool,
) -> NDArray[Any]:
    """Magnitude and phase with their bands, two rows an output and a column an input."""
    l, r = len(curves), len(curves[0]) if curves else 0
    axes = grid(
        ax, 2 * l, r, "a row of magnitudes and one of phases for each output, a column for each input",
        (4.5 * r + 2.5, 4.8 * l), sharex=True,
    )
    for o, row in enumerate(curves):
        for i, curve in enumerate(row):
            _bode_pair(axes[2 * o, i], axes[2 * o + 1, i], curve, hertz, label, decibels)
    for one in axes.flat:
        if nyquist is not None and hertz.size:
            one.axvline(nyquist, color=COLOURS[5], linewidth=0.8)
        one.grid(True, which="both", alpha=0.25)
        _readable(one.xaxis)
        if one.get_yscale() == "log":
            _readable(one.yaxis)
    for one in axes[-1]:
        one.set_xlabel("frequency [Hz]")
    if label is not None or any(curve.magnitude_95 is not None for row in curves for curve in row):
        axes[0, 0].legend()
    return axes


def _readable(axis: Any) -> None:
    """Labels of a logarithmic axis that do not overlap: decades, and 1, 2, 5 if there are few decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_minor_formatter(NullFormatter())
    low, high = axis.get_view_interval()
    if 0 < low < high < FEW_DECADES * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _bode_pair(above: Any, below: Any, curve: Curve, hertz: Array, label: str | None, decibels: bool) -> None:
    def size(values: Array) -> Array:
        return 20 * np.log10(values) if decibels else values

    with np.errstate(divide="ignore"):
        (line,) = above.plot(hertz, size(curve.magnitude), label=label)
        colour = line.get_color()
        below.plot(hertz, curve.phase, color=colour)
        if curve.magnitude_95 is not None and curve.phase_95 is not None:
            positive = curve.magnitude[curve.magnitude > 0]
            lowest = positive.min() / DEEPEST_BAND if positive.size else 0.0
            low, high = np.maximum(curve.magnitude_95, lowest).T
            name = "95 % band" if label is None else f"{label}, 95 % band"
            above.fill_between(hertz, size(low), size(high), color=colour, label=name, **BAND)
            below.fill_between(hertz, *curve.phase_95.T, color=colour, **BAND)
    unit = curve.unit
    above.set(title=curve.name, xscale="log")
    above.set_ylabel("magnitude [dB]" if decibels and not unit else f"magnitude [dB, 1 {unit}]" if decibels else
                     f"magnitude [{unit}]" if unit else "magnitude")
    if not decibels:
        above.set_yscale("log")
    below.set_ylabel("phase [°]")
    below.yaxis.get_major_locator().set_params(steps=[1, 1.5, 3, 4.5, 9, 10])


def steps(
    time: Array,
    values: Array,
    half: Array | None,
    names: tuple[Sequence[str], Sequence[str]],
    ax: Any,
    label: str | None,
) -> NDArray[Any]:
    """Step responses with 95 % bands, outputs x inputs."""
    outputs, inputs = names
    axes = grid(
        ax, len(outputs), len(inputs), "a row for each output, a column for each input",
        (4.0 * len(inputs) + 2.5, 2.8 * len(outputs) + 0.8), sharex=True,
    )
    for o, output in enumerate(outputs):
        for i, name in enumerate(inputs):
            one = axes[o, i]
            (line,) = one.step(time, values[o, i], where="post", label=label)
            if half is not None:
                low, high = values[o, i] - half[o, i], values[o, i] + half[o, i]
                band = "95 % band" if label is None else f"{label}, 95 % band"
                one.fill_between(time, low, high, step="post", color=line.get_color(), label=band, **BAND)
            one.set_ylabel(output)
            one.set_title(f"step of {'1 ' + unit_of(name) + ' in ' if unit_of(name) else ''}{without_unit(name)}")
            one.grid(True, alpha=0.25)
    for one in axes[-1]:
        one.set_xlabel("time [s]")
    if label is not None or half is not None:
        axes[0, 0].legend()
    return axes


def ellipse(centre: complex, covariance: Array) -> NDArray[np.complex128]:
    """Corners of the 95 % ellipse of a root in the complex plane."""
    values, vectors = np.linalg.eigh(covariance)
    angle = np.linspace(0, 2 * np.pi, CORNERS)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    x, y = vectors @ (np.sqrt(ELLIPSE_95 * np.maximum(values, 0))[:, np.newaxis] * circle)
    return centre + x + 1j * y


def ellipses(values: NDArray[np.complex128], covariances: Array) -> list[NDArray[np.complex128]]:
    """The ellipses of the roots that have a covariance."""
    return [
        ellipse(value, covariance)
        for value, covariance in zip(values, covariances)
        if np.all(np.isfinite(covariance))
    ]


def unit_circle() -> NDArray[np.complex128]:
    """Corners of the unit circle."""
    return np.exp(1j * np.linspace(0, 2 * np.pi, 361))


def roots(kinds: Sequence[tuple[str, NDArray[np.complex128], Array]], ax: Any, circle: bool = True) -> Any:
    """Poles and zeros (name, values, covariances) in the complex plane with 95 % ellipses."""
    axes = grid(ax, 1, 1, "the complex plane", (6, 6))[0, 0]
    if circle:
        corners = unit_circle()
        axes.plot(corners.real, corners.imag, color=COLOURS[5], linewidth=1)
    for name, values, covariances in kinds:
        mark = {"marker": "o", "fillstyle": "none"} if name == "zeros" else {"marker": "x"}
        (line,) = axes.plot(values.real, values.imag, linestyle="none", label=name, **mark)
        named = False
        for corners in ellipses(values, covariances):
            label = None if named else f"95 % ellipses of {name}"
            axes.fill(corners.real, corners.imag, color=line.get_color(), label=label, **BAND)
            named = True
    axes.axhline(0, color=COLOURS[5], linewidth=0.5)
    axes.axvline(0, color=COLOURS[5], linewidth=0.5)
    of = "" if circle else " [rad/s]"
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel=f"real part{of}", ylabel=f"imaginary part{of}")
    axes.set_title(" and ".join(name for name, _, _ in kinds).capitalize())
    axes.legend()
    return axes


# -- recordings and simulations


def comparison(
    dt: float,
    measured: Sequence[Array],
    runs: Sequence[Run],
    outputs: Sequence[str],
    ax: Any,
    residuals: bool,
) -> NDArray[Any]:
    """Measured and simulated outputs, a column a recording and a row an output; residuals in a row below each."""
    each = 2 if residuals else 1
    rows, columns = each * len(outputs), len(measured)
    needs = "a row for each output" + (" and one for its residuals" if residuals else "") + ", a column for each recording"
    axes = grid(ax, rows, columns, needs, (6.0 * columns + 3.0, 2.6 * rows + 0.8), sharex="col")
    for column, recorded in enumerate(measured):
        time = dt * np.arange(len(recorded))
        for o, output in enumerate(outputs):
            one = axes[each * o, column]
            one.plot(time, recorded[:, o], label="measured", **MEASURED)
            for index, run in enumerate(runs):
                colour = COLOURS[index % len(COLOURS)]
                simulated = run.outputs[column][:, o]
                if not np.any(np.isfinite(simulated)):
                    continue
                one.plot(time, simulated, color=colour, linewidth=1.2, label=f"{run.name}: {run.fit_percent[o]:.1f} %")
                if residuals:
                    error = recorded[:, o] - simulated
                    axes[each * o + 1, column].plot(time, error, color=colour, linewidth=1, label=run.name)
            one.set_ylabel(output)
            if column == 0:
                one.legend(loc="best")
            if residuals:
                _residual_axes(axes[each * o + 1, column], output)
        if columns > 1:
            axes[0, column].set_title(f"recording {column + 1}")
        axes[-1, column].set_xlabel("time [s]")
    for one in axes.flat:
        one.grid(True, alpha=0.25)
    return axes


def _residual_axes(axes: Any, output: str) -> None:
    axes.axhline(0, color=AXIS, linewidth=0.8)
    axes.set_ylabel(_with_unit("residual", output))


def correlations(
    rows: Sequence[Sequence[Correlation | None]], title: str, ax: Any, time_step: str = "samples"
) -> NDArray[Any]:
    """Correlation functions of residuals with their 99 % bounds, as they are given in rows."""
    columns = max(len(row) for row in rows)
    needs = "a row for each output, a column for each signal it is correlated with"
    axes = grid(ax, len(rows), columns, needs, (3.4 * columns + 1.5, 2.5 * len(rows) + 1.0), sharex=True)
    for row, line in zip(axes, rows):
        for one, found in zip(row, line):
            if found is not None:
                _stems(one, found)
    for one in axes[-1]:
        one.set_xlabel(f"lag [{time_step}]")
    if ax is None:
        axes[0, 0].figure.suptitle(title)
    return axes


def _stems(axes: Any, found: Correlation) -> None:
    lags, values, bounds = (np.asarray(part, dtype=float) for part in found[1:])
    outside = np.abs(values) > bounds
    axes.fill_between(lags, -bounds, bounds, color=COLOURS[5], label="99 % bounds", **BAND)
    for select, colour in ((~outside, COLOURS[0]), (outside, COLOURS[1])):
        axes.vlines(lags[select], 0, values[select], color=colour, linewidth=1)
        axes.plot(lags[select], values[select], "o", color=colour, markersize=3)
    axes.axhline(0, color=AXIS, linewidth=0.8)
    largest = max(1.3 * np.max(np.abs([*values, *bounds]), initial=0.0), 1e-12)
    axes.set(ylim=(-largest, largest))
    axes.set_title(found.title, fontsize="medium")
    axes.grid(True, alpha=0.25)


def judged(
    dt: float,
    measured: Array,
    run: Run | None,
    predicted: Array,
    outputs: Sequence[str],
    lags: int,
    title: str,
    ax: Any,
) -> NDArray[Any]:
    """Of each output a column: measured and simulated, the residual one sample ahead, and its autocorrelation."""
    needs = "rows for the output, the residual and its autocorrelation, a column for each output"
    axes = grid(ax, 3, len(outputs), needs, (6.0 * len(outputs) + 1.5, 7.5))
    time = dt * np.arange(len(measured))
    for o, output in enumerate(outputs):
        above, middle, below = axes[:, o]
        above.plot(time, measured[:, o], label="measured", **MEASURED)
        if run is not None:
            text = f"{run.name}: {run.fit_percent[o]:.1f} %"
            above.plot(time, run.outputs[0][:, o], color=COLOURS[0], linewidth=1.2, label=text)
        above.set(ylabel=output)
        above.legend()
        residual = measured[:, o] - predicted[:, o]
        middle.plot(time, residual, color=COLOURS[0], linewidth=1)
        _residual_axes(middle, output)
        middle.set(xlabel="time [s]")
        middle.sharex(above)
        values = autocorrelation(residual, lags)
        bounds = np.full(lags, NORMAL_99 / np.sqrt(len(residual)))
        _stems(below, Correlation("autocorrelation of the residual", range(1, lags + 1), values, bounds))
        below.set(xlabel="lag [samples]")
        for one in (above, middle):
            one.grid(True, alpha=0.25)
    if ax is None:
        axes[0, 0].figure.suptitle(title)
    return axes


def autocorrelation(series: Array, lags: int) -> Array:
    """Correlation coefficients of a series with its past, from lag 1.

    >>> autocorrelation(np.array([1.0, -1.0, 1.0, -1.0]), 2).tolist()
    [-0.75, 0.5]
    """
    centred = series - np.mean(series)
    power = float(np.dot(centred, centred))
    if power == 0.0:
        return np.zeros(lags)
    return np.array([np.dot(centred[lag:], centred[:-lag]) / power for lag in range(1, lags + 1)])


# -- explanations


def explanation(
    traces: Mapping[str, Any], laws: Sequence[Law], names: Mapping[str, str], title: str, ax: Any
) -> NDArray[Any]:
    """Recorded and simulated output, the errors before and after, and the laws."""
    needs = "the output, the error" + "".join(f", {law.title}" for law in laws)
    axes = grid(ax, 2 + len(laws), 1, needs, (9.0, 2.8 * (2 + len(laws)) + 0.6))[:, 0]
    time = np.asarray(traces["time"])
    unit = f" [{traces['unit']}]" if traces["unit"] else ""
    axes[0].plot(time, traces["recorded"], label="measured", **MEASURED)
    for index, (key, name) in enumerate(names.items()):
        series = _numbers(traces[key])
        if series.size != time.size:
            continue
        axes[0].plot(time, series, color=COLOURS[index], linewidth=1.2, label=name)
        axes[1].plot(time, _numbers(traces["recorded"]) - series, color=COLOURS[index], linewidth=1, label=name)
    axes[0].set(ylabel=f"{traces['output']}{unit}")
    axes[1].axhline(0, color=AXIS, linewidth=0.8)
    axes[1].set(xlabel="time [s]", ylabel=f"residual{unit}")
    axes[1].sharex(axes[0])
    axes[0].legend()
    for one, law in zip(axes[2:], laws):
        draw_law(law, one)
    for one in axes:
        one.grid(True, alpha=0.25)
    if ax is None:
        axes[0].figure.suptitle(title)
    return axes


def draw_law(law: Law, ax: Any) -> Any:
    """A law with its 95 % band; what was fitted is dashed."""
    axes = grid(ax, 1, 1, "the law", (6.5, 4.2))[0, 0]
    at, value, std = (_numbers(part) for part in (law.at, law.value, law.std))
    order = np.argsort(at)
    (line,) = axes.plot(at[order], value[order], label="from the recording")
    if std.size == at.size and np.any(np.isfinite(std)):
        half = NORMAL_95 * std
        axes.fill_between(
            at[order], (value - half)[order], (value + half)[order], color=line.get_color(), label="95 % band", **BAND
        )
    if len(law.fitted) == at.size:
        fitted = _numbers(law.fitted)
        axes.plot(at[order], fitted[order], "--", color=COLOURS[1], label="fitted law")
    axes.set(xlabel=law.variable, ylabel=law.value_name)
    axes.set_title(law.title, fontsize="medium")
    axes.legend()
    axes.grid(True, alpha=0.25)
    return axes


def _numbers(values: Any) -> Array:
    """A list of a document as an array; nothing is NaN."""
    return np.asarray([np.nan if value is None else value for value in values], dtype=np.float64)
