# pyright: basic
"""Where resets land: on or beyond the surfaces of the mode they lead to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from hsdsl.base.errors import Decided
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import Edge, Surface
from hsdsl.mathematics.decisions.dynamics import Clause, Dynamics
from hsdsl.mathematics.decisions.question import positive


@dataclass(frozen=True)
class Landing:
    """A reset that lands on a surface of the next mode, wherever its transition fires, and how that is known.

    The surface is that of ``edge``, or a wall (None). ``rate`` says how fast the surface function changes after
    landing, in the states before the reset, and ``bend`` how fast that rate does. ``guard`` is where the first
    transition fires and the condition of the second holds. With ``returns`` the second one leads back to the mode and
    state before the first.
    """

    edge: Edge | None
    surface: Surface
    rate: Any
    bend: Any
    guard: list[Clause]
    returns: bool
    decided: Decided


def landings(dynamics: Dynamics, edge: Edge) -> tuple[Landing, ...]:
    """The surfaces of the next mode that an edge's reset always lands on."""
    return dynamics.remembered(("landings", edge.source, edge.name), lambda: tuple(_landings(dynamics, edge)))


def _landings(dynamics: Dynamics, edge: Edge) -> Iterator[Landing]:
    mode, target = dynamics.modes[edge.source], dynamics.modes[edge.target]
    guard = dynamics.guard(edge)
    surfaces = [*((after.surface, after) for after in target.edges), *((wall, None) for wall in target.walls)]
    for surface, after in surfaces if guard and not target.final else ():
        residual = dynamics.residual(surface)
        carried = dynamics.carried(residual, edge)
        known = [dynamics.vanishes(mode, carried, clause) for clause in guard or ()]
        if None in known:
            continue
        rate = dynamics.rate(target, residual)
        conditions = [()] if after is None else dynamics.condition(after)
        moved = [tuple(c.along(dynamics.carried(c.expr, edge)) for c in clause) for clause in conditions or ()]
        both = [(*before, *clause) for before in guard or () for clause in moved]
        returns = after is not None and _returns(dynamics, edge, after, guard or [])
        bend = None if rate is None else dynamics.rate(target, rate)
        rate, bend = (None if e is None else dynamics.carried(e, edge) for e in (rate, bend))
        yield Landing(after, surface, rate, bend, both, returns, "sampled" if "sampled" in known else "symbolic")


def _returns(dynamics: Dynamics, edge: Edge, after: Edge, guard: list[Clause]) -> bool:
    if after.target != edge.source or (after.name == edge.name and after.source == edge.source):
        return False
    mode = dynamics.modes[edge.source]
    for state, value in after.values.items():
        moved = dynamics.carried(dynamics.placed(value), edge) - symbol(state)
        if moved != 0 and any(dynamics.vanishes(mode, moved, clause) is None for clause in guard):
            return False
    return True


def entered_beyond(dynamics: Dynamics, edge: Edge) -> bool:
    """Whether a state may be beyond an edge's surface when it enters the mode, so that the edge fires at once (M5).

    Where that is not known, it may.
    """
    if edge.condition is not None:
        return False
    residual = dynamics.residual(edge.surface)
    if {s.name for s in residual.free_symbols} & {given.name for given in dynamics.system.inputs}:
        return True  # an input that jumps carries the surface along
    for before in dynamics.incoming[edge.source]:
        if before is not edge:
            mode = dynamics.modes[before.source]
            carried = dynamics.carried(residual, before)
            if not dynamics.ask_any(mode, dynamics.guard(before), positive(carried), prove=True).never:
                return True
    starts_here = edge.source == dynamics.system.initial.mode
    return starts_here and dynamics.value(residual, dynamics.starting_point) > 0
