"""What a page knows of its model besides the compiled code, as plain data: names, sliders, shapes, the exported run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from hsdsl.analysis.plot.style import colours
from hsdsl.analysis.report import words
from hsdsl.analysis.report.words import condensed
from hsdsl.base.names import visible, without_memory
from hsdsl.base.parts import layout_of, numbered
from hsdsl.engine.backends.c import width
from hsdsl.engine.execution import Execution
from hsdsl.engine.runtime import structures
from hsdsl.export.source import Source
from hsdsl.export.web.numbers import SETTINGS, fixed
from hsdsl.mathematics.program import ModeProgram, Program

Data = dict[str, Any]
MOST_COLOURS = 28  # of product modes; then they begin again


def model_of(source: Source, shown: Source, run: Execution) -> Data:
    """The data of a page.

    ``shown`` has the numbers of the scene as further outputs; ``run`` is the run of the exported settings.
    """
    system, problem = source.system, source.problem
    program, states = problem.program, problem.program.all_states
    seen = [name for name in without_memory(states) if name not in numbered(program.parts)]
    colour = colours(program.mode_names)
    return {
        "title": visible(system.title or source.name),
        "about": [*source.heading, *([visible(system.source)] if system.source else [])],
        "controls": [*_parameters(source), *_starts(source, run)],
        "parameters": len(program.parameters),
        "starts": len(problem.states),
        "states": len(states),
        "outputs": len(shown.problem.program.outputs),
        "width": width(program),
        "columns": [*seen, *program.outputs],
        "unseen": [k for k, name in enumerate(states) if name not in seen],
        "units": {name: visible(unit) for name, unit in program.units.items()},
        "modes": [_mode(mode, colour[mode.name]) for mode in program.modes],
        "parts": _parts(program),
        "startStates": list(problem.states),
        "scene": [{"kind": shape.kind, "points": shape.points, "numbers": shape.numbers} for shape in system.scene],
        "settings": list(SETTINGS),
        "inputs": [given.name for given in program.inputs],
        "layouts": {name: _layout(getattr(structures, name.upper())) for name in ("arc", "transition", "note")},
        "reasons": structures.REASONS,
        "notices": structures.NOTICES,
        "failures": structures.FAILURES,
        "verdict": {
            "theorem": run.verdict.theorem,
            "reasons": [visible(text) for text in condensed(run.verdict.reasons)],
        },
        "exported": visible(words.stop(run)),
    }


def _parts(program: Program) -> Data | None:
    """What the page needs to name product modes; None where there are no parts."""
    parts = program.parts
    if not parts:
        return None
    layout = layout_of(parts, program.all_states)
    return {
        "names": [visible(part.name) for part in parts],
        "modes": [list(map(visible, part.modes)) for part in parts],
        "numbers": layout.numbers,
        "owners": layout.owners,
        "owned": layout.owned,
        "colours": list(colours([str(k) for k in range(MOST_COLOURS)]).values()),
    }


def _mode(mode: ModeProgram, colour: str) -> Data:
    edges = [
        {"name": visible(e.name), "target": e.target, "states": list(e.target_states), "text": visible(e.text)}
        for e in mode.edges
    ]
    return {
        "name": visible(mode.name),
        "colour": colour,
        "states": list(mode.states),
        "edges": edges,
        "walls": [visible(text) for text in mode.walls],
    }


def _parameters(source: Source) -> Iterator[Data]:
    values = dict(zip(source.problem.program.parameters, source.problem.timeline.segments[0].data, strict=False))
    frozen = fixed(source.problem)
    bounds = _bounds(source, values)
    for parameter in source.system.parameters:
        name = parameter.name
        least, most = bounds[name]
        low, high = _range(float(values[name]))
        yield {
            "name": name,
            "group": "parameters",
            "unit": visible(parameter.unit or ""),
            "about": visible(parameter.about or ""),
            "value": float(values[name]),
            "low": low if least is None else least,
            "high": high if most is None else most,
            "given": name in source.problem.settings.overrides,
            "fixed": name in frozen,
            "hidden": False,
        }


def _bounds(source: Source, values: Mapping[str, Any]) -> dict[str, tuple[float | None, float | None]]:
    """The bounds of the file, with the exported values; those of later values are checked in the page."""
    kernel, numbers = source.problem.kernel, tuple(values.values())
    names = source.problem.program.constants.names
    return {
        name: tuple(
            float(kernel.constant(f"{kind}_{i}", numbers)[0]) if f"{kind}_{i}" in names else None
            for kind in ("minimum", "maximum")
        )
        for i, name in enumerate(values)
    }  # pyright: ignore[reportReturnType]


def _starts(source: Source, run: Execution) -> Iterator[Data]:
    problem = source.problem
    shown = frozenset(without_memory(run.arcs[0].states))
    for name, value in zip(problem.states, problem.x, strict=True):
        hidden = name not in shown
        reach = _largest(run, name) or 1.0
        yield {
            "name": f"initial.{name}",
            "group": "initial",
            "unit": visible(problem.program.units.get(name, "")),
            "about": "",
            "value": float(value),
            "low": float(value) - reach,
            "high": float(value) + reach,
            "given": f"initial.{name}" in problem.settings.overrides,
            "fixed": hidden,
            "hidden": hidden,
        }


def _range(value: float) -> tuple[float, float]:
    """A range without a scale of its own: from zero to twice the value."""
    low, high = sorted((0.0, 2 * value))
    return (low, high) if low < high else (-1.0, 1.0)


def _largest(run: Execution, name: str) -> float:
    """The largest size that a state has in a run."""
    columns = [
        np.abs(run.values[arc.first : arc.last + 1, arc.states.index(name)]) for arc in run.arcs if name in arc.states
    ]
    sizes = np.concatenate(columns) if columns else np.zeros(1)
    return float(max(sizes[np.isfinite(sizes)], default=0.0))


def _layout(kind: Any) -> Data:
    """Where the fields of a structure are; it has no pointers, and so the same form on every machine."""
    assert kind.fields is not None
    return {
        "size": kind.itemsize,
        "fields": {name: [offset, f"{part.kind}{part.itemsize}"] for name, (part, offset) in kind.fields.items()},
    }
