"""Documents as Python objects."""

from __future__ import annotations

import json
from typing import Any


class Record(dict[str, Any]):
    """A part of a document: a dict whose keys are attributes too.

    >>> Record({"fit": {"percent": 91.5}}).fit.percent
    91.5
    """

    def __init__(self, content: dict[str, Any]) -> None:
        super().__init__((key, _nested(value)) for key, value in content.items())

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"there is no {name!r} here; there are: {', '.join(self)}") from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(key for key in self if isinstance(key, str))]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)


def _nested(value: Any) -> Any:
    if isinstance(value, dict):
        return value if isinstance(value, Record) else Record(value)
    if isinstance(value, list):
        return [_nested(part) for part in value]
    return value


def read(text: str) -> Record:
    """The record of a JSON document."""
    return Record(json.loads(text))
