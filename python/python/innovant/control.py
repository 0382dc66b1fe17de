"""To other libraries: python-control and scipy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .frames import Array

if TYPE_CHECKING:
    from .model import Model


def with_delays(model: Model) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D with the known delays of the inputs as states: a delay of d samples is a chain of d of them."""
    a, b, c, d = model.A, model.B, model.C, model.D
    for channel, delay in enumerate(model.input_delays):
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


def to_control(model: Model) -> Any:
    """See `Model.to_control`."""
    import control

    return control.StateSpace(*with_delays(model), model.dt, inputs=model.input_labels, outputs=model.output_labels)


def to_scipy(model: Model) -> Any:
    """See `Model.to_scipy`."""
    from scipy.signal import StateSpace

    return StateSpace(*with_delays(model), dt=model.dt)
