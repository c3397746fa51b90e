# pyright: basic
"""Whether there is a point where constraints hold: exact linear programs, and a search where some are not affine."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np

from hsdsl.base.numbers.rational import Exact, about, axes, deepest, matrix, maximise, zeros
from hsdsl.mathematics.decisions.decide import Decider
from hsdsl.mathematics.decisions.polynomial import NormalForms
from hsdsl.mathematics.decisions.search import NEVER, UNKNOWN, Answer, Constraint, SearchRange

_FORMS = NormalForms()
REACH = 100.0  # how far a search for a point of constraints that are not affine goes, in units of the model


def decide(constraints: Sequence[Constraint]) -> Answer:
    """Whether there is a point where all constraints hold; `never` is a proof over the whole space.

    Constraints that share no names, as those of several instances, are decided apart.
    """
    answers = [_decided(tuple(part)) for part in _apart([c for c in constraints if not _holds(c)])]
    if any(answer.never for answer in answers):
        return NEVER
    if not all(answer.somewhere for answer in answers):
        return UNKNOWN
    point = {name: number for answer in answers for name, number in answer.point.items()}
    return Answer("somewhere", "symbolic", dict(sorted(point.items(), key=lambda item: item[0].name)))


def _apart(constraints: Sequence[Constraint]) -> list[list[Constraint]]:
    """Constraints by the names that they share."""
    groups: list[tuple[set[Any], list[Constraint]]] = []
    for constraint in constraints:
        names, held = set(constraint.expr.free_symbols), [constraint]
        for group in [group for group in groups if group[0] & names]:
            groups.remove(group)
            names, held = names | group[0], group[1] + held
        groups.append((names, held))
    return [held for _, held in groups]


@lru_cache(10_000)
def _decided(constraints: tuple[Constraint, ...]) -> Answer:
    names = sorted({s for c in constraints for s in c.expr.free_symbols}, key=lambda s: s.name)
    found = [_row(c.expr, names) for c in constraints]
    rows = [row for row in found if row is not None]
    if len(rows) < len(found):
        ranges = {name: SearchRange(None, None, (-REACH, REACH), 1.0) for name in names}
        answer = Decider().decide(constraints, ranges, prove=True)
        return UNKNOWN if answer.never and answer.searched else answer
    relations = [c.relation for c in constraints]
    if any(
        not row[1:].any() and not _constant(row[0], relation) for row, relation in zip(rows, relations, strict=True)
    ):
        return NEVER
    size = len(names)
    pairs = [(row, relation) for row, relation in zip(rows, relations, strict=True) if row[1:].any()]
    weak = [sign * row for row, relation in pairs if relation != "< 0" for sign in (1, -1)[: 1 + (relation == "= 0")]]
    point = _interior(matrix(weak, 1 + size), matrix((row for row, relation in pairs if relation == "< 0"), 1 + size))
    if point is None:
        return NEVER
    return Answer("somewhere", "symbolic", {name: float(v) for name, v in zip(names, point, strict=True)})


@lru_cache(10_000)
def _holds(constraint: Constraint) -> bool:
    row = _row(constraint.expr, [])
    return row is not None and _constant(row[0], constraint.relation)


def _constant(value: Fraction, relation: str) -> bool:
    return value == 0 if relation == "= 0" else value <= 0 if relation == "<= 0" else value < 0


def _row(expr: Any, names: Sequence[Any]) -> Exact | None:
    """An affine expression as its constant and its slopes; None for another."""
    row = zeros(1 + len(names))
    for monomial, factor in _FORMS.of(expr).terms.items():
        if not monomial:
            row[0] += factor
            continue
        ((atom, exponent), *others) = monomial
        if others or exponent != 1 or atom.kind != "name" or atom.head not in names:
            return None
        row[1 + names.index(atom.head)] += factor
    return row


def _interior(weak: Exact, strict: Exact) -> Exact | None:
    """A point where weak rows hold, and strict ones with room to spare."""
    size = weak.shape[1] - 1
    if not len(weak) + len(strict):
        return zeros(size)
    depth, point, _ = deepest(np.vstack([weak, strict]))
    if depth < 0:
        return None
    if not len(strict):
        return point
    goal = axes(size + 1)[-1]
    lengths = np.array([about(row[1:]) for row in strict], dtype=object)
    wider = [np.column_stack([weak, zeros(len(weak))]), np.column_stack([strict, lengths])]
    wider.append(np.append(np.array([Fraction(-1)], dtype=object), goal)[None])
    found = maximise(goal, np.vstack(wider), np.append(point, zeros(1)))
    assert found is not None  # the last row bounds it
    return found[0][:-1] if found[0][-1] > 0 else None
