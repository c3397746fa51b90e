"""Values of parameters and the initial state in an exported module: expressions where a run computes them so."""

from __future__ import annotations

from hsdsl.export.jax.language import function, literal
from hsdsl.export.routines import definitions, parameters_in
from hsdsl.export.source import Source


def values_text(source: Source) -> list[str]:
    """Functions ``parameter_values(given)`` and ``initial_state(p)``.

    A parameter that depends on others follows them, unless ``--set`` gave it a value of its own; so do initial values.
    """
    problem, program = source.problem, source.problem.program
    count = len(program.parameters)
    data = {f"p{i}": f"p[{i}]" for i in range(count)}
    routines, constant = definitions(program.constants), problem.kernel.constant
    given = problem.timeline.segments[0].data[:count]
    texts: list[str] = []
    lines = ["def parameter_values(given):", "    p = []"]
    for i, value in enumerate(given):
        name, routine = f"parameter_{i}", routines[f"parameter_{i}"]
        number = literal(float(value))
        if parameters_in(routine) and constant(name, given)[0] == value:
            texts.append(function(name, routine, data, "p"))
            number = f"{name}(p)[0]"
        lines.append(f"    p.append(given.get({i}, {number}))")
    texts.append("\n".join([*lines, f"    return padded(p, {count})", ""]))
    return [*texts, _start(source, data, given)]


def _start(source: Source, data: dict[str, str], given: tuple[float, ...]) -> str:
    problem, program = source.problem, source.problem.program
    numbers = [literal(float(value)) for value in problem.x]
    lines, known = list[str](), ()
    if problem.mode == program.initial_mode and problem.states == program.initial_states:
        text = function("values", definitions(program.constants)["initial"], data, "p")
        lines = [f"    {line}" for line in text.splitlines()]
        known = problem.kernel.constant("initial", given)
    if parameters_in(definitions(program.constants)["initial"]):
        own = [i for i, (a, b) in enumerate(zip(known, problem.x, strict=False)) if a == b]
        numbers = [f"found[{i}]" if i in own else number for i, number in enumerate(numbers)]
        lines += ["    found = values(p)"] if own else []
    else:
        lines = []
    return "\n".join(["def initial_state(p):", *lines, f"    return padded([{', '.join(numbers)}], SIZES[0])", ""])
