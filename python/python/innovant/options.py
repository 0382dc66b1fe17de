"""Options of `identify` as the native part reads them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict

import numpy as np

from ._innovant import InnovantError

Method = Literal["pbsid-opt", "knudsen", "pem", "subid", "whitening", "innovation-estimation"]


class Options(TypedDict, total=False):
    """What `identify` and `Moments` can be asked for; see `identify`."""

    order: int | Sequence[int] | None
    past: int | None
    future: int | None
    method: Method
    stochastic: Literal["first-column", "cholesky", "innovations"] | None
    weight: Literal["identity", "cva"] | None
    polish: Literal["auto", "always", "never"]
    covariance: Literal["model", "robust"]
    detrend: Literal["mean", "linear", "none"]
    feedthrough: bool
    delay: int | Sequence[int]
    stable: bool
    seed: int


def listed(value: Any) -> Any:
    """Numbers of numpy as numbers of Python; sequences as lists."""
    if isinstance(value, (str, bytes)):
        return value
    if isinstance(value, (np.integer, np.floating, np.bool_)):
        return value.item()
    if isinstance(value, (Sequence, range, np.ndarray)):
        return [listed(part) for part in value]
    return value


def delays(delay: int | Sequence[int]) -> list[int]:
    """One delay for all inputs, or one for each."""
    given = listed(delay)
    return given if isinstance(given, list) else [given] if given else []


def written(options: Mapping[str, Any]) -> str:
    """The options as JSON."""
    unknown = set(options) - Options.__annotations__.keys()
    if unknown:
        raise InnovantError(
            f"there is no option {', '.join(sorted(unknown))}; there are: {', '.join(Options.__annotations__)}"
        )
    plain = {key: listed(value) for key, value in options.items()}
    if "delay" in plain:
        plain["delay"] = delays(plain["delay"])
    if plain.get("order") == "auto":
        plain["order"] = None
    try:
        return json.dumps(plain)
    except TypeError as error:
        raise InnovantError(f"an option is neither a number nor a word: {error}") from None
