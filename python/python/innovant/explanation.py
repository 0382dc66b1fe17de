"""What a simulation leaves out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _innovant, frames, html, plots
from ._innovant import InnovantError
from .documents import document, written
from .frames import Array
from .model import Model
from .plant import Plant
from .record import Record, read

#: What a plot shows beside the recording: key of a signal in the document, and what it is called.
SIGNALS = {"simulated": "simulation", "parameters_only": "other parameters only", "augmented": "with what was found"}


class Explanation:
    """What a recording shows that the simulation does not; made by `explain`."""

    __slots__ = ("_core", "_record", "_simulator", "_dt")

    def __init__(
        self, core: _innovant.Explanation, simulator: Callable[[Any], Any] | None = None, dt: float | None = None
    ) -> None:
        self._core = core
        self._record = read(core.to_json())
        self._simulator = simulator
        model = self._record.get("model")
        self._dt = dt if model is None else model["sample_time"]

    @property
    def verdict(self) -> str:
        """`consistent`, `parameters`, `named`, `family` or `unexplained`."""
        return self._record["verdict"]

    @property
    def probability(self) -> float:
        """Probability that the answer is right."""
        return self._record["probability"]

    @property
    def summary(self) -> list[str]:
        """A few lines for people."""
        return self._record["summary"]

    @property
    def effects(self) -> list[Record]:
        """What was left out, most important first: `effect`, `signal`, `equation`, `parameters`, `evidence`, ..."""
        return self._record["effects"]

    @property
    def where(self) -> Record:
        """Where recording and simulation differ: `outputs`, `port`, `time`, `frequency`, `regime`."""
        return self._record["where"]

    @property
    def alternatives(self) -> list[Record]:
        """What else was tried, best first, and why it lost."""
        return self._record["alternatives"]

    @property
    def fit(self) -> Record:
        """How well the outputs are explained step by step, on what was fitted (`train`) and what was not (`heldout`)."""
        return self._record["fit"]

    @property
    def remaining(self) -> Record:
        """What the answer still leaves unexplained, with its test."""
        return self._record["remaining"]

    def to_dict(self) -> Record:
        """The whole document `innovant-explanation/1`."""
        return self._record

    @property
    def plant(self) -> Plant | None:
        """The plant in equations with what was found, if the simulation was one."""
        found = self._record.get("plant")
        return None if found is None else Plant(found["modelica"])

    @property
    def dt(self) -> float | None:
        """Sample time in seconds; of a plant in equations that was read from a document `None`."""
        return self._dt

    def channels(self) -> tuple[list[str], list[str]]:
        """Names of the inputs and of the outputs, with units."""
        plant = self.plant
        return self._core.names() if plant is None else (plant.inputs, plant.outputs)

    def simulate(
        self, u: Any, x0: ArrayLike | Mapping[str, float] | None = None, simulation: Any = None, dt: float | None = None
    ) -> Any:
        """Simulation with the missing physics in it, on new inputs, in the units of the recording.

        `u` is samples x inputs or a frame with the columns of the inputs. An explanation relative to a simulator that is
        not linear, or of its sensors, needs the answer of that simulator to the same inputs, `simulation`; when it was made
        with a function, that is called. Of a plant in equations `x0` gives initial states by name, and `dt` is the sample
        time of `u`: that of the recording without it, which a document does not contain.
        """
        plant = self.plant
        if plant is not None:
            return frames.like(u, self._simulate_plant(plant, u, x0, simulation, dt), plant.outputs)
        inputs, outputs = self._core.names()
        columns = frames.by_names(u, inputs, "u", dt=self._dt)
        given = self._answer(u, simulation, outputs) if self._core.needs_simulation() else None
        state = None if x0 is None else [float(x) for x in frames.numbers(x0, "x0").reshape(-1)]  # type: ignore[arg-type]
        return frames.like(u, self._core.simulate(columns, state, given), outputs)

    def _answer(self, u: Any, simulation: Any, outputs: list[str]) -> Array | None:
        """The simulator's answer to new inputs, as it is given or as the function that was explained computes it."""
        if simulation is None:
            simulation = self._simulator
        if callable(simulation):
            simulation = simulation(u)
        return None if simulation is None else frames.by_names(simulation, outputs, "y", label="simulation")

    def _simulate_plant(self, plant: Plant, u: Any, x0: Any, simulation: Any, dt: float | None) -> Array:
        if x0 is not None and not isinstance(x0, Mapping):
            raise InnovantError('x0: a plant in equations takes initial states by name, as {"phi": 0.1}')
        hold = self._record["plant"].get("hold", "zero")
        step = frames.sample_time(u, dt if dt is not None else None if frames.index_time(u, "u") else self._dt)
        measured = self._record["plant"].get("simulated_inputs", [])
        if measured:
            answer = self._answer(u, simulation, plant.outputs)
            if answer is None:
                raise InnovantError(f"simulation: the sensors measure {', '.join(measured)}; give the simulator's answer to u")
            recorded = [name for name in plant.inputs if name not in measured]
            u = np.hstack([frames.by_names(u, recorded, "u", dt=self._dt), answer])
        # Another recording comes after what changed in the first.
        changed = {name: -step for name in self._record["plant"].get("times_of_change", [])}
        return plant.simulate(u, step, parameters=changed, start=x0, hold=hold)

    def initial_state(self, u: Any, y: Any = None, dt: float | None = None) -> Any:
        """The state at the first sample that explains a recording best; of a plant in equations a dictionary by name."""
        plant = self.plant
        if plant is not None:
            step = dt if dt is not None else self._dt
            return plant.initial_state(u, y, step, self._record["plant"].get("hold", "zero"))
        inputs, outputs = self._core.names()
        measured = u if y is None else y
        if y is None and not frames.is_frame(u):
            raise InnovantError("y is missing: give u and y as arrays, or one data frame with the columns of both")
        first, second = frames.by_names(u, inputs, "u", dt=self._dt), frames.by_names(measured, outputs, "y", dt=self._dt)
        frames.check_rows(first, second)
        return self._core.initial_state(first, second)

    @property
    def laws(self) -> list[plots.Law]:
        """The laws that the recording shows, over the values of a variable: of effects in plants in equations, and the
        missing static law of other simulations."""
        found = [
            plots.Law(
                law["variable"],
                f"added to the equation of {effect['enters']}" if effect.get("enters") else "added to the equation",
                law["at"],
                law["value"],
                law["std"],
                [],
                f"{effect['effect'].replace('_', ' ')}: {effect['equation']}",
            )
            for effect in self.effects
            if (law := effect.get("law")) is not None
        ]
        curve = self._record.get("curve")
        if curve is not None:
            name = ", ".join(effect["effect"].replace("_", " ") for effect in self.effects) or "missing law"
            found.append(
                plots.Law(
                    curve["variable"], curve["force"], curve["at"], curve["value"], curve["std"], curve.get("fitted", []), name
                )
            )
        return found

    def plot(self, ax: Any = None, *, output: str | None = None, recording: int = 0) -> Any:
        """Measured and simulated output before and after, the residuals of both, and each law with its 95 % band.

        `output` is the one that the effect shows most, without another name. Needs matplotlib. Returns the array of Axes;
        `ax` takes such an array.
        """
        signals = self._record["signals"]
        output = output if output is not None else self.fit["output"]
        chosen = [s for s in signals if s["output"] == output and s["recording"] == recording]
        if not chosen:
            there = ", ".join(f"{s['output']!r} of recording {s['recording']}" for s in signals) or "none"
            raise InnovantError(f"there are no signals of output {output!r} of recording {recording}; there are: {there}")
        names = SIGNALS if self.effects else {key: SIGNALS[key] for key in ("simulated", "parameters_only")}
        found = ", ".join(effect["effect"].replace("_", " ") for effect in self.effects)
        title = f"{self.verdict}{': ' + found if found else ''} (probability {self.probability:.2f})"
        return plots.explanation(chosen[0], self.laws, names, title, ax)

    def plot_law(self, ax: Any = None, *, index: int = 0) -> Any:
        """One of the `laws` with its 95 % band; needs matplotlib. Returns the Axes, which is `ax` if given."""
        laws = self.laws
        if not -len(laws) <= index < len(laws):
            raise InnovantError(f"law {index} is not there: this explanation has {len(laws)} laws")
        return plots.draw_law(laws[index], ax)

    def report(self, path: str | Path) -> None:
        """Write the page with plots: one HTML file that opens offline."""
        self._core.report(str(path))

    def to_json(self, path: str | Path | None = None) -> str:
        """The document `innovant-explanation/1`, as the command line writes it; also into a file."""
        return written(self._core.to_json(), path)

    @classmethod
    def from_json(cls, source: str | Path) -> Explanation:
        """An explanation out of a document or the path of one."""
        return cls(_innovant.Explanation.from_json(*document(source)))

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.to_json(), self._dt)

    def __repr__(self) -> str:
        found = ", ".join(effect.effect for effect in self.effects)
        return f"innovant.Explanation({self.verdict}{': ' + found if found else ''}, probability={self.probability:.2f})"

    def __str__(self) -> str:
        return self._core.text()

    def _repr_html_(self) -> str:
        return html.explanation(self._record)


def _restored(text: str, dt: float | None) -> Explanation:
    return Explanation(_innovant.Explanation.from_json("document", text), None, dt)


def explain(
    u: Any,
    y: Any = None,
    *,
    simulation: Any,
    dt: float | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    time: str | None = None,
    without: Sequence[str] = (),
    seed: int = 0,
    only: Sequence[str] = (),
    hypotheses: str | Sequence[str] = (),
    hold: str | None = None,
) -> Explanation:
    """Say what a simulation leaves out: where it differs from the recording, which physics is missing, and the proof.

    Parameters
    ----------
    u, y, dt, inputs, outputs, time
        The recording, as for `identify`.
    simulation : array_like, Model, Plant, or callable
        The simulated outputs on the recorded inputs, samples x outputs (a list for several experiments); or a linear
        model: a `Model`, or whatever has `A`, `B`, `C`, `D` and `dt`, as those of python-control and scipy do; or a
        function that takes the inputs as they were given and returns the simulated outputs; or a plant in equations.
    without : sequence of str
        Effects to leave out of the library: what would be said if nobody had thought of them?
    seed : int
        Seed of the bootstrap.
    only, hypotheses, hold
        Of plants in equations: the only effects of the library that are tried; terms of your own, as
        ``"drag: m*der(v) += -c*v*abs(v), c > 0"``; ``zero`` or ``linear`` inputs between samples.

    Examples
    --------
    A mass on a spring with dry friction, which the simulation knows nothing of:

    >>> import innovant, numpy as np
    >>> rng = np.random.default_rng(1)
    >>> dt, u = 0.01, np.repeat(rng.normal(0, 2, 150), 10)
    >>> def mass(u, friction):
    ...     position, velocity, y = 0.0, 0.0, []
    ...     for force in u:
    ...         y.append(position)
    ...         for _ in range(20):
    ...             acceleration = force - 25 * position - velocity - friction * np.tanh(velocity / 1e-3)
    ...             velocity += acceleration * dt / 20
    ...             position += velocity * dt / 20
    ...     return np.array(y)
    >>> y = mass(u, 0.3) + rng.normal(0, 2e-4, len(u))
    >>> found = innovant.explain(u, y, simulation=lambda u: mass(u, 0.0), dt=dt)
    >>> found.verdict, found.effects[0].effect
    ('named', 'coulomb_friction')
    """
    if isinstance(simulation, Plant):
        inputs = simulation.inputs if inputs is None else inputs
        outputs = simulation.outputs if outputs is None else outputs
    data = frames.recordings(u, y, dt=dt, inputs=inputs, outputs=outputs, time=time)
    texts = [hypotheses] if isinstance(hypotheses, str) else list(hypotheses)
    if isinstance(simulation, Plant):
        found = _innovant.explain_plant(
            simulation._plant, data.u, data.y, data.dt, (data.inputs, data.outputs), hold, list(only), list(without), texts
        )
        return Explanation(found, None, data.dt)
    if only or texts or hold is not None:
        raise InnovantError("only, hypotheses and hold belong to plants in equations, and the simulation is none")
    model = None
    simulated: list[Array] = []
    simulator = None
    if isinstance(simulation, Model):
        model = simulation
    elif all(hasattr(simulation, name) for name in "ABCD"):
        sampled = getattr(simulation, "dt", None)
        if not sampled or sampled is True:
            raise InnovantError(
                "simulation: this model has no sample time; sample it at that of the recording first, "
                f"{data.dt} s"
            )
        model = Model(simulation.A, simulation.B, simulation.C, simulation.D, dt=sampled)
    else:
        if callable(simulation):
            simulator = simulation
            simulation = [simulation(part) for part in frames.experiments(u)]
        simulated = [
            frames.by_names(part, data.outputs, "y", label="simulation") for part in frames.experiments(simulation)
        ]
    core = _innovant.explain(
        data.u,
        data.y,
        data.dt,
        (data.inputs, data.outputs),
        None if model is None else model._core,
        simulated,
        list(without),
        seed,
    )
    return Explanation(core, simulator, data.dt)
