"""Which passage may follow which on a shortest path: the sequences that a cheaper one always replaces are left out.

Three rules, each proved from the geometry alone, for any ends of the path:

1. f then g back into the mode that f left: useless where the straight way from where f is entered to where g is left is
   never longer than the way between the two on the other side. So e then e backwards goes where the reset shortens no
   length along the guard, and e backwards then e where it lengthens none.
2. a passage g that stays in its mode, after f: useless where every point at which f can leave is as near to where
   g leaves as to where g is entered.
3. such a g before h: useless where every point at which h can be entered is as near to where g is entered.

A fourth rule bounds runs back and forth through one gate, which could go on for ever. Moves on one side of a gate add
up, so a run longer than ``RUN`` is no shorter than two or three passages, of which the second need not keep the gate's
inequalities. That passage is written ``~i`` for passage i.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise, takewhile

import numpy as np

from hsdsl.analysis.metrics.geometry import Array, Passage, Space
from hsdsl.analysis.metrics.rational import Exact, maximise, never_negative

# A way may grow by this share where a pair is left out: far below rounding, and above what numbers that are not
# rational were rounded to.
SLACK = Fraction(1, 10**40)

SEEN = 1e-6  # relative: what is longer by so much is so in floats too

RUN = 3  # passages back and forth through one gate, one after the other


def passage_number(i: int) -> int:
    """A passage's index, of itself or of its plane."""
    return i if i >= 0 else ~i


def hops_of(sequence: Sequence[int]) -> int:
    """The fewest passages that a sequence stands for."""
    return len(sequence) + (RUN - 1) * sum(i < 0 for i in sequence)


def followers(space: Space, sequence: tuple[int, ...]) -> Iterator[int]:
    """The passages into the mode that a sequence leads to, by rule 4 alone."""
    numbers = [passage_number(i) for i in reversed(sequence)]
    turned = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1] ^ 1, pairwise(numbers)))
    mode = space.passages[numbers[0]].target
    for passage in space.passages:
        back = passage.index == numbers[0] ^ 1
        if passage.source == mode and (not back or turned < RUN - 1):
            yield passage.index
        if back and not turned and may_run(space, passage.index):
            yield ~passage.index


def may_run(space: Space, i: int) -> bool:
    """Whether a shortest path may go back and forth through a gate more often than ``RUN``."""
    key = ("run", i | 1)
    found: bool | None = space.cache.get(key)
    if found is None:
        gate = space.passages[i].gate
        found = bool(gate.normals.size) and all(may_follow(space, f, f ^ 1)[0] for f in (i, i ^ 1))
        space.cache[key] = found
    return found


def may_follow(space: Space, first: int, second: int) -> tuple[bool, bool, bool]:
    """Which of the three rules leave the pair standing; True: nothing is known against it.

    Rule 1 takes both passages away, rule 2 the second and rule 3 the first. A path that begins in the first one's strip
    or ends in the second one's is bound to it, so the rule that takes it away must not be used (rule 1: unless one
    of the two is free, when going back out of the strip is no longer than going on and coming back).
    """
    first, second = passage_number(first), passage_number(second)
    key = ("follow", first, second)
    found: tuple[bool, bool, bool] | None = space.cache.get(key)
    if found is None:
        f, g = space.passages[first], space.passages[second]
        after = g.source != g.target or not _never_nearer(g, *g.exact, f.exact[1], f)
        before = f.source != f.target or not _never_nearer(f, f.exact[1], f.exact[0], g.exact[0], g)
        found = (_worth_returning(f, g), after, before)
        space.cache[key] = found
    return found


def _worth_returning(f: Passage, g: Passage) -> bool:
    if f.source != g.target:
        return True
    short, long = _difference(f.exact[0], g.exact[1]), _difference(f.exact[1], g.exact[0])
    return _seen_longer(short.astype(float), long.astype(float)) or not _never_longer(short, long)


def _seen_longer(short: Array, long: Array) -> bool:
    """Whether ``|short @ u| > |long @ u|`` for some u by far more than rounding; most pairs need no closer look."""
    excess, size = long.T @ long - short.T @ short, np.abs(np.vstack([long, short])).max(initial=0)
    return bool(np.linalg.eigvalsh(excess)[0] < -SEEN * size**2)


def _difference(one: Exact, other: Exact) -> Exact:
    """The matrix that takes (1, s, s') to the difference of two points."""
    return np.column_stack([one[:, 0] - other[:, 0], one[:, 1:], -other[:, 1:]])


def _never_longer(short: Exact, long: Exact) -> bool:
    """Whether ``|short u| <= (1 + slack) |long u|`` for every u."""
    if ((short != 0).any(axis=0) & (long == 0).all(axis=0)).any():
        return False
    return never_negative((1 + SLACK) * (long.T @ long) - short.T @ short)


def _never_nearer(g: Passage, far: Exact, near: Exact, side: Exact, other: Passage) -> bool:
    """Whether ``|y - far(s)| >= |y - near(s)|`` for all s in g and y on the other passage's side.

    Where far - near = (a s + b) w with one direction w, the difference of squares is that factor times
    ``w . (far + near - 2 y)``: it cannot be negative where both factors have one sign, two linear programs each.
    """
    apart = far - near
    w = next((column for column in apart.T if column.any()), None)
    if w is None:
        return True
    factor = w @ apart / (w @ w)
    if (apart - np.outer(w, factor)).any():
        return False
    forms = ((factor, g), (w @ (far + near), g), (-2 * (w @ side), other))

    def one_sign(sign: int) -> bool:
        own, middle, away = (_least(sign * form, gate) for form, gate in forms)
        return own is not None and middle is not None and away is not None and own >= 0 and middle + away >= 0

    return one_sign(1) or one_sign(-1)


def _least(form: Exact, passage: Passage) -> Fraction | None:
    """The minimum of ``form . (1, s)`` over a guard, None where there is none."""
    exact = passage.gate.exact
    found = maximise(-form[1:], exact.rows, exact.inner)
    return None if found is None else form[0] + form[1:] @ found[0]
