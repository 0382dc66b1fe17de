"""Does a model hold on a recording?"""

from __future__ import annotations

from html import escape

from .record import Record, read


class Validation:
    """Fit and residual tests, with the keys of ``innovant validate --format json`` as attributes.

    `rejected` is the verdict; `findings` says why in sentences; `one_step` and `free_run` are fits; `whiteness`,
    `past_inputs`, `linearity`, `same_sample`, `feedback` are tests, each with `p_value` and `explained_share`;
    `too_short` is there when the recording is too short to judge a model of this order.
    """

    def __init__(self, text: str, json: str) -> None:
        self._text = text
        self._record = read(json)

    def __getattr__(self, name: str):
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._record, name)

    @property
    def rejected(self) -> bool:
        """Whether the model does not hold."""
        return self._record["rejected"]

    @property
    def fit_percent(self) -> float:
        """Fit one step ahead in percent."""
        return self._record["one_step"]["fit_percent"]

    def to_dict(self) -> Record:
        """Everything."""
        return self._record

    def __bool__(self) -> bool:
        """Whether the model holds."""
        return not self.rejected

    def __repr__(self) -> str:
        return f"innovant.Validation(rejected={self.rejected}, fit_percent={self.fit_percent:.1f})"

    def __str__(self) -> str:
        return self._text

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self._text)}</pre>"
