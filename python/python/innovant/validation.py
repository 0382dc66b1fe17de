"""Does a model hold on a recording?"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

from . import plots
from ._innovant import InnovantError
from .frames import Array
from .record import Record, read

#: Lags of the autocorrelation that a plot shows, where the document has none.
LAGS_SHOWN = 30


class Validation:
    """Fit and residual tests, with the keys of ``innovant validate --format json`` as attributes.

    `rejected` is the verdict; `findings` says why in sentences; `one_step` and `free_run` are fits; `whiteness`,
    `past_inputs`, `linearity`, `same_sample`, `feedback` are tests, each with `p_value` and `explained_share`;
    `too_short` is there when the recording is too short to judge a model of this order.
    """

    def __init__(self, text: str, json: str) -> None:
        self._text = text
        self._record = read(json)

    def __getattr__(self, name: str) -> Any:
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

    def plot(self, ax: Any = None) -> Any:
        """Correlations of the residuals with their 99 % bounds; needs matplotlib.

        A row for each output; the columns are the autocorrelations of the residuals, then their correlations with past
        inputs. A right model leaves one value in a hundred outside of the bounds; the verdict is that of the tests, which
        look at all lags at once. Returns the array of Axes; `ax` takes such an array.

        >>> import innovant
        >>> u, y, dt = innovant.examples.servo(4000)
        >>> model = innovant.identify(u, y, dt=dt, order=3)
        >>> model.validate(u, y, fresh=False).plot().shape
        (1, 2)
        """
        own, inputs = self._record["autocorrelation"], self._record["cross_correlation"]
        outputs = [fit["output"] for fit in self._record["one_step"]["outputs"]]
        columns = [(own, name, "residual of ") for name in _sources(own)]
        columns += [(inputs, name, "") for name in _sources(inputs)]
        if not columns:
            raise InnovantError("there is nothing to plot: the residuals vanish")
        rows = [
            [_correlation(pairs, name, output, kind) for pairs, name, kind in columns]
            for output in outputs
        ]
        return plots.correlations(rows, self._title(), ax)

    def _title(self) -> str:
        return f"The tests {'reject' if self.rejected else 'do not reject'} the model at the {100 * self.level:g} % level"

    def to_dict(self) -> Record:
        """Everything."""
        return self._record

    def __bool__(self) -> bool:
        """Whether the model holds."""
        return not self.rejected

    def __repr__(self) -> str:
        return f"innovant.{type(self).__name__}(rejected={self.rejected}, fit_percent={self.fit_percent:.1f})"

    def __str__(self) -> str:
        return self._text

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self._text)}</pre>"


def _sources(pairs: Sequence[Record]) -> list[str]:
    """The channels whose past it is, each once."""
    return list(dict.fromkeys(pair["from"] for pair in pairs))


def _correlation(pairs: Sequence[Record], source: str, output: str, kind: str) -> plots.Correlation | None:
    same = bool(kind) and source == output
    title = f"autocorrelation of the residual of {output}" if same else f"{kind}{source} → residual of {output}"
    for pair in pairs:
        if (pair["from"], pair["to"]) == (source, output):
            return plots.Correlation(title, pair["lags"], pair["values"], pair["bounds_99"])
    return None


class PlantValidation(Validation):
    """Fit and residual tests of a plant in equations, with the keys of ``innovant validate --format json`` as attributes:
    `one_step`, `free_run`, `initial_states`, `residual_tests`, `innovation_size`, `findings`, `rejected`.

    `simulated` and `predicted` are the free run and the predictions one sample ahead, one array a recording.
    """

    def __init__(
        self,
        text: str,
        json: str,
        dt: float,
        measured: list[Array],
        simulated: list[Array] | None,
        predicted: list[Array],
        outputs: list[str],
    ) -> None:
        super().__init__(text, json)
        self.dt = dt
        self.measured = measured
        self.simulated = simulated
        self.predicted = predicted
        #: Names of the outputs, with units.
        self.outputs = outputs

    def plot(self, ax: Any = None, *, recording: int = 0) -> Any:
        """Measured and simulated output, the residual one sample ahead and its autocorrelation with 99 % bounds for white
        residuals; needs matplotlib. Returns the array of Axes, 3 x outputs; `ax` takes such an array."""
        if not -len(self.measured) <= recording < len(self.measured):
            raise InnovantError(f"recording = {recording}: there are {len(self.measured)}, from 0")
        measured, run = self.measured[recording], None
        if self.simulated is not None and self._record["free_run"] is not None:
            percent = [fit["fit_percent"] for fit in self._record["free_run"]["outputs"]]
            run = plots.Run("simulated", [self.simulated[recording]], percent)
        lags = min(LAGS_SHOWN, len(measured) - 1)
        return plots.judged(self.dt, measured, run, self.predicted[recording], self.outputs, lags, self._title(), ax)
