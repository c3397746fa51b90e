# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportCallIssue=false
"""Singular parts of expressions: jumps, kinks, poles, infinite slopes, arguments without a real value; smooth pieces.

Derivatives of kinked expressions are those of one side, or of none. On a piece no abs, sign, min or max is left, and a
closed piece goes on smoothly beyond its ends. So what holds for the derivatives of every piece holds on both sides of a
kink.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import sympy as sp

from hsdsl.base import functions
from hsdsl.base.graphs import closure
from hsdsl.mathematics.decisions.decide import MOST_PARTS
from hsdsl.mathematics.decisions.dynamics import Clause, Dynamics
from hsdsl.mathematics.decisions.search import Constraint, at_most_zero, negative, positive, too_large, zero

_SMOOTH = ("sin", "cos", "tan", "atan", "sinh", "cosh", "tanh", "asinh", "exp", "log", "asin", "acos", "acosh", "atanh")
_CONTINUOUS = (  # but for the poles of `tan`, which `divisors` has
    sp.Add, sp.Mul, sp.Symbol, sp.Number, sp.NumberSymbol, sp.Abs, sp.Min, sp.Max, functions.absolute,
    functions.minimum, functions.maximum, *(functions.FUNCTIONS[name][0] for name in _SMOOTH),
)  # fmt: skip
_JUMPING = (functions.sign, functions.floor, functions.atan2)
_LEVELS = (1, 0, -1, 2)  # whole numbers that the argument of a floor is looked for at


class Part(NamedTuple):
    """A part of an expression, its name in messages, and the alternatives in which it is singular."""

    expr: Any
    name: str
    alternatives: tuple[Clause, ...]


def parts(expr: Any) -> list[Any]:
    """Every different part of an expression; none where there are too many."""
    return [] if too_large([expr], MOST_PARTS) else list(dict.fromkeys(sp.preorder_traversal(expr)))


def jumps(expr: Any) -> Iterator[Part]:
    """Jumps of signs, floors and angles, except where their factor vanishes."""
    for part in parts(expr):
        if isinstance(part, _JUMPING):
            weights = _weights(expr, part)
            for condition in _jump(part):
                yield Part(part, _name(part), tuple((*condition, w) for w in weights))


def jumps_in_time(dynamics: Dynamics, expr: Any) -> bool:
    """Whether an expression may jump at a time that no state decides."""
    timed = (part for part in parts(expr) if isinstance(part, _JUMPING) and part.free_symbols <= dynamics.timed)
    return bool(expr.free_symbols & dynamics.held) or any(timed)


def _jump(part: Any) -> list[Clause]:
    if isinstance(part, functions.floor):
        return [(zero(part.args[0] - level),) for level in _LEVELS]
    if isinstance(part, functions.atan2):
        return [(zero(part.args[0]), negative(part.args[1]))]
    return [(zero(part.args[0]),)]


@lru_cache(maxsize=5_000)
def discontinuities(expr: Any) -> tuple[Clause, ...] | None:
    """Where an expression may jump or pass a pole, as alternatives; None where that is not known."""
    found: list[Clause] = []
    for part in parts(expr):
        if isinstance(part, (functions.floor, sp.floor)):
            found.append((zero(sp.sin(sp.pi * part.args[0])),))
        elif isinstance(part, (functions.sign, sp.sign)):
            found.append((zero(part.args[0]),))
        elif isinstance(part, functions.atan2):
            found.append((zero(part.args[0]), at_most_zero(part.args[1])))
        elif not isinstance(part, _CONTINUOUS) and not part.is_Pow:
            return None
    found += [(zero(divisor),) for divisor in divisors(expr)]
    return None if too_large([expr], MOST_PARTS) else tuple(found)


@lru_cache(maxsize=5_000)
def breaks(expr: Any) -> tuple[Clause, ...] | None:
    """Where an expression without kinks may not have derivatives of every order, as alternatives."""
    jumping = discontinuities(expr)
    return None if jumping is None else (*jumping, *((zero(end),) for part in parts(expr) for end in _ends(part)))


def _ends(part: Any) -> tuple[Any, ...]:
    """What is positive inside the real domain of a root, a logarithm or an inverse function, and 0 at its end."""
    if part.is_Pow:
        return () if part.exp.is_Integer or part.base.is_number else (part.base,)
    if isinstance(part, (sp.asin, sp.acos, sp.atanh)):
        return 1 - part.args[0], 1 + part.args[0]
    if isinstance(part, sp.acosh):
        return (part.args[0] - 1,)
    return part.args if isinstance(part, sp.log) else ()


def kinks(expr: Any) -> Iterator[Part]:
    """Kinks of abs, min and max, except where their factor vanishes."""
    for part in parts(expr):
        if isinstance(part, (functions.absolute, functions.minimum, functions.maximum)):
            inside = part.args[0] if len(part.args) == 1 else part.args[0] - part.args[1]
            steep = positive(sum(inside.diff(s) ** 2 for s in inside.free_symbols))
            yield Part(part, _name(part), tuple((zero(inside), steep, w) for w in _weights(expr, part)))


def _weights(expr: Any, part: Any) -> list[Constraint]:
    """The factor that a part comes with in an expression is not zero, as two alternatives."""
    name = sp.Dummy(real=True)
    weight = expr.xreplace({part: name}).diff(name).xreplace({name: part})
    if weight.is_number:
        return [at_most_zero(sp.S.Zero)] if weight != 0 else []
    return [positive(weight), negative(weight)]


def _name(part: Any) -> str:
    return {"absolute": "abs", "minimum": "min", "maximum": "max"}.get(type(part).__name__, type(part).__name__)


def divisors(expr: Any) -> Iterator[Any]:
    for part in parts(expr):
        if part.is_Pow and part.exp.is_Rational and part.exp < 0 and not part.base.is_number:
            yield part.base
        elif isinstance(part, sp.tan):
            yield sp.cos(part.args[0])


def without_value(expr: Any) -> Iterator[Part]:
    """Where square roots, logarithms and inverse functions have no real value."""
    for part in parts(expr):
        if ends := _ends(part):
            outside = at_most_zero if isinstance(part, sp.log) else negative
            name = _label(part, "a power that is no whole number")
            yield Part(part.args[0], name, tuple((outside(end),) for end in ends))


def infinite_slopes(expr: Any) -> Iterator[Part]:
    """Infinite slopes of roots and inverse functions, except where their factor vanishes."""
    for part in parts(expr):
        steep = part.is_Pow and part.exp.is_Rational and 0 < part.exp < 1
        if (steep or isinstance(part, (sp.asin, sp.acos, sp.acosh))) and (ends := _ends(part)):
            alternatives = tuple((zero(end), weight) for end in ends for weight in _weights(expr, part))
            yield Part(part.args[0], _label(part, "a fractional power"), alternatives)


def _label(part: Any, power: str) -> str:
    if part.is_Pow:
        return "a square root" if abs(part.exp) == sp.Rational(1, 2) else power
    return "a logarithm" if isinstance(part, sp.log) else f"`{_name(part)}`"


MOST = 32
_SIGNS = (functions.sign, sp.sign)
_SIZES = (functions.absolute, sp.Abs)
_LEAST, _LARGEST = (functions.minimum, sp.Min), (functions.maximum, sp.Max)
KINKED = (*_SIGNS, *_SIZES, *_LEAST, *_LARGEST)


@dataclass(frozen=True)
class SmoothPiece:
    """A part of the states and times, with the surface function and the flow there.

    There no ``sides`` are negative, and ``zeros`` vanish: with any the piece has no inside. The flow is that of the
    states that the surface function depends on in the course of time.
    """

    sides: tuple[Any, ...]
    zeros: tuple[Any, ...]
    residual: Any
    flow: Mapping[Any, Any]

    @property
    def closed(self) -> tuple[Constraint, ...]:
        """The piece with its ends."""
        return (*(at_most_zero(-side) for side in self.sides), *map(zero, self.zeros))

    @property
    def inside(self) -> tuple[Constraint, ...]:
        """The piece without its ends."""
        return (*(negative(-side) for side in self.sides), *map(zero, self.zeros))

    def split(self, kink: Any) -> Iterator[SmoothPiece]:
        """The pieces on both sides of a kink, and that of a sign's zero."""
        first = kink.args[0]
        rest = kink.func(*kink.args[1:]) if len(kink.args) > 2 else kink.args[-1]
        if isinstance(kink, _SIGNS):
            yield self._where(first, kink, sp.S.One)
            yield self._where(-first, kink, sp.S.NegativeOne)
            yield self._where(None, kink, sp.S.Zero)
        elif isinstance(kink, _SIZES):
            yield self._where(first, kink, first)
            yield self._where(-first, kink, -first)
        else:
            larger, smaller = (first, rest) if isinstance(kink, _LARGEST) else (rest, first)
            yield self._where(first - rest, kink, larger)
            yield self._where(rest - first, kink, smaller)

    def _where(self, side: Any, kink: Any, value: Any) -> SmoothPiece:
        def replaced(expr: Any) -> Any:
            return expr.xreplace({kink: value})

        sides = (*map(replaced, self.sides), *([] if side is None else [side]))
        zeros = (*map(replaced, self.zeros), *([kink.args[0]] if side is None else []))
        return SmoothPiece(sides, zeros, replaced(self.residual), {s: replaced(f) for s, f in self.flow.items()})


def pieces(residual: Any, flow: Mapping[Any, Any]) -> list[SmoothPiece] | None:
    """The pieces of a surface function and of the flows that it depends on; None where they are too many."""
    waiting, done = [SmoothPiece((), (), residual, influencing(residual, flow))], []
    while waiting:
        piece = waiting.pop(0)
        kink = _innermost((piece.residual, *piece.flow.values()))
        if kink is None:
            done.append(piece)
        else:
            waiting += piece.split(kink)
        if len(waiting) + len(done) > MOST:
            return None
    return done


def influencing(expr: Any, flow: Mapping[Any, Any]) -> dict[Any, Any]:
    """The flows that an expression depends on in the course of time."""
    reached = closure(expr.free_symbols & flow.keys(), lambda s: flow[s].free_symbols & flow.keys())
    return {s: f for s, f in flow.items() if s in reached}


def _innermost(exprs: tuple[Any, ...]) -> Any | None:
    for expr in exprs:
        for part in sp.postorder_traversal(expr) if expr.has(*KINKED) else ():
            if isinstance(part, KINKED):
                return part
    return None
