"""Numbers of a page as C, ``page_numbers.h``: the model's own expressions of parameters, for `parts/page.c`."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import pairwise

from hsdsl.base import limits
from hsdsl.base.defaults import DEFAULTS
from hsdsl.base.graphs import closure
from hsdsl.base.numbers.arithmetic import FLOAT64, TIE, Number
from hsdsl.engine.backends.c import constant_bodies, switching_bodies
from hsdsl.engine.backends.c.printer import literal
from hsdsl.engine.simulate import Problem
from hsdsl.engine.simulate.control import LARGEST_SHARE
from hsdsl.engine.simulate.state_layouts import StateLayouts
from hsdsl.engine.simulate.switches import same
from hsdsl.export.c.text import array, function
from hsdsl.export.parameters import derived, used_by, with_sources
from hsdsl.mathematics.program import Program

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
            count = _sample_count(program, i)
            rows.append(f"{{{count}, {kind}, 0, 0, file_input_{i}}}")
            continue
        times, values = (map(FLOAT64.constant, column) for column in (given.times, given.values))
        parts += [_numbers(f"input_times_{i}", times), _numbers(f"input_values_{i}", values)]
        rows.append(f"{{{len(given.times)}, {kind}, input_times_{i}, input_values_{i}, 0}}")
    return "".join(parts) + array("static const page_input", "page_inputs", rows or ["{0, 0, 0, 0, 0, 0}"])


def _sample_count(program: Program, i: int) -> int:
    body = constant_bodies(program)[f"input_{i}"]
    return sum(line.lstrip().startswith("out[") for line in body.splitlines()) // 2


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
        cuts, values = _changes(problem, i)
        parts += [_numbers(f"switch_cuts_{i}", cuts), _numbers(f"switch_numbers_{i}", values)]
        rows.append(f"{head}0, {len(cuts)}, switch_cuts_{i}, switch_numbers_{i}}}")
    return "".join(parts) + array("static const page_switch", "page_switches", rows or ["{0, 0, 0, 0, 0, 0, 0}"])


def _changes(problem: Problem, i: int) -> tuple[list[Number], list[Number]]:
    """When a switch changes in the exported run, and its numbers before and after."""
    segments, place = problem.timeline.segments, i - len(problem.program.switches)
    changed = [b for a, b in pairwise(segments) if not same(a.data[place], b.data[place])]
    return [s.start for s in changed], [segments[0].data[place], *(s.data[place] for s in changed)]
