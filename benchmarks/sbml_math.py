# pyright: basic
"""Formulas of SBML as text of the language: libSBML's trees of MathML, written out with all their parentheses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import libsbml

Node = libsbml.ASTNode

AVOGADRO = "6.02214179e23"  # the value that SBML Level 3 gives it
_SAME = ["sin", "cos", "tan", "sinh", "cosh", "tanh", "abs", "exp", "floor"]
_SAME += ["arcsin", "arccos", "arctan", "arcsinh", "arccosh", "arctanh"]
_INVERSES = {"sec": "cos", "csc": "sin", "cot": "tan"}
_FUNCTIONS = {
    **{getattr(libsbml, f"AST_FUNCTION_{name.upper()}"): f"{name.replace('arc', 'a')}({{}})" for name in _SAME},
    libsbml.AST_FUNCTION_LN: "log({})",
    libsbml.AST_FUNCTION_CEILING: "(-floor(-{}))",
    **{
        getattr(libsbml, f"AST_FUNCTION_{name.upper()}{kind}"): f"(1/{function}{kind.lower()}({{}}))"
        for name, function in _INVERSES.items()
        for kind in ("", "H")
    },
    **{
        getattr(libsbml, f"AST_FUNCTION_ARC{name.upper()}{kind}"): f"a{function}{kind.lower()}(1/{{}})"
        for name, function in _INVERSES.items()
        for kind in ("", "H")
    },
}
_COMPARISONS = {
    libsbml.AST_RELATIONAL_GT: ">",
    libsbml.AST_RELATIONAL_GEQ: ">=",
    libsbml.AST_RELATIONAL_LT: "<",
    libsbml.AST_RELATIONAL_LEQ: "<=",
    libsbml.AST_RELATIONAL_EQ: "==",
    libsbml.AST_RELATIONAL_NEQ: "!=",
}
_OPPOSITE = {">": "<=", ">=": "<", "<": ">=", "<=": ">", "==": "!=", "!=": "=="}
# 1 where the sign of left - right says that the comparison holds
_INDICATOR = {
    ">": "max(0, sign({0} - {1}))",
    ">=": "min(1, 1 + sign({0} - {1}))",
    "<": "max(0, sign({1} - {0}))",
    "<=": "min(1, 1 + sign({1} - {0}))",
    "==": "(1 - abs(sign({0} - {1})))",
    "!=": "abs(sign({0} - {1}))",
}


class NotExpressible(Exception):
    """A feature of SBML that the language has no words for; the message is its name."""


def children(node: Node) -> list[Node]:
    """The arguments of a node."""
    return [node.getChild(i) for i in range(node.getNumChildren())]


def instant(conditions: Writer, node: Node) -> str:
    """The number of a condition where it is evaluated once, as in initial values."""
    return conditions.indicator(node)


@dataclass(frozen=True)
class Writer:
    """How formulas are written: the text of names, of rates of change, and the number (0 or 1) of a condition."""

    name: Callable[[str], str]
    rate: Callable[[str], str]
    chooses: Callable[[Writer, Node], str] = instant
    time: str = "t"

    def number(self, node: Node) -> str:
        """The text of a number; that of a condition is 0 or 1."""
        kind, arguments = node.getType(), children(node)
        if node.isLogical() or node.isRelational() or kind in (libsbml.AST_CONSTANT_TRUE, libsbml.AST_CONSTANT_FALSE):
            return self.chooses(self, node)
        if not arguments and node.isNumber():
            return _constant(node)
        if kind in _FUNCTIONS:
            return _FUNCTIONS[kind].format(self.number(arguments[0]))
        special = _SPECIAL.get(kind)
        if special is None:
            raise NotExpressible(f"formula {libsbml.formulaToL3String(node) or kind}")
        return special(self, node, arguments)

    def condition(self, node: Node, positive: bool = True) -> str:
        """The text of a condition, or of its opposite."""
        kind, parts = node.getType(), children(node)
        if kind in (libsbml.AST_CONSTANT_TRUE, libsbml.AST_CONSTANT_FALSE):
            return "true" if (kind == libsbml.AST_CONSTANT_TRUE) == positive else "false"
        if kind in _COMPARISONS:
            pairs = list(pairwise(parts))
            signs = [_COMPARISONS[kind] if positive else _OPPOSITE[_COMPARISONS[kind]]] * len(pairs)
            texts = [self._comparison(sign, *pair) for sign, pair in zip(signs, pairs, strict=True)]
            return _joined("and" if positive else "or", texts)
        if kind == libsbml.AST_LOGICAL_NOT:
            return self.condition(parts[0], not positive)
        if kind in (libsbml.AST_LOGICAL_AND, libsbml.AST_LOGICAL_OR):
            word = "and" if (kind == libsbml.AST_LOGICAL_AND) == positive else "or"
            empty = "true" if word == "and" else "false"
            return _joined(word, [self.condition(part, positive) for part in parts]) if parts else empty
        if kind == libsbml.AST_LOGICAL_IMPLIES:
            texts = [self.condition(parts[0], not positive), self.condition(parts[1], positive)]
            return _joined("or" if positive else "and", texts)
        if kind == libsbml.AST_LOGICAL_XOR:
            return self._odd(parts, positive)
        number = self.number(node)  # a number is true where it is not 0
        return f"({number} > 0 or {number} < 0)" if positive else f"({number} >= 0 and {number} <= 0)"

    def _comparison(self, sign: str, left: Node, right: Node) -> str:
        a, b = self.number(left), self.number(right)
        if sign == "==":
            return f"({a} >= {b} and {a} <= {b})"
        return f"({a} > {b} or {a} < {b})" if sign == "!=" else f"{a} {sign} {b}"

    def _odd(self, parts: list[Node], positive: bool) -> str:
        """That an odd number of conditions holds."""
        if not parts:
            return "false" if positive else "true"
        if len(parts) == 1:
            return self.condition(parts[0], positive)
        first, rest = parts[0], parts[1:]
        one = _joined("and", [self.condition(first), self._odd(rest, not positive)])
        other = _joined("and", [self.condition(first, False), self._odd(rest, positive)])
        return _joined("or", [one, other])

    def indicator(self, node: Node) -> str:
        """The number of a condition by signs: right wherever it is evaluated, and it jumps."""
        kind, parts = node.getType(), children(node)
        if kind in (libsbml.AST_CONSTANT_TRUE, libsbml.AST_CONSTANT_FALSE):
            return "1" if kind == libsbml.AST_CONSTANT_TRUE else "0"
        if kind in _COMPARISONS:
            values = list(map(self.number, parts))
            factors = [_INDICATOR[_COMPARISONS[kind]].format(*pair) for pair in pairwise(values)]
            return f"({'*'.join(factors) or '1'})"
        texts = [self.indicator(part) for part in parts] if node.isLogical() else []
        if kind == libsbml.AST_LOGICAL_NOT:
            return f"(1 - {texts[0]})"
        if kind == libsbml.AST_LOGICAL_AND:
            return f"({'*'.join(texts) or '1'})"
        if kind == libsbml.AST_LOGICAL_OR:
            return f"max(0, {', '.join(texts) or '0'})"
        if kind == libsbml.AST_LOGICAL_IMPLIES:
            return f"max(1 - {texts[0]}, {texts[1]})"
        if kind == libsbml.AST_LOGICAL_XOR:
            odd = "0"
            for text in texts:
                odd = f"abs({odd} - {text})"
            return odd
        return f"abs(sign({self.number(node)}))"


def _joined(word: str, texts: list[str]) -> str:
    if not texts:
        return "true"
    return texts[0] if len(texts) == 1 else f"({f' {word} '.join(texts)})"


def _constant(node: Node) -> str:
    kind = node.getType()
    if kind == libsbml.AST_INTEGER:
        return f"({node.getInteger()})" if node.getInteger() < 0 else str(node.getInteger())
    if kind == libsbml.AST_RATIONAL:
        return f"({node.getNumerator()}/{node.getDenominator()})"
    return literal(node.getReal())


def literal(value: float) -> str:
    """The text of a number."""
    if not math.isfinite(value):
        raise NotExpressible("infinity or not-a-number as a value")
    return f"({value!r})" if value < 0 else repr(int(value) if value.is_integer() and value < 1e15 else value)


def _sum(writer: Writer, node: Node, arguments: list[Node]) -> str:
    return f"({' + '.join(map(writer.number, arguments)) or '0'})"


def _product(writer: Writer, node: Node, arguments: list[Node]) -> str:
    return f"({'*'.join(map(writer.number, arguments)) or '1'})"


def _minus(writer: Writer, node: Node, arguments: list[Node]) -> str:
    return f"(-{writer.number(arguments[0])})" if len(arguments) == 1 else f"({_two(writer, arguments, ' - ')})"


def _divide(writer: Writer, node: Node, arguments: list[Node]) -> str:
    return f"({_two(writer, arguments, '/')})"


def _power(writer: Writer, node: Node, arguments: list[Node]) -> str:
    return f"({_two(writer, arguments, '**')})"


def _two(writer: Writer, arguments: list[Node], sign: str) -> str:
    return sign.join(map(writer.number, arguments))


def _root(writer: Writer, node: Node, arguments: list[Node]) -> str:
    *degree, base = map(writer.number, arguments)
    return f"sqrt({base})" if degree in ([], ["2"]) else f"({base}**(1/{degree[0]}))"


def _log(writer: Writer, node: Node, arguments: list[Node]) -> str:
    *base, value = map(writer.number, arguments)
    return f"(log({value})/log({base[0] if base else 10}))"


def _piecewise(writer: Writer, node: Node, arguments: list[Node]) -> str:
    """Each value times 1 where its condition holds and none before it."""
    text = writer.number(arguments[-1]) if len(arguments) % 2 else "0"
    for i in reversed(range(0, len(arguments) - 1, 2)):
        condition = arguments[i + 1]
        holds = writer.chooses(writer, condition)
        value = writer.number(arguments[i])
        text = value if holds == "1" else text if holds == "0" else f"select({holds}, {value}, {text})"
    return text


def _quotient(writer: Writer, node: Node, arguments: list[Node]) -> str:
    """The quotient rounded towards zero."""
    ratio = _divide(writer, node, arguments)
    return f"(sign({ratio})*floor(abs({ratio})))"


def _remainder(writer: Writer, node: Node, arguments: list[Node]) -> str:
    a, b = map(writer.number, arguments)
    return f"({a} - {b}*{_quotient(writer, node, arguments)})"


def _factorial(writer: Writer, node: Node, arguments: list[Node]) -> str:
    if not arguments[0].isNumber():
        raise NotExpressible("factorial of what is not a number")
    return str(math.factorial(round(arguments[0].getValue())))


def _rate(writer: Writer, node: Node, arguments: list[Node]) -> str:
    return writer.rate(arguments[0].getName())


def _call(writer: Writer, node: Node, arguments: list[Node]) -> str:
    return f"{node.getName()}({', '.join(map(writer.number, arguments))})"


def _of_list(function: str) -> Callable[[Writer, Node, list[Node]], str]:
    def write(writer: Writer, node: Node, arguments: list[Node]) -> str:
        texts = list(map(writer.number, arguments))
        return texts[0] if len(texts) == 1 else f"{function}({', '.join(texts)})"

    return write


def _delay(writer: Writer, node: Node, arguments: list[Node]) -> str:
    raise NotExpressible("delay equations")


_SPECIAL: dict[int, Callable[[Writer, Any, list[Any]], str]] = {
    libsbml.AST_PLUS: _sum,
    libsbml.AST_TIMES: _product,
    libsbml.AST_MINUS: _minus,
    libsbml.AST_DIVIDE: _divide,
    libsbml.AST_POWER: _power,
    libsbml.AST_FUNCTION_POWER: _power,
    libsbml.AST_FUNCTION_ROOT: _root,
    libsbml.AST_FUNCTION_LOG: _log,
    libsbml.AST_FUNCTION_PIECEWISE: _piecewise,
    libsbml.AST_FUNCTION_QUOTIENT: _quotient,
    libsbml.AST_FUNCTION_REM: _remainder,
    libsbml.AST_FUNCTION_FACTORIAL: _factorial,
    libsbml.AST_FUNCTION_RATE_OF: _rate,
    libsbml.AST_FUNCTION_DELAY: _delay,
    libsbml.AST_FUNCTION_MAX: _of_list("max"),
    libsbml.AST_FUNCTION_MIN: _of_list("min"),
    libsbml.AST_FUNCTION: _call,
    libsbml.AST_NAME: lambda writer, node, _: writer.name(node.getName()),
    libsbml.AST_NAME_TIME: lambda writer, node, _: writer.time,
    libsbml.AST_NAME_AVOGADRO: lambda writer, node, _: AVOGADRO,
    libsbml.AST_CONSTANT_E: lambda writer, node, _: "exp(1)",
    libsbml.AST_CONSTANT_PI: lambda writer, node, _: "pi",
}
