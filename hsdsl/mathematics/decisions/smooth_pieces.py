# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportCallIssue=false
"""A surface function and the flows it depends on, piece by piece: on a piece no abs, sign, min or max is left.

Derivatives of kinked expressions are those of one side, or of none. On a closed piece the function goes on smoothly
beyond its ends. So what holds for the derivatives of every piece holds on both sides of a kink.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import sympy as sp

from hsdsl.base import functions
from hsdsl.base.graphs import closure
from hsdsl.mathematics.decisions.question import Constraint, at_most_zero, negative, zero

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
