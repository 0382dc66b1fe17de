"""Recordings of known plants, to try things on."""

from __future__ import annotations

from . import _innovant
from .frames import Array


def closed_loop(samples: int = 2000, seed: int = 1) -> tuple[Array, Array, float]:
    """Inputs, outputs and sample time of van Wingerden's Example I: order 4, two inputs, two outputs, under feedback.

    >>> u, y, dt = closed_loop(100)
    >>> u.shape, y.shape, dt
    ((100, 2), (100, 2), 1.0)
    """
    return _innovant.example("closed_loop", samples, seed)


def servo(samples: int = 4000, seed: int = 1) -> tuple[Array, Array, float]:
    """Input, output and sample time of a servo: order 3, one input, one output, coloured noise.

    >>> u, y, dt = servo(100)
    >>> u.shape, y.shape
    ((100, 1), (100, 1))
    """
    return _innovant.example("servo", samples, seed)
