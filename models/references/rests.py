"""What comes after infinitely many transitions: the end of a Zeno tail, and rest."""

from __future__ import annotations

from references.interpolation import Number, Stretch, Vector

UNRESOLVED = 2.0**-51  # of the time: with less left of a tail, floats no longer tell its transitions apart


def rest(mode: str, start: Number, end: Number, x: Vector) -> Stretch:
    """Stay at x from start to end."""
    return Stretch(mode, start, end, x, x, None, lambda n: tuple(a * 0 for a in x))


def tail(mode: str, start: Number, limit: Number, first: Vector, last: Vector) -> Stretch:
    """Go straight to the limit of infinitely many transitions; off by no more than twice the way there."""
    way = tuple(abs(b - a) for a, b in zip(first, last, strict=True))
    slack = 2 * max(map(float, way))
    return Stretch(mode, start, limit, first, last, None, lambda n: tuple(a * 0 for a in way), slack=slack)
