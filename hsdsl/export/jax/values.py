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
    numbers, lines = [literal(float(value)) for value in problem.x], list[str]()
    routine, own = definitions(program.constants)["initial"], program.initial_states
    if problem.mode == program.initial_mode and parameters_in(routine):
        known = dict(zip(own, problem.kernel.constant("initial", given), strict=True))
        follow = [known.get(name) == value for name, value in zip(problem.states, problem.x, strict=True)]
        lines = [f"    {line}" for line in function("values", routine, data, "p").splitlines()] if any(follow) else []
        lines += ["    found = values(p)"] if any(follow) else []
        triples = zip(problem.states, follow, numbers, strict=True)
        numbers = [f"found[{own.index(name)}]" if follows else number for name, follows, number in triples]
    return "\n".join(["def initial_state(p):", *lines, f"    return padded([{', '.join(numbers)}], SIZES[0])", ""])
