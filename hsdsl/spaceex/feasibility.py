# pyright: basic
"""Decision whether constraints can hold together: an exact linear program, or a search where one is not affine."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from hsdsl.lint.analysis.decide import Decider
from hsdsl.lint.analysis.normal_form import NormalForms
from hsdsl.lint.analysis.question import NEVER, UNKNOWN, Answer, Constraint, SearchRange
from hsdsl.metrics.rational import ZERO, Row, about, deepest, maximise

_FORMS = NormalForms()
REACH = 100.0  # how far a search for a point of constraints that are not affine goes, in units of the model


def decide(constraints: Sequence[Constraint]) -> Answer:
    """Whether there is a point where all constraints hold; `never` is a proof over the whole space."""
    constraints = [c for c in constraints if not _holds(c)]
    names = sorted({s for c in constraints for s in c.expr.free_symbols}, key=lambda s: s.name)
    found = [_row(c.expr, names) for c in constraints]
    rows = [row for row in found if row is not None]
    if len(rows) < len(found):
        ranges = {name: SearchRange(None, None, (-REACH, REACH), 1.0) for name in names}
        answer = Decider().decide(tuple(constraints), ranges, prove=True)
        return UNKNOWN if answer.never and answer.searched else answer
    relations = [c.relation for c in constraints]
    if any(not any(n) and not _constant(v, relation) for (n, v), relation in zip(rows, relations, strict=True)):
        return NEVER
    point = _interior(*_split(rows, relations, len(names)))
    if point is None:
        return NEVER
    return Answer("somewhere", "symbolic", {name: float(v) for name, v in zip(names, point, strict=True)})


def _holds(constraint: Constraint) -> bool:
    row = _row(constraint.expr, [])
    return row is not None and _constant(row[1], constraint.relation)


def _constant(level: Fraction, relation: str) -> bool:
    return level == 0 if relation == "= 0" else level >= 0 if relation == "<= 0" else level > 0


def _row(expr: Any, names: Sequence[Any]) -> Row | None:
    """``normal . x <= level`` for an affine expression that is at most zero; None for another."""
    normal, level = [ZERO] * len(names), ZERO
    for monomial, factor in _FORMS.of(expr).terms.items():
        if not monomial:
            level -= factor
            continue
        ((atom, exponent), *others) = monomial
        if others or exponent != 1 or atom.kind != "name" or atom.head not in names:
            return None
        normal[names.index(atom.head)] += factor
    return tuple(normal), level


def _split(rows: Sequence[Row], relations: Sequence[str], size: int) -> tuple[list[Row], list[Row], int]:
    """Rows that hold weakly, and those that hold strictly; those without names do not count."""
    weak: list[Row] = []
    strict: list[Row] = []
    for (normal, level), relation in zip(rows, relations, strict=True):
        if any(normal):
            (strict if relation == "< 0" else weak).append((normal, level))
            if relation == "= 0":
                weak.append((tuple(-v for v in normal), -level))
    return weak, strict, size


def _interior(weak: list[Row], strict: list[Row], size: int) -> Sequence[Fraction] | None:
    """A point where weak rows hold, and strict ones with room to spare."""
    if not weak + strict:
        return (ZERO,) * size
    depth, point, _ = deepest(weak + strict)
    if depth < 0:
        return None
    if not strict:
        return point
    one = Fraction(1)
    wider = [((*normal, ZERO), level) for normal, level in weak]
    wider += [((*normal, about(normal)), level) for normal, level in strict]
    wider.append(((ZERO,) * size + (one,), one))
    found = maximise((ZERO,) * size + (one,), wider, (*point, ZERO))
    assert found is not None  # the last row bounds it
    return found[0][:-1] if found[0][-1] > 0 else None
