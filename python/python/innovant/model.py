"""The model: matrices, what it foresees, whether it holds, documents."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from . import _innovant, control, frames, html, model_plots
from ._innovant import InnovantError
from .documents import document, written
from .frames import Array, without_unit
from .record import Record, read
from .responses import FrequencyResponse, Roots, StepResponse
from .validation import Validation

if TYPE_CHECKING:
    import control as python_control
    import scipy.signal

#: Longest step response where no length is asked for, in samples.
LONGEST_STEP_RESPONSE = 2000


class Model:
    """State-space model in innovation form, with what is known about its uncertainty.

    ``x[k+1] = A x[k] + B u[k] + K e[k]``, ``y[k] = C x[k] + D u[k] + e[k]``, in deviations from the operating point
    (`input_levels`, `output_levels`); `simulate`, `predict` and `validate` take and give values in the units of the
    recording. `identify` makes one from recordings; the constructor makes one from matrices.

    >>> import innovant
    >>> lag = innovant.Model([[0.9]], [[0.1]], [[1.0]], dt=0.01)
    >>> lag.simulate([1.0, 1.0, 1.0])
    array([0.  , 0.1 , 0.19])
    """

    __slots__ = ("_core",)

    def __init__(
        self,
        A: ArrayLike,
        B: ArrayLike,
        C: ArrayLike,
        D: ArrayLike | None = None,
        K: ArrayLike | None = None,
        *,
        dt: float,
    ) -> None:
        given = {"A": A, "B": B, "C": C, "D": D, "K": K}
        matrices: dict[str, Any] = {
            name: np.atleast_2d(frames.numbers(matrix, name)).tolist()
            for name, matrix in given.items()
            if matrix is not None
        }
        self._core = _innovant.Model.from_json("model", json.dumps({**matrices, "dt": float(dt)}))

    @classmethod
    def _of(cls, core: _innovant.Model) -> Model:
        made = object.__new__(cls)
        made._core = core
        return made

    # -- matrices

    @property
    def A(self) -> Array:
        """State matrix, n x n."""
        return self._core.a()

    @property
    def B(self) -> Array:
        """Input matrix, n x inputs."""
        return self._core.b()

    @property
    def C(self) -> Array:
        """Output matrix, outputs x n."""
        return self._core.c()

    @property
    def D(self) -> Array:
        """Feedthrough, outputs x inputs; zero unless it was asked for."""
        return self._core.d()

    @property
    def K(self) -> Array:
        """Kalman gain, n x outputs; zero for a model without a noise model."""
        return self._core.k()

    @property
    def innovation_covariance(self) -> Array | None:
        """Covariance of the innovations e, outputs x outputs."""
        return self._core.innovation_covariance()

    @property
    def covariance(self) -> Array | None:
        """Covariance of ``[vec A; vec B; vec K; vec C (; vec D)]`` in the basis of this model; `None` without one.

        It is bound to this basis. What does not depend on the basis (poles, responses) has its own uncertainty.
        """
        return self._core.covariance()

    @property
    def x0(self) -> Array:
        """State at the first sample of the first recording."""
        return self._core.x0()

    @property
    def dt(self) -> float:
        """Sample time in seconds."""
        return self._core.dt()

    @property
    def order(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    nstates = order

    @property
    def ninputs(self) -> int:
        """Number of inputs."""
        return self.B.shape[1]

    @property
    def noutputs(self) -> int:
        """Number of outputs."""
        return self.C.shape[0]

    @property
    def input_labels(self) -> list[str]:
        """Names of the inputs, without units."""
        return [without_unit(name) for name in self._core.names()[0]]

    @property
    def output_labels(self) -> list[str]:
        """Names of the outputs, without units."""
        return [without_unit(name) for name in self._core.names()[1]]

    def headers(self) -> tuple[list[str], list[str]]:
        """Names of the inputs and of the outputs, with units: ``force [N]``."""
        return self._core.names()

    @property
    def input_levels(self) -> Array:
        """Operating point of the inputs."""
        return np.array(self._core.levels()[0])

    @property
    def output_levels(self) -> Array:
        """Operating point of the outputs."""
        return np.array(self._core.levels()[1])

    @property
    def input_delays(self) -> list[int]:
        """Known delays of the inputs in samples, which A and B do not hold."""
        return self._core.delays()

    # -- what is known about it

    @property
    def verdict(self) -> str:
        """One sentence: what this model is, and whether to trust it."""
        return self._core.verdict()

    @property
    def warnings(self) -> list[str]:
        """What to know before trusting it, one sentence each."""
        return self._core.warnings()

    @property
    def residual_tests(self) -> Record | None:
        """Tests of the residuals on the recordings that it was estimated from, made when first asked for."""
        tests = self._core.residual_tests()
        return None if tests is None else read(tests)

    def poles(self) -> Roots:
        """Poles with covariance, natural frequency, damping and time constant, slowest first.

        >>> import innovant, numpy
        >>> u, y, dt = innovant.examples.servo(4000)
        >>> poles = innovant.identify(u, y, dt=dt, order=3).poles()
        >>> bool(numpy.all(numpy.abs(poles) < 1)), poles.covariance.shape
        (True, (3, 2, 2))
        """
        return _roots(_innovant.poles(self._core), "poles")

    def zeros(self) -> Roots:
        """Invariant zeros from inputs to outputs, as `poles`."""
        return _roots(_innovant.zeros(self._core), "zeros")

    def frequency_response(self, omega: ArrayLike | None = None) -> FrequencyResponse:
        """Response from inputs to outputs at `omega` (rad/s; default: a logarithmic grid up to Nyquist), with bands.

        >>> import innovant
        >>> u, y, dt = innovant.examples.servo(4000)
        >>> response = innovant.identify(u, y, dt=dt, order=3).frequency_response([1.0, 10.0])
        >>> response.magnitude.shape, response.covariance.shape, response.magnitude_95.shape
        ((1, 1, 2), (1, 1, 2, 2, 2), (1, 1, 2, 2))
        """
        return self._response(omega, noise=False)

    def noise_response(self, omega: ArrayLike | None = None) -> FrequencyResponse:
        """Response from innovations to outputs, as `frequency_response`."""
        return self._response(omega, noise=True)

    def _response(self, omega: ArrayLike | None, *, noise: bool) -> FrequencyResponse:
        if omega is None:
            grid = _innovant.default_frequencies(self._core)
        else:
            grid = np.atleast_1d(frames.numbers(omega, "omega"))
            if grid.ndim != 1:
                raise InnovantError(f"omega has the shape {grid.shape}; expected frequencies in one dimension, in rad/s")
        nyquist = np.pi / self.dt
        # A Nyquist frequency that was typed is rounded.
        beyond = grid[(grid > nyquist * (1 + 1e-3)) | (grid < 0) | ~np.isfinite(grid)]
        if beyond.size:
            raise InnovantError(
                f"omega = {beyond[0]}: beyond the Nyquist frequency of this model, {nyquist:.6} rad/s, or below zero, "
                "there is nothing to see"
            )
        response, covariance, bands = _innovant.frequency_response(self._core, grid, noise)
        magnitude_95, magnitude_99, phase_95 = bands or (None, None, None)
        inputs, outputs = self._core.names()
        if noise:
            inputs = [f"e({name})" for name in map(without_unit, outputs)]
        return FrequencyResponse(
            grid, response, covariance, magnitude_95, magnitude_99, phase_95, inputs, outputs, self.dt
        )

    def step_response(self, samples: int | None = None) -> StepResponse:
        """Response to a unit step of each input from rest, with standard deviations.

        Without `samples` it lasts until it has settled.
        """
        count = samples if samples is not None else _innovant.settling_samples(self._core, LONGEST_STEP_RESPONSE)
        values, std = _innovant.step_response(self._core, count)
        time = np.arange(count, dtype=np.float64) * np.float64(self.dt)
        return StepResponse(time, values, std, *self._core.names())

    def static_gain(self) -> tuple[Array, Array | None] | None:
        """Static gain and its standard deviation, outputs x inputs; `None` with an integrator."""
        return _innovant.static_gain(self._core)

    # -- on data

    def simulate(self, u: Any, x0: ArrayLike | None = None) -> Any:
        """Free run from the inputs alone, in the units of the recording; known delays are applied.

        `u` is samples x inputs, or a frame that holds the columns of the inputs; the answer has the same form. `x0` is
        the state at the first sample: the operating point without it; `initial_state` finds the one of a recording.

        >>> import innovant
        >>> u, y, dt = innovant.examples.servo(4000)
        >>> model = innovant.identify(u, y, dt=dt, order=3)
        >>> model.simulate(u, x0=model.initial_state(u, y)).shape
        (4000, 1)
        """
        inputs = frames.by_names(u, self._core.names()[0], "u", dt=self.dt)
        return frames.like(u, self._core.simulate(inputs, self._state(x0)), self._core.names()[1])

    def predict(self, u: Any, y: Any = None, x0: ArrayLike | None = None) -> Any:
        """One-step predictions of the outputs, in the units of the recording.

        `u` and `y` are samples x channels, or `u` is a frame that holds both. `x0` is the state at the first sample:
        the one that fits best without it.
        """
        inputs, outputs = self._pair(u, y)
        predicted = self._core.predict(inputs, outputs, self._state(x0))
        return frames.like(u if y is None else y, predicted, self._core.names()[1])

    def initial_state(self, u: Any, y: Any = None) -> Array:
        """The state at the first sample that explains a recording best."""
        return self._core.initial_state(*self._pair(u, y))

    def validate(
        self,
        u: Any,
        y: Any = None,
        *,
        level: float = 0.01,
        detrend: Literal["level", "mean", "linear"] | None = None,
        fresh: bool = True,
    ) -> Validation:
        """Judge the model on one recording or a list of them: fit, tests of the residuals.

        Parameters
        ----------
        level : float
            Probability that a right model is rejected.
        detrend : str
            What is taken out of each channel first: the operating point of the model (`level`), the recording's own
            `mean`, or its straight line (`linear`).
        fresh : bool
            Whether the model has not seen these recordings. For those it was estimated from say ``fresh=False`` (or
            look at `residual_tests`): then the tests allow for what the estimation has fitted away.

        >>> import innovant
        >>> u, y, dt = innovant.examples.closed_loop(2000, seed=1)
        >>> model = innovant.identify(u, y, dt=dt)
        >>> u, y, dt = innovant.examples.closed_loop(2000, seed=2)
        >>> model.validate(u, y).rejected
        False
        """
        pairs = [self._pair(first, second, which) for first, second, which in frames.pairs(u, y)]
        judged, text = self._core.validate(
            [pair[0] for pair in pairs], [pair[1] for pair in pairs], level, detrend, fresh
        )
        return Validation(text, judged)

    def _pair(self, u: Any, y: Any, which: str = "") -> tuple[Array, Array]:
        inputs, outputs = self._core.names()
        measured = u if y is None else y
        if y is None and not frames.is_frame(u):
            raise InnovantError("y is missing: give u and y as arrays, or one data frame with the columns of both")
        first = frames.by_names(u, inputs, "u", label=f"u{which}", dt=self.dt)
        second = frames.by_names(measured, outputs, "y", label=f"y{which}", dt=self.dt)
        frames.check_rows(first, second, which)
        return first, second

    def _state(self, x0: ArrayLike | None) -> Array | None:
        return None if x0 is None else frames.vector(x0, "x0", self.order, "state")

    # -- plots

    def plot(self, omega: ArrayLike | None = None, *, ax: Any = None, label: str | None = None) -> Any:
        """Bode diagram of the inputs with 95 % bands: `frequency_response`, and its `plot`. Needs matplotlib.

        Other plots of a model: ``poles().plot()``, ``step_response().plot()``, ``validate(u, y).plot()`` for the
        residuals, and `innovant.compare` for measured and simulated outputs.

        >>> import innovant
        >>> innovant.Model([[0.9]], [[0.1]], [[1.0]], dt=0.01).plot().shape
        (2, 1)
        """
        return self.frequency_response(omega).plot(ax, label=label)

    # -- elsewhere

    def to_control(self) -> python_control.StateSpace:
        """python-control's StateSpace from inputs to outputs, known delays included; deviations from the levels."""
        import control as python_control

        return python_control.StateSpace(
            *self._with_delays(), self.dt, inputs=self.input_labels, outputs=self.output_labels
        )

    def to_scipy(self) -> scipy.signal.StateSpace:
        """scipy's discrete StateSpace from inputs to outputs, known delays included; deviations from the levels."""
        from scipy.signal import StateSpace

        return StateSpace(*self._with_delays(), dt=self.dt)

    def _with_delays(self) -> tuple[Array, Array, Array, Array]:
        return control.with_delays(self.A, self.B, self.C, self.D, self.input_delays)

    def plot_bode(self, omega: ArrayLike | None = None, *, backend: Literal["plotly", "matplotlib"] = "plotly") -> Any:
        """Magnitude and phase with their 95 % bands; a figure of plotly or of matplotlib."""
        response = self.frequency_response(omega)
        curves = [curve for row in response.curves() for curve in row]
        return model_plots.bode(curves, response.frequency, backend)

    def plot_poles(self, *, backend: Literal["plotly", "matplotlib"] = "plotly") -> Any:
        """Poles with their 95 % ellipses, and zeros; a figure of plotly or of matplotlib."""
        return model_plots.poles(self.poles(), self.zeros(), backend)

    def report(self, path: str | Path) -> None:
        """Write the page with plots: one HTML file that opens offline.

        What the recording looked like is on the page of the command line only; a model does not keep it.
        """
        self._core.report(str(path))

    def to_json(self, path: str | Path | None = None) -> str:
        """The document `innovant-model/1`, as the command line writes it; also into a file."""
        return written(self._core.to_json(), path)

    @classmethod
    def from_json(cls, source: str | Path) -> Model:
        """A model out of a document or the path of one: `innovant-model/1` or ``{"A":..,"B":..,"C":..,"dt":..}``.

        >>> Model.from_json('{"A": [[0.5]], "B": [[1]], "C": [[1]], "dt": 1}').order
        1
        """
        return cls._of(_innovant.Model.from_json(*document(source)))

    def __reduce__(self) -> tuple[Any, ...]:
        return Model.from_json, (self.to_json(),)

    def __repr__(self) -> str:
        return (
            f"innovant.Model(order={self.order}, inputs={self.input_labels}, outputs={self.output_labels}, "
            f"dt={self.dt})"
        )

    def __str__(self) -> str:
        return self._core.text()

    def _repr_html_(self) -> str:
        return html.model(self.verdict, self.poles(), self.warnings)


def _roots(found: tuple[Any, Array, Sequence[Array]], kind: str) -> Roots:
    values, covariance, columns = found
    frequency, frequency_std, damping, damping_std, constant, constant_std = columns
    return Roots(values, covariance, frequency, frequency_std, damping, damping_std, constant, constant_std, kind)
