"""What is estimated of plants in equations and of simulators."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, NamedTuple

from . import plots
from .frames import Array


class EstimatedParameter(NamedTuple):
    """A parameter with its uncertainty."""

    value: float
    #: Standard deviation; None where the recordings do not determine it.
    std: float | None
    #: 95 % interval; None where it is open.
    interval_95: tuple[float | None, float | None]


class Estimate:
    """What was estimated: of a plant in equations, or of a simulator."""

    def __init__(self, document: str, text: str, measured: list[Array], dt: float, outputs: list[str]) -> None:
        self._json = document
        self._text = text
        self._measured = measured
        self._dt = dt
        self._headers = outputs
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

    @property
    def fit_percent(self) -> dict[str, float]:
        """Fit of the simulation to each output in percent, on the recordings of the estimation."""
        return {fit["output"]: fit["free_run_percent"] for fit in self.document["fit"]}

    def _simulated(self) -> list[Array]:
        """The simulation of each recording of the estimation."""
        raise NotImplementedError

    def plot(self, ax: Any = None) -> Any:
        """Measured and simulated outputs of the estimation, and their residuals; needs matplotlib.

        A column for each recording, and two rows for each output. Returns the array of Axes; `ax` takes such an array.
        `innovant.compare` does the same for other recordings and several models.
        """
        run = plots.Run("simulated", self._simulated(), list(self.fit_percent.values()))
        return plots.comparison(self._dt, self._measured, [run], self._headers, ax, residuals=True)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the document."""
        Path(path).write_text(self._json, encoding="utf-8")

    def __str__(self) -> str:
        return self._text
