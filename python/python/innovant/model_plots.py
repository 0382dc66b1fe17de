"""Figures of a whole model in one pair of axes, by plotly or matplotlib: what `Model.plot_bode` and `plot_poles` return."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from . import plots
from ._innovant import InnovantError
from .frames import Array
from .plots import COLOURS, Curve
from .responses import Roots


def _checked(backend: str) -> str:
    if backend not in ("plotly", "matplotlib"):
        raise InnovantError(f"backend = {backend!r}: expected one of plotly, matplotlib")
    return backend


def bode(curves: Sequence[Curve], hertz: Array, backend: str) -> Any:
    """See `Model.plot_bode`."""
    draw = _bode_plotly if _checked(backend) == "plotly" else _bode_matplotlib
    return draw(curves, hertz)


def poles(found: Roots, zeros: Roots, backend: str) -> Any:
    """See `Model.plot_poles`."""
    draw = _poles_plotly if _checked(backend) == "plotly" else _poles_matplotlib
    return draw(found, zeros)


def _bode_plotly(curves: Sequence[Curve], hertz: Array) -> Any:
    from plotly.graph_objects import Scatter
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for index, curve in enumerate(curves):
        colour, name = COLOURS[index % len(COLOURS)], curve.name
        for row, values, band in ((1, curve.magnitude, curve.magnitude_95), (2, curve.phase, curve.phase_95)):
            if band is not None:
                low, high = band.T
                figure.add_trace(
                    Scatter(
                        x=np.concatenate([hertz, hertz[::-1]]),
                        y=np.concatenate([high, low[::-1]]),
                        fill="toself",
                        fillcolor=colour,
                        opacity=0.2,
                        line={"width": 0},
                        hoverinfo="skip",
                        showlegend=False,
                        legendgroup=name,
                    ),
                    row=row,
                    col=1,
                )
            figure.add_trace(
                Scatter(x=hertz, y=values, name=name, legendgroup=name, showlegend=row == 1, line={"color": colour}),
                row=row,
                col=1,
            )
    figure.update_xaxes(type="log")
    figure.update_xaxes(title_text="frequency [Hz]", row=2, col=1)
    figure.update_yaxes(type="log", title_text="magnitude", row=1, col=1)
    figure.update_yaxes(title_text="phase [degrees]", row=2, col=1)
    figure.update_layout(title="Frequency response with 95 % bands", height=600)
    return figure


def _bode_matplotlib(curves: Sequence[Curve], hertz: Array) -> Any:
    plots.pyplot()
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for index, curve in enumerate(curves):
        colour = COLOURS[index % len(COLOURS)]
        for axes, values, band in ((above, curve.magnitude, curve.magnitude_95), (below, curve.phase, curve.phase_95)):
            axes.plot(hertz, values, color=colour, label=curve.name)
            if band is not None:
                axes.fill_between(hertz, *band.T, color=colour, alpha=0.2, linewidth=0)
    above.set(xscale="log", yscale="log", ylabel="magnitude", title="Frequency response with 95 % bands")
    below.set(xlabel="frequency [Hz]", ylabel="phase [degrees]")
    above.legend()
    return figure


def _poles_plotly(found: Roots, zeros: Roots) -> Any:
    from plotly.graph_objects import Figure, Scatter

    line = {"color": COLOURS[5], "width": 1}
    circle = plots.unit_circle()
    figure = Figure()
    figure.add_trace(Scatter(x=circle.real, y=circle.imag, line=line, name="unit circle", hoverinfo="skip"))
    for corners in plots.ellipses(found.values, found.covariance):
        figure.add_trace(
            Scatter(x=corners.real, y=corners.imag, fill="toself", line={"width": 1, "color": COLOURS[0]}, showlegend=False)
        )
    for roots, symbol in ((found, "x"), (zeros, "circle-open")):
        marker = {"symbol": symbol, "size": 9, "color": COLOURS[0]}
        values = roots.values
        figure.add_trace(Scatter(x=values.real, y=values.imag, mode="markers", marker=marker, name=roots.kind))
    figure.update_layout(title="Poles with 95 % ellipses, and zeros", xaxis_title="real", yaxis_title="imaginary", height=600)
    figure.update_yaxes(scaleanchor="x", scaleratio=1)
    return figure


def _poles_matplotlib(found: Roots, zeros: Roots) -> Any:
    plots.pyplot()
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 6), layout="constrained")
    axes = figure.subplots()
    circle = plots.unit_circle()
    axes.plot(circle.real, circle.imag, color=COLOURS[5], linewidth=1)
    for corners in plots.ellipses(found.values, found.covariance):
        axes.fill(corners.real, corners.imag, color=COLOURS[0], alpha=0.3)
    axes.plot(found.values.real, found.values.imag, "x", color=COLOURS[0], label="poles")
    axes.plot(zeros.values.real, zeros.values.imag, "o", color=COLOURS[0], fillstyle="none", label="zeros")
    axes.set(aspect="equal", xlabel="real", ylabel="imaginary", title="Poles with 95 % ellipses, and zeros")
    axes.legend()
    return figure
