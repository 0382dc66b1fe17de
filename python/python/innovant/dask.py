"""Recordings that are spread over a Dask cluster: `identify` reduces them where they are, `explain_many` explains many.

Dask moves and schedules the work; what travels are moments (`innovant.Moments`), a few hundred kilobytes a chunk
whatever its length. Work that is lost with a worker is done again by Dask. Needs ``pip install 'innovant[dask]'``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from . import frames
from ._innovant import InnovantError
from .explanation import Explanation, explain
from .model import Model
from .moments import SAMPLES_KEPT, Moments
from .options import delays

__all__ = ["explain_many", "identify", "moments"]


def _pair(chunk: Any) -> tuple[Any, Any]:
    """A chunk is a pair (u, y) or a frame."""
    if isinstance(chunk, (tuple, list)) and len(chunk) == 2:
        return chunk[0], chunk[1]
    return chunk, None


def _last(chunk: Any, samples: int) -> tuple[Any, Any]:
    """The end of a chunk, which the next one overlaps."""
    u, y = _pair(chunk)
    return u[-samples:], None if y is None else y[-samples:]


def _joined(before: Any, after: Any) -> Any:
    if before is None or after is None:
        return after
    if not frames.is_frame(after):
        return np.concatenate([np.asarray(before), np.asarray(after)])
    if hasattr(after, "iloc"):
        import pandas

        return pandas.concat([before, after])
    import polars

    return polars.concat([before, after])


def _chunk(chunk: Any, before: Any, first: bool, settings: dict[str, Any]) -> Moments:
    """Moments of one chunk, with what it overlaps of the chunk before."""
    u, y = _pair(chunk)
    overlap = 0
    if before is not None:
        overlap = len(before[0])
        u, y = _joined(before[0], u), _joined(before[1], y)
    return Moments(u, y, overlap=overlap, keep=SAMPLES_KEPT if first else 0, **settings)


def _append(first: Moments, second: Moments) -> Moments:
    return first.append(second)


def _add(first: Moments, second: Moments) -> Moments:
    return first + second


def _partition(logs: Sequence[Any], settings: dict[str, Any]) -> Moments | None:
    """The sum over the recordings of one partition of a bag."""
    total: Moments | None = None
    for log in logs:
        one = _chunk(log, None, True, settings)
        total = one if total is None else total + one
    return total


def _sum_known(parts: Sequence[Moments | None]) -> Moments:
    known = [part for part in parts if part is not None]
    if not known:
        raise InnovantError("there is no recording in this bag")
    return _pairwise(known, _add)


def _pairwise(parts: list[Any], join: Any) -> Any:
    """Neighbours are joined, then the results: the order stays, and the depth is the logarithm of the number."""
    while len(parts) > 1:
        parts = [join(*parts[i : i + 2]) if i + 1 < len(parts) else parts[i] for i in range(0, len(parts), 2)]
    return parts[0]


def _is_chunk(part: Any) -> bool:
    """Whether this is a chunk and not a list of chunks."""
    return not isinstance(part, list)


def moments(recordings: Any, **settings: Any) -> Any:
    """The moments of all recordings, as a `dask.delayed.Delayed`; arguments as for `identify`."""
    from dask import delayed

    longest = max(delays(settings.get("delay", 0)), default=0)
    if hasattr(recordings, "map_partitions") and not hasattr(recordings, "columns"):
        # A bag: an unordered collection, so every element is a recording of its own.
        parts = [delayed(_partition)(part, settings) for part in recordings.to_delayed()]
        return delayed(_sum_known)(parts)
    if hasattr(recordings, "to_delayed"):
        # A Dask data frame: its partitions follow each other.
        recordings = list(recordings.to_delayed())
    if not isinstance(recordings, (list, tuple)) or len(recordings) == 0:
        raise InnovantError(
            "give a list of chunks of one recording, a list of such lists, a Dask bag of recordings, or a Dask data frame"
        )
    logs = [list(recordings)] if all(_is_chunk(part) for part in recordings) else list(recordings)
    totals = []
    for chunks in logs:
        chunks = [chunks] if _is_chunk(chunks) else chunks
        if not chunks:
            raise InnovantError("a recording without chunks: every list needs at least one")
        parts = []
        for index, chunk in enumerate(chunks):
            before = delayed(_last)(chunks[index - 1], longest) if longest and index else None
            parts.append(delayed(_chunk)(chunk, before, index == 0, settings))
        totals.append(_pairwise(parts, delayed(_append)))
    return _pairwise(totals, delayed(_add))


def identify(
    recordings: Any,
    *,
    dt: float | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    time: str | None = None,
    **options: Any,
) -> Model:
    """Identify one model from recordings that are spread over a cluster.

    The model is that of `innovant.identify` on all samples in one place. It is made by the active Dask scheduler: that
    of the current `dask.distributed.Client`, or threads of this machine without one.

    Parameters
    ----------
    recordings
        A list of chunks of one recording, in their order; or a list of such lists, one a recording; or a Dask data
        frame, whose partitions are chunks of one recording; or a Dask bag, each element a whole recording. A chunk is
        a pair ``(u, y)`` of arrays or a frame, or a `dask.delayed` value or a future of one.
    dt, inputs, outputs, time, **options
        As for `innovant.identify`.

    Examples
    --------
    >>> import dask, innovant
    >>> import innovant.dask
    >>> @dask.delayed
    ... def load(day):
    ...     u, y, dt = innovant.examples.closed_loop(2000, seed=day)
    ...     return u, y
    >>> innovant.dask.identify([[load(1)], [load(2)], [load(3)]], dt=1.0).order
    4
    """
    settings = {"dt": dt, "inputs": inputs, "outputs": outputs, "time": time, **options}
    return moments(recordings, **settings).compute().identify()


def _explained(case: Any, settings: dict[str, Any]) -> Explanation | InnovantError:
    try:
        u, y, simulation = case
        return explain(u, y, simulation=simulation, **settings)
    except InnovantError as error:
        return error


def _explained_all(cases: Sequence[Any], settings: dict[str, Any]) -> list[Explanation | InnovantError]:
    return [_explained(case, settings) for case in cases]


def explain_many(cases: Any, *, dt: float | None = None, **settings: Any) -> list[Explanation | InnovantError]:
    """Explain many recordings, each by itself, on the active Dask scheduler.

    `cases` is a list of triples ``(u, y, simulation)`` (or of `dask.delayed` values of them), or a Dask bag of them;
    `settings` are those of `innovant.explain`. The answers come back in the same order; a case that cannot be explained
    gives its `InnovantError` and does not stop the rest.
    """
    from dask import compute, delayed

    settings = {"dt": dt, **settings}
    if hasattr(cases, "to_delayed"):
        parts = compute(*[delayed(_explained_all)(part, settings) for part in cases.to_delayed()])
        return [answer for part in parts for answer in part]
    return list(compute(*[delayed(_explained)(case, settings) for case in cases]))
