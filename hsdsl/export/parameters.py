"""Parameters and initial values by what a change of them needs: which follow others, which decide times of inputs."""

from __future__ import annotations

from hsdsl.base.parts import numbered
from hsdsl.engine.simulate import Problem
from hsdsl.export.routines import definitions, parameters_in
from hsdsl.mathematics.program import Program


def derived(problem: Problem) -> set[str]:
    """The parameters that are expressions of others, and not overridden."""
    program = problem.program
    used = used_by(program)
    return {
        name
        for i, name in enumerate(program.parameters)
        if used[f"parameter_{i}"] and name not in problem.settings.overrides
    }


def structural(problem: Problem) -> set[str]:
    """The parameters that decide the samples of inputs or when switches of time change; such times are data."""
    program = problem.program
    used = used_by(program)
    direct = {i for name, needed in used.items() if name.startswith("input_") for i in needed}
    direct |= parameters_in(*definitions(program.switching).values())
    return {program.parameters[i] for i in with_sources(program, used, derived(problem), direct)}


def used_by(program: Program) -> dict[str, set[int]]:
    """The parameters that each constant is computed from."""
    return {name: parameters_in(routine) for name, routine in definitions(program.constants).items()}


def with_sources(program: Program, used: dict[str, set[int]], own: set[str], direct: set[int]) -> set[int]:
    """Parameters with those that they are derived from, which come before them."""
    found = set(direct)
    for i in reversed(range(len(program.parameters))):
        if i in found and program.parameters[i] in own:
            found |= used[f"parameter_{i}"]
    return found


def given(problem: Problem) -> set[str]:
    """The states whose initial values the call gives: by name, or as numbers of the modes of parts."""
    overrides = problem.settings.overrides
    parts = problem.program.parts
    numbers = {name for name in numbered(parts) if not {"initial.mode", f"initial.{name}.mode"}.isdisjoint(overrides)}
    return numbers | {name for name in problem.states if f"initial.{name}" in overrides}


def followed(problem: Problem) -> list[int | None]:
    """For each state of the start the place of its initial value among those of the file; None where it has another."""
    known, own = problem.program.initial_states, given(problem)
    return [known.index(name) if name in known and name not in own else None for name in problem.states]
