"""What a notebook shows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from .record import Record
from .responses import Roots


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of text."""

    def line(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    return f"<table><thead>{line(head, 'th')}</thead><tbody>{''.join(line(row, 'td') for row in rows)}</tbody></table>"


def _list(sentences: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences) + "</ul>" if sentences else ""


def _number(value: float, std: float) -> str:
    """A number with its standard deviation; nothing where there is none."""
    if not np.isfinite(value):
        return ""
    return f"{value:.4g}" if not np.isfinite(std) else f"{value:.4g} ± {std:.2g}"


def model(verdict: str, poles: Roots, warnings: Sequence[str]) -> str:
    """Verdict, poles, warnings."""
    rows = [
        (
            f"{value.real:.4f} {'+' if value.imag > 0 else '-'} {abs(value.imag):.4f}j" if value.imag else f"{value.real:.4f}",
            _number(poles.natural_frequency[i], poles.natural_frequency_std[i]),
            _number(poles.damping[i], poles.damping_std[i]),
            _number(poles.time_constant[i], poles.time_constant_std[i]),
        )
        for i, value in enumerate(poles.values)
        if value.imag >= 0
    ]
    head = ("pole", "natural frequency [rad/s]", "damping", "time constant [s]")
    return f"<p><b>{escape(verdict)}</b></p>{table(head, rows)}{_list(warnings)}"


def explanation(shown: Record) -> str:
    """Verdict, what was found, what else was tried, of a document `innovant-explanation/1`."""
    said = "".join(f"<p>{escape(line)}</p>" for line in shown["summary"])
    found = _list([effect["sentence"] for effect in shown["effects"]])
    alternatives = shown["alternatives"]
    rivals = table(
        ("not this", "because"), [(rival["effect"].replace("_", " "), rival["why_not"]) for rival in alternatives]
    )
    title = f"<p><b>{escape(shown['verdict'])}</b>, probability {shown['probability']:.2f}</p>"
    return title + said + found + (rivals if alternatives else "")
