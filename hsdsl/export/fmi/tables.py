"""The variables of a unit as tables of C, with their derivatives; for `parts/fmu.c`."""

from __future__ import annotations

from hsdsl.base.parts import numbered
from hsdsl.engine.backends.c import constant_bodies, routine_functions
from hsdsl.engine.backends.c.printer import literal
from hsdsl.export.c.text import array, comment, function, string
from hsdsl.export.fmi.variables import Unit, switched
from hsdsl.mathematics.lower.slopes import lower_given

_HEADER = """
#ifndef VARIABLES_H
#define VARIABLES_H

#include "hs.h"

enum {{ FMU_TIME, FMU_STATE, FMU_DERIVATIVE, FMU_PARAMETER, FMU_INPUT, FMU_OUTPUT, FMU_MODE, FMU_INDICATOR }};

#define FMU_VARIABLES {variables}
#define FMU_STATES {states} /* those that flow, before the numbers of the modes of parts */
#define FMU_INPUTS {inputs}
#define FMU_SLOPES {slopes}
#define FMU_TOKEN {token}

/* A variable by its reference: its kind, and its place among those of the kind. */
typedef struct {{
  int kind, index;
}} fmu_variable;

/* An input: its place among sampled ones, the parameter that turns its expression off (-1: samples), whether it stays
   as given, and whether it changes at events alone. */
typedef struct {{
  int samples, given, fixed, held;
}} fmu_input_place;

/* The slopes of a mode that are not zero everywhere, by references of unknown and known. */
typedef struct {{
  hs_routine *values;
  int count;
  const unsigned *row, *column;
}} fmu_slope_table;

extern const fmu_variable fmu_variables[];
extern const fmu_input_place fmu_input[];
extern const double fmu_input_start[], fmu_input_nominal[], fmu_nominal[];
extern const fmu_slope_table fmu_slopes[];
extern const char *const fmu_moves[]; /* for each mode: of each surface whether each input moves it */

/* Which parameter is beyond a bound of its own; 0 for none. */
const char *fmu_beyond(const double *p);

/* The value of the expression of an input. */
double fmu_given(int input, const double *p, double t);

#endif
"""
_BEYOND = """
const char *fmu_beyond(const double *p) {{
  double bound;
  (void)p, (void)bound;
{tests}
  return 0;
}}
"""
_GIVEN = """
double fmu_given(int input, const double *p, double t) {{
  double out[1] = {{NAN}};
  (void)input, (void)p, (void)t;
{calls}
  return out[0];
}}
"""


def header(unit: Unit, token: str) -> str:
    """The text of ``variables.h``."""
    return comment(unit.source.heading) + _HEADER.format(
        variables=len(unit.variables),
        states=len(unit.references("state")),
        inputs=len(unit.source.system.inputs),
        slopes=max(len(slopes.places) for slopes in unit.slopes),
        token=string(token),
    )


def numbers(unit: Unit) -> str:
    """The text of ``variables.c``."""
    system = unit.source.system
    off = switched(unit.source)
    inputs = [variable for variable in unit.variables if variable.kind == "input"]
    variables = (f"{{FMU_{variable.kind.upper()}, {variable.index}}}" for variable in unit.variables)
    places = (
        f"{{{i}, {off.get(given.name, -1)}, {int(inputs[i].fixed)}, {int(inputs[i].discrete)}}}"
        for i, given in enumerate(system.inputs)
    )
    parts = [
        comment(unit.source.heading),
        '\n#include "variables.h"\n\n#include "hs_math.h"\n\n',
        array("const fmu_variable", "fmu_variables", variables),
        array("const fmu_input_place", "fmu_input", list(places) or ["{0, 0, 0, 0}"]),
        array("const double", "fmu_input_start", (literal(variable.start or 0.0) for variable in inputs)),
        array("const double", "fmu_input_nominal", (literal(variable.nominal or 1.0) for variable in inputs)),
        array("const double", "fmu_nominal", map(literal, [*unit.nominals, *_ones(unit)])),
        _slopes(unit),
        _moves(unit),
        _given(unit),
        _bounds(unit),
    ]
    return "".join(parts)


def _ones(unit: Unit) -> list[float]:
    """A size for each number of a part's mode."""
    return [1.0] * len(numbered(unit.problem.program.parts))


def _slopes(unit: Unit) -> str:
    program = unit.problem.program
    nothing = [len(unit.variables) for _ in _ones(unit)]
    derivatives, outputs = unit.references("derivative") + nothing, unit.references("output")
    states, inputs = unit.references("state") + nothing, unit.references("input")
    parts, rows = list[str](), list[str]()
    for k, (mode, slopes) in enumerate(zip(program.flows, unit.slopes, strict=True)):
        own = [program.all_states.index(name) for name in mode.states]
        row = [*(derivatives[i] for i in own), *outputs]
        column = [*(states[i] for i in own), *inputs]
        parts.append(routine_functions(slopes.routines, program, f"mode_{k}_"))
        parts.append(array("static const unsigned", f"row_{k}", (str(row[i]) for i, _ in slopes.places)))
        parts.append(array("static const unsigned", f"column_{k}", (str(column[i]) for _, i in slopes.places)))
        rows.append(f"{{mode_{k}_slopes, {len(slopes.places)}, row_{k}, column_{k}}}")
    return "".join(parts) + array("const fmu_slope_table", "fmu_slopes", rows)


def _moves(unit: Unit) -> str:
    parts, names = list[str](), list[str]()
    inputs, outputs = len(unit.source.system.inputs), len(unit.source.system.outputs)
    for k, (mode, slopes) in enumerate(zip(unit.problem.program.flows, unit.slopes, strict=True)):
        width = len(mode.states)
        flags = (str(int(width + i in uses)) for uses in slopes.uses[width + outputs :] for i in range(inputs))
        parts.append(array("static const char", f"moves_{k}", flags))
        names.append(f"moves_{k}")
    return "".join(parts) + array("const char *const", "fmu_moves", names)


def _given(unit: Unit) -> str:
    routines = lower_given(unit.source.system)
    calls = (f"  if (input == {name.removeprefix('given_')}) {name}(p, t, 0, out);" for name in routines.names)
    functions = routine_functions(routines, unit.problem.program, "")
    return functions + _GIVEN.format(calls="\n".join(calls))


def _bounds(unit: Unit) -> str:
    program = unit.problem.program
    bodies, functions, tests = constant_bodies(program), list[str](), list[str]()
    for i, name in enumerate(program.parameters):
        for kind, relation in (("minimum", "<"), ("maximum", ">")):
            if (bound := f"{kind}_{i}") in bodies:
                functions.append(function(bound, "const hs_real *p", bodies[bound]))
                text = string(f"parameter {name} is beyond its {kind}")
                tests.append(f"  if (!{bound}(p, &bound) && p[{i}] {relation} bound) return {text};")
    return "".join(functions) + _BEYOND.format(tests="\n".join(tests))
