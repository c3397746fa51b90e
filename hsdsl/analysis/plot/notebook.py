# pyright: reportUnknownMemberType=false
"""Runs and ensembles as notebooks display them: a summary, and a picture inside the text; nothing is fetched."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.plot.curves import View
from hsdsl.analysis.plot.style import ALARM, INK, empty, styled, write_figure
from hsdsl.analysis.report import words
from hsdsl.analysis.report.summary import html
from hsdsl.base.errors import WARNINGS
from hsdsl.base.names import called, visible, without_memory
from hsdsl.engine.execution import Array, Ensemble, Execution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 12  # rows of a table of transitions
PANELS = 4  # states of an ensemble that are drawn
DOTS = 90  # an inch


def run_html(run: Execution) -> str:
    """Return a run's summary and picture; every text of the model is escaped."""
    with styled():
        from hsdsl.analysis.plot import figure

        drawn = figure.picture([run], View(**run.view()))
        return f"{html(run, limit=MOST)}\n{_element(drawn, words.heading(run))}"


def ensemble_html(ensemble: Ensemble) -> str:
    """Return what was varied, how the runs ended, and a picture over one or two names that vary."""
    count = ensemble.stop.size
    rows = [("runs", f"{count:,}, shape {ensemble.shape}")]
    rows += [(f"varied {name}", _range(values)) for name, values in ensemble.varied.items()]
    rows += [("stops", ", ".join(f"{number:,} {reason}" for reason, number in ensemble.reasons.items()) or "none")]
    rows += [("warnings", f"{number:,} {code}: {WARNINGS[code]}") for code, number in ensemble.warning_counts.items()]
    rows += [("transitions", _range(ensemble.transitions))] if count else []
    rows += [(f"final {name}", _range(ensemble.state[name])) for name in without_memory(ensemble.state)]
    rows += [("seconds", ", ".join(f"{name} {value:.3g}" for name, value in ensemble.seconds.items()))]
    heading = f"{called(ensemble.title, ensemble.model)}: {ensemble.scheme} {ensemble.method}, engine {ensemble.engine}"
    table = f'<div class="hsdsl"><p><strong>{escape(visible(heading))}</strong></p>{words.html_facts(rows)}</div>'
    if not count or len(ensemble.varied) not in (1, 2):
        return table
    with styled():
        drawn = _curves(ensemble) if len(ensemble.varied) == 1 else _map(ensemble)
        return f"{table}\n{_element(drawn, heading)}"


def lines_html(text: str) -> str:
    """Return lines of text; every text of the model is escaped."""
    return f'<div class="hsdsl"><pre>{words.escaped(text)}</pre></div>'


def measured_html(
    text: str, run: Execution, times: Array, columns: Mapping[str, Array], units: Mapping[str, str]
) -> str:
    """Return lines of text, and a picture of measurements and the run fitted to them."""
    with styled():
        from hsdsl.analysis.plot.ensembles import measured

        return f"{lines_html(text)}\n{_element(measured(run, times, columns, units), words.heading(run))}"


def _range(values: Any) -> str:
    """The least and the largest value; a word for none."""
    numbers = np.asarray(values, dtype=float)
    finite = numbers[np.isfinite(numbers)]
    if not len(finite):
        return "no value"
    least, most = float(finite.min()), float(finite.max())
    return words.number(least) if least == most else f"{words.number(least)} to {words.number(most)}"


def _curves(ensemble: Ensemble) -> Figure:
    """Final states over the one name that varies; runs that failed are crosses."""
    ((name, values),) = ensemble.varied.items()
    x, failed = np.asarray(values, dtype=float).ravel(), ensemble.failed.ravel()
    states = {name: ensemble.state[name] for name in without_memory(ensemble.state)[:PANELS]}
    states = states or {"transitions": ensemble.transitions}
    figure = empty(8, 1.9 * len(states) + 0.6)
    axes = figure.subplots(len(states), 1, squeeze=False, sharex=True)[:, 0]
    for axis, (state, ends) in zip(axes, states.items(), strict=True):
        y = ends.ravel().astype(float)
        axis.plot(x[~failed], y[~failed], ".", color=INK, markersize=4, rasterized=True)
        bottom = np.full(failed.sum(), 0.04)  # their last values are arbitrary
        across = axis.get_xaxis_transform()
        axis.plot(x[failed], bottom, "x", color=ALARM, markersize=5, transform=across, label="failed", rasterized=True)
        axis.set_ylabel(f"final {state}" if state in ensemble.state else state, parse_math=False)
    if failed.any():
        axes[0].set_title("crosses: runs that did not get to their end", loc="left", fontsize=8.5, color=ALARM)
    axes[-1].set_xlabel(name, parse_math=False)
    return figure


def _map(ensemble: Ensemble) -> Figure:
    """The number of transitions over the two names that vary; runs that failed are crosses."""
    (x, y) = (np.broadcast_to(values, ensemble.shape).ravel() for values in ensemble.varied.values())
    failed = ensemble.failed.ravel()
    figure = empty(7, 4.6)
    axis = figure.subplots()
    size = float(np.clip(2e4 / len(x), 1.0, 60.0))
    shades: dict[str, Any] = {
        "c": ensemble.transitions.ravel()[~failed],
        "cmap": "viridis",
        "linewidths": 0,
        "rasterized": True,
    }
    figure.colorbar(axis.scatter(x[~failed], y[~failed], s=size, marker="s", **shades), ax=axis, label="transitions")
    axis.plot(x[failed], y[failed], "x", color=ALARM, markersize=4, rasterized=True, label="failed")
    across, up = ensemble.varied
    axis.set_xlabel(across, parse_math=False)
    axis.set_ylabel(up, parse_math=False)
    return figure


def _element(figure: Figure, name: str) -> str:
    """A picture as an element of HTML that holds its own bytes."""
    file = BytesIO()
    write_figure(figure, file, "png", DOTS)
    data = base64.b64encode(file.getvalue()).decode()
    alt = escape(visible(name), quote=True)
    return f'<img alt="{alt}" style="max-width: 100%" src="data:image/png;base64,{data}">'
