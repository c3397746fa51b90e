"""One routine of a program as a C function: the same operations in the same order.

A routine's text is a small language (see `hsdsl.program`) that happens to be Python's: assignments, arithmetic,
comparisons, calls of known functions. It is read by Python's parser and printed again; a node that is not listed here
is refused. Every operation has its own parentheses, so that C's rules of precedence have no say.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from fractions import Fraction

from hsdsl.arithmetic import FLOAT64

_CONSTANT = re.compile(r"q_(m?)(\d+)_(\d+)")
_OPERATORS: dict[type[ast.AST], str] = {
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
_TRIGONOMETRIC = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh")
_FUNCTIONS = {*_TRIGONOMETRIC, "exp", "log", "sqrt", "pow", "atan2", "abs", "sign", "heaviside", "floor"}
_FOLDED = {"min", "max"}
_NUMBERS = {"pi": FLOAT64.functions["pi"], "e": FLOAT64.functions["e"]}


def literal(value: float) -> str:
    """Write a number without loss."""
    if value != value:
        return "NAN"
    if value in (float("inf"), float("-inf")):
        return "INFINITY" if value > 0 else "(-INFINITY)"
    return f"({value.hex()})" if value < 0 else value.hex()


def function_body(definition: ast.FunctionDef, names: Mapping[str, str]) -> str:
    """Print the body of a routine; ``names`` says what its arguments and data are called in C.

    Raises
    ------
    ValueError
        The text is not of the language of routines.
    """
    printer = _Printer(names)
    lines: list[str] = []
    for statement in definition.body:
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                lines.append(f"const double {name} = {printer.expression(value)};")
                printer.names[name] = name
            case ast.Return(value=ast.Tuple(elts=results)):
                lines += [f"out[{i}] = {printer.expression(result)};" for i, result in enumerate(results)]
            case _:
                raise ValueError(f"no statement of a routine: {ast.unparse(statement)}")
    return "\n".join(f"  {line}" for line in lines)


def expression(text: str, names: Mapping[str, str]) -> str:
    """Print one expression of the language of routines.

    Raises
    ------
    ValueError
        It is none.
    """
    return _Printer(names).expression(ast.parse(text, "<hsdsl tape>", mode="eval").body)


class _Printer:
    def __init__(self, names: Mapping[str, str]) -> None:
        self.names = dict(names)

    def expression(self, node: ast.expr) -> str:
        match node:
            case ast.Name(id=name):
                return self.name(name)
            case ast.Constant(value=bool(value)):
                return "1" if value else "0"
            case ast.BinOp(left=left, op=ast.Div(), right=right):
                return f"hs_div({self.expression(left)}, {self.expression(right)}, &bad)"
            case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
                return self.joined(_OPERATORS[type(operator)], [left, right])
            case ast.BoolOp(op=operator, values=values):
                return self.joined(_OPERATORS[type(operator)], values)
            case ast.Compare(left=left, ops=[operator], comparators=[right]) if type(operator) in _OPERATORS:
                return self.joined(_OPERATORS[type(operator)], [left, right])
            case ast.UnaryOp(op=operator, operand=operand) if type(operator) in _OPERATORS:
                return f"({_OPERATORS[type(operator)]}{self.expression(operand)})"
            case ast.IfExp(test=test, body=body, orelse=other):
                return f"({self.expression(test)} ? {self.expression(body)} : {self.expression(other)})"
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self.call(name, [self.expression(a) for a in arguments])
            case _:
                raise ValueError(f"no expression of a routine: {ast.unparse(node)}")

    def joined(self, operator: str, operands: list[ast.expr]) -> str:
        return "(" + f" {operator} ".join(map(self.expression, operands)) + ")"

    def name(self, name: str) -> str:
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
        if name in _FUNCTIONS:
            return f"hs_{name}({', '.join(arguments)}, &bad)"
        if name not in _FOLDED or not arguments:
            raise ValueError(f"a routine calls {name}, which no kernel has")
        text = arguments[0]
        for argument in arguments[1:]:
            text = f"hs_{name}({text}, {argument})"
        return text
