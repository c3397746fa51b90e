"""A whole program as one C file: every routine once, and the tables that `runtime/c/hs.h` declares.

Modes of a large model often have the same routines up to their names; equal texts become one function.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import fields
from itertools import count
from textwrap import dedent
from typing import cast

from hsdsl.base.graphs import Elimination, Variation
from hsdsl.engine.backends.c.routine import LEAST_LIKE, function_body, routine_function, shape_function, shape_of
from hsdsl.engine.backends.c.series import flow_lines, is_large, line_count, piecewise, read_by_surfaces, surface_lines
from hsdsl.mathematics.program import EdgeProgram, ModeProgram, Program, Queue, Routines, Tape

DEFINITION = re.compile(r"^    def (\w+)(\(.*?)(?=^    (?:def|return) )", re.MULTILINE | re.DOTALL)
_GIVEN = re.compile(r"^ +[px]\d+ = given\[\d+\]\n", re.MULTILINE)
_SIGNATURE = re.compile(r"^int \w+\([^{]*\)(?= \{)", re.MULTILINE)
PART = 1 << 14  # characters of functions that are worth a file of their own
_HEAD = """\
/* Generated from a model; see hs.h for what the tables mean. */

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("ipa-ra", "tree-slp-vectorize") /* what makes -O2 faster than -O1, but not to compile */
#endif

#include "hs.h"
#include "hs_series.h"

"""
_BESIDE = """\
static int NAME(const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict out) {{
  return {routine}(p, t, x, out) && hs_beside({routine}, p, t, x, out);
}}
"""
_SERIES = """\
static int NAME(const hs_real *p, int order, hs_real t, const hs_real *x, hs_real *lines) {{
  hs_real c[{size}] = {{0.0}};
  (void)p;
  return order > HS_MOST_ORDER || {constants}{core}(c, order, t, x, lines);
}}
"""
_SURFACE_SERIES = """\
static int NAME(const hs_real *p, int order, hs_real *lines) {{
  hs_real c[{size}] = {{0.0}};
  (void)p;
  return order > HS_MOST_ORDER || {constants}{core}(c, order, lines);
}}
"""
_PIECEWISE = """\
static int NAME(const hs_real *p, int order, hs_real t, const hs_real *x, hs_real *lines) {{
  hs_real c[{size}] = {{0.0}};
  const int length = order + 2;
  (void)p;
  if (order > HS_MOST_ORDER{constants}) return 1;
  hs_begin_series({dimension}, length, t, x, lines);
  for (int k = 0; k <= order; k++)
    if ({parts}) return 1;
  return 0;
}}
"""
_PIECEWISE_SURFACES = """\
static int NAME(const hs_real *p, int order, hs_real *lines) {{
  hs_real c[{size}] = {{0.0}};
  const int length = order + 2;
  (void)p;
  if (order > HS_MOST_ORDER{constants}) return 1;
  for (int k = 0; k <= order; k++)
    if ({parts}) return 1;
  return 0;
}}
"""


def model_source(program: Program) -> str:
    """Write a program as C99, to be compiled together with the headers of `hsdsl/engine/runtime/c`."""
    writer, table = _written(program)
    return "".join((_HEAD, *writer.functions.values(), *writer.tables, table))


def model_parts(program: Program, most: int) -> list[str]:
    """Write a program as several files, which can be compiled in parallel and linked to a library."""
    writer, table = _written(program)
    functions = sorted(map(_visible, writer.functions.values()), key=len, reverse=True)
    parts: list[list[str]] = [[] for _ in range(max(1, min(most, sum(map(len, functions)) // PART)))]
    for text in functions:
        min(parts, key=lambda part: sum(map(len, part))).append(text)
    head = _HEAD + "".join(f"{_SIGNATURE.findall(text)[-1]};\n" for text in functions)
    parts[0] += [*writer.tables, table]
    return [head + "".join(part) for part in parts]


def _visible(function: str) -> str:
    """A function that other files call; its pieces, which come before it, are its own."""
    start = function.rindex("\nstatic int ") + 1 if "\nstatic int " in function else 0
    return function[:start] + function[start:].removeprefix("static ")


def _written(program: Program) -> tuple[Writer, str]:
    """The functions and tables of a program, and the last of them."""
    writer = Writer(program)
    modes = [writer.mode(k, mode) for k, mode in enumerate(program.flows)]
    table = writer.table("hs_mode", "modes", modes)
    model = (
        f"extern const hs_model hs_the_model;\n"
        f"HS_EXPORT const hs_model hs_the_model = {{{len(program.modes)}, {len(modes)}, {width(program)}, "
        f"{max(len(m.surfaces) for m in program.flows)}, {max(len(m.edges) for m in program.flows)}, "
        f"{len(program.outputs)}, {len(writer.data) - program.contact_count}, {program.contact_count}, "
        f"{lines(program)}, {len(writer.states)}, {derivatives(program)}, {factors(program)}, {varied(program)}, "
        f"{len(program.queues)}, {program.queued}, {table}}};\n"
    )
    return writer, model


def width(program: Program) -> int:
    """How many states the largest mode has; one without a flow has those it is entered with."""
    entered = (len(edge.target_states) for edge in program.edges)
    return max((len(program.initial_states), *(len(mode.states) for mode in program.modes), *entered))


def lines(program: Program) -> int:
    """How many lines the largest tape has."""
    return max((line_count(m.tape, len(m.states)) for m in program.flows if m.tape), default=0)


def derivatives(program: Program) -> int:
    """How many derivatives of a flow are not zero everywhere, of the mode with most."""
    return max(len(m.jacobian.places) for m in program.flows)


def factors(program: Program) -> int:
    """How many entries a matrix of an implicit step has, of the mode with most."""
    found = ((m.jacobian.elimination, len(m.states)) for m in program.flows)
    return max(n * n if of is None else of.size for of, n in found)


def varied(program: Program) -> int:
    """How many derivatives of a flow the largest mode has whose states are derivatives of others; at least one."""
    return max(max(1, len(m.jacobian.places)) if m.jacobian.varied else 0 for m in program.flows)


def constant_bodies(program: Program) -> dict[str, str]:
    """The bodies of `Program.constants`' routines in C, of parameters ``p``, by their names."""
    return _bodies(program.constants, {f"p{i}": f"p[{i}]" for i in range(len(program.parameters))})


def initial_bodies(program: Program) -> dict[str, str]:
    """The bodies of `Program.initial_values`' routines in C, of ``p``: parameters, then initial values."""
    count = len(program.parameters)
    names = {f"p{i}": f"p[{i}]" for i in range(count)}
    names |= {f"x{i}": f"p[{count + i}]" for i in range(len(program.initial_states))}
    return _bodies(program.initial_values, names)


def switching_bodies(program: Program) -> dict[str, str]:
    """The bodies of `Program.switching`'s routines in C, of the data ``p`` of a segment and ``t``, by their names."""
    return _bodies(program.switching, data_names(program) | {"t": "t"})


def data_names(program: Program) -> dict[str, str]:
    """What parameters, segments of inputs, switches and contacts are called in C."""
    names = [f"p{i}" for i in range(len(program.parameters))]
    names += [f"{letter}{i}" for i in range(len(program.inputs)) for letter in "abc"]
    names += [f"k{i}" for i in range(len(program.switches))]
    names += [f"d{i}" for i in range(program.contact_count)]
    return {name: f"p[{i}]" for i, name in enumerate(names)}


def _bodies(routines: Routines, names: dict[str, str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for name, text in DEFINITION.findall(routines.source):
        definition = ast.parse(dedent(f"    def routine{_GIVEN.sub('', text)}")).body[0]
        assert isinstance(definition, ast.FunctionDef)
        found[name] = function_body(definition, names)
    return found


def routine_functions(routines: Routines, program: Program, prefix: str) -> str:
    """Further routines over a program's data as functions of C, each named by a prefix and its own name."""
    writer = Writer(program)
    found: list[str] = []
    for name, text in DEFINITION.findall(routines.source):
        found.append(routine_function(f"{prefix}{name}", text, writer.data))
    return "".join(found)


class Writer:
    def __init__(self, program: Program) -> None:
        self.data = data_names(program)
        self.states, self.queues = {name: str(i) for i, name in enumerate(program.all_states)}, program.queues
        self.timed = bool(program.inputs or program.switches)
        self.functions: dict[str, str] = {}  # by the routine's text
        self.tables: list[str] = []
        self._names: dict[str, str] = {}
        self._tables: dict[tuple[str, str], str] = {}
        self._count = count()
        texts = (text for mode in program.flows for _, text in DEFINITION.findall(mode.routines.source))
        few = dict.fromkeys(text for text in texts if text.startswith("(*given)"))
        self._shapes = {text: shape_of(text, self.data) for text in few}
        self._alike = Counter(shape for shape, _ in self._shapes.values())
        self.read: dict[object, set[int]] = {}  # by the operations of flows, the lines that surfaces read
        for tape in (mode.tape for mode in program.flows if mode.tape):
            self.read.setdefault(_flow_of(tape), set()).update(read_by_surfaces(tape))

    def mode(self, index: int, mode: ModeProgram) -> str:
        texts = dict[str, str](DEFINITION.findall(mode.routines.source))
        routine = {
            name: self.few(text) if text in self._shapes else self.function(text, name == "outputs")
            for name, text in texts.items()
        }
        if mode.ends and self.timed:
            routine["flow"] = self.shared("beside", _BESIDE.format(routine=routine["flow"]))
        edges = [self.edge(k, edge, mode, routine) for k, edge in enumerate(mode.edges)]
        fields = [
            *map(str, (len(mode.states), len(mode.edges), len(mode.surfaces), int(mode.final))),
            *(routine[name] for name in ("flow", "surfaces", "magnitudes", "outputs")),
            self.table(
                "hs_sparse", "gradients", [self.sparse(routine[f"gradient_{k}"], mode.slopes[k]) for k in mode.surfaces]
            ),
            self.table("hs_local", "locals", [routine[f"rate_{k}"] for k in mode.surfaces]),
            self.table("hs_edge", f"edges_{index}", edges),
            *(self.series(mode.tape, len(mode.states), mode.derived > 0) if mode.tape else ("0", "0", "0")),
            self.sparse(f"{{{self.only(mode.jacobian.routines, few=True)}, 0}}", mode.jacobian.places),
            self.pattern(mode.jacobian.elimination),
            str(int(mode.affine)),
            self.only(mode.terms) if mode.terms else "0",
            self.table("int", "state", [self.states[name] for name in mode.states]),
            str(-1 if mode.held is None else mode.held),
            str(len(mode.measured)),
            self.table("int", "measured", list(map(str, mode.measured))),
            self.pattern(mode.jacobian.variation),
            str(len(mode.states) - mode.derived),
            str(len(mode.queues)),
            self.table("hs_queue", "queues", list(map(self.queue, mode.queues))),
            str(len(mode.idle)),
            self.table("int", "places", list(map(str, mode.idle))),
        ]
        return f"{{{', '.join(fields)}}}"

    def queue(self, queue: Queue) -> str:
        """Write where executions of an event wait."""
        values = self.table("int", "places", list(map(str, queue.values)))
        return f"{{{self.queues.index(queue.name)}, {queue.waiting}, {len(queue.values)}, {values}, {queue.most}}}"

    def sparse(self, routine: str, places: Sequence[int]) -> str:
        """Write a routine with the places of its values."""
        return f"{{{routine}, {len(places)}, {self.table('int', 'places', list(map(str, places)))}}}"

    def pattern(self, of: Elimination | Variation | None) -> str:
        """Write the pattern of a sparse elimination, or which states are derivatives of others."""
        if of is None:
            return "0"
        name, written = type(of).__name__.lower(), list[str]()
        for value in (getattr(of, field.name) for field in fields(of)):
            if isinstance(value, list):
                value = self.table("int", name, list(map(str, cast("list[int]", value))))
            written.append(str(value) if isinstance(value, (int, str)) else self.pattern(value))
        return self.table(f"hs_{name}", f"{name}_pattern", [f"{{{', '.join(written)}}}"])

    def series(self, tape: Tape, dimension: int, has_derivatives: bool) -> tuple[str, str, str]:
        """Write the functions of a tape: those of the lines, which many modes share, and those that give constants.

        Models with derivatives are not exported: they may use what some compilers lack.
        """
        own, further = tape.constant_count, tape.surface_constant_count
        texts, size = dict[str, str](DEFINITION.findall(tape.constants.source)), max(1, own + further)
        first = f"{self.function(texts['flow'])}(p, 0.0, 0, c) || " if own else ""
        second = f"{self.function(texts['surfaces'])}(p, 0.0, 0, c + {own}) || " if further else ""
        found = [str(-1 if line is None else line) for line in tape.surfaces]
        if is_large(tape, dimension):
            return (*self.piecewise(tape, dimension, size, first, first + second), self.table("int", "line", found))
        core = self.shared("flow_lines", flow_lines(tape, dimension, self.read[_flow_of(tape)], has_derivatives))
        series = _SERIES.format(size=size, constants=first, core=core)
        core = self.shared("surface_lines", surface_lines(tape, dimension))
        surface_series = _SURFACE_SERIES.format(size=size, constants=first + second, core=core)
        return (
            self.shared("series", series),
            self.shared("surface_series", surface_series),
            self.table("int", "line", found),
        )

    def piecewise(self, tape: Tape, dimension: int, size: int, first: str, every: str) -> tuple[str, str]:
        """Write the functions of a large tape; ``first`` gives the constants of the flow, ``every`` those of all."""
        start, end, read = dimension + 1 + tape.needed, line_count(tape, dimension), self.read[_flow_of(tape)]
        parts = [
            self.core(piecewise(tape, dimension, range(dimension + 1, start), range(1, dimension + 1), read)),
            self.core(piecewise(tape, dimension, range(start, end), (), read)),
        ]
        flow, surfaces = (f"{part}(c, k, length, lines)" for part in parts)
        constants = [f" || {text.removesuffix(' || ')}" if text else "" for text in (first, every)]
        given = {"size": size, "dimension": dimension}
        return (
            self.shared("series", _PIECEWISE.format(**given, constants=constants[0], parts=flow)),
            self.shared("surface_series", _PIECEWISE_SURFACES.format(**given, constants=constants[1], parts=surfaces)),
        )

    def core(self, written: tuple[str, list[str]]) -> str:
        """Write a function and its pieces."""
        whole, parts = written
        return self.shared("lines", "".join((*parts, whole)))

    def edge(self, k: int, edge: EdgeProgram, mode: ModeProgram, routine: dict[str, str]) -> str:
        parts = [routine[name] for name in mode.conditions[k]]
        numbers = (edge.target, len(edge.target_states), int(edge.conditional), edge.priority, len(parts))
        return (
            f"{{{', '.join(map(str, numbers))}, {self.table('hs_local', 'locals', parts)}, "
            f"{routine[f'reset_{k}']}, {routine[f'spread_{k}']}, {len(edge.changes)}, "
            f"{self.table('int', 'places', list(map(str, edge.changes)))}, "
            f"{-1 if edge.contact is None else edge.contact}, {edge.push_order}, {len(edge.counts)}, "
            f"{self.table('int', 'places', list(map(str, edge.counts)))}, {int(edge.branched)}, "
            f"{int(bool(edge.of_event))}, {int(edge.strict)}, {-1 if edge.releases is None else edge.releases}}}"
        )

    def table(self, kind: str, name: str, rows: Sequence[str]) -> str:
        """Write a constant array, once for each content; C has no empty ones."""
        if not rows:
            return "0"
        key = kind, ",\n  ".join(rows)
        if key not in self._tables:
            self._tables[key] = f"{name}_{next(self._count)}"
            self.tables.append(f"static const {kind} {self._tables[key]}[] = {{\n  {key[1]}}};\n")
        return self._tables[key]

    def only(self, routines: Routines, few: bool = False) -> str:
        """Write the one routine that there is."""
        ((_, text),) = DEFINITION.findall(routines.source)
        return self.function(text, few=few)

    def shared(self, kind: str, text: str) -> str:
        """Write a function whose name is ``NAME`` in its text; equal texts are one function."""
        if text not in self.functions:
            self._names[text] = f"{kind}_{len(self.functions)}"
            self.functions[text] = text.replace("NAME", self._names[text])
        return self._names[text]

    def function(self, text: str, apart: bool = False, few: bool = False) -> str:
        """Write a routine; returns its name."""
        key = f"{text} # {apart} {few}"
        if key not in self.functions:
            self._names[key] = name = f"routine_{len(self.functions)}"
            self.functions[key] = routine_function(name, text, self.data, apart, few)
        return self._names[key]

    def few(self, text: str) -> str:
        """Write a routine of few operands: the function, and where the operands are if many routines are alike."""
        shape, operands = self._shapes[text]
        if not operands or self._alike[shape] < LEAST_LIKE:
            return f"{{{self.function(text, few=True)}, 0}}"
        if shape not in self.functions:
            self._names[shape] = name = f"shape_{len(self.functions)}"
            self.functions[shape] = shape_function(name, shape, operands)
        return f"{{{self._names[shape]}, {self.table('int', 'of', [operand[2:-1] for operand in operands])}}}"


def _flow_of(tape: Tape) -> object:
    """What the function of the flow's lines is written from."""
    return tape.operations[: tape.needed], tape.flow
