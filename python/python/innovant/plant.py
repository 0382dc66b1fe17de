"""Plants in equations: flat Modelica, simulated, estimated and judged."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import _innovant, frames
from ._innovant import InnovantError
from .estimate import Estimate
from .frames import Array
from .linearisation import Linearisation
from .validation import PlantValidation


def _text(source: str | os.PathLike[str]) -> tuple[str, str]:
    """Name and text of a plant: a file, or the text itself."""
    if isinstance(source, str) and ("\n" in source or source.lstrip().startswith(("model", "{"))):
        return "plant", source
    return str(source), Path(source).read_text(encoding="utf-8")


class Plant:
    """A plant in equations.

    ``source`` is a file with flat Modelica text, the text itself, or a document that ``fit`` or
    ``innovant identify --structure`` wrote.

    >>> plant = Plant('''model Lag
    ...   parameter Real T(unit="s", min=0.1, max=10) = 1;
    ...   input Real u; output Real y; Real x(start=0);
    ... equation
    ...   T*der(x) = u - x; y = x;
    ... end Lag;''')
    >>> plant.simulate([1.0, 1.0, 1.0], dt=1.0).round(4).ravel().tolist()
    [0.0, 0.6321, 0.8647]
    """

    def __init__(self, source: str | os.PathLike[str]) -> None:
        name, text = _text(source)
        self._plant = _innovant.Plant(name, text)

    @property
    def name(self) -> str:
        """Name of the plant in its text."""
        return self._plant.name()

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""
        return self._plant.inputs()

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs."""
        return self._plant.outputs()

    def headers(self) -> tuple[list[str], list[str]]:
        """Names of the inputs and of the outputs, with units: ``torque [N.m]``."""
        return self._plant.headers()

    @property
    def states(self) -> list[str]:
        """Names of the states."""
        return self._plant.states()

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters that may be changed, with their values."""
        return dict(self._plant.parameters())

    @property
    def hold(self) -> str:
        """How inputs behave between samples: ``zero``, or ``linear`` if they were in the estimation."""
        return self._plant.hold_name()

    def simulate(
        self,
        u: Any,
        dt: float | None = None,
        parameters: Mapping[str, float] | None = None,
        start: Mapping[str, float] | None = None,
        hold: str = "zero",
        start_time: float = 0.0,
    ) -> Array:
        """Outputs, samples x channels, for inputs ``u`` (samples x channels or a frame with columns of their names; for a
        plant without inputs the number of samples). ``dt`` is the sample time in seconds, which the time index of a pandas
        frame gives without it. ``start`` gives initial states by name; the others are those of the text."""
        step = frames.sample_time(u, dt)
        return self._plant.simulate(
            self._inputs(u), step, start_time, list((parameters or {}).items()), list((start or {}).items()), hold
        )

    def fit(
        self,
        u: Any,
        y: Any = None,
        dt: float | None = None,
        fix: Sequence[str] = (),
        hold: str = "zero",
        form: str | None = None,
        least_squares: bool = False,
    ) -> PlantEstimate:
        """Estimates parameters and initial states by maximum likelihood. Lists of arrays are several recordings; a frame
        with the columns of inputs and outputs stands for both. Outputs may be NaN where they were not measured. ``form`` is
        ``"free run"``, ``"innovation"`` or the likelier (None); ``least_squares`` fits the free run as if its error were
        white."""
        data = self._recordings(u, y, dt)
        fixed = [fix] if isinstance(fix, str) else list(fix)
        document, text = self._plant.fit(data.u, data.y, data.dt, fixed, hold, form, least_squares)
        return PlantEstimate(document, text, (data.u, data.y, data.dt))

    def initial_state(self, u: Any, y: Any = None, dt: float | None = None, hold: str | None = None) -> dict[str, float]:
        """The initial states that fit a recording best in free run, for ``simulate(..., start=...)``."""
        data = self._recordings(u, y, dt)
        if len(data.u) != 1:
            raise InnovantError(f"{len(data.u)} recordings in u; expected one")
        return dict(self._plant.initial_state(data.u[0], data.y[0], data.dt, hold))

    def validate(
        self,
        u: Any,
        y: Any = None,
        dt: float | None = None,
        *,
        level: float = 0.01,
        hold: str | None = None,
    ) -> PlantValidation:
        """Judges the plant on recordings that it was not estimated from: fit, tests of the residuals. Initial states are
        estimated; ``level`` is the probability that a right plant is rejected. The parameters of an estimate have their
        uncertainty, those of a text are taken as known."""
        data = self._recordings(u, y, dt)
        document, text, simulated, predicted = self._plant.validate(data.u, data.y, data.dt, hold, level, False)
        return PlantValidation(text, document, data.dt, data.y, simulated, predicted, self.headers()[1])

    def _inputs(self, u: Any) -> Array:
        if isinstance(u, (int, np.integer)) and not self.inputs:
            return np.empty((int(u), 0))
        return frames.by_names(u, self.inputs, "u")

    def _recordings(self, u: Any, y: Any, dt: float | None) -> frames.Recordings:
        return frames.known_recordings(u, y, dt=dt, inputs=self.inputs, outputs=self.outputs)

    def linearise(
        self, state: Mapping[str, float] | None = None, inputs: Sequence[float] | None = None
    ) -> tuple[Array, Array, Array, Array]:
        """Continuous-time ``A, B, C, D`` at a state (those not given are the start values of the text) and inputs (zero);
        ``control.ss(*plant.linearise())`` is a system of python-control."""
        return self._plant.linearise(list((state or {}).items()), self._given(inputs))

    def linearisation(
        self,
        state: Mapping[str, float] | None = None,
        inputs: Sequence[float] | None = None,
        frequencies: Sequence[float] = (),
    ) -> Linearisation:
        """The document ``innovant-linearisation/1``: ``poles`` (natural frequency, damping, time constant),
        ``static_gain`` and ``frequency_response`` (``frequencies`` in rad/s; a grid about the poles) at the equilibrium
        with these inputs (zero), or at a state. Those of an estimate have standard deviations and bands, which follow
        from the covariance of the parameters. Its `plot` is a Bode diagram."""
        at = None if state is None else list(state.items())
        document = self._plant.linearisation(at, self._given(inputs), [float(w) for w in frequencies])
        return Linearisation(json.loads(document), *self.headers())

    def to_modelica(self) -> str:
        """The equations with the values of the parameters."""
        return self._plant.modelica()

    def to_control(
        self, state: Mapping[str, float] | None = None, inputs: Sequence[float] | None = None
    ) -> Any:
        """``linearise`` as a ``control.StateSpace`` of python-control, in continuous time."""
        import control

        return control.StateSpace(
            *self.linearise(state, inputs), inputs=self.inputs, outputs=self.outputs, states=self.states
        )

    def _given(self, inputs: Sequence[float] | None) -> list[float]:
        return [0.0] * len(self.inputs) if inputs is None else [float(v) for v in inputs]

    def __str__(self) -> str:
        return self._plant.text()


class PlantEstimate(Estimate, Plant):
    """A plant with estimated parameters."""

    def __init__(self, document: str, text: str, recordings: tuple[list[Array], list[Array], float]) -> None:
        Plant.__init__(self, document)
        Estimate.__init__(self, document, text, recordings[1], recordings[2], self.headers()[1])
        self._recordings_used = recordings

    def _simulated(self) -> list[Array]:
        us, ys, dt = self._recordings_used
        _, _, simulated, predicted = self._plant.validate(us, ys, dt, None, 0.01, True)
        return predicted if simulated is None else simulated

    def report(self, path: str | os.PathLike[str]) -> None:
        """Writes a page: parameters, recorded and simulated outputs, residuals and equations, in one file that opens
        offline."""
        Path(path).write_text(self._plant.page(*self._recordings_used), encoding="utf-8")
