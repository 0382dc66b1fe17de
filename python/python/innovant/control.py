"""To other libraries: python-control and scipy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .frames import Array


def with_delays(a: Array, b: Array, c: Array, d: Array, delays: Sequence[int]) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D with the known delays of the inputs as states: a delay of d samples is a chain of d of them.

    >>> one = np.ones((1, 1))
    >>> with_delays(0.5 * one, one, one, 0 * one, [2])[0].shape
    (3, 3)
    """
    for channel, delay in enumerate(delays):
        if delay == 0:
            continue
        n = a.shape[0]
        # What left the input `delay` samples ago stands at the end of the chain.
        chain = np.eye(delay, k=-1)
        last = np.zeros((1, delay))
        last[0, -1] = 1.0
        a = np.block([[a, b[:, [channel]] @ last], [np.zeros((delay, n)), chain]])
        c = np.hstack([c, d[:, [channel]] @ last])
        b = np.vstack([b, np.zeros((delay, b.shape[1]))])
        b[:n, channel] = 0.0
        b[n, channel] = 1.0
        d = d.copy()
        d[:, channel] = 0.0
    return a, b, c, d
