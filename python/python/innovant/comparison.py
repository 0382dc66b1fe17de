"""Several models on the same recording, in free run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from . import frames, html, plots
from ._innovant import InnovantError
from .explanation import Explanation
from .frames import Array, without_unit
from .model import Model
from .plant import Plant
from .simulator import Simulator

#: What `compare` takes, for messages.
KINDS = (
    "a Model, a Plant or its estimate, an Explanation, a Simulator, a state-space model of python-control or scipy, a "
    "function u -> y, or an array of simulated outputs"
)


class Comparison:
    """Free runs of several models on the same recordings, made by `compare`."""

    def __init__(
        self,
        names: list[str],
        outputs: list[str],
        dt: float,
        measured: list[Array],
        simulated: list[list[Array]],
    ) -> None:
        #: Names of the models.
        self.names = names
        #: Names of the outputs, with units.
        self.outputs = outputs
        #: Sample time in seconds.
        self.dt = dt
        #: Recorded outputs, one array a recording.
        self.measured = measured
        #: Of each model the simulated outputs, one array a recording. An output that a model has not is NaN.
        self.simulated = dict(zip(names, simulated))
        figures = [[_figures(measured, run, o) for o in range(len(outputs))] for run in simulated]
        both: Array = np.array(figures, dtype=np.float64).reshape(len(names), len(outputs), 2)
        #: Fit in percent, models x outputs: 100 % is no error, 0 % is as good as the mean of the output.
        self.fit_percent: Array = both[..., 0]
        #: Root mean square of the error in the unit of the output, models x outputs.
        self.rmse: Array = both[..., 1]

    def residuals(self, name: str) -> list[Array]:
        """Recorded minus simulated outputs of a model, one array a recording."""
        if name not in self.simulated:
            raise InnovantError(f"there is no model {name!r}; there are: {', '.join(self.names)}")
        return [y - simulated for y, simulated in zip(self.measured, self.simulated[name])]

    def to_dict(self) -> dict[str, dict[str, dict[str, float]]]:
        """Of each model and each output ``fit_percent`` and ``rmse``."""
        return {
            name: {
                without_unit(output): {"fit_percent": float(self.fit_percent[m, o]), "rmse": float(self.rmse[m, o])}
                for o, output in enumerate(self.outputs)
            }
            for m, name in enumerate(self.names)
        }

    def plot(self, ax: Any = None, *, residuals: bool = False) -> Any:
        """Measured and simulated outputs with the fits in the legend; with `residuals` also these, in a row below each.

        A row for each output, a column for each recording. Needs matplotlib. Returns the array of Axes; `ax` takes such an
        array.
        """
        runs = [plots.Run(name, self.simulated[name], self.fit_percent[m]) for m, name in enumerate(self.names)]
        return plots.comparison(self.dt, self.measured, runs, self.outputs, ax, residuals)

    def _rows(self) -> tuple[list[str], list[list[str]]]:
        head = ["model", "output", "fit", "rmse"]
        rows = [
            [
                name if o == 0 else "",
                without_unit(output),
                _known(f"{self.fit_percent[m, o]:.2f} %"),
                _known(f"{self.rmse[m, o]:.4g} {frames.unit_of(output)}".rstrip()),
            ]
            for m, name in enumerate(self.names)
            for o, output in enumerate(self.outputs)
        ]
        return head, rows

    def __repr__(self) -> str:
        count = len(self.measured)
        samples = sum(len(y) for y in self.measured)
        head, rows = self._rows()
        widths = [max(len(row[column]) for row in [head, *rows]) for column in range(len(head))]
        # Names are aligned at the left, numbers at the right.
        sides = ("<", "<", ">", "<")
        lines = [
            "  ".join(f"{cell:{side}{width}}" for cell, side, width in zip(row, sides, widths)).rstrip()
            for row in [head, *rows]
        ]
        of = "1 recording" if count == 1 else f"{count} recordings"
        return "\n".join([f"Free run on {of}, {samples} samples, dt = {self.dt:g} s", *lines])

    def _repr_html_(self) -> str:
        return html.table(*self._rows())


def _known(text: str) -> str:
    return "-" if text.startswith("nan") else text


def _figures(measured: Sequence[Array], simulated: Sequence[Array], output: int) -> tuple[float, float]:
    """Fit in percent and root mean square of the error of an output, over all recordings; means are by recording, and of
    the values that were measured."""
    error = spread = 0.0
    samples = 0
    for all_recorded, run in zip(measured, simulated):
        known = ~np.isnan(all_recorded[:, output])
        recorded = all_recorded[known, output]
        error += float(np.sum((recorded - run[known, output]) ** 2))
        spread += float(np.sum((recorded - np.mean(recorded)) ** 2)) if recorded.size else 0.0
        samples += recorded.size
    fit = 100.0 * (1.0 - np.sqrt(error / spread)) if spread > 0.0 else np.nan
    return float(fit), float(np.sqrt(error / max(samples, 1)))


class _Case(NamedTuple):
    """One recording, as it was given and as arrays."""

    given_u: Any
    given_y: Any
    u: Array
    y: Array
    suffix: str


class _Candidate:
    """A model with its names: what is simulated, and how."""

    def __init__(self, model: Any, initial: str) -> None:
        self.model = model
        self.initial = initial
        self.dt: float | None = None
        self.inputs: list[str] | None = None
        self.outputs: list[str] | None = None
        #: Names of the outputs with units.
        self.headers: list[str] | None = None
        if isinstance(model, Model):
            self.name = f"model of order {model.order}"
            self.inputs, self.outputs = model.headers()
            self.headers = self.outputs
            self.dt = model.dt
        elif isinstance(model, Explanation):
            found = ", ".join(effect.effect for effect in model.effects)
            self.name = f"explanation: {found or model.verdict}"
            self.inputs, self.outputs = model.channels()
            self.headers = self.outputs if model.plant is None else model.plant.headers()[1]
            self.dt = model.dt
        elif isinstance(model, Plant):
            self.name = model.name
            self.inputs, self.outputs = model.inputs, model.outputs
            self.headers = model.headers()[1]
        elif isinstance(model, Simulator):
            self.name = getattr(model.function, "__name__", "simulator")
            self.inputs, self.outputs = model.inputs, model.outputs
            self.headers = model.outputs
        elif callable(model) and not all(hasattr(model, letter) for letter in "ABCD"):
            self.name = getattr(model, "__name__", "simulation").replace("<lambda>", "simulation")
        else:
            self.name = "simulation"

    def simulate(self, case: _Case, dt: float, data: frames.Recordings, index: int) -> tuple[Array, list[str] | None]:
        """Simulated outputs, and their names if they are a part of those recorded."""
        model = self.model
        if self.dt is not None and abs(self.dt - dt) > frames.SAMPLING_TOLERANCE * dt:
            raise InnovantError(f"the data have dt = {dt:g} s and the model dt = {self.dt:g} s; resample one of them")
        if isinstance(model, (Model, Explanation, Plant, Simulator)):
            u = self._channels(case.given_u, case.u, self.inputs, data.inputs, f"u{case.suffix}", "u")
            outputs = self.outputs if self.outputs is not None else data.outputs
            start: Any = None
            if self.initial == "estimate" and not isinstance(model, Simulator):
                given = case.given_u if case.given_y is None else case.given_y
                y = self._channels(given, case.y, outputs, data.outputs, f"y{case.suffix}", "y")
                start = model.initial_state(u, y, dt) if isinstance(model, (Plant, Explanation)) else model.initial_state(u, y)
            return self._run(model, u, start, dt), outputs
        if callable(model):
            return frames.by_names(model(case.given_u), data.outputs, "y", label=self.name), None
        runs = frames.experiments(model)
        if index >= len(runs):
            raise InnovantError(f"it holds {len(runs)} recordings, and the data have more")
        return frames.by_names(runs[index], data.outputs, "y", label=self.name), None

    @staticmethod
    def _run(model: Any, u: Array, start: Any, dt: float) -> Array:
        if isinstance(model, Plant):
            return model.simulate(u, dt, start=start, hold=model.hold)
        if isinstance(model, Explanation):
            return model.simulate(u, start, dt=dt)
        return model.simulate(u, start) if isinstance(model, Model) else model.simulate(u)

    @staticmethod
    def _channels(
        given: Any, array: Array, names: list[str] | None, known: list[str], what: str, letter: Literal["u", "y"]
    ) -> Array:
        """The channels of a model: by name in a frame or if the recording names them, in their order otherwise."""
        if names is None:
            return array
        if frames.is_frame(given):
            return frames.by_names(given, names, letter, label=what)
        places = [without_unit(name) for name in known]
        wanted = [without_unit(name) for name in names]
        if all(name in places for name in wanted):
            return array[:, [places.index(name) for name in wanted]]
        return frames.samples(array, what, names)


def compare(
    data: Any,
    *models: Any,
    dt: float | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    time: str | None = None,
    names: str | Sequence[str] | None = None,
    initial: Literal["estimate", "zero"] = "estimate",
) -> Comparison:
    """Simulate several models on the same recordings from the inputs alone, and say how well each follows the outputs.

    Parameters
    ----------
    data
        A pair ``(u, y)`` of arrays, a data frame, or a list of pairs or of frames for several recordings.
    *models
        Each a `Model`, a `Plant` or its estimate, an `Explanation`, a `Simulator`, a discrete state-space model of
        python-control or scipy, a function of the inputs, or an array of simulated outputs. In frames, channels are found
        by the names in the model; arrays have the order of the model.
    dt, inputs, outputs, time
        As for `identify`. Without `inputs` and `outputs` the channels of a frame are those of the first model that has
        names.
    names : sequence of str
        What the models are called.
    initial : str
        ``estimate`` starts each model at the state that fits the recording best, ``zero`` at its operating point (plants in
        equations: at the values of their text). Functions, simulators and arrays start where they do.

    Examples
    --------
    >>> import innovant
    >>> u, y, dt = innovant.examples.servo(4000)
    >>> models = [innovant.identify(u, y, dt=dt, order=order) for order in (1, 3)]
    >>> new_u, new_y, _ = innovant.examples.servo(2000, seed=2)
    >>> comparison = innovant.compare((new_u, new_y), *models, dt=dt)
    >>> comparison.fit_percent.shape, bool(comparison.fit_percent[0, 0] < comparison.fit_percent[1, 0])
    ((2, 1), True)
    """
    if not models:
        raise InnovantError(f"there is nothing to compare: pass {KINDS}")
    if initial not in ("estimate", "zero"):
        raise InnovantError(f"initial = {initial!r}: expected one of estimate, zero")
    candidates = [_candidate(model, number, initial) for number, model in enumerate(models)]
    pairs = _pairs(data)
    if pairs[0][1] is None:
        named = [c for c in candidates if c.outputs is not None]
        if outputs is None and named:
            outputs = named[0].outputs
        if inputs is None and named:
            inputs = next((c.inputs for c in named if c.inputs is not None), None)
    us: Any = [u for u, _ in pairs]
    ys: Any = [y for _, y in pairs]
    known = frames.recordings(
        us[0] if len(us) == 1 else us,
        None if ys[0] is None else ys[0] if len(ys) == 1 else ys,
        dt=dt,
        inputs=inputs,
        outputs=outputs,
        time=time,
    )
    if outputs is None and pairs[0][1] is not None and not frames.is_frame(pairs[0][1]):
        # Arrays have no names: those of the first model that has some.
        fitting = (c for c in candidates if c.headers is not None and len(c.headers) == len(known.outputs))
        named_by = next(fitting, None)
        if named_by is not None and named_by.headers is not None:
            known.outputs = list(named_by.headers)
    labels = _labels(candidates, names)
    simulated = [_simulated(c, label, pairs, known) for c, label in zip(candidates, labels)]
    return Comparison(labels, known.outputs, known.dt, known.y, simulated)


def _candidate(model: Any, number: int, initial: str) -> _Candidate:
    if not isinstance(model, (Model, Explanation, Plant, Simulator)) and all(hasattr(model, name) for name in "ABCD"):
        step = getattr(model, "dt", None)
        if not step or step is True:
            raise InnovantError(f"model {number + 1} has no sample time: sample it at that of the recording first")
        made = _Candidate(Model(model.A, model.B, model.C, model.D, dt=step), initial)
        # Its channels are in their order; the names are not those of the recording.
        made.inputs = made.outputs = made.headers = None
        return made
    if isinstance(model, (str, bytes, dict)) or model is None:
        raise InnovantError(f"model {number + 1} is a {type(model).__name__}; expected {KINDS}")
    return _Candidate(model, initial)


def _pairs(data: Any) -> list[tuple[Any, Any]]:
    """Inputs and outputs of each recording; frames have no outputs of their own."""
    if isinstance(data, tuple) and len(data) == 2:
        return [(data[0], data[1])]
    parts = data if isinstance(data, list) and data else [data]
    found: list[tuple[Any, Any]] = []
    for part in parts:
        if frames.is_frame(part):
            found.append((part, None))
        elif isinstance(part, tuple) and len(part) == 2:
            found.append((part[0], part[1]))
        else:
            raise InnovantError(
                f"data is a {type(data).__name__}; expected a pair (u, y), a data frame, or a list of pairs or of frames"
            )
    if len({y is None for _, y in found}) > 1:
        raise InnovantError("data holds pairs and frames; expected recordings of one kind")
    return found


def _labels(candidates: Sequence[_Candidate], names: str | Sequence[str] | None) -> list[str]:
    """Names of the models, each once."""
    if names is not None:
        given = [names] if isinstance(names, str) else [str(name) for name in names]
        if len(given) != len(candidates) or len(set(given)) != len(given):
            raise InnovantError(
                f"names holds {len(given)} names for {len(candidates)} models; expected a different one for each"
            )
        return given
    labels: list[str] = []
    for candidate in candidates:
        label, count = candidate.name, 1
        while label in labels:
            count += 1
            label = f"{candidate.name} ({count})"
        labels.append(label)
    return labels


def _simulated(candidate: _Candidate, label: str, pairs: Sequence[tuple[Any, Any]], known: frames.Recordings) -> list[Array]:
    runs = []
    single = len(pairs) == 1
    for index, (given_u, given_y) in enumerate(pairs):
        case = _Case(given_u, given_y, known.u[index], known.y[index], "" if single else f"[{index}]")
        try:
            run, outputs = candidate.simulate(case, known.dt, known, index)
            runs.append(_placed(run, outputs, known.outputs, case.y))
        except InnovantError as error:
            raise InnovantError(f"{label}: {error}") from None
    return runs


def _placed(run: Array, outputs: list[str] | None, known: Sequence[str], y: Array) -> Array:
    """Simulated outputs in the columns of those recorded; those that the model has not are NaN."""
    if len(run) != len(y):
        raise InnovantError(f"it has the shape {run.shape}, and the recorded outputs have the shape {y.shape}")
    recorded = [without_unit(name) for name in known]
    wanted = None if outputs is None else [without_unit(name) for name in outputs]
    if wanted is None or not all(name in recorded for name in wanted):
        return frames.samples(run, "the simulation", list(known), few=True)
    placed = np.full(y.shape, np.nan)
    for column, name in enumerate(wanted):
        placed[:, recorded.index(name)] = run[:, column]
    return placed
