"""The part of an exported module that a model makes: its routines, tables and settings."""

from __future__ import annotations

from collections.abc import Iterable

from hsdsl.backends.c.source import width
from hsdsl.export.jax.inputs import fixed_parameters, timeline_text
from hsdsl.export.jax.language import function
from hsdsl.export.jax.values import values_text
from hsdsl.export.routines import data_names, mode_definitions
from hsdsl.export.source import Source
from hsdsl.integrators import ButcherTableau
from hsdsl.integrators.numbers import table_numbers
from hsdsl.program import ModeProgram


def model_text(source: Source, table: ButcherTableau) -> str:
    """All of it."""
    program = source.problem.program
    fixed = fixed_parameters(program)
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


def flows(source: Source) -> tuple[ModeProgram, ...]:
    """The modes and, where a run has them, the motions along their guards."""
    program = source.problem.program
    return program.modes if source.problem.settings.completion == "none" else program.flows


def _functions(source: Source) -> Iterable[str]:
    program = source.problem.program
    data = {name: f"p[{i}]" for i, name in enumerate(data_names(program))}
    for j, mode in enumerate(flows(source)):
        for name, definition in mode_definitions(mode).items():
            spread = ", s" if name.startswith("spread") else ""
            yield function(f"mode_{j}_{name}", definition, data, f"p, t, x{spread}")


def _tables(source: Source) -> str:
    program, modes = source.problem.program, flows(source)
    surfaces = max(1, *(len(mode.edges) + len(mode.walls) for mode in modes))
    wide = max(1, width(program))
    states = program.all_states
    lines = [f"SIZES = {wide}, {surfaces}, {len(program.outputs)}", f"STATES = {_strings(states)}"]
    numbers, edges = list[tuple[int, ...]](), list[str]()
    for j, mode in enumerate(program.modes):
        numbers.append(tuple(range(len(edges), len(edges) + len(mode.edges))))
        for k, edge in enumerate(mode.edges):
            target = tuple(map(states.index, edge.target_states))
            edges.append(
                f"    edge_of({edge.name!a}, {j}, {edge.target}, {target}, {edge.conditional}, {edge.priority}, "
                f"SIZES[0],\n            mode_{j}_reset_{k}, mode_{j}_spread_{k}),"
            )
    texts = [_mode(j, mode, modes, states, numbers) for j, mode in enumerate(modes)]
    lines += ["MODES = (", *texts, ")", "EDGES = (", *edges, ")"]
    return "\n".join(lines) + "\n"


def _mode(
    j: int, mode: ModeProgram, modes: tuple[ModeProgram, ...], states: tuple[str, ...], numbers: list[tuple[int, ...]]
) -> str:
    surfaces = range(len(mode.edges) + len(mode.walls))
    conditions = [
        [name for name in mode.routines.names if name.startswith(f"condition_{k}_")] for k in range(len(mode.edges))
    ]
    listed = [_names(j, [f"{kind}_{k}" for k in surfaces]) for kind in ("gradient", "rate")]
    parts = "".join(f"{_names(j, names)}, " for names in conditions)
    owner, held = next(((i, k) for i, m in enumerate(modes) for k, e in enumerate(m.edges) if e.contact == j), (j, -1))
    own = numbers[owner]
    edges = own if owner == j else (*own, *(own[held] for _ in mode.edges[len(own) :]))
    contacts = tuple(-1 if edge.contact is None or edge.contact >= len(modes) else edge.contact for edge in mode.edges)
    contact = contacts, tuple(edge.releases for edge in mode.edges), owner, held, mode.push_order
    return (
        f"    mode_of({mode.name!a}, {tuple(map(states.index, mode.states))}, {mode.final}, {edges}, {contact},\n"
        f"            SIZES, mode_{j}_flow, mode_{j}_surfaces, mode_{j}_magnitudes, {', '.join(listed)},\n"
        f"            ({parts}), mode_{j}_outputs),"
    )


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
        f"MODEL = Model(MODES, EDGES, STATES, SIZES[0], {_strings(program.outputs)}, METHOD, timeline)",
        "CONFIG = Config(", *(f"    {name}={value}," for name, value in fields.items()), ")",
        f"FIXED = {{{', '.join(f'{name!a}: {why!a}' for name, why in fixed.items())}}}",
        f"EXPERIMENT = Experiment(MODEL, CONFIG, {_strings(program.parameters)}, FIXED, parameter_values, "
        f"initial_state, {problem.mode})",
        "parameters, initial, simulate = EXPERIMENT.parameters, EXPERIMENT.initial, EXPERIMENT.simulate",
        "", 'if __name__ == "__main__":', "    EXPERIMENT.show()", "",
    ]  # fmt: skip
    return "\n".join(lines)
