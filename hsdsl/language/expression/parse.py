"""Text to tokens, and tokens to a tree by operator precedence, which is Python's. Each node has its range."""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any, Literal, NamedTuple

from hsdsl.base.names import LOOKALIKES, normalised, shown
from hsdsl.language.expression.timebox import deep_stack

Expected = Literal["number", "condition", "inequality"]


class ExpressionError(Exception):
    """A fault at the characters ``start`` to ``end`` of an expression."""

    def __init__(self, code: str, message: str, start: int, end: int, hint: str | None = None) -> None:
        super().__init__(message)
        self.code = code
        self.message = message
        self.start = start
        self.end = end
        self.hint = hint


def explained(what: str, *facts: Any) -> Any:
    """What a function of `hsdsl.language.diagnosis.expressions` says of a fault."""
    from hsdsl.language.diagnosis import expressions

    return getattr(expressions, what)(*facts)


@dataclass(frozen=True, slots=True)
class Number:
    """A number, exactly as written."""

    value: Fraction
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Name:
    """A name."""

    name: str
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Sum:
    """Terms added (False) or subtracted (True), from left to right; ``-x`` is a sum of one."""

    terms: tuple[tuple[bool, Tree], ...]
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Product:
    """Factors multiplied (False) or divided by (True), from left to right."""

    factors: tuple[tuple[bool, Tree], ...]
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Power:
    """``base**exponent``."""

    base: Tree
    exponent: Tree
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Call:
    """``function(argument, ...)``."""

    function: str
    arguments: tuple[Tree, ...]
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Comparison:
    """``a < b <= c``: one operator fewer than operands."""

    operands: tuple[Tree, ...]
    operators: tuple[str, ...]
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Logic:
    """Conditions joined by `and` or by `or`, or one with `not` before it."""

    operator: Literal["and", "or", "not"]
    operands: tuple[Tree, ...]
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Truth:
    """`true` or `false`."""

    value: bool
    start: int
    end: int


Tree = Number | Name | Sum | Product | Power | Call | Comparison | Logic | Truth


def children(tree: Tree) -> tuple[Tree, ...]:
    """The nodes directly below one."""
    match tree:
        case Number() | Name() | Truth():
            return ()
        case Sum():
            return tuple(term for _, term in tree.terms)
        case Product():
            return tuple(factor for _, factor in tree.factors)
        case Power():
            return (tree.base, tree.exponent)
        case Call():
            return tree.arguments
        case Comparison() | Logic():
            return tree.operands


def walk(tree: Tree) -> Iterator[Tree]:
    """Every node, in the order of the text."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        waiting.extend(reversed(children(node)))


def mapped(tree: Tree, change: Callable[[Tree], Tree]) -> Tree:
    """A node with other nodes directly below it."""
    match tree:
        case Number() | Name() | Truth():
            return tree
        case Sum():
            return replace(tree, terms=tuple((minus, change(term)) for minus, term in tree.terms))
        case Product():
            return replace(tree, factors=tuple((below, change(factor)) for below, factor in tree.factors))
        case Power():
            return replace(tree, base=change(tree.base), exponent=change(tree.exponent))
        case Call():
            return replace(tree, arguments=tuple(map(change, tree.arguments)))
        case Comparison() | Logic():
            return replace(tree, operands=tuple(map(change, tree.operands)))


LONGEST = 10_000  # characters
LARGEST_INTEGER = 10**18
_MOST_DIGITS = 1000
_NUMBER = re.compile(r"0[xX][0-9a-fA-F]+|0[oO][0-7]+|([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_OPERATOR = re.compile(r"\*\*|<=|>=|==|!=|[-+*/(),<>]")
_MEMBER = re.compile(r"(\[[^\[\]\n]{1,100}\])?\.([^\W\d]\w*)")  # of an instance of a part
_GROUPED = re.compile(r"[0-9]+(_[0-9]+)+")


class Token(NamedTuple):
    """A number, a name, an operator, or the end."""

    kind: Literal["number", "name", "operator", "end"]
    text: str
    start: int
    end: int
    value: Fraction = Fraction(0)


def tokenize(text: str, expected: Expected) -> list[Token]:
    """The tokens of an expression, the last one being the end.

    Raises ExpressionError: at the first character that begins none.
    """
    if len(text) > LONGEST:
        message = f"the expression has {len(text):,} characters; the most is {LONGEST:,}"
        raise ExpressionError("HS110", message, 0, 1, "name its parts under `let`")
    tokens: list[Token] = []
    at = 0
    while at < len(text):
        if text[at].isspace():
            at += 1
            continue
        token = _number(text, at) or _name(text, at) or _operator(text, at, expected)
        tokens.append(token)
        at = token.end
    tokens.append(Token("end", "", len(text), len(text)))
    return tokens


def _number(text: str, at: int) -> Token | None:
    grouped = _GROUPED.match(text, at)
    if grouped:
        plain = grouped.group().replace("_", "")
        raise ExpressionError("HS105", "digits are not grouped by `_`", at, grouped.end(), f"write {shown(plain)}")
    match = _NUMBER.match(text, at)
    if not match:
        return None
    return Token("number", match.group(), at, match.end(), _value(match, at))


def _value(match: re.Match[str], at: int) -> Fraction:
    digits, exponent = match.group(1), match.group(2)
    if len(match.group()) > _MOST_DIGITS:
        raise ExpressionError("HS124", f"the number has more than {_MOST_DIGITS:,} digits", at, match.end())
    if digits is None or (digits.isdigit() and not exponent):
        value = int(match.group(), 10 if digits else 0)
        if value > LARGEST_INTEGER:
            hint = "write it with an exponent: 2.5e20"
            raise ExpressionError("HS124", "a whole number is at most 1e18", at, match.end(), hint)
        return Fraction(value)
    return _scaled(Fraction(digits), int(exponent[1:]) if exponent else 0, at, match.end())


def _scaled(mantissa: Fraction, power: int, start: int, end: int) -> Fraction:
    """``mantissa * 10**power``, refused where a float could not hold it, before anything large is computed."""
    if mantissa == 0:
        return mantissa
    if abs(power) <= 2 * _MOST_DIGITS:
        value = mantissa * Fraction(10) ** power
        if Fraction(1, 2**1074) <= value < 2**1024:
            return value
    if power > 0:
        raise ExpressionError("HS118", "the number is too large to have a finite value", start, end)
    raise ExpressionError("HS105", "the number is below the smallest float", start, end, "write 0")


def _name(text: str, at: int) -> Token | None:
    if not text[at].isidentifier():
        return None
    end = at + 1
    while end < len(text) and ("a" + text[end]).isidentifier() and text[end] not in LOOKALIKES:
        end += 1
    member = _MEMBER.match(text, end)
    end = member.end() if member and member.group(2).isidentifier() else end
    return Token("name", normalised(text[at:end]), at, end)


def _operator(text: str, at: int, expected: Expected) -> Token:
    match = _OPERATOR.match(text, at)
    if match:
        return Token("operator", match.group(), at, match.end())
    raise ExpressionError(*explained("strange_sign", text, at, expected))


DEEPEST = 200
_COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
_OR, _AND, _NOT, _COMPARE, _ADD, _MULTIPLY, _POWER = range(1, 8)
_BINDING = {"or": _OR, "and": _AND, "+": _ADD, "-": _ADD, "*": _MULTIPLY, "/": _MULTIPLY, "**": _POWER}
_BINDING.update(dict.fromkeys(_COMPARISONS, _COMPARE))


@lru_cache(maxsize=1 << 12)  # the instances of an automaton have the same expressions
def parse(text: str, expected: Expected = "number") -> Tree:
    """The tree of an expression of at most 10,000 characters, nested at most 200 deep; ``expected`` words the hints.

    Raises ExpressionError: at the first fault.
    """
    tokens = tokenize(text, expected)
    if tokens[0].kind == "end":
        raise ExpressionError("HS121", "an expression is missing", 0, 1, "write a number or an expression")
    with deep_stack():
        return _Parser(tokens, expected).whole()


class _Parser:
    def __init__(self, tokens: list[Token], expected: Expected) -> None:
        self.expected = expected
        self.tokens = tokens
        self.at = 0
        self.depth = 0

    def whole(self) -> Tree:
        """The tree of all tokens."""
        tree = self.expression(0)
        if self.tokens[self.at].kind != "end":
            raise self.unexpected()
        return tree

    def expression(self, weakest: int) -> Tree:
        """The longest expression from here on whose operators bind at least as strongly as ``weakest``."""
        begin = self.tokens[self.at].start
        left = self.prefixed()
        while True:
            token = self.tokens[self.at]
            binding = _BINDING.get(token.text, 0) if token.kind in ("operator", "name") else 0
            if binding == 0 or binding < weakest:
                return left
            left = self.joined(left, begin, binding)

    def joined(self, left: Tree, begin: int, binding: int) -> Tree:
        """``left`` with all that operators of one strength join to it: as one node, however long."""
        if binding == _POWER:
            self.at += 1
            with self.deeper():
                exponent = self.expression(_POWER)
            return Power(left, exponent, begin, self.tokens[self.at - 1].end)
        operators: list[str] = []
        operands = [left]
        while _BINDING.get(self.tokens[self.at].text, 0) == binding:
            operators.append(self.tokens[self.at].text)
            self.at += 1
            operands.append(self.expression(binding + 1))
        return _chain(binding, operators, operands, begin, self.tokens[self.at - 1].end)

    def prefixed(self) -> Tree:
        """An operand with the signs or the `not`s before it, however many."""
        first = self.tokens[self.at]
        if first.text in ("-", "+"):
            negative = self.skipped(("-", "+")).count("-") % 2 == 1
            operand = self.expression(_POWER)
            return Sum(((True, operand),), first.start, self.tokens[self.at - 1].end) if negative else operand
        if first.text == "not":
            denied = len(self.skipped(("not",))) % 2 == 1
            operand = self.expression(_COMPARE)
            inner = Logic("not", (operand,), first.start, self.tokens[self.at - 1].end)
            return inner if denied else Logic("not", (inner,), inner.start, inner.end)
        return self.operand()

    def skipped(self, texts: tuple[str, ...]) -> list[str]:
        """Take tokens while they are among ``texts``."""
        begin = self.at
        while self.tokens[self.at].text in texts:
            self.at += 1
        return [token.text for token in self.tokens[begin : self.at]]

    def operand(self) -> Tree:
        """A number, a name, a call, or an expression in parentheses."""
        token = self.tokens[self.at]
        if token.kind == "number":
            self.at += 1
            return Number(token.value, token.start, token.end)
        if token.kind == "name" and token.text in ("true", "false"):
            self.at += 1
            return Truth(token.text == "true", token.start, token.end)
        if token.kind == "name" and token.text not in ("and", "or"):
            self.at += 1
            if self.tokens[self.at].text == "(":
                return self.call(token)
            return Name(token.text, token.start, token.end)
        if token.text == "(":
            self.at += 1
            with self.deeper():
                inner = self.expression(0)
            self.close(token)
            return inner
        raise ExpressionError(*explained("missing_operand", self.tokens, self.at))

    def call(self, function: Token) -> Tree:
        """A function's arguments."""
        opened = self.tokens[self.at]
        self.at += 1
        arguments: list[Tree] = []
        with self.deeper():
            while self.tokens[self.at].text != ")" or arguments:
                arguments.append(self.expression(0))
                if self.tokens[self.at].text != ",":
                    break
                self.at += 1
        return Call(function.text, tuple(arguments), function.start, self.close(opened))

    def close(self, opened: Token) -> int:
        """Take the closing parenthesis of ``opened``."""
        token = self.tokens[self.at]
        if token.text == ")":
            self.at += 1
            return token.end
        if token.kind == "end":
            raise ExpressionError("HS103", "this parenthesis is never closed", opened.start, opened.end, "add `)`")
        raise self.unexpected()

    @contextmanager
    def deeper(self) -> Generator[None]:
        """One level of nesting, refused beyond the deepest."""
        self.depth += 1
        if self.depth > DEEPEST:
            token = self.tokens[self.at - 1]
            message = f"the expression is nested more than {DEEPEST} deep"
            raise ExpressionError("HS123", message, token.start, token.end, "name its parts under `let`")
        yield
        self.depth -= 1

    def unexpected(self) -> ExpressionError:
        """The error for something after an operand that is no operator."""
        return ExpressionError(*explained("unexpected", self.tokens, self.at, self.expected, self.depth))


def _chain(binding: int, operators: list[str], operands: list[Tree], start: int, end: int) -> Tree:
    if binding in (_OR, _AND):
        word: Literal["and", "or"] = "or" if binding == _OR else "and"
        return Logic(word, tuple(operands), start, end)
    if binding == _COMPARE:
        return Comparison(tuple(operands), tuple(operators), start, end)
    pairs = tuple(zip([False, *(operator in ("-", "/") for operator in operators)], operands, strict=True))
    return Sum(pairs, start, end) if binding == _ADD else Product(pairs, start, end)
