# pyright: basic, reportOperatorIssue=false
"""Inequalities of guards and walls, and the conditions of events.

A condition of an event is comparisons with their surfaces, joined by `and` and `or`; `not` is moved into comparisons.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import sympy as sp

from hsdsl.base.functions import absolute, below
from hsdsl.base.names import shown
from hsdsl.language.expression import symbolic
from hsdsl.language.expression.algebra import either
from hsdsl.language.expression.parse import Comparison, ExpressionError, Logic, Tree, Truth
from hsdsl.language.expression.scope import Scope, Value


def inequality(tree: Tree, scope: Scope, text: str, key: str) -> tuple[Value, str, Value]:
    """The two sides of an inequality whose names the scope has, and its sign between them.

    Raises ExpressionError: as `symbolic.number`, and where there is no inequality or more than one.
    """
    comparison = the_comparison(tree, key, text)
    left, right = (symbolic.number(side, scope, text) for side in comparison.operands)
    return left, comparison.operators[0], right


def equation(tree: Tree, scope: Scope, text: str) -> tuple[Value, Value]:
    """The two sides of an equation whose names the scope has.

    Raises ExpressionError: as `symbolic.number`, and where there is no single equation.
    """
    if not (isinstance(tree, Comparison) and tree.operators == ("==",)):
        raise ExpressionError("HS325", "expected one equation", tree.start, tree.end, "write it as left == right")
    left, right = (symbolic.number(side, scope, text) for side in tree.operands)
    return left, right


def the_comparison(tree: Tree, key: str, text: str) -> Comparison:
    """The tree, if it is exactly one inequality.

    Raises ExpressionError: otherwise, with what to write under ``key``.
    """
    if isinstance(tree, Logic) or (isinstance(tree, Comparison) and len(tree.operands) > 2):
        message = f"`{key}` takes one inequality"
        raise ExpressionError("HS116", message, tree.start, tree.end, _apart(tree, key, text))
    if not isinstance(tree, Comparison):
        message = f"`{key}` takes an inequality, and this is not one"
        hint = "write it as left >= right" + ("" if isinstance(tree, Truth) else f": {_said(tree, text)} >= 0")
        raise ExpressionError("HS116", message, tree.start, tree.end, hint)
    operator = tree.operators[0]
    if operator in ("==", "!="):
        message = f"`{key}` takes an inequality, not `{operator}`"
        left, right = (_said(side, text) for side in tree.operands)
        hint = f"write {left} >= {right} or {left} <= {right}, whichever is true where the mode "
        hint += "ends" if key == "when" else "may be"
        raise ExpressionError("HS107", message, tree.start, tree.end, hint)
    return tree


def _apart(tree: Tree, key: str, text: str) -> str:
    """The hint for several inequalities in one."""
    if key != "when":
        return "write each inequality as an item of its own"
    event = f"write event: {_said(tree, text)}, which is made where that turns true"
    if (
        not isinstance(tree, Logic)
        or tree.operator == "not"
        or not all(isinstance(o, Comparison) for o in tree.operands)
    ):
        return event
    if tree.operator == "or":
        return "write a transition for each: " + "; ".join(f"when: {_said(o, text)}" for o in tree.operands)
    first, *others = (_said(operand, text) for operand in tree.operands)
    return f"{event}; `when: {first}` with `if: {' and '.join(others)}` reads the `if` only where the first is crossed"


def _said(tree: Tree, text: str) -> str:
    return shown(text[tree.start : tree.end], 40)


_OPPOSITE = {">": "<=", ">=": "<", "<": ">=", "<=": ">"}
# within this share of its sides a comparison that is reached together with another one counts as reached:
# 32 units of round-off of 64-bit floats, as for surfaces
_NEAR = sp.Rational(1, 2**48)


@dataclass(frozen=True)
class Reached:
    """A comparison: its surface function ``residual`` = left - right rises through 0 where it turns true."""

    left: Any
    right: Any
    residual: Any
    strict: bool
    text: str
    opposite: str

    @property
    def _margin(self) -> Any:
        """The round-off of its surface function."""
        return _NEAR * (absolute(self.left) + absolute(self.right))

    def holds(self, meaning: Mapping[Any, Any]) -> Any:
        """1 where it holds at values of its symbols, 0 elsewhere; at round-off of its surface if it is not strict."""
        margin = -2 * self._margin if self.strict else 2 * self._margin  # that of the crossing before, too
        value = (self.residual + margin).xreplace(meaning)
        return _positive(value) if self.strict else _not_negative(value)

    def nearly_holds(self, rate: Any, time: Any) -> Any:
        """1 where it holds, or counts as reached; 0 elsewhere."""
        return _not_negative(self.residual + 2 * self._reach(rate, time))

    def _reach(self, rate: Any, time: Any) -> Any:
        """The round-off of its surface function where a surface is crossed: the time has some, too."""
        return self._margin + _NEAR * absolute(rate * time)

    def follows(self, rate: Any, time: Any) -> Any:
        """The Boolean that it holds next along the flow, which changes its surface function at a rate, at a time."""
        rises = sp.Gt(rate, 0) if self.strict else sp.Ge(rate, 0)
        margin = self._reach(rate, time)
        return sp.Or(sp.Gt(self.residual, margin), sp.And(sp.Ge(self.residual, -margin), rises))

    def crosses(self, rate: Any, time: Any) -> Any:
        """1 where it holds, or counts as reached, and rises; 0 elsewhere."""
        return self.nearly_holds(rate, time) * _positive(rate)

    def goes_on(self, rate: Any, time: Any) -> Any:
        """1 where it holds beyond round-off, or is on its surface and holds next; 0 elsewhere."""
        beyond = _positive(self.residual - self._reach(rate, time))
        keeps = self.crosses(rate, time) if self.strict else self.nearly_holds(rate, time) * _not_negative(rate)
        return either([beyond, keeps])

    def holds_next(self, turned: bool, before: Any, after: Any) -> Any:
        """1 where it holds next along the flow on its surface, where it has just turned true or false; 0 elsewhere.

        A reset turns the flow back also where flights are too short to be resolved, and the flow before leads inwards.
        """
        if turned:
            return _not_negative(after) * (1 - _positive(-before) * _positive(after))
        return _positive(after) if self.strict else _not_negative(after)

    def turns(self, other: Reached | None) -> bool | None:
        """Whether it turns true where another one does, or false; None where their surfaces are not the same."""
        if other is None:
            return None
        own, others = self.residual.primitive()[1], other.residual.primitive()[1]
        return own == others if own in (others, -others) else None


def _positive(value: Any) -> Any:
    """1 where a number is positive, 0 elsewhere: a truth of an instant, which has no switches of time."""
    return below(-value, sp.S.Zero, sp.S.One, sp.S.Zero)


def _not_negative(value: Any) -> Any:
    """1 where a number is not negative, 0 elsewhere."""
    return below(value, sp.S.Zero, sp.S.Zero, sp.S.One)


def without_roundoff(expression: Any) -> Any:
    """An expression without the round-off that conditions of events allow for: it depends on time where they do."""
    noise = {
        part: sp.S.Zero
        for part in sp.preorder_traversal(expression)
        if part.is_Mul and sp.Abs(part.args[0]) in (_NEAR, 2 * _NEAR) and part.atoms(absolute)
    }
    return expression.xreplace(noise) if noise else expression


def reached(left: Any, right: Any) -> Any:
    """1 where one number is not below another one but by round-off; 0 elsewhere."""
    return Reached(left, right, left - right, False, "", "").holds({})


class Joined(NamedTuple):
    """Parts joined by `and` or by `or`."""

    word: Literal["and", "or"]
    parts: tuple[Trigger, ...]


Trigger = Reached | Joined | bool


def trigger_of(tree: Tree, scope: Scope, text: str, positive: bool = True) -> Trigger:
    """The trigger of a condition; with ``positive`` false, of its opposite.

    Raises ExpressionError: a number in place of a condition, `==` or `!=`, and as `symbolic.number`.
    """
    match tree:
        case Truth():
            return tree.value == positive
        case Logic("not", (operand,)):
            return trigger_of(operand, scope, text, not positive)
        case Logic():
            word = "and" if (tree.operator == "and") == positive else "or"
            return Joined(word, tuple(trigger_of(part, scope, text, positive) for part in tree.operands))
        case Comparison():
            pairs = zip(tree.operators, tree.operands, tree.operands[1:], strict=False)
            parts = tuple(_reached(tree, *pair, scope, text, positive) for pair in pairs)
            return parts[0] if len(parts) == 1 else Joined("and" if positive else "or", parts)
    message = f"expected a condition, got the number `{shown(text[tree.start : tree.end], 40)}`"
    raise ExpressionError("HS115", message, tree.start, tree.end, "compare it with something, as x > 0")


def _reached(tree: Tree, operator: str, left: Tree, right: Tree, scope: Scope, text: str, positive: bool) -> Reached:
    if operator not in _OPPOSITE:
        message = f"`event` takes inequalities, not `{operator}`"
        a, b = (shown(text[side.start : side.end], 40) for side in (left, right))
        hint = f"write {a} >= {b} for where it rises, or {a} <= {b} for where it falls; for both, an event each"
        hint = f"write {a} > {b} or {a} < {b}" if operator == "!=" else hint
        raise ExpressionError("HS107", message, tree.start, tree.end, hint)
    a, b = symbolic.number(left, scope, text).expr, symbolic.number(right, scope, text).expr
    own, other = text[left.start : left.end], text[right.start : right.end]
    operator = operator if positive else _OPPOSITE[operator]
    if operator in ("<", "<="):
        a, b = b, a
    return Reached(a, b, a - b, operator in "><", f"{own} {operator} {other}", f"{own} {_OPPOSITE[operator]} {other}")


def comparisons(trigger: Trigger) -> tuple[Reached, ...]:
    """Its comparisons, each surface once."""
    found: dict[Any, Reached] = {}
    for part in _parts(trigger):
        found.setdefault(part.residual, part)
    return tuple(found.values())


def _parts(trigger: Trigger) -> Iterator[Reached]:
    if isinstance(trigger, Joined):
        for part in trigger.parts:
            yield from _parts(part)
    elif isinstance(trigger, Reached):
        yield trigger


def condition(trigger: Trigger, of: Callable[[Reached], Any]) -> Any:
    """The Boolean of a trigger, with that of each comparison."""
    if isinstance(trigger, Joined):
        return (sp.And if trigger.word == "and" else sp.Or)(*(condition(part, of) for part in trigger.parts))
    return of(trigger) if isinstance(trigger, Reached) else sp.true if trigger else sp.false


def number(trigger: Trigger, of: Callable[[Reached], Any]) -> Any:
    """1 where a trigger holds and 0 elsewhere, from that of each comparison."""
    if isinstance(trigger, Joined):
        values = [number(part, of) for part in trigger.parts]
        return sp.Mul(*values) if trigger.word == "and" else either(values)
    return of(trigger) if isinstance(trigger, Reached) else sp.Integer(int(trigger))
