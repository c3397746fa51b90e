"""A problem as C: ``problem.h`` with its sizes and names, ``problem.c`` with its numbers; for `parts/instance.c`.

``problem.c`` has the names of a model as strings for people, the method and its interpolation as initialisers, and
``problem_derive`` and ``problem_start``: parameters and initial values that follow others. In 32-bit floats no
tolerance is below their round-off. No text of a model can end the string or the comment that it stands in.
"""

from __future__ import annotations

import ctypes
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hsdsl.base.names import visible
from hsdsl.base.numbers.arithmetic import FLOAT64, Arithmetic, Number
from hsdsl.base.parts import layout_of
from hsdsl.engine.backends.c.routine import constant, literal
from hsdsl.engine.backends.c.source import constant_bodies, derivatives, factors, initial_bodies, lines, width
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.structures import COMPILED_SCHEMES, METHOD_KINDS, Row, array_at, method_table
from hsdsl.engine.simulate import Problem, Settings
from hsdsl.engine.simulate.control import make_control
from hsdsl.engine.simulate.moving import LEAST_UNITS
from hsdsl.engine.simulate.settings import along_steps, interpolation
from hsdsl.export.source import Source, derived, filled, given, structural
from hsdsl.mathematics.program import ModeProgram, Program

PARTS = Path(__file__).parent / "parts"


def header(source: Source, tunable: bool = False) -> str:
    """The text of ``problem.h``."""
    sizes = ("#define PROBLEM_TUNABLE\n" if tunable else "") + _sizes(source.problem)
    return comment(source.heading) + "\n" + filled((PARTS / "problem.h.in").read_text(), sizes=sizes)


def _sizes(problem: Problem) -> str:
    program, modes = problem.program, problem.program.modes
    sizes = {
        "MODES": len(modes),
        "WIDTH": width(program),
        "SURFACES": max(len(mode.surfaces) for mode in program.flows),
        "EDGES": max(len(mode.edges) for mode in program.flows),
        "LINES": lines(program),
        "DERIVATIVES": derivatives(program),
        "FACTORS": factors(program),
        "STATES": len(program.all_states),
        "OUTPUTS": len(program.outputs),
        "PARTS": len(program.parts),
        "PARAMETERS": len(program.parameters),
        "INPUTS": len(program.inputs),
        "DATA": len(problem.timeline.segments[0].data),
        "CONTACTS": program.contact_count,
        "SEGMENTS": len(problem.timeline.segments),
        "QUEUES": len(program.queues),
        "QUEUED": program.queued,
    }
    located = f" + {_LOCATED}" if problem.settings.scheme == "located" else ""
    own = in_both(*(_of_method(settings) for settings in _both(problem.settings)))
    return f"{_defined(sizes)}{own}#define PROBLEM_WORKSPACE ({_SPACE}{located})\n"


_SPACE = """HS_SPACE(PROBLEM_WIDTH, PROBLEM_SURFACES, PROBLEM_EDGES, PROBLEM_LINES, PROBLEM_STATES, \\
  (PROBLEM_DATA + PROBLEM_CONTACTS), PROBLEM_DERIVATIVES, PROBLEM_FACTORS, PROBLEM_KIND, PROBLEM_STAGES, \\
  PROBLEM_EXTRA, PROBLEM_ORDER, PROBLEM_DEGREE)"""
_LOCATED = """HS_LOCATED_SPACE(PROBLEM_WIDTH, PROBLEM_SURFACES, PROBLEM_MODES, \\
  PROBLEM_STAGES, PROBLEM_EXTRA, PROBLEM_ORDER, PROBLEM_DEGREE)"""


def _defined(sizes: dict[str, Any]) -> str:
    return "".join(f"#define PROBLEM_{name} {size}\n" for name, size in sizes.items())


def _of_method(settings: Settings) -> str:
    assert settings.method is not None
    table = method_table(settings.method)
    kind = f"HS_{METHOD_KINDS[table.kind].upper()}"
    sizes = {"STAGES": table.stages, "EXTRA": table.extra, "ORDER": table.order, "DEGREE": table.degree}
    return _defined({"KIND": kind} | sizes)


def _both(settings: Settings) -> tuple[Settings, Settings]:
    return in_single(settings), settings


def numbers(source: Source) -> str:
    """The text of ``problem.c``."""
    problem = source.problem
    pair = tuple(zip(_both(problem.settings), PRECISIONS, strict=True))
    segments = problem.timeline.segments
    rows = [number for segment in segments for number in segment.data]
    parts = [
        comment(source.heading),
        '\n#include "problem.h"\n\n#include "hs_math.h"\n\n',
        in_both(*(_method(settings) for settings, _ in pair)),
        in_both(*(_interpolation(settings, arithmetic) for settings, arithmetic in pair)),
        array("static const hs_time", "starts", (literal(s.start) for s in segments))
        + array("static const hs_time", "ends", (literal(s.end) for s in segments))
        + array("static const int32_t", "jumps", (str(int(s.jump)) for s in segments))
        + array("static const hs_real", "data", map(constant, rows))
        + f"const hs_timeline problem_timeline = {{{len(segments)}, starts, ends, jumps, data}};\n",
        in_both(*(_settings(settings, problem.program, arithmetic) for settings, arithmetic in pair)),
        f"const int problem_mode = {problem.mode}, problem_dimension = {len(problem.x)};\n",
        array("const hs_real", "problem_x", map(constant, problem.x)),
        names_text(problem, source.name),
        derivations(problem),
    ]
    return "".join(parts)


def _method(settings: Settings) -> str:
    assert settings.method is not None
    table = method_table(settings.method)
    rows = _Rows()
    count = table.stages + 1 + table.extra if table.c else 0
    own = table.dense and structures.INTERPOLANTS[table.interpolant] == "dense"
    c = _numbers(array_at(ctypes.c_double, table.c, count))
    parts = [f"static const hs_real method_c[] = {{{c or '0'}}};\n"]
    for name, length in (("a", count), ("dense", table.degree if own else 0)):
        listed = ",\n  ".join(rows.row(row) for row in array_at(Row, getattr(table, name), length))
        parts.append(f"static const hs_row method_{name}[] = {{\n  {listed or '{0, 0, 0}'}}};\n")
    single = ", ".join(rows.row(getattr(table, name)) for name in ("b", "error", "coarse"))
    collocation = _collocation(table)
    numbers = f"{table.kind}, {table.stages}, {table.extra}, {table.order}, {table.interpolant}, {table.degree}"
    last = f"method_dense, {constant(table.gain)}, {'&method_collocation' if collocation else 0}"
    method = f"const hs_method problem_method = {{\n  {numbers}, method_c, method_a, {single}, {last}}};\n"
    return "".join([*rows.tables, *parts, collocation, method])


def _interpolation(settings: Settings, arithmetic: Arithmetic) -> str:
    degree, share = along_steps(settings)
    by = interpolation(degree, arithmetic)
    columns = {"nodes": by.nodes, "tests": by.tests, "matrix": [number for line in by.matrix for number in line]}
    tables = "".join(f"static const hs_real {name}[] = {{{_numbers(list(c))}}};\n" for name, c in columns.items())
    row = f"{len(by.nodes) - 1}, nodes, tests, matrix, {constant(share + by.rounding)}"
    return f"{tables}const hs_interpolation problem_interpolation = {{{row}}};\n"


def _settings(settings: Settings, program: Program, arithmetic: Arithmetic) -> str:
    control = make_control(settings, arithmetic)
    scale = [settings.scale.get(name, 0.0) for name in program.all_states] if settings.scale else []
    contacts = int(settings.completion != "none")
    values = [control.h, control.tolerance or 0.0, control.largest, settings.relaxation]
    return (
        (array("static const hs_real", "scales", map(constant, scale)) if scale else "")
        + f"const hs_settings problem_settings = {{\n  {', '.join(map(constant, values))}, {literal(settings.until)}, "
        + f"{min(settings.max_transitions, 2**62)}, {COMPILED_SCHEMES.index(settings.scheme)}, {contacts}, "
        + f"{'scales' if scale else 0}, 0, 0}};\n"
    )


_PLAIN = frozenset(map(chr, range(0x20, 0x7F))) - set('"\\?')


def string(text: str) -> str:
    """A string literal of UTF-8: all but plain ASCII are octal escapes, a question mark too (trigraphs)."""
    signs = (
        sign if sign in _PLAIN else "".join(f"\\{byte:03o}" for byte in sign.encode(errors="replace")) for sign in text
    )
    return f'"{"".join(signs)}"'


def comment(lines: Iterable[str]) -> str:
    """A comment of these lines; no signs in them open, close or splice anything."""
    plain = (visible(line).replace("\\", "/").replace("*/", "* /").replace("/*", "/ *") for line in lines)
    wrapped = [part for line in plain for part in textwrap.wrap(line.replace("??", "? ?"), 114) or [""]]
    return "/* " + "\n   ".join(wrapped) + " */\n"


def array(kind: str, name: str, values: Iterable[str], after: str = "") -> str:
    """The definition of an array, of at least one element: C has no empty ones; ``after`` is of its type."""
    listed = list(values) or ["0"]
    return f"{kind} {name}[]{after} = {{\n  {_wrapped(listed)}}};\n"


def function(name: str, arguments: str, body: str, real: str = "hs_real") -> str:
    """The definition of a routine of ``p`` that writes to ``out``; it returns 0 where it has a value."""
    head = f"static int {name}({arguments}, {real} *out) {{\n  int bad = 0;\n  (void)p, (void)out;\n"
    return f"{head}{body}\n  return bad;\n}}\n"


def _wrapped(values: Sequence[str]) -> str:
    rows, row = list[str](), ""
    for value in values:
        if row and len(row) + len(value) > 112:
            rows.append(row.rstrip())
            row = ""
        row += f"{value}, "
    return "\n  ".join([*rows, row.removesuffix(", ")])


STRINGS = "const char *const"


def names_text(problem: Problem, title: str) -> str:
    """The definitions of ``problem_name``, ``problem_state`` and the others."""
    program, settings = problem.program, problem.settings
    assert settings.method is not None
    modes = range(len(program.modes))
    parts = [_mode(k, mode) for k, mode in enumerate(program.modes)]
    for kind, pointer in (("state", STRINGS), ("edge", STRINGS), ("edge_state", f"{STRINGS} *const")):
        parts.append(array(f"{pointer} *const", f"problem_{kind}", (f"{kind}s_{k}" for k in modes)))
    for kind, text in (("name", title), ("scheme", settings.scheme), ("method_name", settings.method.name)):
        parts.append(f"const char problem_{kind}[] = {string(text)};\n")
    parts.append(_strings("problem_mode_name", program.mode_names))
    parts.append(_strings("problem_start_state", problem.states))
    parts.append(_strings("problem_parameter", program.parameters))
    parts.append(_strings("problem_output", program.outputs))
    return "".join([*parts, *_parts(program)])


def _parts(program: Program) -> Iterable[str]:
    """The parts of a system, and what their modes have."""
    parts = program.parts
    layout = layout_of(parts, program.modes[0].states)
    yield array("const int", "problem_part_number", map(str, layout.numbers))
    yield array("const int", "problem_owner", map(str, layout.owners))
    yield _strings("problem_part", (part.name for part in parts))
    kinds = {part.modes: f"part_modes_{k}" for k, part in enumerate(parts)}
    for modes, name in kinds.items():
        yield _strings(name, modes, "static ")
    yield array(f"{STRINGS} *const", "problem_part_mode", (kinds[part.modes] for part in parts))
    yield _strings("problem_owned", layout.owned)


def _mode(k: int, mode: ModeProgram) -> str:
    """The names of a mode's states and edges, and of the states that each edge leads to."""
    targets = [_strings(f"target_{k}_{i}", e.target_states, "static ") for i, e in enumerate(mode.edges)]
    return "".join(
        [
            _strings(f"states_{k}", mode.states, "static "),
            _strings(f"edges_{k}", (edge.name for edge in mode.edges), "static "),
            *targets,
            array(f"static {STRINGS} *const", f"edge_states_{k}", (f"target_{k}_{i}" for i in range(len(targets)))),
        ]
    )


def _strings(name: str, texts: Iterable[str], static: str = "") -> str:
    return array(f"{static}{STRINGS}", name, map(string, texts))


class _Rows:
    """Rows of a table; ``tables`` are the arrays that they point into."""

    def __init__(self) -> None:
        self.tables: list[str] = []

    def row(self, row: Any) -> str:
        """The initialiser of one row."""
        if not row.terms:
            return "{0, 0, 0}"
        number = len(self.tables) // 2
        stages = ", ".join(map(str, array_at(ctypes.c_int, row.stage, row.terms)))
        weights = _numbers(array_at(ctypes.c_double, row.weight, row.terms))
        self.tables.append(f"static const int stages_{number}[] = {{{stages}}};\n")
        self.tables.append(f"static const hs_real weights_{number}[] = {{{weights}}};\n")
        return f"{{{row.terms}, stages_{number}, weights_{number}}}"


def _collocation(table: Any) -> str:
    if not table.collocation:
        return ""
    known = structures.Collocation.from_address(table.collocation)
    fields = ", ".join(_nested(getattr(known, name)) for name, _ in structures.Collocation._fields_)
    return f"static const hs_collocation method_collocation = {{\n  {fields}}};\n"


def _nested(value: Any) -> str:
    return constant(value) if isinstance(value, float) else f"{{{', '.join(map(_nested, value))}}}"


def _numbers(values: Sequence[Number]) -> str:
    return ", ".join(map(constant, values))


FLOAT32 = replace(FLOAT64, name="float32", bits=24, unit=2.0**-24)  # its numbers are rounded where they are compiled


def in_single(settings: Settings) -> Settings:
    """The settings that a program in 32-bit floats has."""
    assert settings.method is not None
    if settings.tolerance is None:
        return replace(settings, method=settings.method.for_tolerance(None, FLOAT32))
    tolerance = max(settings.tolerance, LEAST_UNITS * FLOAT32.unit)
    return replace(settings, tolerance=tolerance, method=settings.method.for_tolerance(tolerance, FLOAT32))


def in_both(single: str, double: str) -> str:
    """Text for both precisions; the same in both is written once."""
    return double if single == double else f"#if defined(HS_FLOAT32)\n{single}#else\n{double}#endif\n"


PRECISIONS: tuple[Arithmetic, ...] = (FLOAT32, FLOAT64)


def derivations(problem: Problem) -> str:
    """The definitions of ``problem_derive`` and ``problem_start``, and of what kind each parameter is."""
    program = problem.program
    bodies, own, fixed = constant_bodies(program), derived(problem), structural(problem)
    flags = array("const int", "problem_derived", (str(int(name in own)) for name in program.parameters))
    flags += array("const int", "problem_structural", (str(int(name in fixed)) for name in program.parameters))
    functions, calls = list[str](), list[str]()
    for i, name in enumerate(program.parameters):
        if name in own:
            functions.append(function(f"parameter_{i}", "const hs_real *p", bodies[f"parameter_{i}"]))
            calls.append(f"  bad |= parameter_{i}(p, p + {i});")
    return (
        flags
        + "".join(functions)
        + "\n"
        + filled((PARTS / "derive.c.in").read_text(), calls="\n".join(calls))
        + _starts(problem)
    )


def _starts(problem: Problem) -> str:
    """The definitions of ``problem_given`` and ``problem_start``."""
    program = problem.program
    known, chosen = program.initial_states, given(problem)
    bodies = {"initial_values": constant_bodies(program)["initial"]} | initial_bodies(program)
    text = "".join(function(name, "const hs_real *p", body) for name, body in bodies.items())
    text += array(
        "static const int", "start_place", (str(known.index(n) if n in known else -1) for n in problem.states)
    )
    text += array("static const int", "follower", map(str, program.initial_order))
    pointers = (f"initial_{i}" for i in program.initial_order)
    text += array("static int (*const", "following", pointers, ")(const hs_real *, hs_real *)")
    text += array("const char", "problem_given", (str(int(name in chosen)) for name in problem.states))
    return (
        text
        + "\n"
        + filled(
            (PARTS / "start.c.in").read_text(),
            width=len(known) + 1,
            states=len(known),
            starts=len(problem.states),
            followers=len(program.initial_order),
        )
    )
