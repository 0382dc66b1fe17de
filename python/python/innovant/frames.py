"""What users hand in (arrays, lists of them, data frames) as arrays of samples x channels, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _innovant
from ._innovant import InnovantError

Array = NDArray[np.float64]

#: Sample times of one plant's recordings may differ by this, as on the command line.
SAMPLING_TOLERANCE = 1e-3


@dataclass
class Recordings:
    """One or more experiments of one plant."""

    u: list[Array]
    y: list[Array]
    dt: float
    inputs: list[str]
    outputs: list[str]


def is_frame(data: Any) -> bool:
    """Whether this is a data frame (pandas, polars, or one that behaves like them)."""
    return hasattr(data, "columns") and hasattr(data, "__getitem__") and not isinstance(data, np.ndarray)


def experiments(data: Any) -> list[Any]:
    """A list of arrays or frames as it is, anything else as the only one of its kind."""
    if isinstance(data, (list, tuple)) and len(data) > 0:
        if all(is_frame(part) or hasattr(part, "__array__") and np.ndim(part) > 0 for part in data):
            return list(data)
    return [data]


def samples(data: ArrayLike, what: str) -> Array:
    """An array of samples x channels. One dimension is one channel; what was given is not changed."""
    if isinstance(data, np.ma.MaskedArray):
        data = np.ma.filled(data.astype(np.float64), np.nan)
    try:
        if np.iscomplexobj(data):
            raise TypeError("it is complex")
        array = np.asarray(data, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InnovantError(f"{what} cannot be read as numbers: {error}") from None
    if array.ndim == 1:
        array = array[:, np.newaxis]
    if array.ndim != 2:
        raise InnovantError(
            f"{what} has {array.ndim} dimensions; give samples x channels, or one dimension for one channel"
        )
    return array


def headers(frame: Any) -> list[str]:
    """The names of the columns."""
    return [str(name) for name in frame.columns]


def _column(frame: Any, index: int) -> NDArray[Any]:
    if hasattr(frame, "iloc"):
        series = frame.iloc[:, index]
        if getattr(series.dtype, "kind", "") == "M":
            return series.to_numpy()
        return series.to_numpy(dtype=np.float64, na_value=np.nan)
    return frame[:, index].to_numpy()


def _columns(frame: Any, indices: Sequence[int]) -> Array:
    names = headers(frame)
    try:
        columns = [np.asarray(_column(frame, index), dtype=np.float64) for index in indices]
    except (TypeError, ValueError) as error:
        chosen = ", ".join(f"`{names[index]}`" for index in indices)
        raise InnovantError(f"frame: the columns {chosen} cannot be read as numbers: {error}") from None
    return np.column_stack(columns) if columns else np.empty((len(frame), 0))


def _seconds(stamps: NDArray[Any]) -> Array:
    """Time stamps as numbers: of dates, the seconds since the first."""
    if np.issubdtype(stamps.dtype, np.datetime64):
        return (stamps - stamps[:1]) / np.timedelta64(1, "s")
    return np.asarray(stamps, dtype=np.float64)


def _listed(names: str | Sequence[str] | None) -> list[str] | None:
    if names is None:
        return None
    return [names] if isinstance(names, str) else [str(name) for name in names]


def _dates(frame: Any) -> NDArray[Any] | None:
    """The index of a pandas frame, where it is made of dates."""
    index = getattr(frame, "index", None)
    values = getattr(index, "values", None)
    return values if getattr(values, "dtype", np.dtype(float)).kind == "M" else None


def _of_frame(
    frame: Any,
    dt: float | None,
    inputs: list[str] | None,
    outputs: list[str] | None,
    time: str | None,
) -> tuple[Array, Array, float, list[str], list[str]]:
    names = headers(frame)
    dates = _dates(frame) if dt is None and time is None else None
    if dates is not None:
        dt = _innovant.time_base("time", list(_seconds(dates)))
    u, y, when = _innovant.find_columns(names, inputs, outputs, time, dt, "both")
    if dt is None:
        # Without dt a time column was found, or there was an error that says so.
        assert when is not None
        stamps = np.asarray(_column(frame, when))
        # Of dates the unit is known; of numbers it may stand in the header.
        dt = _innovant.time_base("time" if stamps.dtype.kind == "M" else names[when], list(_seconds(stamps)))
    return _columns(frame, u), _columns(frame, y), dt, [names[i] for i in u], [names[i] for i in y]


def recordings(
    u: Any,
    y: Any = None,
    *,
    dt: float | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    time: str | None = None,
) -> Recordings:
    """Experiments of one plant out of whatever was given."""
    inputs, outputs = _listed(inputs), _listed(outputs)
    if y is None:
        frames = experiments(u)
        if not all(is_frame(frame) for frame in frames):
            raise InnovantError(
                "y is missing: give u and y as arrays, or one data frame with inputs=[...] and outputs=[...]"
            )
        parts = [_of_frame(frame, dt, inputs, outputs, time) for frame in frames]
        for other in parts[1:]:
            if abs(other[2] - parts[0][2]) > SAMPLING_TOLERANCE * parts[0][2]:
                raise InnovantError(f"sample times differ: {parts[0][2]} s and {other[2]} s; resample one of the frames")
        return Recordings([p[0] for p in parts], [p[1] for p in parts], parts[0][2], parts[0][3], parts[0][4])
    if dt is None:
        raise InnovantError("the sample time is not known: pass dt= (seconds)")
    us, ys = experiments(u), experiments(y)
    if len(us) != len(ys):
        raise InnovantError(f"{len(us)} experiments in u and {len(ys)} in y: give one of each for every experiment")
    # A frame of inputs alone, or of outputs alone, names its channels.
    inputs = headers(us[0]) if inputs is None and is_frame(us[0]) else inputs
    outputs = headers(ys[0]) if outputs is None and is_frame(ys[0]) else outputs
    us = [samples(part, "u") for part in us]
    ys = [samples(part, "y") for part in ys]
    for which, arrays in (("u", us), ("y", ys)):
        counts = {array.shape[1] for array in arrays}
        if len(counts) > 1:
            raise InnovantError(f"the experiments in {which} differ in their channels: {sorted(counts)}")
    return Recordings(
        us,
        ys,
        float(dt),
        _named(inputs, "u", us[0].shape[1], "inputs"),
        _named(outputs, "y", ys[0].shape[1], "outputs"),
    )


def _named(names: list[str] | None, letter: str, count: int, what: str) -> list[str]:
    """Names of the channels of an array."""
    if names is None:
        return [f"{letter}{index + 1}" for index in range(count)]
    if len(names) != count:
        raise InnovantError(f"{what}= names {len(names)} channels, but the array has {count}")
    return names


def by_names(data: Any, names: Sequence[str], what: str) -> Array:
    """The channels called `names` of a frame; an array as it is."""
    if not is_frame(data):
        return samples(data, what)
    inputs, outputs = (list(names), None) if what == "u" else (None, list(names))
    need = "inputs" if what == "u" else "outputs"
    u, y, _ = _innovant.find_columns(headers(data), inputs, outputs, None, 1.0, need)
    return _columns(data, u if what == "u" else y)


def like(data: Any, array: Array, names: Sequence[str]) -> Any:
    """An answer in the form of what was asked: a frame for a frame, one dimension for one dimension."""
    if is_frame(data):
        if hasattr(data, "iloc"):
            return type(data)(array, columns=list(names), index=data.index)
        return type(data)(array, schema=list(names))
    return array[:, 0] if np.ndim(data) == 1 and array.shape[1] == 1 else array
