"""Recordings reduced to moments: what can be sent around, joined and added instead of samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from . import _innovant, frames
from ._innovant import InnovantError
from .model import Model
from .options import written

#: Samples kept from the beginning of a recording: the initial state and the residual tests look at them.
SAMPLES_KEPT = 20_000


class Moments:
    """Moments of one recording, of a chunk of one, or of several recordings of one plant.

    They pickle, and are exact: chunks of one recording are joined with `append`, in their order; recordings are added
    with ``+``; `identify` then gives the model of all samples, whatever machine each was on. They grow with the past
    window and the number of channels, not with the number of samples.

    Parameters
    ----------
    u, y, dt, inputs, outputs, time
        One recording or a chunk of one, as for `identify`.
    overlap : int
        Samples at the beginning that belong to the chunk before. Chunks need none but for known delays (`delay`): then
        it is the longest of them for every chunk but the first.
    keep : int
        Samples kept from the beginning; 0 for chunks that do not come first.
    **options
        Those of `identify`. Windows, method, delays and kind of covariance must be known here; `identify` can still be
        asked for another order.

    Examples
    --------
    >>> import innovant, numpy as np
    >>> u, y, dt = innovant.examples.closed_loop(4000)
    >>> first = innovant.Moments(u[:1500], y[:1500], dt=dt)
    >>> second = innovant.Moments(u[1500:], y[1500:], dt=dt, keep=0)
    >>> model = first.append(second).identify()
    >>> bool(np.abs(model.A - innovant.identify(u, y, dt=dt).A).max() < 1e-10)
    True
    """

    __slots__ = ("_core", "_options")

    def __init__(
        self,
        u: Any,
        y: Any = None,
        *,
        dt: float | None = None,
        inputs: str | Sequence[str] | None = None,
        outputs: str | Sequence[str] | None = None,
        time: str | None = None,
        overlap: int = 0,
        keep: int = SAMPLES_KEPT,
        **options: Any,
    ) -> None:
        data = frames.recordings(u, y, dt=dt, inputs=inputs, outputs=outputs, time=time, few=True)
        if len(data.u) != 1:
            raise InnovantError("one recording at a time: make moments of each, and add them")
        self._options = options
        names = (data.inputs, data.outputs)
        self._core = _innovant.Moments(data.u[0], data.y[0], data.dt, names, overlap, keep, written(options))

    @classmethod
    def _of(cls, core: _innovant.Moments, options: Any) -> Moments:
        made = object.__new__(cls)
        made._core, made._options = core, options
        return made

    def append(self, following: Moments) -> Moments:
        """The recording that goes on with `following`, without a gap."""
        return Moments._of(self._core.append(following._core), self._options)

    def __add__(self, other: Moments) -> Moments:
        """These recordings and those of `other`: several experiments of one plant."""
        if not isinstance(other, Moments):
            return NotImplemented
        return Moments._of(self._core.add(other._core), self._options)

    @property
    def samples(self) -> int:
        """Samples of all recordings."""
        return self._core.samples()

    @property
    def recordings(self) -> int:
        """Number of recordings."""
        return self._core.recordings()

    def identify(self, **options: Any) -> Model:
        """The model; `options` replace those that the moments were made with."""
        return Model._of(self._core.identify(written({**self._options, **options})))

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self._core.to_json(), dict(self._options))

    def __repr__(self) -> str:
        return f"innovant.Moments(recordings={self.recordings}, samples={self.samples}, lags={self._core.lags()})"


def _restored(text: str, options: dict[str, Any]) -> Moments:
    return Moments._of(_innovant.Moments.from_json(text), options)
