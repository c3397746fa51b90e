"""What a page knows of its model besides the compiled code.

Plain data: names, sliders, shapes, the exported run. Numbers as C, ``page_numbers.h``: the model's own expressions of
parameters, for `parts/page.c`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import isfinite
from typing import Any

from hsdsl.analysis.plot.style import colours
from hsdsl.analysis.report import words
from hsdsl.analysis.report.words import condensed
from hsdsl.base import limits
from hsdsl.base.defaults import DEFAULTS
from hsdsl.base.graphs import closure
from hsdsl.base.names import visible, without_memory
from hsdsl.base.numbers.arithmetic import FLOAT64, TIE, Number
from hsdsl.base.parts import layout_of, numbered
from hsdsl.engine.backends.c.routine import literal
from hsdsl.engine.backends.c.source import constant_bodies, switching_bodies, width
from hsdsl.engine.execution import Execution
from hsdsl.engine.runtime import structures
from hsdsl.engine.simulate import Problem
from hsdsl.engine.simulate.columns import StateLayouts
from hsdsl.engine.simulate.control import LARGEST_SHARE
from hsdsl.engine.simulate.switches import same
from hsdsl.export.c.problem import array, function
from hsdsl.export.source import Source, bounds_of, derived, used_by, with_sources
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
    for i, parameter in enumerate(source.system.parameters):
        name, (least, most) = parameter.name, bounds_of(source, i)  # those of later values are checked in the page
        low, high = sorted((0.0, 2 * float(values[name])))
        low, high = (low, high) if low < high else (-1.0, 1.0)
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


def _starts(source: Source, run: Execution) -> Iterator[Data]:
    problem = source.problem
    shown, sizes = frozenset(without_memory(run.arcs[0].states)), run.sizes()
    for name, value in zip(problem.states, problem.x, strict=True):
        hidden = name not in shown
        reach = size if isfinite(size := sizes.get(name, 0.0)) and size else 1.0
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


def _layout(kind: Any) -> Data:
    """Where the fields of a structure are; it has no pointers, and so the same form on every machine."""
    assert kind.fields is not None
    return {
        "size": kind.itemsize,
        "fields": {name: [offset, f"{part.kind}{part.itemsize}"] for name, (part, offset) in kind.fields.items()},
    }


SETTINGS = ("until", "step", "relaxation", "max_transitions", "scale")  # in the order of page.h
MEMORY = 1 << 28  # bytes of rows that a page may keep
_DATA = re.compile(r"\bp\[(\d+)\]")


def page_numbers(problem: Problem) -> str:
    """The text of ``page_numbers.h``."""
    program = problem.program
    bodies = constant_bodies(program)
    functions = (
        function(f"file_{name}", "const double *p", body, "double")
        for name, body in bodies.items()
        if not name.startswith(("tolerance", "sample_", "initial")) and (name not in SETTINGS or by_file(problem, name))
    )
    return "".join([*_sizes(problem), *functions, *_tables(problem), _inputs(program), _switches(problem)])


def by_file(problem: Problem, name: str) -> bool:
    """Whether a setting of the run is an expression of the file, and no override."""
    return name in problem.program.constants.names and f"experiment.{name}" not in problem.settings.overrides


def fixed(problem: Problem) -> set[str]:
    """The parameters that stay as they were exported.

    A page finds the changes of switches that are linear in time. To find those of others needs enclosures of intervals,
    which only Python has: they stay, and with them all that decides them. A tolerance decides the method's order.
    """
    program = problem.program
    used, bodies = used_by(program), switching_bodies(program)
    direct: set[int] = set(used["tolerance"]) if by_file(problem, "tolerance") else set()
    curved = [i for i in range(len(program.switches)) if f"line_{i}" not in bodies]
    parameters, inputs = len(program.parameters), 3 * len(program.inputs)

    def named(switch: int) -> list[int]:
        return [int(k) for k in _DATA.findall(bodies[f"argument_{switch}"])]

    def within(k: int) -> Iterable[int]:
        return () if k < parameters + inputs else named(k - parameters - inputs)

    for k in closure((k for i in curved for k in named(i)), within):
        if k < parameters:
            direct.add(k)
        elif k < parameters + inputs:
            direct |= used.get(f"input_{(k - parameters) // 3}", set())
    if curved and by_file(problem, "until"):
        direct |= used["until"]
    return {program.parameters[i] for i in with_sources(program, used, derived(problem), direct)}


def _sizes(problem: Problem) -> Iterable[str]:
    program = problem.program
    by_default = not by_file(problem, "relaxation") and "experiment.relaxation" not in problem.settings.overrides
    relaxation = FLOAT64.constant(DEFAULTS["relaxation"]) if by_default else 0.0
    sizes = {
        "STARTS": len(problem.states),
        "STATES": len(program.all_states),
        "INPUT_COUNT": len(program.inputs),
        "SWITCH_COUNT": len(program.switches),
        "MOST_SWITCHES": limits.current().switches,
        "MEMORY": MEMORY,
        "DEFAULT_RELAXATION": literal(relaxation),
        "LARGEST_SHARE": literal(LARGEST_SHARE),
    }
    yield f"#define HS_TIE {literal(TIE)}\n"
    yield from (f"#define PAGE_{name} {size}\n" for name, size in sizes.items())


def _tables(problem: Problem) -> Iterable[str]:
    """Which routine computes what, and where states are."""
    program, overrides, names = problem.program, problem.settings.overrides, problem.program.constants.names
    for kind in ("parameter", "minimum", "maximum"):
        listed = (f"{kind}_{i}" for i in range(len(program.parameters)))
        pointers = (f"file_{name}" if name in names else "0" for name in listed)
        yield array("static page_constant *const", f"page_{kind}", pointers)
    pointers = (f"file_{name}" if by_file(problem, name) else "0" for name in SETTINGS)
    yield array("static page_constant *const", "page_setting", pointers)
    scaled = (
        name in program.scaled_states and f"experiment.scale.{name}" not in overrides for name in program.all_states
    )
    places = (
        str(program.scaled_states.index(name)) if own else "-1"
        for name, own in zip(program.all_states, scaled, strict=True)
    )
    yield array("static const int", "page_scale_place", places)
    layouts = StateLayouts(program, problem.states)
    yield array("static const int", "page_layout_of_mode", map(str, layouts.of_mode.tolist()))
    yield array("static const int32_t", "page_dimensions", (str(len(kind)) for kind in layouts.kinds))
    columns = (str(kind.index(name)) if name in kind else "-1" for kind in layouts.kinds for name in program.all_states)
    yield array("static const int32_t", "page_columns", columns)


def _numbers(name: str, values: Iterable[Number]) -> str:
    return array("static const double", name, map(literal, map(float, values)))


def _inputs(program: Program) -> str:
    parts, rows = list[str](), list[str]()
    for i, given in enumerate(program.inputs):
        kind = f"{int(given.hold == 'linear')}, {int(given.sloped)}"
        if given.times is None or given.values is None:
            body = constant_bodies(program)[f"input_{i}"]
            count = sum(line.lstrip().startswith("out[") for line in body.splitlines()) // 2
            rows.append(f"{{{count}, {kind}, 0, 0, file_input_{i}}}")
            continue
        times, values = (map(FLOAT64.constant, column) for column in (given.times, given.values))
        parts += [_numbers(f"input_times_{i}", times), _numbers(f"input_values_{i}", values)]
        rows.append(f"{{{len(given.times)}, {kind}, input_times_{i}, input_values_{i}, 0}}")
    return "".join(parts) + array("static const page_input", "page_inputs", rows or ["{0, 0, 0, 0, 0, 0}"])


def _switches(problem: Problem) -> str:
    """Switches: how a page finds their changes, or where these were in the exported run."""
    bodies = switching_bodies(problem.program)
    parts, rows = list[str](), list[str]()
    for name, body in bodies.items():
        arguments = "const double *p, double t" if name.startswith("argument") else "const double *p"
        parts.append(function(f"switch_{name}", arguments, body, "double"))
    for i, switch in enumerate(problem.program.switches):
        head = f"{{{int(switch.kind == 'floor')}, {int(switch.jumps)}, switch_argument_{i}, "
        if f"line_{i}" in bodies:
            rows.append(f"{head}switch_line_{i}, 0, 0, 0}}")
            continue
        segments, place = problem.timeline.segments, i - len(problem.program.switches)
        changed = [b for a, b in pairwise(segments) if not same(a.data[place], b.data[place])]
        cuts, values = [s.start for s in changed], [segments[0].data[place], *(s.data[place] for s in changed)]
        parts += [_numbers(f"switch_cuts_{i}", cuts), _numbers(f"switch_numbers_{i}", values)]
        rows.append(f"{head}0, {len(cuts)}, switch_cuts_{i}, switch_numbers_{i}}}")
    return "".join(parts) + array("static const page_switch", "page_switches", rows or ["{0, 0, 0, 0, 0, 0, 0}"])
