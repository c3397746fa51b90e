"""A problem as C: ``problem.h`` with its sizes and names, ``problem.c`` with its numbers; for `parts/instance.c`."""

from __future__ import annotations

from typing import Any

from hsdsl.base.numbers.arithmetic import Arithmetic
from hsdsl.engine.backends.c import derivatives, factors, lines, width
from hsdsl.engine.backends.c.printer import constant, literal
from hsdsl.engine.runtime.methods import method_table
from hsdsl.engine.runtime.structures import METHOD_KINDS, SCHEMES
from hsdsl.engine.simulate import Problem, Settings
from hsdsl.engine.simulate.control import make_control
from hsdsl.engine.simulate.interpolation import along_steps, interpolation
from hsdsl.export.c.method import interpolation_text, method_text
from hsdsl.export.c.names import names_text
from hsdsl.export.c.precision import PRECISIONS, in_both, in_single
from hsdsl.export.c.starts import derivations
from hsdsl.export.c.text import array, comment
from hsdsl.export.source import Source
from hsdsl.mathematics.program import Program

_HEADER = """
#ifndef PROBLEM_H
#define PROBLEM_H

#include "hs_simulate.h"

{sizes}
extern const hs_model hs_the_model;
extern const hs_method problem_method;
extern const hs_timeline problem_timeline;
extern const hs_settings problem_settings;
extern const hs_interpolation problem_interpolation;
extern const int problem_mode, problem_dimension; /* the start */
extern const hs_real problem_x[];

/* Names, for people: of the model; of each mode, its states and its edges; of the states that an edge leads to; of
   parameters, outputs and all states. */
extern const char problem_name[], problem_scheme[], problem_method_name[];
extern const char *const problem_mode_name[];
extern const char *const *const problem_state[];
extern const char *const *const problem_edge[];
extern const char *const *const *const problem_edge_state[];
extern const char *const problem_start_state[];
extern const char *const problem_parameter[];
extern const char *const problem_output[];

/* Of a system of parts: the state that is the number of each part's mode, from 1 on, or -1 where it has one mode; names
   of parts and their modes; the part that each state is of, or -1; of each mode of that a 1 where it has the state. */
extern const int problem_part_number[], problem_owner[];
extern const char *const problem_part[];
extern const char *const *const problem_part_mode[];
extern const char *const problem_owned[];

/* Of each parameter whether others decide it, and whether it decides the times of inputs, which stay as exported. */
extern const int problem_derived[], problem_structural[];

/* Of each state of the start whether the export gave its value; others follow parameters and those. */
extern const char problem_given[];

/* Derive parameters from the ones before them. Derive those initial values in `x` that are not `given` from parameters
   and others, as in the file. Not 0 where one has no value. */
int problem_derive(hs_real *p);
int problem_start(const hs_real *p, const char *given, hs_real *x);

#endif
"""


def header(source: Source, tunable: bool = False) -> str:
    """The text of ``problem.h``."""
    sizes = ("#define PROBLEM_TUNABLE\n" if tunable else "") + _sizes(source.problem)
    return comment(source.heading) + _HEADER.format(sizes=sizes)


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
    parts = [
        comment(source.heading),
        '\n#include "problem.h"\n\n#include "hs_math.h"\n\n',
        in_both(*(_method(settings) for settings, _ in pair)),
        in_both(*(_interpolation(settings, arithmetic) for settings, arithmetic in pair)),
        _timeline(problem),
        in_both(*(_settings(settings, problem.program, arithmetic) for settings, arithmetic in pair)),
        f"const int problem_mode = {problem.mode}, problem_dimension = {len(problem.x)};\n",
        array("const hs_real", "problem_x", map(constant, problem.x)),
        names_text(problem, source.name),
        derivations(problem),
    ]
    return "".join(parts)


def _method(settings: Settings) -> str:
    assert settings.method is not None
    return method_text(method_table(settings.method))


def _interpolation(settings: Settings, arithmetic: Arithmetic) -> str:
    degree, share = along_steps(settings)
    return interpolation_text(interpolation(degree, arithmetic), share)


def _timeline(problem: Problem) -> str:
    segments = problem.timeline.segments
    rows = [number for segment in segments for number in segment.data]
    return (
        array("static const hs_time", "starts", (literal(s.start) for s in segments))
        + array("static const hs_time", "ends", (literal(s.end) for s in segments))
        + array("static const int32_t", "jumps", (str(int(s.jump)) for s in segments))
        + array("static const hs_real", "data", map(constant, rows))
        + f"const hs_timeline problem_timeline = {{{len(segments)}, starts, ends, jumps, data}};\n"
    )


def _settings(settings: Settings, program: Program, arithmetic: Arithmetic) -> str:
    control = make_control(settings, arithmetic)
    scale = [settings.scale.get(name, 0.0) for name in program.all_states] if settings.scale else []
    contacts = int(settings.completion != "none")
    values = [control.h, control.tolerance or 0.0, control.largest, settings.relaxation]
    return (
        (array("static const hs_real", "scales", map(constant, scale)) if scale else "")
        + f"const hs_settings problem_settings = {{\n  {', '.join(map(constant, values))}, {literal(settings.until)}, "
        + f"{min(settings.max_transitions, 2**62)}, {SCHEMES.index(settings.scheme)}, {contacts}, "
        + f"{'scales' if scale else 0}, 0, 0}};\n"
    )
