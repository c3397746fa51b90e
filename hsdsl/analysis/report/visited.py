"""Programs for pictures: the product modes that a run visited, and events as they were written."""

from __future__ import annotations

from dataclasses import replace

from hsdsl.base.parts import inner_modes, written_edges
from hsdsl.engine.execution import Execution
from hsdsl.mathematics.program import EdgeProgram, ModeProgram, Program


def visited_part(program: Program, run: Execution | None) -> Program:
    """The product modes that a run was in, with the edges that it took; none without a run."""
    if not program.parts:
        return program
    if run is None:
        return replace(program, modes=())
    names = list(dict.fromkeys([*(arc.mode for arc in run.arcs), *(made.target for made in run.transitions)]))
    states = {arc.mode: arc.states for arc in run.arcs}
    taken = dict.fromkeys((made.source, made.edge, made.target) for made in run.transitions)
    texts = {edge.name: edge for edge in program.modes[0].edges}
    whole = program.modes[0]

    def edge(name: str, source: str, target: str) -> EdgeProgram:
        of, own = texts[name], frozenset(states.get(target, whole.states))
        pairs = [(s, text) for s, text in zip(of.target_states, of.reset_texts, strict=True) if s in own]
        changed = [k for k, (s, text) in enumerate(pairs) if s != text]
        return replace(
            of,
            source=names.index(source),
            target=names.index(target),
            target_states=tuple(s for s, _ in pairs),
            changes=tuple(changed),
            change_texts=tuple(pairs[k][1] for k in changed),
        )

    def edges(mode: str) -> tuple[EdgeProgram, ...]:
        return tuple(edge(name, source, target) for source, name, target in taken if source == mode)

    flows = dict(zip(whole.states, whole.flow_texts, strict=True))
    modes: list[ModeProgram] = []
    for mode in names:
        own = states.get(mode, ())
        modes.append(
            replace(whole, name=mode, states=own, flow_texts=tuple(flows[s] for s in own), edges=edges(mode), walls=())
        )
    return replace(program, modes=tuple(modes), contacts=(), initial_mode=0)


def as_written(program: Program, run: Execution | None) -> Program:
    """A program with one edge for each event, without modes that only end runs, unless this run ended in one."""
    inner = inner_modes(program.modes)
    last = run.arcs[-1].mode if run is not None and run.arcs else None
    shown = [k for k, mode in enumerate(program.modes) if k not in inner or mode.name == last]
    number = {k: i for i, k in enumerate(shown)}
    modes = tuple(
        replace(mode, edges=tuple(_moved(e, number) for e in written_edges(mode.edges, inner & number.keys())))
        for mode in (program.modes[k] for k in shown)
    )
    return replace(program, modes=modes, initial_mode=number.get(program.initial_mode, 0))


def _moved(edge: EdgeProgram, number: dict[int, int]) -> EdgeProgram:
    return replace(edge, source=number[edge.source], target=number[edge.target])
