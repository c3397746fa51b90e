"""Which passage may follow which on a shortest path: the sequences that a cheaper one always replaces are left out.

Three rules, each proved from the geometry alone, whatever the ends of the path are:

1. f then g back into the mode that f left: useless where the straight way from where f is entered to where g is left is
   never longer than the way between the two on the other side. So e then e backwards goes where the reset shortens no
   length along the guard, and e backwards then e where it lengthens none.
2. a passage g that stays in its mode, after f: useless where every point at which f can leave is as near to where
   g leaves as to where g is entered.
3. such a g before h: useless where every point at which h can be entered is as near to where g is entered.
"""

from __future__ import annotations

import numpy as np

from hsdsl.metrics.geometry import Array, Passage, Space
from hsdsl.metrics.polyhedra import largest

SLACK = 1e-12


def may_follow(space: Space, first: int, second: int) -> tuple[bool, bool, bool]:
    """Which of the three rules leave the pair standing; True: nothing is known against it.

    Rule 1 takes both passages away, rule 2 the second and rule 3 the first. A path that begins in the first one's strip
    or ends in the second one's is bound to it, so the rule that takes it away must not be used (rule 1: unless one
    of the two is free, when going back out of the strip is no longer than going on and coming back).
    """
    key = ("follow", first, second)
    found: tuple[bool, bool, bool] | None = space.cache.get(key)
    if found is None:
        f, g = space.passages[first], space.passages[second]
        after = g.source != g.target or not _nearer_behind(g, f.leave, f)
        before = f.source != f.target or not _nearer_ahead(f, g.enter, g)
        found = (_worth_returning(f, g), after, before)
        space.cache[key] = found
    return found


def _worth_returning(f: Passage, g: Passage) -> bool:
    if f.source != g.target:
        return True
    if f.gate is g.gate and f.forward != g.forward:
        least, most = f.gate.stretch
        return least < 1 - SLACK if f.forward else most > 1 + SLACK
    return not _never_longer(_difference(f.enter, g.leave), _difference(f.leave, g.enter))


def _difference(one: tuple[Array, Array], other: tuple[Array, Array]) -> Array:
    """The matrix that takes (1, s, s') to the difference of two points."""
    return np.column_stack([one[0] - other[0], one[1], -other[1]])


def _never_longer(short: Array, long: Array) -> bool:
    """Whether ``|short @ u| <= |long @ u|`` for every u."""
    excess = long.T @ long - short.T @ short
    return bool(np.linalg.eigvalsh(excess)[0] >= -SLACK * (np.abs(long).max(initial=0) ** 2 + 1e-300))


def _nearer_behind(g: Passage, side: tuple[Array, Array], other: Passage) -> bool:
    """Whether ``|y - enter| >= |y - leave|`` for all y on the other passage's side and all points of g."""
    return _never_nearer(g, g.enter, g.leave, side, other)


def _nearer_ahead(f: Passage, side: tuple[Array, Array], other: Passage) -> bool:
    """Whether ``|leave - y| >= |enter - y|`` for all y on the other passage's side and all points of f."""
    return _never_nearer(f, f.leave, f.enter, side, other)


def _never_nearer(
    g: Passage, far: tuple[Array, Array], near: tuple[Array, Array], side: tuple[Array, Array], other: Passage
) -> bool:
    """Whether ``|y - far(s)| >= |y - near(s)|`` for all s in g and y in the other's side.

    Where far - near = (a s + b) w with one direction w, the difference of squares is that factor times
    ``w . (far + near - 2 y)``: it cannot be negative where both factors have one sign, two linear programs each.
    """
    base, frame = far[0] - near[0], far[1] - near[1]
    both = np.column_stack([base, frame])
    left, sizes, right = np.linalg.svd(both, full_matrices=False)
    if sizes.size == 0 or sizes[0] == 0:
        return True
    if sizes.size > 1 and sizes[1] > SLACK * sizes[0]:
        return False
    w, factor = left[:, 0], sizes[0] * right[0]
    normals, levels = g.gate.normals, g.gate.levels
    along, start = (far[1] + near[1]).T @ w, float((far[0] + near[0]) @ w)
    other_along, other_start = side[1].T @ w, float(side[0] @ w)
    tolerance = SLACK * (1 + abs(start) + abs(other_start) + abs(float(factor[0])))

    def least(sign: float) -> tuple[float, float]:
        own = largest(-sign * factor[1:], normals, levels)
        near_part = largest(-sign * along, normals, levels)
        far_part = largest(sign * 2 * other_along, other.gate.normals, other.gate.levels)
        if own is None or near_part is None or far_part is None:
            return -np.inf, -np.inf
        return sign * float(factor[0]) - own, sign * (start - 2 * other_start) - near_part - far_part

    return any(all(part >= -tolerance for part in least(sign)) for sign in (1.0, -1.0))
