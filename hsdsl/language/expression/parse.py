"""Tokens to a tree, by operator precedence. The precedence is Python's."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from typing import Literal

from hsdsl.base.functions import FUNCTIONS
from hsdsl.base.names import shown
from hsdsl.language.expression import syntax
from hsdsl.language.expression.expression_hints import CASES, compared, measured, power_of, side_by_side, timed
from hsdsl.language.expression.stack import deep_stack
from hsdsl.language.expression.syntax import Expected, ExpressionError, Tree
from hsdsl.language.expression.tokens import Token, tokenize

DEEPEST = 200
_COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
_OR, _AND, _NOT, _COMPARE, _ADD, _MULTIPLY, _POWER = range(1, 8)
_BINDING = {"or": _OR, "and": _AND, "+": _ADD, "-": _ADD, "*": _MULTIPLY, "/": _MULTIPLY, "**": _POWER}
_BINDING.update(dict.fromkeys(_COMPARISONS, _COMPARE))
_FOREIGN_WORDS = ("if", "else", "for", "in", "is", "lambda", "then", "AND", "OR", "NOT")


def parse(text: str, expected: Expected = "number") -> Tree:
    """The tree of an expression of at most 10,000 characters, nested at most 200 deep; ``expected`` words the hints.

    Raises ExpressionError: at the first fault.
    """
    tokens = tokenize(text, expected)
    if tokens[0].kind == "end":
        raise ExpressionError("HS121", "an expression is missing", 0, 1, "write a number or an expression")
    with deep_stack():
        return _Parser(text, tokens, expected).whole()


class _Parser:
    def __init__(self, text: str, tokens: list[Token], expected: Expected) -> None:
        self.text = text
        self.expected = expected
        self.tokens = tokens
        self.at = 0
        self.depth = 0

    def whole(self) -> Tree:
        """The tree of all tokens."""
        tree = self.expression(0)
        token = self.tokens[self.at]
        if token.kind != "end":
            raise self.unexpected(token)
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
            return syntax.Power(left, exponent, begin, self.tokens[self.at - 1].end)
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
            return syntax.Negative(operand, first.start, self.tokens[self.at - 1].end) if negative else operand
        if first.text == "not":
            denied = len(self.skipped(("not",))) % 2 == 1
            operand = self.expression(_COMPARE)
            inner = syntax.Not(operand, first.start, self.tokens[self.at - 1].end)
            return inner if denied else syntax.Not(inner, inner.start, inner.end)
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
            return syntax.Number(token.value, token.start, token.end)
        if token.kind == "name" and token.text in ("true", "false"):
            self.at += 1
            return syntax.Truth(token.text == "true", token.start, token.end)
        if token.kind == "name" and token.text not in ("and", "or"):
            self.at += 1
            if self.tokens[self.at].text == "(":
                return self.call(token)
            return syntax.Name(token.text, token.start, token.end)
        if token.text == "(":
            self.at += 1
            with self.deeper():
                inner = self.expression(0)
            self.close(token)
            return inner
        raise self.missing(token)

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
        end = self.close(opened)
        return syntax.Call(function.text, tuple(arguments), function.start, end)

    def close(self, opened: Token) -> int:
        """Take the closing parenthesis of ``opened``."""
        token = self.tokens[self.at]
        if token.text == ")":
            self.at += 1
            return token.end
        if token.kind == "end":
            raise ExpressionError.at(opened, "HS103", "this parenthesis is never closed", "add `)`")
        raise self.unexpected(token)

    @contextmanager
    def deeper(self) -> Generator[None]:
        """One level of nesting, refused beyond the deepest."""
        self.depth += 1
        if self.depth > DEEPEST:
            token = self.tokens[self.at - 1]
            message = f"the expression is nested more than {DEEPEST} deep"
            raise ExpressionError.at(token, "HS123", message, "name its parts under `let`")
        yield
        self.depth -= 1

    def missing(self, token: Token) -> ExpressionError:
        """The error for a missing operand."""
        before = self.tokens[self.at - 1] if self.at else None
        if before is None:
            if token.text == ")":
                return ExpressionError.at(token, "HS103", "this parenthesis closes nothing", "remove it")
            return ExpressionError.at(token, "HS102", f"an operand is missing before `{token.text}`")
        if before.text == "(" and token.text == ")":
            return ExpressionError("HS102", "there is nothing between the parentheses", before.start, token.end)
        hint = "write `**` for a power" if before.text == "**" and token.text == "*" else None
        if before.text == "/" and token.text == "/":
            hint = "write floor(x/y) for a whole quotient, and `#` before a comment"
        hint = hint or f"write what follows `{before.text}`, or remove it"
        return ExpressionError.at(before, "HS102", f"an operand is missing after `{before.text}`", hint)

    def unexpected(self, token: Token) -> ExpressionError:
        """Something after an operand that is no operator."""
        before = self.tokens[self.at - 1]
        if token.text == ")":
            return ExpressionError.at(token, "HS103", "this parenthesis closes nothing", "remove it")
        if token.text == ",":
            after = self.tokens[self.at + 1]
            decimal = before.kind == after.kind == "number"
            hint = "parentheses hold one expression" if self.depth else "write one expression here"
            hint = _decimal(before.text, after.text) if decimal else hint
            if self.expected == "inequality" and not self.depth:
                hint = "write one inequality here: the rest of a `when` under `if`, of a `domain` as further items"
            return ExpressionError.at(token, "HS102", "a comma separates only arguments of a function", hint)
        return self.no_operator(before, token)

    def no_operator(self, before: Token, token: Token) -> ExpressionError:
        """Two operands side by side."""
        left, right = shown(before.text, 30), shown(token.text, 30)
        if token.text in _FOREIGN_WORDS or before.text in _FOREIGN_WORDS:
            word = token if token.text in _FOREIGN_WORDS else before
            hint = f"write `{word.text.lower()}`" if word.text.isupper() else CASES
            return ExpressionError.at(word, "HS109", f"`{word.text}` is not a word of the language", hint)
        if before.text in FUNCTIONS:
            message = f"`{before.text}` is a function and needs parentheses"
            hint = f"write {before.text}({right})"
            return ExpressionError.at(before, "HS112", message, hint)
        if token.text == "(" and self.power_of_function():
            message = f"`{self.tokens[self.at - 3].text}` is a function and needs parentheses"
            hint = power_of(self.tokens[self.at - 3].text)
            return ExpressionError("HS112", message, self.tokens[self.at - 3].start, before.end, hint)
        if token.text == "(":
            left, right = (left, "(...)") if before.text != ")" else ("(...)", "(...)")
        elif before.text == ")":
            left = "(...)"
        message = f"an operator is missing between `{left}` and `{right}`"
        return ExpressionError("HS104", message, before.start, token.end, _joined(before, token, left, right))

    def power_of_function(self) -> bool:
        """Whether the last tokens are ``sin**2``."""
        function, power = self.tokens[max(0, self.at - 3)], self.tokens[max(0, self.at - 2)]
        return function.text in FUNCTIONS and power.text == "**"


def _joined(before: Token, token: Token, left: str, right: str) -> str:
    if before.kind == token.kind == "number":
        plain = right == "1" and before.end < token.start  # as in 1.2 1/h
        return measured(left) if plain else "a number has one decimal point, and no blanks"
    known = side_by_side(left, right) if (before.kind, token.kind) == ("number", "name") else compared(left, right)
    known = known or timed(left, right)
    return known or f"write {left}*{right} for a product"


def _decimal(left: str, right: str) -> str:
    both = f"{shown(left)}.{shown(right)}"
    return f"write {shown(left)}{shown(right)}, or {both}" if len(right) == 3 else f"write {both}"


def _chain(binding: int, operators: list[str], operands: list[Tree], start: int, end: int) -> Tree:
    if binding in (_OR, _AND):
        word: Literal["and", "or"] = "or" if binding == _OR else "and"
        return syntax.Logic(word, tuple(operands), start, end)
    if binding == _COMPARE:
        return syntax.Comparison(tuple(operands), tuple(operators), start, end)
    inverted = [False, *(operator in ("-", "/") for operator in operators)]
    pairs = tuple(zip(inverted, operands, strict=True))
    return syntax.Sum(pairs, start, end) if binding == _ADD else syntax.Product(pairs, start, end)
