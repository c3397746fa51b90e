"""A problem as C: ``problem.h`` with its sizes and names, ``problem.c`` with its numbers; for `parts/instance.c`."""

from __future__ import annotations

from hsdsl.arithmetic import FLOAT64
from hsdsl.backends.c import lines, width
from hsdsl.backends.c.printer import literal
from hsdsl.export.c.method import interpolation_text, method_text
from hsdsl.export.c.names import names_text
from hsdsl.export.c.text import array, comment
from hsdsl.export.c.tuning import derivations
from hsdsl.export.source import Source
from hsdsl.program import Program
from hsdsl.runtime.methods import method_table
from hsdsl.runtime.structures import METHOD_KINDS, SCHEMES
from hsdsl.simulate import Problem, Settings
from hsdsl.simulate.control import make_control
from hsdsl.simulate.interpolation import OVER_TIME, along_steps, interpolation

_HEADER = """
#ifndef PROBLEM_H
#define PROBLEM_H

#include "hs_simulate.h"

{sizes}
extern const hs_model hs_the_model;
extern const hs_method problem_method;
extern const hs_timeline problem_timeline;
extern const hs_settings problem_settings;
extern const hs_interpolation problem_interpolation[2];
extern const int problem_mode, problem_dimension; /* the start */
extern const double problem_x[];

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

/* Of each parameter whether others decide it, and whether it decides the times of inputs, which stay as exported. */
extern const int problem_derived[], problem_structural[];

/* Derive parameters from the ones before them, and the initial state from parameters. Not 0 where one has no value. */
int problem_derive(double *p);
int problem_start(const double *p, double *x);

#endif
"""


def header(source: Source) -> str:
    """The text of ``problem.h``."""
    return comment(source.heading) + _HEADER.format(sizes=_sizes(source.problem))


def _sizes(problem: Problem) -> str:
    program, settings = problem.program, problem.settings
    assert settings.method is not None
    table = method_table(settings.method)
    data = len(problem.timeline.segments[0].data)
    surfaces = max(len(mode.edges) + len(mode.walls) for mode in program.modes)
    edges = max(len(mode.edges) for mode in program.modes)
    w, n, states = width(program), lines(program), len(program.all_states)
    modes, kind = len(program.modes), f"HS_{METHOD_KINDS[table.kind].upper()}"
    space = f"HS_SPACE({w}, {surfaces}, {edges}, {n}, {states}, {kind}, {table.stages}, {table.extra}, {table.order}, "
    space += f"{table.degree})"
    if settings.scheme == "located":
        space += f" + HS_LOCATED_SPACE({w}, {surfaces}, {modes}, {n}, {table.stages}, {table.extra}, {table.order}, "
        space += f"{table.degree})"
    sizes = {
        "MODES": modes,
        "WIDTH": w,
        "EDGES": edges,
        "OUTPUTS": len(program.outputs),
        "PARAMETERS": len(program.parameters),
        "INPUTS": len(program.inputs),
        "DATA": data,
        "SEGMENTS": len(problem.timeline.segments),
        "DEGREE": table.degree,
    }
    named = "".join(f"#define PROBLEM_{name} {size}\n" for name, size in sizes.items())
    return f"{named}#define PROBLEM_WORKSPACE ({space})\n"


def numbers(source: Source) -> str:
    """The text of ``problem.c``."""
    problem = source.problem
    settings, program = problem.settings, problem.program
    assert settings.method is not None
    parts = [
        comment(source.heading),
        '\n#include "problem.h"\n\n#include "hs_math.h"\n\n',
        method_text(method_table(settings.method)),
        _interpolations(settings),
        _timeline(problem),
        _settings(settings, program),
        f"const int problem_mode = {problem.mode}, problem_dimension = {len(problem.x)};\n",
        array("const double", "problem_x", map(literal, problem.x)),
        names_text(problem, source.name),
        derivations(problem),
    ]
    return "".join(parts)


def _interpolations(settings: Settings) -> str:
    pair = [(interpolation(degree, FLOAT64), share) for degree, share in (along_steps(settings), OVER_TIME)]
    return interpolation_text(pair)


def _timeline(problem: Problem) -> str:
    segments = problem.timeline.segments
    rows = [number for segment in segments for number in segment.data]
    return (
        array("static const double", "starts", (literal(s.start) for s in segments))
        + array("static const double", "ends", (literal(s.end) for s in segments))
        + array("static const int32_t", "jumps", (str(int(s.jump)) for s in segments))
        + array("static const double", "data", map(literal, rows))
        + f"const hs_timeline problem_timeline = {{{len(segments)}, starts, ends, jumps, data}};\n"
    )


def _settings(settings: Settings, program: Program) -> str:
    control = make_control(settings, FLOAT64)
    scale = [settings.scale.get(name, 0.0) for name in program.all_states] if settings.scale else []
    values = [control.h, control.tolerance or 0.0, control.largest, settings.relaxation, settings.until]
    return (
        (array("static const double", "scales", map(literal, scale)) if scale else "")
        + f"const hs_settings problem_settings = {{\n  {', '.join(map(literal, values))}, "
        + f"{min(settings.max_transitions, 2**62)}, {SCHEMES.index(settings.scheme)}, {'scales' if scale else 0}, "
        + "0, 0};\n"
    )
