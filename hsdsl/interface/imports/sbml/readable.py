"""Formulas with no more parentheses, signs and factors than they need: the same operations in the same order."""

from __future__ import annotations

from hsdsl.language.expression.parse import (
    Call,
    Comparison,
    ExpressionError,
    Logic,
    Number,
    Power,
    Product,
    Sum,
    Tree,
    parse,
)

_OR, _AND, _NOT, _COMPARE, _ADD, _NEGATIVE, _MULTIPLY, _POWER, _ATOM = range(9)
Written = tuple[str, int]  # a text, and how strongly its weakest operator binds


def readable(text: str) -> str:
    """A formula as people write it; a text that is no formula, or too long, is returned unchanged."""
    try:
        return _Printer(text).written(parse(text, "condition"))[0]
    except ExpressionError:
        return text


class _Printer:
    def __init__(self, text: str) -> None:
        self.text = text

    def written(self, tree: Tree) -> Written:
        match tree:
            case Sum(((True, Sum(((True, operand),))),)):
                return self.written(operand)
            case Sum(((True, operand),)):
                return self.negative(self.written(operand))
            case Sum():
                return self.sum(tree)
            case Product():
                return self.product(tree)
            case Power():
                return f"{self.within(tree.base, _ATOM)}**{self.within(tree.exponent, _POWER)}", _POWER
            case Call():
                return f"{tree.function}({', '.join(self.within(part, _OR) for part in tree.arguments)})", _ATOM
            case Comparison():
                first, *others = (self.within(part, _ADD) for part in tree.operands)
                pairs = zip(tree.operators, others, strict=True)
                return first + "".join(f" {sign} {other}" for sign, other in pairs), _COMPARE
            case Logic("not", (operand,)):
                return f"not {self.within(operand, _COMPARE)}", _NOT
            case Logic():
                binding = _OR if tree.operator == "or" else _AND
                return f" {tree.operator} ".join(self.within(part, binding) for part in tree.operands), binding
            case _:
                return self.text[tree.start : tree.end], _ATOM

    def within(self, tree: Tree, weakest: int) -> str:
        return _enclosed(self.written(tree), weakest)

    def negative(self, operand: Written) -> Written:
        """The opposite: of a product it is that of its first factor, with the same rounding."""
        if operand[0].startswith("-") and operand[1] >= _NEGATIVE:
            return operand[0][1:], _MULTIPLY
        return f"-{_enclosed(operand, _MULTIPLY)}", _NEGATIVE

    def sum(self, tree: Sum) -> Written:
        text = ""
        for minus, term in tree.terms:
            one, binding = self.written(term)
            if not text:
                text = one if binding >= _ADD else f"({one})"
                continue
            if one.startswith("-") and binding == _NEGATIVE:
                minus, one, binding = not minus, one[1:], _MULTIPLY
            text += f" {'-' if minus else '+'} {_enclosed((one, binding), _MULTIPLY)}"
        return text, _ADD

    def product(self, tree: Product) -> Written:
        """A product without its factors of 1, and with the sign of one of -1 before it."""
        factors, sign = list(tree.factors), False
        while len(factors) > 1 and not factors[1][0] and (one := _unit(factors[0][1])):
            sign ^= one < 0
            del factors[0]
        factors = [factors[0], *(pair for pair in factors[1:] if _unit(pair[1]) != 1)]
        text, binding = self.written(factors[0][1])
        if len(factors) > 1:
            text = _enclosed((text, binding), _NEGATIVE)
            text += "".join(f"{'/' if below else '*'}{self.within(factor, _POWER)}" for below, factor in factors[1:])
            binding = _NEGATIVE if text.startswith("-") else _MULTIPLY
        return self.negative((text, binding)) if sign else (text, binding)


def _enclosed(written: Written, weakest: int) -> str:
    return written[0] if written[1] >= weakest else f"({written[0]})"


def _unit(tree: Tree) -> int:
    """1 or -1 where a factor is that number, else 0."""
    match tree:
        case Sum(((True, operand),)):
            return -_unit(operand)
        case _:
            return int(isinstance(tree, Number) and tree.value == 1)
