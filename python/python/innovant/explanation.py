"""What a simulation leaves out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _innovant, frames, html
from ._innovant import InnovantError
from .frames import Array
from .model import Model, document, written
from .record import Record, read


class Explanation:
    """What a recording shows that the simulation does not; made by `explain`."""

    __slots__ = ("_core", "_record", "_simulator")

    def __init__(self, core: _innovant.Explanation, simulator: Callable[[Any], Any] | None = None) -> None:
        self._core = core
        self._record = read(core.to_json())
        self._simulator = simulator

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

    def simulate(self, u: Any, x0: ArrayLike | None = None, simulation: Any = None) -> Any:
        """Simulation with the missing physics in it, on new inputs, in the units of the recording.

        `u` is samples x inputs or a frame with the columns of the inputs. An explanation relative to a simulator that is
        not linear needs the answer of that simulator to the same inputs, `simulation`; when it was made with a function,
        that is called.
        """
        inputs, outputs = self._core.names()
        columns = frames.by_names(u, inputs, "u")
        given = None
        if self._core.needs_simulation():
            if simulation is None:
                simulation = self._simulator
            if callable(simulation):
                simulation = simulation(u)
            given = None if simulation is None else frames.by_names(simulation, outputs, "y")
        state = None if x0 is None else [float(x) for x in np.asarray(x0, dtype=np.float64).reshape(-1)]
        return frames.like(u, self._core.simulate(columns, state, given), outputs)

    def initial_state(self, u: Any, y: Any = None) -> Array:
        """The state at the first sample that explains a recording best."""
        inputs, outputs = self._core.names()
        measured = u if y is None else y
        return self._core.initial_state(frames.by_names(u, inputs, "u"), frames.by_names(measured, outputs, "y"))

    def report(self, path: str | Path) -> None:
        """Write the page with pictures: one HTML file that opens offline."""
        self._core.report(str(path))

    def to_json(self, path: str | Path | None = None) -> str:
        """The document `innovant-explanation/1`, as the command line writes it; also into a file."""
        return written(self._core.to_json(), path)

    @classmethod
    def from_json(cls, source: str | Path) -> Explanation:
        """An explanation out of a document or the path of one."""
        return cls(_innovant.Explanation.from_json(*document(source)))

    def __reduce__(self) -> tuple[Any, ...]:
        return Explanation.from_json, (self.to_json(),)

    def __repr__(self) -> str:
        found = ", ".join(effect.effect for effect in self.effects)
        return f"innovant.Explanation({self.verdict}{': ' + found if found else ''}, probability={self.probability:.2f})"

    def __str__(self) -> str:
        return self._core.text()

    def _repr_html_(self) -> str:
        return html.explanation(self)


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
) -> Explanation:
    """Say what a simulation leaves out: where it differs from the recording, which physics is missing, and the proof.

    Parameters
    ----------
    u, y, dt, inputs, outputs, time
        The recording, as for `identify`.
    simulation : array_like, Model, or callable
        The simulated outputs on the recorded inputs, samples x outputs (a list for several experiments); or a linear
        model: a `Model`, or whatever has `A`, `B`, `C`, `D` and `dt`, as those of python-control and scipy do; or a
        function that takes the inputs as they were given and returns the simulated outputs.
    without : sequence of str
        Effects to leave out of the library: what would be said if nobody had thought of them?
    seed : int
        Seed of the bootstrap.

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
    data = frames.recordings(u, y, dt=dt, inputs=inputs, outputs=outputs, time=time)
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
        simulated = [frames.by_names(part, data.outputs, "y") for part in frames.experiments(simulation)]
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
    return Explanation(core, simulator)
