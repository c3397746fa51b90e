# pyright: basic
"""Scalars to values: parsed, looked up, translated, with every fault at its place in the file."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

from hsdsl.base.errors import Findings
from hsdsl.base.names import shown
from hsdsl.language.expression import Expected, ExpressionError, numeric, parse, symbolic
from hsdsl.language.expression.conditions import Inequality, Trigger, equation, inequality, the_comparison, trigger_of
from hsdsl.language.expression.scope import Scope, Value
from hsdsl.language.expression.syntax import Call, Tree
from hsdsl.language.expression.timebox import Box
from hsdsl.language.source import ABSENT, Scalar, SourceRange

T = TypeVar("T")

_NOT_FINITE = (".inf", "+.inf", "-.inf", ".nan", "inf", "+inf", "-inf", "infinity", "-infinity", "nan")


def resolved_expression(text: str, scope: Scope) -> Value:
    """The value of an expression that is in no file.

    Raises ExpressionError: at its first fault.
    """
    tree = _tree(text, "number", scope)
    faults = scope.faults(tree)
    if faults:
        raise faults[0]
    return symbolic.number(tree, scope, text)


def all_of(parts: Iterable[T | None]) -> list[T] | None:
    """The parts, or None where one of them is broken and reported."""
    every = list(parts)
    whole = [part for part in every if part is not None]
    return whole if len(whole) == len(every) else None


@dataclass
class ExpressionResolver:
    """Resolver of expressions: their faults go to ``findings``, and the answer is then None.

    ``box`` bounds the time that each of them takes, and ``at`` is the one that was begun last.
    """

    findings: Findings
    box: Box | None = None
    at: Scalar | None = None

    def report(self, place: SourceRange, code: str, message: str, hint: str | None = None) -> None:
        """Report a fault at a place."""
        self.findings.add(place.diagnostic(code, message, hint))

    def number(self, scalar: Scalar, scope: Scope, finite_now: bool = False) -> Value | None:
        """The value of an expression; with ``finite_now`` it must have one with the file's own parameters."""
        value = self._built(scalar, scope, "number", lambda tree: symbolic.number(tree, scope, scalar.value))
        if value and finite_now and value.number is not None and not numeric.finite(value.number):
            message = f"`{shown(scalar.value, 40)}` has no finite real value with the parameters of this file"
            self.report(scalar.place, "HS118", message)
            return None
        return value

    def tree(self, scalar: Scalar) -> Tree | None:
        """The tree of an expression whose names are looked up later."""
        try:
            return None if scalar.value == ABSENT else parse("" if scalar.kind == "null" else scalar.value)
        except ExpressionError as error:
            self._report(scalar, error)
            return None

    def names_known(self, scalar: Scalar, tree: Tree, scope: Scope) -> bool:
        """Whether all names of an expression can be used; those that cannot are reported."""
        faults = scope.faults(tree)
        for fault in faults:
            self._report(scalar, fault)
        return not faults and not scope.broken(tree)

    def condition(self, scalar: Scalar, scope: Scope) -> Any | None:
        """The SymPy Boolean of a condition."""
        return self._built(scalar, scope, "condition", lambda tree: symbolic.condition(tree, scope, scalar.value))

    def equation(self, scalar: Scalar, scope: Scope) -> tuple[Value, Value] | None:
        """Both sides of an equation."""
        text = scalar.value
        return self._built(scalar, scope, "condition", lambda tree: equation(tree, scope, text))

    def trigger(self, scalar: Scalar, scope: Scope) -> Trigger | None:
        """The condition of an event."""
        return self._built(scalar, scope, "condition", lambda tree: trigger_of(tree, scope, scalar.value))

    def inequality(self, scalar: Scalar, scope: Scope, key: str) -> Inequality | None:
        """The two sides of one inequality."""
        text = scalar.value
        return self._built(scalar, scope, "inequality", lambda tree: inequality(tree, scope, text, key), key)

    def _built(
        self, scalar: Scalar, scope: Scope, expected: Expected, build: Callable[[Tree], T], key: str = ""
    ) -> T | None:
        """An object built of an expression; None where it has faults, which are reported."""
        try:
            tree = self._resolved(scalar, scope, expected, key)
            return build(tree) if tree else None
        except ExpressionError as error:
            self._report(scalar, error)
            return None

    def _resolved(self, scalar: Scalar, scope: Scope, expected: Expected, key: str) -> Tree | None:
        """The tree of an expression all of whose names can be used; None where one's definition is broken."""
        if scalar.value == ABSENT:
            return None
        self.at = scalar
        if self.box:
            self.box.restart()
        text = "" if scalar.kind == "null" else scalar.value.lower() if scalar.kind == "boolean" else scalar.value
        tree = _tree(text, expected, scope)
        tree = tree if scope.expanded is None else scope.expanded(tree)
        known = self.names_known(scalar, tree, scope)
        if expected == "inequality" and not (isinstance(tree, Call) and scope.faults(tree)):
            the_comparison(tree, key, text)
        return tree if known else None

    def _report(self, scalar: Scalar, error: ExpressionError) -> None:
        hint = error.hint
        if scalar.plain and scalar.value.count("(") > scalar.value.count(")") and _cut_by_comment(scalar.place):
            hint = "YAML begins a comment at ` #`: quote this expression"
        span = scalar.span(error.start, error.end)
        self.findings.add(scalar.place.text.diagnostic(error.code, error.message, span, hint))


def _tree(text: str, expected: Expected, scope: Scope) -> Tree:
    word = text.strip().lower()
    if word in _NOT_FINITE and word.lstrip("+-") not in scope.values:
        message, hint = f"`{text.strip()}` is not a finite number", "every number is finite here"
        raise ExpressionError("HS118", message, 0, len(text), hint)
    return parse(text, expected)


def _cut_by_comment(place: SourceRange) -> bool:
    line = place.text.lines[place.end[1]]
    return line[place.end[2] :].lstrip().startswith("#")
