"""What each unknown of a unit depends on, by references: lists that tools build sparse matrices from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hsdsl.export.fmi.variables import Kind, Unit
from hsdsl.export.parameters import derived, used_by, with_sources


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
        width = _first_parameter(unit, problem.mode)
        needed = with_sources(program, used, own, {k - width for k in columns if k >= width})
        found[unknown] = sorted(_knowns(unit, problem.mode, columns, {shown[i] for i in needed & shown.keys()}))
    for i, variable in enumerate(unit.variables):
        if variable.kind == "parameter" and variable.start is None:
            needed = with_sources(program, used, own, {variable.index})
            found[i] = sorted(shown[k] for k in needed & shown.keys())
    return found


def _first_parameter(unit: Unit, mode: int) -> int:
    """The column of the first parameter."""
    return len(unit.problem.program.flows[mode].states) + len(unit.source.system.inputs) + 1


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
