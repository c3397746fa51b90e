"""Routines of a program in another language: the same operations in the same order.

A routine's text is a small language (see `program`) that happens to be Python's: assignments, arithmetic,
comparisons, calls of known functions. It is read by Python's parser and printed again; a node that is not listed here
is refused. Every operation has its own parentheses, so that a language's rules of precedence have no say.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import copysign

from hsdsl.base.numbers.arithmetic import FLOAT64

_CONSTANT = re.compile(r"q_(m?)(\d+)_(\d+)")
_TRIGONOMETRIC = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh")
FUNCTIONS = (*_TRIGONOMETRIC, "exp", "log", "sqrt", "pow", "atan2", "abs", "sign", "heaviside", "floor")
_FOLDED = {"min", "max"}
_NUMBERS = {"pi": FLOAT64.functions["pi"], "e": FLOAT64.functions["e"]}
C_OPERATORS: Mapping[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.And: "&&",
    ast.Or: "||",
    ast.USub: "-",
    ast.Not: "!",
}


def number_text(value: float, nan: str, infinity: str, finite: Callable[[float], str] = repr) -> str:
    """Write a number without loss, in parentheses where it is negative."""
    if value != value:
        return nan
    text = infinity if abs(value) == float("inf") else finite(abs(value))
    return f"(-{text})" if copysign(1, value) < 0 else text


def stored(values: Iterable[str]) -> list[str]:
    """Statements that hand values back in an array ``out``."""
    return [f"out[{i}] = {value};" for i, value in enumerate(values)]


@dataclass(frozen=True)
class Language:
    """How a language writes the operations of a routine."""

    literal: Callable[[float], str]  # writes a number without loss
    assign: str  # a statement, with ``{name}`` and ``{value}``
    results: Callable[[Sequence[str]], list[str]]  # the statements that hand back a routine's values, given as text
    divide: str  # with ``{left}`` and ``{right}``
    choose: str  # with ``{test}``, ``{body}`` and ``{other}``
    call: str  # of a function that may have no value, with ``{name}`` and ``{arguments}``
    fold: str  # `min` and `max` of two, with ``{name}``, ``{left}`` and ``{right}``
    truths: tuple[str, str]  # false and true
    operators: Mapping[type[ast.AST], str]

    def body(self, definition: ast.FunctionDef, names: Mapping[str, str]) -> list[str]:
        """Print the statements of a routine; ``names`` says what its arguments and data are called.

        Raises ValueError: the text is not of the language of routines.
        """
        own = dict(names)
        printer = _Printer(self, own)
        lines: list[str] = []
        for statement in definition.body:
            match statement:
                case ast.Assign(targets=[ast.Name(id=name)], value=value):
                    lines.append(self.assign.format(name=name, value=printer.expression(value)))
                    own[name] = name
                case ast.Return(value=ast.Tuple(elts=results)):
                    lines += self.results([printer.expression(result) for result in results])
                case _:
                    raise ValueError(f"no statement of a routine: {ast.unparse(statement)}")
        return lines

    def expression(self, text: str, names: Mapping[str, str]) -> str:
        """Print one expression of the language of routines.

        Raises ValueError: it is none.
        """
        return _Printer(self, names).expression(ast.parse(text, "<hsdsl tape>", mode="eval").body)


class _Printer:
    def __init__(self, language: Language, names: Mapping[str, str]) -> None:
        self.language, self.names = language, names

    def expression(self, node: ast.expr) -> str:
        language, operators = self.language, self.language.operators
        match node:
            case ast.Name(id=name):
                return self.name(name)
            case ast.Constant(value=bool(value)):
                return language.truths[value]
            case ast.BinOp(left=left, op=ast.Div(), right=right):
                return language.divide.format(left=self.expression(left), right=self.expression(right))
            case ast.BinOp(left=left, op=operator, right=right) if type(operator) in operators:
                return self.joined(operators[type(operator)], [left, right])
            case ast.BoolOp(op=operator, values=values):
                return self.joined(operators[type(operator)], values)
            case ast.Compare(left=left, ops=[operator], comparators=[right]) if type(operator) in operators:
                return self.joined(operators[type(operator)], [left, right])
            case ast.UnaryOp(op=operator, operand=operand) if type(operator) in operators:
                return f"({operators[type(operator)]}{self.expression(operand)})"
            case ast.IfExp(test=test, body=body, orelse=other):
                parts = {"test": test, "body": body, "other": other}
                return language.choose.format(**{key: self.expression(part) for key, part in parts.items()})
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self.call(name, [self.expression(a) for a in arguments])
            case _:
                raise ValueError(f"no expression of a routine: {ast.unparse(node)}")

    def joined(self, operator: str, operands: list[ast.expr]) -> str:
        return "(" + f" {operator} ".join(map(self.expression, operands)) + ")"

    def name(self, name: str) -> str:
        literal = self.language.literal
        if name in self.names:
            return self.names[name]
        if found := _CONSTANT.fullmatch(name):
            return literal(FLOAT64.constant(Fraction(int(found[2]) * (-1 if found[1] else 1), int(found[3]))))
        if name in _NUMBERS:
            return literal(_NUMBERS[name])
        if name in ("nan", "inf"):
            return literal(float(name))
        raise ValueError(f"a routine names {name}, which nothing defines")

    def call(self, name: str, arguments: list[str]) -> str:
        if name == "below" and len(arguments) == 4:
            number, bound, body, other = arguments
            return self.language.choose.format(test=f"({number} < {bound})", body=body, other=other)
        if name in FUNCTIONS:
            return self.language.call.format(name=name, arguments=", ".join(arguments))
        if name not in _FOLDED or not arguments:
            raise ValueError(f"a routine calls {name}, which no kernel has")
        text = arguments[0]
        for argument in arguments[1:]:
            text = self.language.fold.format(name=name, left=text, right=argument)
        return text
