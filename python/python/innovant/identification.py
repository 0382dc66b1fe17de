"""From recordings to a model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from . import _innovant, frames
from .model import Model
from .options import Method, written


def identify(
    u: Any,
    y: Any = None,
    *,
    dt: float | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    time: str | None = None,
    order: int | Sequence[int] | None = None,
    past: int | None = None,
    future: int | None = None,
    method: Method = "pbsid-opt",
    stochastic: Literal["first-column", "cholesky", "innovations"] | None = None,
    weight: Literal["identity", "cva"] | None = None,
    polish: Literal["auto", "always", "never"] = "auto",
    covariance: Literal["model", "robust"] = "model",
    detrend: Literal["mean", "linear", "none"] = "mean",
    feedthrough: bool = False,
    delay: int | Sequence[int] = 0,
    stable: bool = False,
    seed: int = 0,
) -> Model:
    """Identify a state-space model with its uncertainty, from recordings that may be in closed loop.

    The model is ``x[k+1] = A x[k] + B u[k] + K e[k]``, ``y[k] = C x[k] + D u[k] + e[k]`` with white ``e``, in
    deviations from the operating point. The arrays are read where they are: nothing is copied as a whole or changed, and
    no other thread should change them meanwhile.

    Parameters
    ----------
    u, y : array_like, or lists of arrays for several experiments of one plant
        Inputs and outputs, samples x channels; one dimension is one channel. Or `u` is a pandas or polars frame (or a
        list of them) and `y` is left out: then `inputs` and `outputs` name columns.
    dt : float
        Sample time in seconds. A frame with a time column, or with dates as its index, needs none.
    inputs, outputs : str or sequence of str
        Columns of a frame (default: those that start with u and with y), or names of the channels of an array;
        ``force [N]`` is a name with a unit.
    time : str
        Time column of a frame (default: ``t`` or ``time``).
    order : int or sequence of int
        Number of states, or several to compare; chosen without.
    past, future : int
        Windows in samples; chosen without.
    method, stochastic, weight, polish, covariance, detrend, feedthrough, delay, stable, seed
        As on the command line: ``innovant identify --help``.

    Returns
    -------
    Model

    Raises
    ------
    InnovantError
        A `ValueError` that says what is wrong with the recordings or the options, and what to do.

    Examples
    --------
    >>> import innovant
    >>> u, y, dt = innovant.examples.closed_loop(2000)
    >>> model = innovant.identify(u, y, dt=dt)
    >>> model
    innovant.Model(order=4, inputs=['u1', 'u2'], outputs=['y1', 'y2'], dt=1.0)
    >>> model.poles().natural_frequency.round(2)
    array([0.78, 0.78, 2.36, 2.36])

    A frame, with names and units:

    >>> import pandas
    >>> frame = pandas.DataFrame({"force [N]": u[:, 0], "torque": u[:, 1], "position [m]": y[:, 0]})
    >>> innovant.identify(frame, dt=dt, inputs=["force", "torque"], outputs="position", order=4).output_labels
    ['position']
    """
    data = frames.recordings(u, y, dt=dt, inputs=inputs, outputs=outputs, time=time)
    options = written(
        {
            "order": order,
            "past": past,
            "future": future,
            "method": method,
            "stochastic": stochastic,
            "weight": weight,
            "polish": polish,
            "covariance": covariance,
            "detrend": detrend,
            "feedthrough": feedthrough,
            "delay": delay,
            "stable": stable,
            "seed": seed,
        }
    )
    return Model._of(_innovant.identify(data.u, data.y, data.dt, data.inputs, data.outputs, options))
