"""Figures of a model, by plotly or matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ._innovant import InnovantError
from .frames import Array

if TYPE_CHECKING:
    from .model import Model

#: 95 % of the chi-square law with two degrees of freedom: radius of an ellipse in standard deviations, squared.
ELLIPSE_95 = 5.991464547107979
#: Corners of an ellipse as it is drawn.
CORNERS = 73
COLOURS = ("#1f6feb", "#d1570a", "#1a7f37", "#8250df", "#bf3989", "#6e7781")


def _checked(backend: str) -> str:
    if backend not in ("plotly", "matplotlib"):
        raise InnovantError(f"backend = {backend!r}: expected one of plotly, matplotlib")
    return backend


def bode(model: Model, omega: ArrayLike | None, backend: str) -> Any:
    """See `Model.plot_bode`."""
    draw = _bode_plotly if _checked(backend) == "plotly" else _bode_matplotlib
    return draw(model, _curves(model, omega))


def poles(model: Model, backend: str) -> Any:
    """See `Model.plot_poles`."""
    draw = _poles_plotly if _checked(backend) == "plotly" else _poles_matplotlib
    return draw(model)


def _curves(model: Model, omega: ArrayLike | None) -> list[tuple[str, Array, dict[str, Any]]]:
    """Of each pair of channels: its name, frequencies in Hz, and magnitude and phase with their bands."""
    response = model.frequency_response(omega)
    curves = []
    for o, output in enumerate(model.output_labels):
        for i, name in enumerate(model.input_labels):
            phase = np.unwrap(response.phase[o, i])
            bands: dict[str, Any] = {"magnitude": response.magnitude[o, i], "phase": np.degrees(phase)}
            if response.magnitude_95 is not None and response.phase_95 is not None:
                bands["magnitude_95"] = response.magnitude_95[o, i]
                # The band is around the principal value; it goes where the curve goes.
                turns = (phase - response.phase[o, i])[:, np.newaxis]
                bands["phase_95"] = np.degrees(response.phase_95[o, i] + turns)
            curves.append((f"{output} / {name}", response.frequency, bands))
    return curves


def _bode_plotly(model: Model, curves: list[tuple[str, Array, dict[str, Any]]]) -> Any:
    from plotly.graph_objects import Scatter
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for index, (name, hertz, bands) in enumerate(curves):
        colour = COLOURS[index % len(COLOURS)]
        for row, what in ((1, "magnitude"), (2, "phase")):
            if f"{what}_95" in bands:
                low, high = bands[f"{what}_95"].T
                figure.add_trace(
                    Scatter(
                        x=np.concatenate([hertz, hertz[::-1]]),
                        y=np.concatenate([high, low[::-1]]),
                        fill="toself",
                        fillcolor=colour,
                        opacity=0.2,
                        line={"width": 0},
                        hoverinfo="skip",
                        showlegend=False,
                        legendgroup=name,
                    ),
                    row=row,
                    col=1,
                )
            figure.add_trace(
                Scatter(x=hertz, y=bands[what], name=name, legendgroup=name, showlegend=row == 1, line={"color": colour}),
                row=row,
                col=1,
            )
    figure.update_xaxes(type="log")
    figure.update_xaxes(title_text="frequency [Hz]", row=2, col=1)
    figure.update_yaxes(type="log", title_text="magnitude", row=1, col=1)
    figure.update_yaxes(title_text="phase [degrees]", row=2, col=1)
    figure.update_layout(title="Frequency response with 95 % bands", height=600)
    return figure


def _bode_matplotlib(model: Model, curves: list[tuple[str, Array, dict[str, Any]]]) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for index, (name, hertz, bands) in enumerate(curves):
        colour = COLOURS[index % len(COLOURS)]
        for axes, what in ((above, "magnitude"), (below, "phase")):
            axes.plot(hertz, bands[what], color=colour, label=name)
            if f"{what}_95" in bands:
                axes.fill_between(hertz, *bands[f"{what}_95"].T, color=colour, alpha=0.2, linewidth=0)
    above.set(xscale="log", yscale="log", ylabel="magnitude", title="Frequency response with 95 % bands")
    below.set(xlabel="frequency [Hz]", ylabel="phase [degrees]")
    above.legend()
    return figure


def ellipse(centre: complex, covariance: Array) -> Array:
    """Corners of the 95 % ellipse of a root in the complex plane."""
    values, vectors = np.linalg.eigh(covariance)
    angle = np.linspace(0, 2 * np.pi, CORNERS)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    x, y = vectors @ (np.sqrt(ELLIPSE_95 * np.maximum(values, 0))[:, np.newaxis] * circle)
    return centre + x + 1j * y


def _ellipses(model: Model) -> list[Array]:
    roots = model.poles()
    return [
        ellipse(value, covariance)
        for value, covariance in zip(roots.values, roots.covariance)
        if np.all(np.isfinite(covariance))
    ]


def _circle() -> Array:
    return np.exp(1j * np.linspace(0, 2 * np.pi, 361))


def _poles_plotly(model: Model) -> Any:
    from plotly.graph_objects import Figure, Scatter

    line = {"color": COLOURS[5], "width": 1}
    circle, found, zeros = _circle(), model.poles().values, model.zeros().values
    figure = Figure()
    figure.add_trace(Scatter(x=circle.real, y=circle.imag, line=line, name="unit circle", hoverinfo="skip"))
    for corners in _ellipses(model):
        figure.add_trace(
            Scatter(x=corners.real, y=corners.imag, fill="toself", line={"width": 1, "color": COLOURS[0]}, showlegend=False)
        )
    for roots, name, symbol in ((found, "poles", "x"), (zeros, "zeros", "circle-open")):
        marker = {"symbol": symbol, "size": 9, "color": COLOURS[0]}
        figure.add_trace(Scatter(x=roots.real, y=roots.imag, mode="markers", marker=marker, name=name))
    figure.update_layout(title="Poles with 95 % ellipses, and zeros", xaxis_title="real", yaxis_title="imaginary", height=600)
    figure.update_yaxes(scaleanchor="x", scaleratio=1)
    return figure


def _poles_matplotlib(model: Model) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 6), layout="constrained")
    axes = figure.subplots()
    circle, found, zeros = _circle(), model.poles().values, model.zeros().values
    axes.plot(circle.real, circle.imag, color=COLOURS[5], linewidth=1)
    for corners in _ellipses(model):
        axes.fill(corners.real, corners.imag, color=COLOURS[0], alpha=0.3)
    axes.plot(found.real, found.imag, "x", color=COLOURS[0], label="poles")
    axes.plot(zeros.real, zeros.imag, "o", color=COLOURS[0], fillstyle="none", label="zeros")
    axes.set(aspect="equal", xlabel="real", ylabel="imaginary", title="Poles with 95 % ellipses, and zeros")
    axes.legend()
    return figure
