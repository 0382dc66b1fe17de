"""Simulators of your own: any function of inputs and parameters, its parameters estimated from recordings."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from . import _innovant, frames
from .estimate import Estimate
from .frames import Array


def _parameter(name: str, given: Any) -> tuple[str, float, float, float]:
    """Name, value and bounds."""
    if np.ndim(given) == 0:
        value, low, high = float(given), -math.inf, math.inf
    elif len(given) == 3:
        value, low, high = (float(v) for v in given)
    else:
        raise _innovant.InnovantError(f"parameter {name}: a number or (value, min, max) is expected, not {given!r}")
    if not (math.isfinite(value) and low <= value <= high and low < high):
        raise _innovant.InnovantError(f"parameter {name}: the value {value} is not between min {low} and max {high}")
    return name, value, low, high


class Simulator:
    """A function ``f(u, **parameters)`` whose parameters are to be estimated.

    ``u`` is an array of samples x inputs (of samples, where there is one input); the function returns samples x outputs (or
    samples, where there is one output). ``parameters`` gives for each name a value, or ``(value, min, max)``. Anything that
    simulates will do: an ODE solver, an FMU, a program that the function starts. Its derivatives are differences of calls;
    no call is made twice with the same values. Calls come one after the other, from the thread that called ``fit``. Where
    the function returns NaN, these values of the parameters are not taken; what it raises ends the estimation.

    >>> import numpy as np
    >>> def lag(u, T):
    ...     y = np.zeros(len(u))
    ...     for k in range(1, len(u)):
    ...         y[k] = y[k - 1] + (1 - np.exp(-0.1 / T)) * (u[k - 1] - y[k - 1])
    ...     return y
    >>> rng = np.random.default_rng(1)
    >>> u = np.repeat(rng.standard_normal(60), 10)
    >>> y = lag(u, T=0.7) + 0.01 * rng.standard_normal(600)
    >>> fitted = Simulator(lag, parameters={"T": (1.0, 0.1, 10.0)}).fit(u, y, dt=0.1)
    >>> found = fitted.estimates["T"]
    >>> abs(found.value - 0.7) < 4 * found.std < 0.02
    True
    """

    def __init__(
        self,
        function: Callable[..., Any],
        parameters: Mapping[str, float | tuple[float, float, float]],
        outputs: Sequence[str] = ("y",),
        inputs: Sequence[str] | None = None,
    ) -> None:
        if not callable(function):
            raise _innovant.InnovantError("the simulator is not a function: f(u, **parameters) is expected")
        self.function = function
        #: Names of the outputs.
        self.outputs = [outputs] if isinstance(outputs, str) else list(outputs)
        #: Names of the inputs; None takes as many as ``u`` has columns.
        self.inputs = [inputs] if isinstance(inputs, str) else None if inputs is None else list(inputs)
        self._parameters = [_parameter(name, given) for name, given in parameters.items()]

    @property
    def parameters(self) -> dict[str, float]:
        """The parameters with their values."""
        return {name: value for name, value, _, _ in self._parameters}

    def _names(self, u: Any) -> list[str]:
        """Names of the inputs, as many as ``u`` has columns where none were given."""
        if self.inputs is not None:
            return self.inputs
        if frames.is_frame(u):
            raise _innovant.InnovantError("a frame needs the names of the columns: Simulator(..., inputs=[...])")
        count = np.shape(u)[1] if np.ndim(u) == 2 else 1
        return ["u"] if count == 1 else [f"u{i + 1}" for i in range(count)]

    def _call(self, u: Array, values: Mapping[str, float]) -> Array:
        """Calls the function, and checks what it returns."""
        samples, count = len(u), len(self.outputs)
        y = np.asarray(self.function(u[:, 0] if u.shape[1] == 1 else u, **values), dtype=float)
        shape = y.shape
        if y.ndim == 1 and count == 1:
            y = y[:, None]
        if y.shape != (samples, count):
            expected = f"({samples},)" if count == 1 else f"({samples}, {count})"
            names = ", ".join(self.outputs)
            raise _innovant.InnovantError(
                f"the simulator returned an array of the shape {shape}; expected is {expected}: a row for each sample of "
                f"u, and the outputs {names}"
            )
        return np.ascontiguousarray(y)

    def simulate(self, u: Any, parameters: Mapping[str, float] | None = None) -> Array:
        """Outputs, samples x outputs; parameters that are not given keep their values."""
        values = self.parameters | dict(parameters or {})
        return self._call(frames.by_names(u, self._names(u), "u"), values)

    def fit(
        self,
        u: Any,
        y: Any = None,
        dt: float | None = None,
        fix: Sequence[str] = (),
        least_squares: bool = False,
    ) -> SimulatorEstimate:
        """Estimates the parameters in free run by maximum likelihood under coloured noise, or by least squares. Lists of
        arrays are several recordings; a frame with the columns of inputs and outputs stands for both."""
        inputs = self._names(frames.experiments(u)[0])
        data = frames.known_recordings(u, y, dt=dt, inputs=inputs, outputs=self.outputs)
        document, text = _innovant.estimate_simulator(
            self._call,
            getattr(self.function, "__name__", "simulator"),
            inputs,
            self.outputs,
            self._parameters,
            data.u,
            data.y,
            data.dt,
            [fix] if isinstance(fix, str) else list(fix),
            least_squares,
        )
        return SimulatorEstimate(self, document, text, (data.u, data.y, data.dt))


class SimulatorEstimate(Estimate, Simulator):
    """A simulator with estimated parameters."""

    def __init__(
        self, simulator: Simulator, document: str, text: str, recordings: tuple[list[Array], list[Array], float]
    ) -> None:
        Estimate.__init__(self, document, text, recordings[1], recordings[2], simulator.outputs)
        self._recorded_inputs = recordings[0]
        values = {p["name"]: p["value"] for p in self.document["simulator"]["parameters"]}
        given = {name: (values[name], low, high) for name, _, low, high in simulator._parameters}
        Simulator.__init__(self, simulator.function, given, simulator.outputs, simulator.inputs)

    def _simulated(self) -> list[Array]:
        return [self._call(u, self.parameters) for u in self._recorded_inputs]
