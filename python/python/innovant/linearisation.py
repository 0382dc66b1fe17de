"""Plants in equations, linearised."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import plots
from .frames import Array
from .record import Record
from .responses import FrequencyResponse


class Linearisation(Record):
    """The document ``innovant-linearisation/1``: a dictionary whose keys are attributes too."""

    def __init__(
        self, content: dict[str, Any], inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None
    ) -> None:
        super().__init__(content)
        # Names with units, which the document does not contain.
        self._headers = inputs, outputs

    def __reduce__(self) -> tuple[Any, ...]:
        return Linearisation, (dict(self), *self._headers)

    def response(self) -> FrequencyResponse:
        """The entries of `frequency_response` as arrays outputs x inputs x frequencies, with their bands."""
        points = self["frequency_response"]
        outputs = list(dict.fromkeys(point["output"] for point in points))
        inputs = list(dict.fromkeys(point["input"] for point in points))
        omega = sorted({point["rad_s"] for point in points})
        shape = (len(outputs), len(inputs), len(omega))
        response = np.full(shape, np.nan, dtype=np.complex128)
        covariance = np.full((*shape, 2, 2), np.nan)
        magnitude_95, magnitude_99, phase_95 = (np.full((*shape, 2), np.nan) for _ in range(3))
        bands = {"magnitude_95": magnitude_95, "magnitude_99": magnitude_99, "phase_95": phase_95}
        names = self._headers[0] or inputs, self._headers[1] or outputs
        known = False
        place = {w: k for k, w in enumerate(omega)}
        for point in points:
            at = outputs.index(point["output"]), inputs.index(point["input"]), place[point["rad_s"]]
            if point["real"] is not None:
                response[at] = complex(point["real"], point["imag"])
            if point["covariance"] is not None:
                covariance[at] = point["covariance"]
            for key, band in bands.items():
                if point[key] is not None:
                    band[at] = point[key]
                    known = True
        if not known:
            return FrequencyResponse(np.array(omega), response, None, None, None, None, *names)
        return FrequencyResponse(np.array(omega), response, covariance, magnitude_95, magnitude_99, phase_95, *names)

    def plot(self, ax: Any = None, *, label: str | None = None, decibels: bool = False) -> Any:
        """Bode diagram, with 95 % bands from the covariance of the estimated parameters; see `FrequencyResponse.plot`."""
        return self.response().plot(ax, label=label, decibels=decibels)

    def plot_poles(self, ax: Any = None) -> Any:
        """Poles in the s plane with their 95 % ellipses; needs matplotlib. Returns the Axes, which is `ax` if given."""
        poles = self["poles"]
        values: NDArray[np.complex128] = np.array([complex(p["real"], p["imag"]) for p in poles], dtype=np.complex128)
        nothing = np.full((2, 2), np.nan)
        stacked: Array = np.array([nothing if p["covariance"] is None else p["covariance"] for p in poles], dtype=float)
        return plots.roots([("poles", values, stacked.reshape(-1, 2, 2))], ax, circle=False)
