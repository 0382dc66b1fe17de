"""What a model does, with its uncertainty: poles, zeros, frequency and step response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import plots
from .frames import Array

#: 97.5 % quantile of the standard normal law: half the width of a 95 % interval in standard deviations.
NORMAL_95 = 1.959963984540054


@dataclass(frozen=True)
class Roots:
    """Poles or zeros, slowest first. Where an array of complex numbers is expected, this is one.

    Standard deviations are NaN where there are none: an integrator has no time constant, a multiple pole no derivative.
    """

    values: NDArray[np.complex128]
    covariance: Array
    """Covariance of (real part, imaginary part): n x 2 x 2."""
    natural_frequency: Array
    """In rad/s."""
    natural_frequency_std: Array
    damping: Array
    damping_std: Array
    time_constant: Array
    """In seconds."""
    time_constant_std: Array
    kind: str = "poles"
    """``poles`` or ``zeros``."""

    def plot(self, ax: Any = None) -> Any:
        """The roots in the complex plane with their 95 % ellipses and the unit circle; needs matplotlib.

        Returns the matplotlib Axes, which is `ax` if given.

        >>> import innovant
        >>> lag = innovant.Model([[0.9]], [[0.1]], [[1.0]], dt=0.01)
        >>> lag.poles().plot().get_xlabel()
        'real part'
        """
        return plots.roots([(self.kind, self.values, self.covariance)], ax)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        array = self.values if dtype is None else self.values.astype(dtype)
        return array.copy() if copy else array

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, index: Any) -> Any:
        return self.values[index]


@dataclass(frozen=True)
class FrequencyResponse:
    """Response at `omega` (rad/s): arrays outputs x inputs x frequencies."""

    omega: Array
    response: NDArray[np.complex128]
    covariance: Array | None
    """Covariance of (real part, imaginary part): ... x 2 x 2; `None` for a model without uncertainty."""
    magnitude_95: Array | None
    """Confidence band of the magnitude, 95 %: ... x 2."""
    magnitude_99: Array | None
    phase_95: Array | None
    """Confidence band of the phase in rad, 95 %: ... x 2."""
    inputs: Sequence[str] | None = None
    """Names of the inputs, with units: ``force [N]``."""
    outputs: Sequence[str] | None = None
    """Names of the outputs, with units."""
    dt: float | None = None
    """Sample time in seconds; `None` in continuous time."""

    @property
    def magnitude(self) -> Array:
        """Magnitude."""
        return np.abs(self.response)

    @property
    def phase(self) -> Array:
        """Phase in rad, between -pi and pi."""
        return np.angle(self.response)

    @property
    def frequency(self) -> Array:
        """Frequencies in Hz."""
        return self.omega / (2 * np.pi)

    def curves(self) -> list[list[plots.Curve]]:
        """What a Bode plot shows, outputs x inputs: magnitude, continuous phase in degrees, and their 95 % bands."""
        inputs = self.inputs or [f"u{i + 1}" for i in range(self.response.shape[1])]
        outputs = self.outputs or [f"y{i + 1}" for i in range(self.response.shape[0])]
        return [[self._curve(o, i, output, name) for i, name in enumerate(inputs)] for o, output in enumerate(outputs)]

    def _curve(self, o: int, i: int, output: str, name: str) -> plots.Curve:
        principal = self.phase[o, i]
        phase = np.unwrap(principal)
        band = None
        if self.phase_95 is not None:
            # The band is around the principal value; it goes where the curve goes.
            band = np.degrees(self.phase_95[o, i] + (phase - principal)[:, np.newaxis])
        magnitude_95 = None if self.magnitude_95 is None else self.magnitude_95[o, i]
        return plots.Curve(name, output, self.magnitude[o, i], np.degrees(phase), magnitude_95, band)

    def plot(self, ax: Any = None, *, label: str | None = None, decibels: bool = False) -> Any:
        """Bode diagram with 95 % bands: for each output a row of magnitudes and a row of phases, for each input a column.

        Needs matplotlib. Returns the array of Axes, 2 outputs x inputs. `ax` takes such an array: the response is drawn
        into it, so that several can be compared, with a legend if there is a `label`. A vertical line is the Nyquist
        frequency.

        >>> import innovant
        >>> u, y, dt = innovant.examples.servo(4000)
        >>> axes = innovant.identify(u, y, dt=dt, order=3).frequency_response().plot()
        >>> axes.shape, axes[1, 0].get_xlabel()
        ((2, 1), 'frequency [Hz]')
        """
        nyquist = None if self.dt is None else 0.5 / self.dt
        return plots.bode(self.curves(), self.frequency, nyquist, ax, label, decibels)


@dataclass(frozen=True)
class StepResponse:
    """Response to a unit step of each input: arrays outputs x inputs x samples."""

    time: Array
    """In seconds."""
    outputs: Array
    std: Array | None
    """Standard deviations; `None` for a model without uncertainty."""
    input_names: Sequence[str] | None = None
    """Names of the inputs, with units."""
    output_names: Sequence[str] | None = None
    """Names of the outputs, with units."""

    def plot(self, ax: Any = None, *, label: str | None = None) -> Any:
        """Step responses with 95 % bands, a row for each output and a column for each input; needs matplotlib.

        Returns the array of Axes, outputs x inputs; `ax` takes such an array.

        >>> import innovant
        >>> innovant.Model([[0.9]], [[0.1]], [[1.0]], dt=0.01).step_response().plot().shape
        (1, 1)
        """
        l, r = self.outputs.shape[:2]
        names = (
            list(self.output_names or (f"y{i + 1}" for i in range(l))),
            list(self.input_names or (f"u{i + 1}" for i in range(r))),
        )
        half = None if self.std is None else NORMAL_95 * self.std
        return plots.steps(self.time, self.outputs, half, names, ax, label)
