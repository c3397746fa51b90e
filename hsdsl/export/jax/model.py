"""The part of an exported module that a model makes: its routines, tables, settings, and inputs over time.

Inputs have segments at the times of the export, and samples that follow parameters.
"""

from __future__ import annotations

import ast
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence

from hsdsl.engine.backends.c.source import width
from hsdsl.engine.backends.printer import C_OPERATORS, Language, number_text
from hsdsl.engine.integrators import ButcherTableau
from hsdsl.engine.integrators.tableau import table_numbers
from hsdsl.engine.simulate import Problem
from hsdsl.export.source import (
    Source,
    data_names,
    definitions,
    derived,
    followed,
    mode_definitions,
    parameters_in,
    switch_parameters,
    used_by,
    with_sources,
)
from hsdsl.mathematics.program import EdgeProgram, ModeProgram, Program


def values_text(source: Source) -> list[str]:
    """Functions ``parameter_values(given)`` and ``initial_state(p)``.

    A parameter that depends on others follows them, unless ``--set`` gave it a value of its own; so do initial values.
    """
    problem, program = source.problem, source.problem.program
    count, own = len(program.parameters), derived(problem)
    data = {f"p{i}": f"p[{i}]" for i in range(count)}
    routines = definitions(program.constants)
    texts: list[str] = []
    lines = ["def parameter_values(given):", "    p = []"]
    for i, (name, value) in enumerate(zip(program.parameters, problem.timeline.segments[0].data, strict=False)):
        number = literal(float(value))
        if name in own:
            texts.append(function(f"parameter_{i}", routines[f"parameter_{i}"], data, "p"))
            number = f"parameter_{i}(p)[0]"
        lines.append(f"    p.append(given.get({i}, {number}))")
    texts.append("\n".join([*lines, f"    return padded(p, {count})", ""]))
    return [*texts, _start(problem, data)]


def _start(problem: Problem, data: dict[str, str]) -> str:
    numbers, lines = [literal(float(value)) for value in problem.x], list[str]()
    routine, places = definitions(problem.program.constants)["initial"], followed(problem)
    if parameters_in(routine) and any(place is not None for place in places):
        lines = [f"    {line}" for line in function("values", routine, data, "p").splitlines()]
        lines.append("    found = values(p)")
        pairs = zip(numbers, places, strict=True)
        numbers = [number if place is None else f"found[{place}]" for number, place in pairs]
    return "\n".join(["def initial_state(p):", *lines, f"    return padded([{', '.join(numbers)}], SIZES[0])", ""])


def model_text(source: Source, table: ButcherTableau) -> str:
    fixed = fixed_parameters(source.problem)
    parts = [
        "# " + "-" * 70 + "\n# The model\n# " + "-" * 70 + "\n",
        *_functions(source),
        *values_text(source),
        timeline_text(source),
        _tables(source),
        _method(table),
        _experiment(source, table, fixed),
    ]
    return "\n\n".join(parts)


def _functions(source: Source) -> Iterable[str]:
    program = source.problem.program
    data = {name: f"p[{i}]" for i, name in enumerate(data_names(program))}
    for j, mode in enumerate(program.flows):
        for name, definition in mode_definitions(mode).items():
            spread = ", s" if name.startswith("spread") else ""
            yield function(f"mode_{j}_{name}", definition, data, f"p, t, x{spread}")


def _tables(source: Source) -> str:
    program = source.problem.program
    surfaces = max(1, *(len(mode.surfaces) for mode in program.flows))
    wide = max(1, width(program))
    states = program.all_states
    lines = [f"SIZES = {wide}, {surfaces}, {len(program.outputs)}", f"STATES = {_strings(states)}"]
    numbers, edges = list[tuple[int, ...]](), list[str]()
    for j, mode in enumerate(program.modes):
        numbers.append(tuple(range(len(edges), len(edges) + len(mode.edges))))
        for k, edge in enumerate(mode.edges):
            target = tuple(map(states.index, edge.target_states))
            head = (
                edge.name, j, edge.target, target, edge.conditional, edge.priority, edge.counts, edge.changes,
                tuple((q.waiting, *q.values) for q in mode.queues if edge.target == j), _tails(mode, edge),
            )  # fmt: skip
            edges.append(
                f"    edge_of({head!a}, SIZES[0],\n            mode_{j}_reset_{k}, "
                f"mode_{j}_spread_{k}, mode_{mode.held if edge.branched else j}_reset_{k}),"
            )
    found = flows(source)
    texts = [_mode(j, program, own, numbers, len(found)) for j, own in enumerate(found)]
    lines += ["MODES = (", *texts, ")", "EDGES = (", *edges, ")"]
    return "\n".join(lines) + "\n"


def _tails(mode: ModeProgram, edge: EdgeProgram) -> int:
    """The field ``tails`` of an edge."""
    waits = any(q.waiting in edge.changes and q.values[0] not in edge.changes for q in mode.queues)
    return 0 if waits else 2 if edge.of_event else 1


def flows(source: Source) -> list[int]:
    """For each of the flows that a run has the number of its mode: the modes, then those with motion along guards."""
    program = source.problem.program
    owners = {mode.held: j for j, mode in enumerate(program.modes) if mode.held is not None}
    none = source.problem.settings.completion == "none"
    return [owners.get(j, j) for j in range(len(program.modes if none else program.flows))]


def _mode(j: int, program: Program, owner: int, numbers: list[tuple[int, ...]], count: int) -> str:
    mode, states = program.flows[j], program.all_states
    listed = [_names(j, [f"{kind}_{k}" for k in mode.surfaces]) for kind in ("gradient", "rate")]
    parts = "".join(f"{_names(j, names)}, " for names in mode.conditions)
    contact = _contact(program.modes[owner], mode, owner, numbers[owner], count)
    return (
        f"    mode_of(({mode.name!a}, {tuple(map(states.index, mode.states))}, {mode.final}, {contact}, {mode.idle}),\n"
        f"            SIZES, mode_{j}_flow, mode_{j}_surfaces, mode_{j}_magnitudes, {', '.join(listed)},\n"
        f"            ({parts}), mode_{j}_outputs),"
    )


def _contact(owner: ModeProgram, mode: ModeProgram, j: int, own: tuple[int, ...], count: int) -> str:
    """The fields of a mode from ``edges`` to ``orders``; those after a mode's own edges are of what they release."""
    held = -1 if owner.held is None or not owner.held < count else owner.held
    places = [-1 if edge.contact is None or held < 0 else edge.contact for edge in owner.edges]
    ends = [-1 if edge.releases is None else edge.releases for edge in mode.edges]
    edges = (*own, *(own[places.index(place)] for place in ends[len(own) :]))
    orders = tuple(edge.push_order for edge in owner.edges)
    return f"{edges}, {len(mode.surfaces) - len(edges)}, {j}, {held}, {tuple(places)}, {tuple(ends)}, {orders}"


def _names(j: int, names: Iterable[str]) -> str:
    return f"({''.join(f'mode_{j}_{name}, ' for name in names).rstrip()})"


def _strings(texts: Iterable[str]) -> str:
    return f"({''.join(f'{text!a}, ' for text in texts).rstrip()})"


def _method(table: ButcherTableau) -> str:
    numbers = table_numbers(table)
    fields = {
        "name": ascii(table.name), "order": table.order, "stages": numbers.stages, "extra": numbers.extra,
        "interpolant": ascii(table.interpolant), "nodes": numbers.nodes, "a": numbers.a, "b": numbers.b,
        "error": numbers.error, "coarse": numbers.coarse, "dense": numbers.dense,
    }  # fmt: skip
    return "METHOD = Method(\n" + "".join(f"    {name}={value},\n" for name, value in fields.items()) + ")\n"


def _experiment(source: Source, table: ButcherTableau, fixed: dict[str, str]) -> str:
    problem, program, settings = source.problem, source.problem.program, source.problem.settings
    largest = 0.1 * settings.until
    step = largest / 100 if settings.step is None else settings.step
    scale = tuple(float(settings.scale.get(name, 0.0)) for name in program.all_states) or (0.0,)
    fields = {
        "scheme": ascii(settings.scheme), "step": step, "tolerance": settings.tolerance,
        "relaxation": settings.relaxation, "until": settings.until, "max_transitions": settings.max_transitions,
        "order": table.error_order, "scale": scale,
    }  # fmt: skip
    lines = [
        f"MODEL = Model(MODES, EDGES, STATES, SIZES[0], {_strings(program.outputs)}, METHOD, timeline, "
        f"{program.contact_count}, {settings.until})",
        "CONFIG = Config(", *(f"    {name}={value}," for name, value in fields.items()), ")",
        f"FIXED = {{{', '.join(f'{name!a}: {why!a}' for name, why in fixed.items())}}}",
        f"EXPERIMENT = Experiment(MODEL, CONFIG, {_strings(program.parameters)}, FIXED, parameter_values, "
        f"initial_state, {problem.mode})",
        "parameters, initial, simulate = EXPERIMENT.parameters, EXPERIMENT.initial, EXPERIMENT.simulate",
        "", 'if __name__ == "__main__":', "    EXPERIMENT.show()", "",
    ]  # fmt: skip
    return "\n".join(lines)


SWITCHES = "it decides when a function of time switches"
SAMPLES = "it decides when an input has a sample"


def fixed_parameters(problem: Problem) -> dict[str, str]:
    """Parameters that times of segments depend on, and why they cannot change; those that decide them, too."""
    program, sampled = problem.program, set[int]()
    routines = definitions(program.constants)
    for i, given in enumerate(program.inputs):
        if given.times is None:
            last = routines[f"input_{i}"].body[-1]
            assert isinstance(last, ast.Return) and isinstance(last.value, ast.Tuple)
            values = last.value.elts
            times = ast.Module([*routines[f"input_{i}"].body[:-1]], [])
            sampled |= parameters_in(times, *values[: len(values) // 2])
    known = used_by(program), derived(problem)
    found = dict.fromkeys(with_sources(program, *known, sampled), SAMPLES)
    found |= dict.fromkeys(with_sources(program, *known, switch_parameters(program)), SWITCHES)
    return {program.parameters[i]: why for i, why in sorted(found.items())}


def timeline_text(source: Source) -> str:
    """A function ``timeline(p)``: starts, ends and jumps of segments, and the numbers that routines are bound to."""
    program, segments = source.problem.program, source.problem.timeline.segments
    count, inputs = len(program.parameters), len(program.inputs)
    rows = [_row([literal(float(v)) for v in segment.data[count:]]) for segment in segments]
    lines = [
        f"STARTS = np.array({_row([literal(float(s.start)) for s in segments])})",
        f"ENDS = np.array({_row([literal(float(s.end)) for s in segments])})",
        f"JUMPS = np.array({_row([str(s.jump) for s in segments])})",
        f"DATA = np.array([{', '.join(rows)}]).reshape({len(segments)}, {3 * inputs + len(program.switches)})",
        "",
        "",
    ]
    body = ["def timeline(p):", "    data = jnp.asarray(DATA)"]
    data = {f"p{i}": f"p[{i}]" for i in range(count)}
    for i, given in enumerate(program.inputs):
        if given.times is None:
            lines += [function(f"input_{i}", definitions(program.constants)[f"input_{i}"], data, "p"), ""]
            body += _samples(source, i)
    return "\n".join([*lines, *body, "    return jnp.asarray(STARTS), jnp.asarray(ENDS), jnp.asarray(JUMPS), data", ""])


def _samples(source: Source, i: int) -> list[str]:
    """Lines that put an input's samples, which follow parameters, in the columns of its segments' numbers."""
    problem = source.problem
    given = problem.program.inputs[i]
    numbers = problem.kernel.constant(
        f"input_{i}", problem.timeline.segments[0].data[: len(problem.program.parameters)]
    )
    times = numbers[: len(numbers) // 2]
    spots = [bisect_right(times, segment.start) - 1 for segment in problem.timeline.segments]
    last = len(times) - 1
    first = tuple(max(0, k) for k in spots)
    following = tuple(k + 1 if given.hold == "linear" and 0 <= k < last else max(0, k) for k in spots)
    return [
        f"    samples = padded(input_{i}(p), {len(numbers)})",
        f"    times, values = samples[:{len(times)}], samples[{len(times)}:]",
        f"    first, following = np.array({first}), np.array({following})",
        "    length = times[following] - times[first]",
        "    slope = (values[following] - values[first]) / jnp.where(length == 0, 1.0, length)",
        f"    data = data.at[:, {3 * i}:{3 * i + 3}].set(jnp.stack([values[first], slope, times[first]], axis=1))",
    ]


def _row(items: list[str]) -> str:
    return f"[{', '.join(items)}]"


def literal(value: float) -> str:
    """Write a number without loss."""
    return number_text(value, "NAN", "INF")


def _results(values: Sequence[str]) -> list[str]:
    return [f"return ({''.join(f'{value}, ' for value in values).rstrip()})"]


JAX = Language(
    literal=literal,
    assign="{name} = {value}",
    results=_results,
    divide="f_div({left}, {right})",
    choose="jnp.where({test}, {body}, {other})",
    call="f_{name}({arguments})",
    fold="f_{name}({left}, {right})",
    truths=("jnp.asarray(False)", "jnp.asarray(True)"),
    operators={**C_OPERATORS, ast.And: "&", ast.Or: "|", ast.Not: "~"},
)


def function(name: str, definition: ast.FunctionDef, data: Mapping[str, str], signature: str) -> str:
    """One routine as a function of this name; states are ``x[0], ...``, sizes ``s[0], ...``."""
    names = (argument.arg for argument in definition.args.args)
    states = {name: f"{name[0]}[{name[1:]}]" for name in names if name[0] in "xs"}
    body = "\n".join(f"    {line}" for line in JAX.body(definition, {"t": "t", **data, **states}))
    return f"def {name}({signature}):\n{body}\n"
