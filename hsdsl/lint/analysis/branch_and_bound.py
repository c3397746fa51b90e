"""Third step of a decision: proof that there is no point, by branch and bound with interval arithmetic.

A box where the bounds of some constraint exclude it is thrown away, every other is halved. When none is left, there is
no point; when the boxes get too many, nothing is known.
"""

from __future__ import annotations

import numpy as np

from hsdsl.lint.analysis.question import Relation
from hsdsl.lint.analysis.straight_line_program import Array, StraightLine

BATCH = 512
MOST_BOXES = 30_000
_SMALLEST = 2.0**-40


def excluded(
    program: StraightLine, relations: tuple[Relation, ...], low: Array, high: Array, most: int = MOST_BOXES
) -> bool:
    """Whether no point of a box satisfies all constraints, after at most so many boxes.

    ``program`` has their expressions, ``relations`` what each has to be; ``low`` and ``high`` (names) are the box.
    """
    whole = np.maximum(high - low, 1e-300)
    lows, highs = low[None], high[None]
    seen = 0
    while len(lows):
        seen += len(lows[-BATCH:])
        if seen > most:
            return False
        first, last = lows[-BATCH:], highs[-BATCH:]
        left = _possible(program, relations, first, last)
        first, last = first[left], last[left]
        widths = (last - first) / whole
        if len(first) and (not first.shape[1] or widths.max(axis=1).min() < _SMALLEST):
            return False
        halves = _halved(first, last, widths)
        lows, highs = (np.concatenate([kept[:-BATCH], new]) for kept, new in ((lows, halves[0]), (highs, halves[1])))
    return True


def _possible(program: StraightLine, relations: tuple[Relation, ...], low: Array, high: Array) -> Array:
    bounds = program.over(low, high)
    possible = np.ones(len(low), dtype=bool)
    for least, most, relation in zip(bounds.low, bounds.high, relations, strict=True):
        if relation == "= 0":
            possible &= (least <= 0) & (most >= 0)
        else:
            possible &= (least <= 0) if relation == "<= 0" else (least < 0)
    return possible


def _halved(low: Array, high: Array, widths: Array) -> tuple[Array, Array]:
    if not len(low):
        return low, high
    rows, widest = np.arange(len(low)), widths.argmax(axis=1)
    middle = (low[rows, widest] + high[rows, widest]) / 2
    left_high, right_low = high.copy(), low.copy()
    left_high[rows, widest] = middle
    right_low[rows, widest] = middle
    return np.concatenate([low, right_low]), np.concatenate([left_high, high])
