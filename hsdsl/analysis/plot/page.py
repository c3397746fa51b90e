"""Runs as one interactive page: zoom, values under the pointer, ribbons of modes, phase plots; nothing is fetched."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from html import escape
from typing import Any

import numpy as np

from hsdsl.analysis.plot.curves import Array, Curves, Pair, View, curves, moving_levels, names_of
from hsdsl.analysis.plot.parts import filled, inert, scripts, shared
from hsdsl.analysis.plot.style import colours
from hsdsl.analysis.report import mode_graph, words
from hsdsl.analysis.report.summary import html
from hsdsl.base.names import visible
from hsdsl.base.parts import short_names
from hsdsl.engine.execution import Execution

NUMBERS = 1_000_000  # that a page holds at most, nearly, for all its runs: 11 MB
PANELS = 6  # over time at first; the others are a click away


def page(runs: Sequence[Execution], view: View) -> str:
    """Return the text of the page; every text of the model in it is escaped for the place where it is."""
    names, pairs, labels = view.names(runs), view.pairs(runs), view.called(runs)
    if view.columns is None:
        columns, shown = names_of(runs), names[:PANELS]
    else:
        columns, shown = list(dict.fromkeys([*names, *(name for pair in pairs for name in pair)])), names
    data = [curves(run) for run in runs]
    pairs_of = zip(runs, data, strict=True)
    modes = list(dict.fromkeys(m for run, drawn in pairs_of for m in (*(a.mode for a in run.arcs), *drawn.modes)))
    kept = [thinned(drawn, columns, NUMBERS // len(runs)) for drawn in data]
    title = escape(visible(view.title or ", ".join(dict.fromkeys(map(words.heading, runs)))))
    ends = [visible(words.stop(run)) for run in runs]
    facts = ends[0] if len(runs) == 1 else f"{len(runs)} runs"
    drawn, points = sum(map(len, kept)), sum(len(each.samples) for each in data)
    sections: list[str] = []
    for run, label in zip(runs, labels, strict=True):
        heading = f"<h2>{escape(visible(label))}</h2>\n" if len(runs) > 1 else ""
        sections.append(f"<section>{heading}{html(run)}</section>")
    graph = view.program and mode_graph.mode_graph(view.program, runs[0] if len(runs) == 1 else None)
    parts = {
        "title": title,
        "style": shared("page.css") + mode_graph.CSS,
        "facts": escape(facts + (f"; {drawn:,} of {points:,} points are drawn" if drawn < points else "")),
        "pictures": shared("pictures.html"),
        "summaries": "\n".join([*sections, graph or ""]),
        "model": inert(_model(view, columns, shown, pairs, modes) | {"moving": list(_moving(view, data))}),
        "runs": inert([_run(*one, columns, modes) for one in zip(runs, data, kept, map(visible, labels), strict=True)]),
        "script": "\n".join([scripts(), shared("runs.js")]),
    }
    return filled(shared("runs.html"), parts)


def _model(view: View, columns: list[str], shown: list[str], pairs: Sequence[Pair], modes: list[str]) -> dict[str, Any]:
    colour, names = colours(modes), short_names(modes)
    guards = {
        (guard.state, guard.value): guard.label for guard in view.guards if guard.mode in modes and guard.moving is None
    }
    return {
        "columns": list(map(visible, columns)),
        "units": {visible(name): visible(unit) for name, unit in view.units.items()},
        "modes": [{"name": visible(names[mode]), "colour": colour[mode]} for mode in modes],
        "guards": [
            {"state": visible(state), "value": value, "label": label} for (state, value), label in guards.items()
        ],
        "shown": list(map(visible, shown)),
        "phases": [list(map(visible, pair)) for pair in pairs or [columns[:2]] * (len(columns) > 1)],
    }


def _moving(view: View, data: Sequence[Curves]) -> Iterator[dict[str, Any]]:
    """Guards that move, as lines."""
    for guard, times, values in moving_levels(data, view.guards):
        if np.isfinite(values).any():
            names = {"state": visible(guard.state), "label": visible(guard.label)}
            yield names | {"times": _doubles(times), "values": _doubles(values)}


def _run(
    run: Execution, drawn: Curves, kept: Array, label: str, columns: Sequence[str], modes: Sequence[str]
) -> dict[str, Any]:
    number = {mode: k for k, mode in enumerate(modes)}
    arcs = run.arcs
    return {
        "label": label,
        "failed": drawn.ends_badly,
        "times": _doubles(drawn.samples.time[kept]),
        "columns": [_doubles(drawn.column(name)[kept]) for name in columns],
        "arcOf": _integers((np.cumsum(drawn.begins) - 1)[kept]),
        "arcs": {
            "start": _doubles([float(run.times[arc.first]) for arc in arcs]),
            "end": _doubles([float(run.times[arc.last]) for arc in arcs]),
            "mode": _integers([number[arc.mode] for arc in arcs]),
            "jump": _integers([arc.jump for arc in arcs]),
            "kind": _integers([arc.kind == "strip" for arc in arcs]),
        },
        "bands": [[number[mode], begin, end] for mode, begin, end in drawn.bands],
    }


def _doubles(values: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode()


def _integers(values: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype="<i4").tobytes()).decode()


def thinned(drawn: Curves, columns: Sequence[str], numbers: int) -> Array:
    """Choose the points of a page: all, or of each stretch of time the first, the last, the least and the largest.

    So a picture of fewer pixels than stretches is that of all points (M4; Jugel et al., VLDB 2014).
    """
    count, each = len(drawn.samples), len(columns) + 1
    if count * each <= numbers:
        return np.arange(count)
    bins = max(1, numbers // (each * 2 * each))
    time: Array = drawn.samples.time
    cuts: list[float] = np.linspace(float(time[0]), float(time[-1]), bins + 1)[1:-1].tolist()
    edges: Array = np.asarray(np.searchsorted(time, cuts))
    starts = np.unique(np.append(edges[edges < count], 0))
    ends = np.append(starts[1:], count) - 1
    kept = [starts, ends]
    for name in columns:
        column = drawn.column(name)
        order = np.lexsort((column, np.repeat(np.arange(len(starts)), np.diff(np.append(starts, count)))))
        kept += [order[starts], order[ends]]
    return np.unique(np.concatenate(kept))
