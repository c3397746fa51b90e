# pyright: basic
"""Expressions as content MathML, in the words that SBML has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import sympy as sp

from hsdsl.base import functions
from hsdsl.base.errors import UsageError
from hsdsl.language.expression.conditions import Joined, Reached, Trigger
from hsdsl.language.system import TIME

SPACE = "http://www.w3.org/1998/Math/MathML"
TIME_URL = "http://www.sbml.org/sbml/symbols/time"
MOST_DIGITS = 15  # of a numerator or a denominator: a float has no more
_WORDS = {
    **{sp.Add: "plus", sp.Mul: "times", sp.Pow: "power", sp.And: "and", sp.Or: "or", sp.Not: "not", sp.Xor: "xor"},
    **{sp.Gt: "gt", sp.Ge: "geq", sp.Lt: "lt", sp.Le: "leq", sp.Eq: "eq", sp.Ne: "neq"},
    **{sp.sin: "sin", sp.cos: "cos", sp.tan: "tan", sp.exp: "exp", sp.log: "ln"},
    **{sp.asin: "arcsin", sp.acos: "arccos", sp.atan: "arctan"},
    **{sp.asinh: "arcsinh", sp.acosh: "arccosh", sp.atanh: "arctanh"},
    **{functions.sinh: "sinh", functions.cosh: "cosh", functions.tanh: "tanh"},
    **{functions.absolute: "abs", functions.floor: "floor", functions.maximum: "max", functions.minimum: "min"},
}
_CONSTANTS = {sp.pi: "pi", sp.E: "exponentiale", sp.true: "true", sp.false: "false"}


class MathML:
    """Writes expressions whose symbols have identifiers."""

    def __init__(self, identifiers: Mapping[str, str]) -> None:
        self.identifiers = identifiers

    def math(self, expression: Any) -> Element:
        """The element `math` of an expression, a condition or a trigger."""
        whole = Element("math", xmlns=SPACE)
        whole.append(self.node(expression))
        return whole

    def node(self, expression: Any) -> Element:
        """The element of an expression.

        Raises UsageError: a function that SBML does not have.
        """
        if expression in _CONSTANTS:
            return Element(_CONSTANTS[expression])
        if expression == TIME:
            return _leaf("csymbol", "time", encoding="text", definitionURL=TIME_URL)
        if expression.is_Symbol:
            return _leaf("ci", self.identifiers[expression.name])
        if expression.is_Number:
            if expression.is_Integer and len(str(expression)) <= MOST_DIGITS:
                return _leaf("cn", str(expression), type="integer")
            if expression.is_Rational and max(len(str(expression.p)), len(str(expression.q))) <= MOST_DIGITS:
                node = _leaf("cn", str(expression.p), type="rational")
                SubElement(node, "sep").tail = str(expression.q)
                return node
            return _leaf("cn", repr(float(expression)))
        if isinstance(expression, functions.sign):
            return self.node(sp.Piecewise(*_signs(expression.args[0])))
        if isinstance(expression, functions.below):
            number, bound, one, other = expression.args
            return self.cases([(one, sp.Lt(number, bound))], other)
        if isinstance(expression, sp.Piecewise):
            pieces: list[Any] = [tuple(piece.args) for piece in expression.args]
            return self.cases(pieces[:-1], pieces[-1][0]) if pieces[-1][1] == sp.true else self.cases(pieces, None)
        if (word := _WORDS.get(type(expression))) is None:
            raise UsageError(f"SBML has no `{expression.func.__name__}`", "write it with the functions of SBML")
        return _apply(word, *map(self.node, expression.args))

    def cases(self, pieces: Any, other: Any) -> Element:
        """A value for each condition, and another one."""
        whole = Element("piecewise")
        for value, condition in pieces:
            SubElement(whole, "piece").extend([self.node(value), self.node(condition)])
        if other is not None:
            SubElement(whole, "otherwise").append(self.node(other))
        return whole


def condition(trigger: Trigger) -> Any:
    """The Boolean of the condition of an event."""
    if isinstance(trigger, Joined):
        return (sp.And if trigger.word == "and" else sp.Or)(*map(condition, trigger.parts))
    if isinstance(trigger, Reached):
        return (sp.Gt if trigger.strict else sp.Ge)(trigger.residual, 0)
    return sp.true if trigger else sp.false


def _signs(number: Any) -> list[tuple[Any, Any]]:
    return [(sp.S.One, sp.Gt(number, 0)), (sp.S.NegativeOne, sp.Lt(number, 0)), (sp.S.Zero, sp.true)]


def _apply(word: str, *arguments: Element) -> Element:
    node = Element("apply")
    node.append(Element(word))
    node.extend(arguments)
    return node


def _leaf(tag: str, text: str, **attributes: str) -> Element:
    node = Element(tag, attributes)
    node.text = text
    return node
