# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportReturnType=false
"""Branches of resets with kinks: what a reset is for ever slower impacts on a guard (M11).

Impacts come from one side: the rate of the guard is positive there (M2). Where that decides the sign of what is zero at
rest, as of v in `abs(v)`, the reset has one branch there, and motion along the guard follows from that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile

import sympy as sp

from hsdsl.base.functions import absolute, maximum, minimum, power, rewritten, sign
from hsdsl.language.system import TIME
from hsdsl.mathematics.completion.nearby import Nearby, Point, as_float, drawn, size_at, solved, value_at

KINKED = (absolute, maximum, minimum, sign)
SPEEDS = (1e-6, 1e-9, 1e-12)  # of the rate of the guard: impacts that are looked at
SEEDS = range(1, 9)  # of points where they are


class Undecided(Exception):
    """The side from which impacts come does not decide a sign."""


def branched(near: Nearby) -> Nearby | None:
    """What a motion depends on, with the branch of the reset that impacts take; None where they take no one branch."""
    if not near.moved.has(*KINKED) and not any(map(_is_root, near.moved.atoms(sp.Pow))):
        return near
    impacts = [points for seed in SEEDS if len(points := _impacts(near, seed)) == len(SPEEDS)]
    if not impacts:
        return near
    branch = _Branch(near, impacts)
    try:
        reset = tuple(branch.of(r) if i in near.changed else r for i, r in enumerate(near.edge.reset))
    except Undecided:
        return None
    if reset == near.edge.reset:
        return near
    return near.by(replace(near.edge, reset=reset), impacts[0][0])


def _impacts(near: Nearby, seed: int) -> list[Point]:
    """Ever slower impacts at random points of a guard; fewer than speeds where none is found at one of them."""
    return list(takewhile(bool, (_impact(near, speed, seed) for speed in SPEEDS)))


def _impact(near: Nearby, speed: float, seed: int) -> Point | None:
    """A random point of a guard that is reached at a speed; at any where the rate of the guard is a constant."""
    rate = near.along(near.guard)
    free = [x for x in near.among(sp.Tuple(near.guard, rate)) if x != TIME]
    at = drawn((near.guard, rate, *near.moved, *near.flows()), seed, {*near.states, TIME})
    found = solved([near.guard, rate - as_float(speed * size_at(rate, at))], free, at)
    return found if found and value_at(rate, found) > 0 else None


def _is_root(power: sp.Pow) -> bool:
    return not power.exp.is_Integer and bool(power.base.free_symbols)


@dataclass
class _Branch:
    """A branch of expressions, by series of ever slower impacts."""

    near: Nearby
    impacts: Sequence[Sequence[Point]]
    done: dict[sp.Basic, sp.Basic] = field(default_factory=dict[sp.Basic, sp.Basic])

    def of(self, expr: sp.Basic) -> sp.Basic:
        """The branch of an expression."""
        return rewritten(expr, self._chosen, self.done)

    def _chosen(self, expr: sp.Basic) -> sp.Basic:
        if isinstance(expr, (sign, absolute)) and (side := self._side(expr.args[0])):
            return side * (expr.args[0] if isinstance(expr, absolute) else sp.S.One)
        if isinstance(expr, (maximum, minimum)) and (side := self._side(expr.args[0] - expr.args[1])):
            return expr.args[0 if (side > 0) == isinstance(expr, maximum) else 1]
        if expr.is_Pow and _is_root(expr):
            return self._power(*expr.args)
        return expr

    def _power(self, base: sp.Expr, exponent: sp.Expr) -> sp.Expr:
        """A power; of what is zero at rest it is that to the first order."""
        if base.is_Pow and base.exp.is_Integer and base.exp % 2 == 0 and (side := self._side(base.base)):
            base, exponent = side * base.base, base.exp * exponent
        if exponent == 1 or not self._vanishes(base):
            return power(base, exponent)
        if exponent.is_number and exponent > 1:
            return sp.S.Zero
        raise Undecided

    def _vanishes(self, value: sp.Expr) -> bool:
        """Whether a value is zero at rest."""
        return all(abs(value_at(value, at[-1])) <= abs(value_at(value, at[0])) / 2 for at in self.impacts)

    def _side(self, value: sp.Expr) -> int:
        """The sign of a value before slow impacts; 0 where it has either, and is not zero at rest."""
        if not self.near.among(value):
            return 0
        found = [[value_at(value, at) for at in points] for points in self.impacts]
        signs = {(number > 0) - (number < 0) for values in found for number in values}
        if len(signs) == 1 and signs != {0}:
            return signs.pop()
        if any(abs(values[-1]) <= abs(values[0]) / 2 for values in found):
            raise Undecided
        return 0
