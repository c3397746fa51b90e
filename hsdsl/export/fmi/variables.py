"""The variables of a unit: time, states, derivatives, parameters, inputs, outputs and the mode, by their references.

Tools build sparse matrices from what each unknown depends on, by references. `parts/fmu.c` reads the variables and
their derivatives as tables of C.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.base.parts import numbered
from hsdsl.engine.backends.c.routine import literal
from hsdsl.engine.backends.c.source import constant_bodies, routine_functions
from hsdsl.engine.backends.python import compile_routines
from hsdsl.engine.execution import Execution
from hsdsl.engine.simulate import Problem
from hsdsl.engine.simulate.verdict.run_view import RunView
from hsdsl.export import Modes
from hsdsl.export.c.problem import array, comment, function, string
from hsdsl.export.source import Source, bounds_of, derived, drivable, filled, structural, used_by, with_sources
from hsdsl.language.elaborate.inputs import switch_name
from hsdsl.mathematics.lower import Slopes, lower_given, lower_slopes

Kind = Literal["time", "state", "derivative", "parameter", "input", "output", "mode", "indicator"]
_FIRST = re.compile(r"\ba(\d+)\b")
_SHARES = np.linspace(0, 1, 257)  # of a run, at which it is compared with a finer one


@dataclass(frozen=True)
class Variable:
    """One variable; ``index`` is its place among those of its kind, its reference that among all.

    ``start`` is None where there is none, ``fixed`` says that it stays as exported (an input: that it cannot be set).
    """

    kind: Kind
    index: int
    name: str
    unit: str | None = None
    start: float | None = None
    about: str | None = None
    fixed: bool = False
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    discrete: bool = False


@dataclass(frozen=True)
class Unit:
    """A source whose inputs can be driven, with its variables in the order of their references.

    ``modes`` says what the numbers of modes are to the caller.
    """

    source: Source
    modes: Modes = "local"

    @property
    def problem(self) -> Problem:
        """The problem, as exported."""
        return self.source.problem

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """All variables; a name that is taken gets underscores."""
        source, system, units = self.source, self.source.system, self.source.system.units
        outputs = (Variable("output", k, name, units.get(name)) for k, name in enumerate(system.outputs))
        surfaces = max(len(mode.surfaces) for mode in self.problem.program.flows)
        indicators = (Variable("indicator", k, f"indicator[{k}]") for k in range(surfaces))
        modes = () if self.modes == "none" else _modes(source)
        given = (Variable("time", 0, "time"), *_states(source), *_parameters(source), *_inputs(source))
        found: list[Variable] = []
        taken: set[str] = set()
        for variable in (*given, *outputs, *modes, *indicators):
            name = variable.name
            while name in taken:
                name += "_"
            taken.add(name)
            found.append(replace(variable, name=name))
        return tuple(found)

    @property
    def nominals(self) -> list[float]:
        """A size for each state."""
        return [variable.nominal or 1.0 for variable in self.variables if variable.kind == "state"]

    def references(self, *kinds: Kind) -> list[int]:
        """The references of the variables of some kinds."""
        return [i for i, variable in enumerate(self.variables) if variable.kind in kinds]

    @cached_property
    def slopes(self) -> tuple[Slopes, ...]:
        """Derivatives of flows and outputs in each mode."""
        return lower_slopes(self.source.system)


def unit_of(source: Source, modes: Modes = "local") -> Unit:
    return Unit(drivable(source), modes)


def _states(source: Source) -> tuple[Variable, ...]:
    problem, units = source.problem, source.system.units
    start = dict(zip(problem.states, problem.x, strict=True))
    names = continuous(source)
    scale = nominals(source)
    states = (
        Variable("state", i, name, units.get(name), float(start.get(name, 0.0)), nominal=scale[i])
        for i, name in enumerate(names)
    )
    return (*states, *(Variable("derivative", i, f"der({name})", units.get(name)) for i, name in enumerate(names)))


def continuous(source: Source) -> list[str]:
    """The states of all modes that flow; after them are the numbers of the modes of parts."""
    program = source.problem.program
    hidden = numbered(program.parts)
    return [name for name in program.all_states if name not in hidden]


def _modes(source: Source) -> tuple[Variable, ...]:
    """The number of the mode, or of a system of parts those of each part's mode, from 1 on, among its states."""
    system, program = source.system, source.problem.program
    if not program.parts:
        return (Variable("mode", 0, "mode", about=_listed([mode.name for mode in system.modes], 0)),)
    place = program.all_states.index
    parts = (part for part in program.parts if part.is_numbered)
    return tuple(Variable("mode", place(p.name), f"{p.name}.mode", about=_listed(p.modes, 1)) for p in parts)


def _listed(modes: Sequence[str], first: int) -> str:
    return "the mode: " + "; ".join(f"{k} {name}" for k, name in enumerate(modes, first))


def nominals(source: Source) -> list[float]:
    """A size for each state: as given, else the power of two that it stays below in the run that is exported."""
    run, given = source.model.simulate(**source.arguments), source.problem.settings.scale
    sizes = RunView(source.problem, run).sizes
    own = {name: size for name, size in sizes.items() if not _is_roundoff(run, name)}
    return [float(given.get(name) or _power(own.get(name, 0.0))) for name in continuous(source)]


def _is_roundoff(run: Execution, name: str) -> bool:
    """Whether the finer run has other digits of a state throughout."""
    finer = run.finer
    if finer is None:
        return False
    end = min(float(run.time_span[1]), float(finer.time_span[1]))
    taken = [each.sample(_SHARES * end) for each in (run, finer)]
    if not all(name in each.states for each in taken):  # the finer run may end before a mode that has the state
        return False
    both = [np.asarray(each[name], dtype=float) for each in taken]
    sizes = np.fmax(*np.abs(both))
    changes = np.abs(both[0] - both[1])[sizes > 0] / sizes[sizes > 0]
    return len(changes) > 0 and not np.nanmedian(changes) < 1 / 2


def _power(size: float) -> float:
    """A power of two, so that the last digits of a run do not matter; 1 for nothing."""
    return 2.0 ** math.ceil(math.log2(size)) if 0 < size < math.inf else 1.0


def switched(source: Source) -> dict[str, int]:
    """For each input that is an expression of time the parameter that turns the expression off."""
    names = source.problem.program.parameters
    return {
        given.name: names.index(switch_name(given.name)) for given in source.system.inputs if given.given is not None
    }


def _parameters(source: Source) -> list[Variable]:
    problem = source.problem
    own, fixed, hidden = derived(problem), structural(problem), set(switched(source).values())
    values = problem.timeline.segments[0].data
    found: list[Variable] = []
    for i, p in enumerate(source.system.parameters):
        if i not in hidden:
            start = None if p.name in own else float(values[i])
            given = Variable("parameter", i, p.name, p.unit, start, p.about, p.name in fixed)
            least, most = bounds_of(source, i)
            found.append(replace(given, minimum=least, maximum=most))
    return found


def _inputs(source: Source) -> list[Variable]:
    """Inputs; one that decides when switches of time change stays as given."""
    problem = source.problem
    deciding = {int(i) for i in _FIRST.findall(problem.program.switching.source.partition("\n")[2])}
    count, data = len(problem.program.parameters), problem.timeline.segments[0].data
    found: list[Variable] = []
    for i, given in enumerate(source.system.inputs):
        start, slope, since = data[count + 3 * i : count + 3 * i + 3]
        first = given_values(source, i, [0.0])[0] if given.given is not None else start + slope * (0.0 - since)
        held = given.given is None and given.hold == "zero"
        size = _power(_input_size(source, i))
        found.append(
            Variable("input", i, given.name, given.unit, float(first), None, i in deciding, nominal=size, discrete=held)
        )
    return found


def given_values(source: Source, index: int, times: Iterable[float]) -> list[float]:
    """The values that the expression of an input has at some times."""
    routines = lower_given(source.system)
    bound = compile_routines(routines, FLOAT64, "inputs")(*source.problem.timeline.segments[0].data)
    values = bound[routines.names.index(f"given_{index}")]
    return [float(values(time)[0]) for time in times]


def _input_size(source: Source, index: int) -> float:
    """The largest size of an input in the run that is exported."""
    problem, place = source.problem, len(source.problem.program.parameters) + 3 * index
    until = float(problem.settings.until)
    if source.system.inputs[index].given is not None:
        values = given_values(source, index, _SHARES * until)
    else:
        values = list[float]()
        for segment in problem.timeline.segments:
            start, slope, since = segment.data[place : place + 3]
            ends = (segment.start, min(float(segment.end), until))
            values += [float(start + slope * (float(time) - since)) for time in ends]
    return max((abs(value) for value in values if math.isfinite(value)), default=0.0)


def dependencies(unit: Unit) -> dict[int, list[int]]:
    """States, inputs and time that unknowns depend on in any mode."""
    found = {i: set[int]() for i in unit.references("derivative", "output", "mode", "indicator")}
    for mode in range(len(unit.slopes)):
        for unknown, columns in _rows(unit, mode):
            found[unknown] |= _knowns(unit, mode, columns, set())
    return {i: sorted(known) for i, known in found.items()} | {i: [i] for i in unit.references("state")}


def initial_dependencies(unit: Unit) -> dict[int, list[int]]:
    """What unknowns depend on in the initial mode: states, inputs, time and parameters; and parameters on others."""
    problem = unit.problem
    program, own = problem.program, derived(problem)
    used = used_by(program)
    shown = {v.index: i for i, v in enumerate(unit.variables) if v.kind == "parameter" and v.start is not None}
    found = {i: list[int]() for i in unit.references("derivative", "output", "mode")}
    for unknown, columns in _rows(unit, problem.mode):
        width = len(unit.problem.program.flows[problem.mode].states) + len(unit.source.system.inputs) + 1
        needed = with_sources(program, used, own, {k - width for k in columns if k >= width})
        found[unknown] = sorted(_knowns(unit, problem.mode, columns, {shown[i] for i in needed & shown.keys()}))
    for i, variable in enumerate(unit.variables):
        if variable.kind == "parameter" and variable.start is None:
            needed = with_sources(program, used, own, {variable.index})
            found[i] = sorted(shown[k] for k in needed & shown.keys())
    return found


def _rows(unit: Unit, mode: int) -> Iterator[tuple[int, frozenset[int]]]:
    """The unknowns of a mode that there are variables of, each with the columns that it uses."""
    program = unit.problem.program
    states, derivatives = program.flows[mode].states, unit.references("derivative")
    own = [program.all_states.index(name) for name in states]
    rows = [derivatives[i] if i < len(derivatives) else None for i in own]
    rows += [*unit.references("output"), *unit.references("indicator")]
    uses = unit.slopes[mode].uses
    for row, (unknown, columns) in enumerate(zip(rows, uses, strict=False)):  # a mode may have fewer surfaces
        surface = row >= len(rows) - len(unit.references("indicator"))
        rates = [uses[column] for column in columns if column < len(states)] if surface else []
        if unknown is not None:
            yield unknown, columns.union(*rates)  # the indicator of a surface has its rate along the flow


def _knowns(unit: Unit, mode: int, columns: frozenset[int], further: set[int]) -> set[int]:
    """The references of states, inputs and time among columns; an input that cannot be set is one of time."""
    program, variables = unit.problem.program, unit.variables
    names = program.flows[mode].states
    places: Mapping[Kind, list[int]] = {kind: unit.references(kind) for kind in ("time", "state", "input")}
    (time,), known = places["time"], set(further)
    for column in columns:
        if column < len(names):
            index = program.all_states.index(names[column])
            known |= {places["state"][index]} if index < len(places["state"]) else set()
        elif column < len(names) + len(places["input"]):
            reference = places["input"][column - len(names)]
            known.add(time if variables[reference].fixed else reference)
        elif column == len(names) + len(places["input"]):
            known.add(time)
    return known


def _part(name: str) -> str:
    return (Path(__file__).parent / "parts" / name).read_text()


def header(unit: Unit, token: str) -> str:
    """The text of ``variables.h``."""
    return (
        comment(unit.source.heading)
        + "\n"
        + filled(
            _part("variables.h.in"),
            variables=len(unit.variables),
            states=len(unit.references("state")),
            inputs=len(unit.source.system.inputs),
            slopes=max(len(slopes.places) for slopes in unit.slopes),
            token=string(token),
        )
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
    return functions + "\n" + filled(_part("given.c.in"), calls="\n".join(calls))


def _bounds(unit: Unit) -> str:
    program = unit.problem.program
    bodies, functions, tests = constant_bodies(program), list[str](), list[str]()
    for i, name in enumerate(program.parameters):
        for kind, relation in (("minimum", "<"), ("maximum", ">")):
            if (bound := f"{kind}_{i}") in bodies:
                functions.append(function(bound, "const hs_real *p", bodies[bound]))
                text = string(f"parameter {name} is beyond its {kind}")
                tests.append(f"  if (!{bound}(p, &bound) && p[{i}] {relation} bound) return {text};")
    return "".join(functions) + "\n" + filled(_part("beyond.c.in"), tests="\n".join(tests))
