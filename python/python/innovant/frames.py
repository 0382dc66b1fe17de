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


def numbers(data: ArrayLike, what: str) -> Array:
    """An array of real numbers; masked values are NaN, and what was given is not changed."""
    if isinstance(data, np.ma.MaskedArray):
        data = np.ma.filled(data.astype(np.float64), np.nan)
    try:
        if np.iscomplexobj(data):
            raise TypeError("it is complex")
        return np.asarray(data, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InnovantError(f"{what} cannot be read as numbers: {error}") from None


def samples(data: ArrayLike, what: str, names: Sequence[str] | None = None, *, few: bool = False) -> Array:
    """An array of samples x channels. One dimension is one channel; what was given is not changed.

    `names` are the channels that are expected. Without them an array of fewer samples than channels is an error, for
    nothing can be estimated from it, unless there may be `few`.

    >>> samples([1.0, 2.0], "u").shape
    (2, 1)
    """
    given = numbers(data, what)
    array = given[:, np.newaxis] if given.ndim == 1 else given
    if array.ndim != 2:
        raise InnovantError(
            f"{what} has the shape {given.shape}, {given.ndim} dimensions; expected samples x channels, or one "
            "dimension for one channel"
        )
    rows, columns = array.shape
    if names is None:
        if 0 < rows < columns and not few:
            raise InnovantError(_transposed(what, array, "expected samples x channels"))
    elif columns != len(names):
        expected = f"expected samples x {len(names)} ({', '.join(names) or 'no channel'})"
        if rows == len(names) and columns > 1:
            raise InnovantError(_transposed(what, array, expected))
        raise InnovantError(f"{what} has the shape {given.shape}, {_count(columns)}; {expected}")
    return array


def _transposed(what: str, array: Array, expected: str) -> str:
    rows, columns = array.shape
    count = "1 sample" if rows == 1 else f"{rows} samples"
    return (
        f"{what} has the shape {array.shape}: {count} of {_count(columns)}: transposed? "
        f"{expected[0].upper()}{expected[1:]}; pass {what}.T"
    )


def _count(channels: int) -> str:
    return "1 channel" if channels == 1 else f"{channels} channels"


def vector(data: ArrayLike, what: str, length: int, of: str) -> Array:
    """An array of `length` numbers, one for each `of`."""
    array = numbers(data, what)
    if array.size != length:
        raise InnovantError(f"{what} has the shape {array.shape}; expected {length} numbers, one for each {of}")
    return array.reshape(-1)


def headers(frame: Any) -> list[str]:
    """The names of the columns."""
    return [str(name) for name in frame.columns]


def _column(frame: Any, index: int) -> NDArray[Any]:
    if hasattr(frame, "iloc"):
        series = frame.iloc[:, index]
        if getattr(series.dtype, "kind", "") in ("M", "m"):
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
    """Time stamps as numbers: of dates, the seconds since the first; of durations, the seconds."""
    if stamps.dtype.kind == "M":
        return (stamps - stamps[:1]) / np.timedelta64(1, "s")
    if stamps.dtype.kind == "m":
        return stamps / np.timedelta64(1, "s")
    return np.asarray(stamps, dtype=np.float64)


def _listed(names: str | Sequence[str] | None) -> list[str] | None:
    if names is None:
        return None
    return [names] if isinstance(names, str) else [str(name) for name in names]


# -- sample time


def _index(data: Any) -> NDArray[Any] | None:
    """The index of a pandas frame or series if it can be a time: dates, durations, or numbers with a fraction."""
    index: Any = getattr(data, "index", None)
    if getattr(index, "tz", None) is not None:
        # Of dates with a time zone, the same dates in UTC.
        index = index.tz_convert(None)
    values: Any = getattr(index, "values", None)
    kind = getattr(getattr(values, "dtype", None), "kind", None)
    return values if kind in ("M", "m", "f") and len(values) > 1 else None


@dataclass
class _Time:
    """What a column or an index of time says."""

    where: str
    dt: float | None
    start: float
    error: InnovantError | None = None


def _time_of(stamps: NDArray[Any], column: str, where: str) -> _Time:
    """The sample time of stamps, or why there is none. Of dates the unit is known; of numbers the header may have it."""
    seconds = _seconds(stamps)
    # Dates are compared with dates: the start is that since 1970.
    start = stamps[0].astype("datetime64[ns]").astype(np.int64) * 1e-9 if stamps.dtype.kind == "M" else seconds[0]
    try:
        dt = _innovant.time_base("time" if stamps.dtype.kind in ("M", "m") else column, seconds.tolist())
    except InnovantError as error:
        return _Time(where, None, start, error)
    return _Time(where, dt, start)


def index_time(data: Any, what: str) -> _Time | None:
    """The time in the index of a pandas frame or series; none if there is no such index."""
    index = _index(data)
    return None if index is None else _time_of(index, "time", f"the index of {what}")


def _agreed(dt: float | None, times: Sequence[_Time | None]) -> float:
    """The sample time that was passed, or that of the times; both must agree. Stamps with unequal steps are not compared
    with a sample time that was passed."""
    known = [time for time in times if time is not None]
    try:
        agreed, source = None if dt is None else float(dt), "dt"
    except (TypeError, ValueError):
        raise InnovantError(f"dt = {dt!r}: expected the sample time in seconds, a number") from None
    for time in known:
        if time.dt is None:
            continue
        if agreed is None:
            agreed, source = time.dt, time.where
        elif abs(time.dt - agreed) > SAMPLING_TOLERANCE * abs(agreed):
            said = f"dt = {agreed:g} s was passed" if source == "dt" else f"{source} gives dt = {agreed:g} s"
            advice = (
                "pass the right one alone" if source == "dt" else "resample one of them, or pass dt= and arrays without times"
            )
            raise InnovantError(f"{said}, and {time.where} gives dt = {time.dt:g} s: {advice}")
    if agreed is None:
        for time in known:
            if time.error is not None:
                raise InnovantError(f"{time.where} gives no sample time, and dt= was not passed: {time.error}")
        raise InnovantError(
            "the sample time is not known: pass dt= (seconds), or a pandas frame whose index is a time with equal steps"
        )
    return agreed


def sample_time(u: Any, dt: float | None) -> float:
    """The sample time that was passed, or that of the index of inputs; both must agree."""
    return _agreed(dt, [index_time(u, "u")])


def check_index(data: Any, what: str, dt: float) -> None:
    """An error if the index of `data` is a time with another sample time than that of a model."""
    time = index_time(data, what)
    if time is not None and time.dt is not None and abs(time.dt - dt) > SAMPLING_TOLERANCE * dt:
        raise InnovantError(
            f"{time.where} gives dt = {time.dt:g} s, and the model has dt = {dt:g} s: resample the data, or drop the index "
            "if it is no time in seconds"
        )


def check_rows(u: Array, y: Array, which: str = "") -> None:
    """Inputs and outputs have a row for each sample."""
    if len(u) != len(y):
        raise InnovantError(
            f"u{which} has the shape {u.shape} and y{which} the shape {y.shape}: {len(u)} and {len(y)} samples; expected "
            "a row for each sample in both"
        )


def _check_starts(u: _Time | None, y: _Time | None, dt: float) -> None:
    """Indices of inputs and outputs begin at the same time."""
    if u is not None and y is not None and abs(u.start - y.start) > 0.5 * dt:
        raise InnovantError(
            f"{y.where} begins {y.start - u.start:g} s after {u.where}: rows of u and y are taken at the same time; join "
            "them on their index first"
        )


# -- recordings


def _of_frame(
    frame: Any,
    dt: float | None,
    inputs: list[str] | None,
    outputs: list[str] | None,
    time: str | None,
) -> tuple[Array, Array, float, list[str], list[str]]:
    names = headers(frame)
    index = index_time(frame, "the frame") if time is None else None
    # With another sample time the core looks for no time column.
    known = dt if dt is not None else None if index is None else index.dt
    try:
        u, y, when = _innovant.find_columns(names, inputs, outputs, time, known, "both")
    except InnovantError:
        if index is not None and known is None:
            # There is no column of time: why the index is none says more.
            _agreed(None, [index])
        raise
    column = None
    if when is not None and (index is None or index.dt is None):
        column = _time_of(np.asarray(_column(frame, when)), names[when], f"the column `{names[when]}`")
        if column.error is not None and dt is None:
            raise column.error
    dt = _agreed(dt, [index if index is not None and index.dt is not None else None, column])
    return _columns(frame, u), _columns(frame, y), dt, [names[i] for i in u], [names[i] for i in y]


def _of_frames(parts: list[tuple[Array, Array, float, list[str], list[str]]]) -> Recordings:
    first = parts[0]
    for other in parts[1:]:
        if abs(other[2] - first[2]) > SAMPLING_TOLERANCE * first[2]:
            raise InnovantError(f"sample times differ: {first[2]} s and {other[2]} s; resample one of the frames")
    return Recordings([part[0] for part in parts], [part[1] for part in parts], first[2], first[3], first[4])


def pairs(u: Any, y: Any) -> list[tuple[Any, Any, str]]:
    """Inputs, outputs and a suffix for messages, one an experiment; outputs are those of the frame without `y`."""
    us = experiments(u)
    ys: list[Any] = [None] * len(us) if y is None else experiments(y)
    if y is None and not all(is_frame(frame) for frame in us):
        raise InnovantError(
            "y is missing: give u and y as arrays, or one data frame with inputs=[...] and outputs=[...]"
        )
    if len(us) != len(ys):
        raise InnovantError(f"{len(us)} experiments in u and {len(ys)} in y: give one of each for every experiment")
    single = len(us) == 1
    return [(first, second, "" if single else f"[{i}]") for i, (first, second) in enumerate(zip(us, ys))]


def recordings(
    u: Any,
    y: Any = None,
    *,
    dt: float | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    time: str | None = None,
    few: bool = False,
) -> Recordings:
    """Experiments of one plant out of whatever was given. There may be `few` samples in a chunk of a recording."""
    inputs, outputs = _listed(inputs), _listed(outputs)
    given = pairs(u, y)
    if y is None:
        return _of_frames([_of_frame(frame, dt, inputs, outputs, time) for frame, _, _ in given])
    dt = _sample_time(given, dt)
    # A frame of inputs alone, or of outputs alone, names its channels.
    inputs = headers(given[0][0]) if inputs is None and is_frame(given[0][0]) else inputs
    outputs = headers(given[0][1]) if outputs is None and is_frame(given[0][1]) else outputs
    us = [samples(part, f"u{which}", few=few) for part, _, which in given]
    ys = [samples(part, f"y{which}", few=few) for _, part, which in given]
    for letter, arrays in (("u", us), ("y", ys)):
        counts = {array.shape[1] for array in arrays}
        if len(counts) > 1:
            raise InnovantError(f"the experiments in {letter} differ in their channels: {sorted(counts)}")
    for first, second, (_, _, which) in zip(us, ys, given):
        check_rows(first, second, which)
    return Recordings(
        us,
        ys,
        dt,
        _named(inputs, "u", us[0].shape[1], "inputs"),
        _named(outputs, "y", ys[0].shape[1], "outputs"),
    )


def _sample_time(given: Sequence[tuple[Any, Any, str]], dt: float | None) -> float:
    """The sample time of pairs of inputs and outputs: passed, or that of an index; all agree."""
    times = [(index_time(u, f"u{which}"), index_time(y, f"y{which}")) for u, y, which in given]
    agreed = _agreed(dt, [time for pair in times for time in pair])
    for first, second in times:
        _check_starts(first, second, agreed)
    return agreed


def known_recordings(
    u: Any, y: Any, *, dt: float | None, inputs: Sequence[str], outputs: Sequence[str], time: str | None = None
) -> Recordings:
    """Experiments of a plant whose channels are known; in frames they are found by their names."""
    given = pairs(u, y)
    if y is None:
        return _of_frames([_of_frame(frame, dt, list(inputs), list(outputs), time) for frame, _, _ in given])
    dt = _sample_time(given, dt)
    us = [by_names(part, inputs, "u", label=f"u{which}") for part, _, which in given]
    ys = [by_names(part, outputs, "y", label=f"y{which}") for _, part, which in given]
    for first, second, (_, _, which) in zip(us, ys, given):
        check_rows(first, second, which)
    return Recordings(us, ys, dt, list(inputs), list(outputs))


def _named(names: list[str] | None, letter: str, count: int, what: str) -> list[str]:
    """Names of the channels of an array."""
    if names is None:
        return [f"{letter}{index + 1}" for index in range(count)]
    if len(names) != count:
        raise InnovantError(f"{what}= names {len(names)} channels ({', '.join(names)}), but the array has {count}")
    return names


def by_names(data: Any, names: Sequence[str], what: str, *, label: str | None = None, dt: float | None = None) -> Array:
    """The channels called `names` of a frame; an array as it is. Messages call the argument `label`."""
    label = label or what
    if dt is not None:
        check_index(data, label, dt)
    if not is_frame(data):
        return samples(data, label, names)
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


def without_unit(header: str) -> str:
    """The name in a header such as ``force [N]``."""
    return header.rsplit(" [", 1)[0] if header.endswith("]") else header


def unit_of(header: str) -> str:
    """The unit in a header such as ``force [N]``; empty without one."""
    return header.rsplit(" [", 1)[1][:-1] if header.endswith("]") and " [" in header else ""
