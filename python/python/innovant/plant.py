"""Plants in equations: flat Modelica, simulated and estimated."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from . import _innovant


class EstimatedParameter(NamedTuple):
    """A parameter with its uncertainty."""

    value: float
    #: Standard deviation; None where the recordings do not determine it.
    std: float | None
    #: 95 % interval; None where it is open.
    interval_95: tuple[float | None, float | None]


def _text(source: str | os.PathLike[str]) -> tuple[str, str]:
    """Name and text of a plant: a file, or the text itself."""
    if isinstance(source, str) and ("\n" in source or source.lstrip().startswith(("model", "{"))):
        return "plant", source
    return str(source), Path(source).read_text(encoding="utf-8")


def _columns(values: Any, names: Sequence[str], what: str) -> np.ndarray:
    """Samples x channels."""
    array = np.asarray(values, dtype=float)
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2 or array.shape[1] != len(names):
        raise _innovant.InnovantError(
            f"{what} has the shape {array.shape}; it is samples x {len(names)} ({', '.join(names) or 'none'})"
        )
    return array


def _recordings(values: Any) -> list[Any]:
    return list(values) if isinstance(values, (list, tuple)) and len(values) and np.ndim(values[0]) > 0 else [values]


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
    def inputs(self) -> list[str]:
        """Names of the inputs."""
        return self._plant.inputs()

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs."""
        return self._plant.outputs()

    @property
    def states(self) -> list[str]:
        """Names of the states."""
        return self._plant.states()

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters that may be changed, with their values."""
        return dict(self._plant.parameters())

    def simulate(
        self,
        u: Any,
        dt: float,
        parameters: Mapping[str, float] | None = None,
        start: Mapping[str, float] | None = None,
        hold: str = "zero",
        start_time: float = 0.0,
    ) -> np.ndarray:
        """Outputs, samples x channels, for inputs ``u`` (samples x channels; for a plant without inputs the number of
        samples). ``start`` gives initial states by name; the others are those of the text."""
        inputs = np.empty((u, 0)) if isinstance(u, int) else _columns(u, self.inputs, "u")
        return self._plant.simulate(
            inputs, dt, start_time, list((parameters or {}).items()), list((start or {}).items()), hold
        )

    def fit(
        self,
        u: Any,
        y: Any,
        dt: float,
        fix: Sequence[str] = (),
        hold: str = "zero",
        form: str | None = None,
        least_squares: bool = False,
    ) -> PlantEstimate:
        """Estimates parameters and initial states by maximum likelihood. Lists of arrays are several recordings.
        ``form`` is ``"free run"``, ``"innovation"`` or the likelier (None); ``least_squares`` fits the free run as if its
        error were white."""
        us = [_columns(a, self.inputs, "u") for a in _recordings(u)]
        ys = [_columns(a, self.outputs, "y") for a in _recordings(y)]
        if len(us) != len(ys):
            raise _innovant.InnovantError(f"u holds {len(us)} recordings and y {len(ys)}")
        document, text = self._plant.fit(us, ys, dt, list(fix), hold, form, least_squares)
        return PlantEstimate(document, text, (us, ys, dt))

    def linearise(
        self, state: Mapping[str, float] | None = None, inputs: Sequence[float] | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Continuous-time ``A, B, C, D`` at a state (those not given are the start values of the text) and inputs (zero);
        ``control.ss(*plant.linearise())`` is a system of python-control."""
        return self._plant.linearise(list((state or {}).items()), self._given(inputs))

    def linearisation(
        self,
        state: Mapping[str, float] | None = None,
        inputs: Sequence[float] | None = None,
        frequencies: Sequence[float] = (),
    ) -> dict[str, Any]:
        """The document ``innovant-linearisation/1``: ``poles`` (natural frequency, damping, time constant),
        ``static_gain`` and ``frequency_response`` (``frequencies`` in rad/s; a grid about the poles) at the equilibrium
        with these inputs (zero), or at a state. Those of an estimate have standard deviations and bands, which follow
        from the covariance of the parameters."""
        at = None if state is None else list(state.items())
        return json.loads(self._plant.linearisation(at, self._given(inputs), [float(w) for w in frequencies]))

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


class Estimate:
    """What was estimated: of a plant in equations, or of a simulator."""

    def __init__(self, document: str, text: str) -> None:
        self._json = document
        self._text = text
        #: The document ``innovant-plant/1``.
        self.document: dict[str, Any] = json.loads(document)

    @property
    def estimates(self) -> dict[str, EstimatedParameter]:
        """The estimated parameters."""
        return {
            p["name"]: EstimatedParameter(p["value"], p["std"], tuple(p["interval_95"]))
            for p in self.document["parameters"]
        }

    @property
    def undetermined(self) -> list[str]:
        """What the recordings do not determine, in words."""
        return list(self.document["undetermined"])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the document."""
        Path(path).write_text(self._json, encoding="utf-8")

    def __str__(self) -> str:
        return self._text


class PlantEstimate(Estimate, Plant):
    """A plant with estimated parameters."""

    def __init__(self, document: str, text: str, recordings: tuple[list[np.ndarray], list[np.ndarray], float]) -> None:
        Estimate.__init__(self, document, text)
        Plant.__init__(self, document)
        self._recordings = recordings

    def report(self, path: str | os.PathLike[str]) -> None:
        """Writes a page: parameters, recorded and simulated outputs, residuals and equations, in one file that opens
        offline."""
        Path(path).write_text(self._plant.page(*self._recordings), encoding="utf-8")
