"""What a model does, with its uncertainty: poles, zeros, frequency and step response."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .frames import Array


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


@dataclass(frozen=True)
class StepResponse:
    """Response to a unit step of each input: arrays outputs x inputs x samples."""

    time: Array
    """In seconds."""
    outputs: Array
    std: Array | None
    """Standard deviations; `None` for a model without uncertainty."""
