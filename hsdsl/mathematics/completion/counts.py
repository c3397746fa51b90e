# pyright: basic, reportArgumentType=false
"""States that impacts count with: nothing else depends on them, and repeated resets lead them nowhere."""

from __future__ import annotations

import sympy as sp

from hsdsl.language.system import Mode
from hsdsl.mathematics.completion.nearby import NUMBERS, Nearby, fixed_point, is_zero, symbols, value_at


def counts_of(near: Nearby) -> tuple[int, ...]:
    """The numbers of the states that an edge which leads back to its mode counts with, as ``n: n + 1``.

    A sum that converges, as that of what impacts dissipate, is none: its increment vanishes where the state rests. Nor
    is what repeated resets take to a limit of its own.
    """
    unused = _unused_of(near.mode) if near.changed else ()
    few = tuple(i for i in near.changed if i in unused)
    if not few or not near.is_small() or (found := fixed_point(near.without(few))) is None:
        return ()
    anywhere = {x: NUMBERS.zero + 1 + 1 / (3 + k) for k, x in enumerate(sorted(near.moved.free_symbols, key=str))}
    at = anywhere | found

    def is_count(i: int, change: sp.Expr) -> bool:
        return not is_zero(change, at) and abs(1 + value_at(sp.diff(change, near.states[i]), at)) >= 1

    return tuple(i for i, change in zip(near.changed, near.moved, strict=True) if i in few and is_count(i, change))


_last: list[tuple[Mode, frozenset[int]]] = []  # of a mode all edges in turn; to hash one takes longer than this does


def _unused_of(mode: Mode) -> frozenset[int]:
    if not _last or _last[0][0] is not mode:
        _last[:] = [(mode, _unused(mode))]
    return _last[0][1]


def _unused(mode: Mode) -> frozenset[int]:
    """The states without a flow that no flow, surface, `if` or other state depends on while the mode lasts."""
    states = dict(zip(symbols(mode.states), range(len(mode.states)), strict=True))
    loops = [edge for edge in mode.edges if edge.target == mode.name and edge.target_states == mode.states]
    conditions = [edge.condition for edge in mode.edges if edge.condition is not None]
    waiting = [*mode.flow, *conditions, *(s.residual for s in mode.surfaces)]
    used = {i for i, f in enumerate(mode.flow) if f != 0}
    waiting += [edge.reset[i] for edge in loops for i in used]
    while waiting:
        for x in sp.sympify(waiting.pop()).free_symbols:
            i = states.get(x)
            if i is not None and i not in used:
                used.add(i)
                waiting += [edge.reset[i] for edge in loops]
    return frozenset(range(len(mode.states))) - used
