"""Formulas of SBML as text of the language, with all their parentheses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from hsdsl.interface.imports.sbml.mathml import Node, NotExpressible

AVOGADRO = "6.02214179e23"  # the value that SBML Level 3 gives it
_SAME = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "abs", "exp", "floor")
_ARCS = ("sin", "cos", "tan", "sinh", "cosh", "tanh")
_INVERSES = {"sec": "cos", "csc": "sin", "cot": "tan"}
_FUNCTIONS = {
    **{name: f"{name}({{}})" for name in _SAME},
    **{f"arc{name}": f"a{name}({{}})" for name in _ARCS},
    "ln": "log({})",
    "ceiling": "(-floor(-{}))",
    **{f"{name}{kind}": f"(1/{other}{kind}({{}}))" for name, other in _INVERSES.items() for kind in ("", "h")},
    **{f"arc{name}{kind}": f"a{other}{kind}(1/{{}})" for name, other in _INVERSES.items() for kind in ("", "h")},
}
_COMPARISONS = {"gt": ">", "geq": ">=", "lt": "<", "leq": "<=", "eq": "==", "neq": "!="}
_LOGICAL = ("and", "or", "not", "xor", "implies")
_CONDITIONS = (*_COMPARISONS, *_LOGICAL, "true", "false")
_OPPOSITE = {">": "<=", ">=": "<", "<": ">=", "<=": ">", "==": "!=", "!=": "=="}
_INDICATOR = {  # 1 where the sign of left - right says that the comparison holds
    ">": "max(0, sign({0} - {1}))",
    ">=": "min(1, 1 + sign({0} - {1}))",
    "<": "max(0, sign({1} - {0}))",
    "<=": "min(1, 1 + sign({1} - {0}))",
    "==": "(1 - abs(sign({0} - {1})))",
    "!=": "abs(sign({0} - {1}))",
}


def instant(conditions: Writer, node: Node) -> str:
    """The number of a condition where it is evaluated once, as in initial values."""
    return conditions.indicator(node)


@dataclass(frozen=True)
class Writer:
    """How formulas are written: the text of names, of rates of change, and the number (0 or 1) of a condition."""

    name: Callable[[Node], str]
    rate: Callable[[Node], str]
    chooses: Callable[[Writer, Node], str] = instant
    time: str = "t"
    function: Callable[[str], str] = str

    def number(self, node: Node) -> str:
        """The text of a number; that of a condition is 0 or 1."""
        if node.kind in _CONDITIONS:
            return self.chooses(self, node)
        if node.kind in _FUNCTIONS:
            return _FUNCTIONS[node.kind].format(self.number(_one(node)))
        if node.kind not in _SPECIAL:
            raise NotExpressible(_UNKNOWN.get(node.kind, f"the formula <{node.kind}>"), node.element)
        return _SPECIAL[node.kind](self, node)

    def condition(self, node: Node, positive: bool = True) -> str:
        """The text of a condition, or of its opposite."""
        kind, parts = node.kind, node.arguments
        if kind in ("true", "false"):
            return "true" if (kind == "true") == positive else "false"
        if kind in _COMPARISONS:
            sign = _COMPARISONS[kind] if positive else _OPPOSITE[_COMPARISONS[kind]]
            texts = [self._comparison(sign, *pair) for pair in pairwise(parts)]
            return _joined("and" if positive else "or", texts)
        if kind == "not":
            return self.condition(_one(node), not positive)
        if kind in ("and", "or"):
            word = "and" if (kind == "and") == positive else "or"
            empty = "true" if word == "and" else "false"
            return _joined(word, [self.condition(part, positive) for part in parts]) if parts else empty
        if kind == "implies":
            texts = [self.condition(parts[0], not positive), self.condition(parts[1], positive)]
            return _joined("or" if positive else "and", texts)
        if kind == "xor":
            return self._odd(parts, positive)
        number = self.number(node)  # a number is true where it is not 0
        return f"({number} > 0 or {number} < 0)" if positive else f"({number} >= 0 and {number} <= 0)"

    def _comparison(self, sign: str, left: Node, right: Node) -> str:
        a, b = self.number(left), self.number(right)
        if sign == "==":
            return f"({a} >= {b} and {a} <= {b})"
        return f"({a} > {b} or {a} < {b})" if sign == "!=" else f"{a} {sign} {b}"

    def _odd(self, parts: tuple[Node, ...], positive: bool) -> str:
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
        kind, parts = node.kind, node.arguments
        if kind in ("true", "false"):
            return "1" if kind == "true" else "0"
        if kind in _COMPARISONS:
            values = list(map(self.number, parts))
            factors = [_INDICATOR[_COMPARISONS[kind]].format(*pair) for pair in pairwise(values)]
            return f"({'*'.join(factors) or '1'})"
        texts = [self.indicator(part) for part in parts] if kind in _LOGICAL else []
        match kind:
            case "not":
                return f"(1 - {texts[0]})"
            case "and":
                return f"({'*'.join(texts) or '1'})"
            case "or":
                return f"max(0, {', '.join(texts) or '0'})"
            case "implies":
                return f"max(1 - {texts[0]}, {texts[1]})"
            case "xor":
                odd = "0"
                for text in texts:
                    odd = f"abs({odd} - {text})"
                return odd
            case _:
                return f"abs(sign({self.number(node)}))"


def _joined(word: str, texts: list[str]) -> str:
    if not texts:
        return "true"
    return texts[0] if len(texts) == 1 else f"({f' {word} '.join(texts)})"


def literal(value: float) -> str:
    """The text of a number."""
    if not math.isfinite(value):
        raise NotExpressible("infinity or not-a-number as a value")
    return f"({value!r})" if value < 0 else repr(int(value) if value.is_integer() and value < 1e15 else value)


def _one(node: Node) -> Node:
    if len(node.arguments) != 1:
        raise NotExpressible(f"<{node.kind}> of {len(node.arguments)} arguments", node.element)
    return node.arguments[0]


def _constant(writer: Writer, node: Node) -> str:
    text = node.value
    try:
        if "/" in text:
            over, under = text.split("/")
            return f"({int(over)}/{int(under)})"
        return literal(float(text))
    except ValueError:
        raise NotExpressible(f"the number '{text}'", node.element) from None


def _listed(sign: str, empty: str) -> Callable[[Writer, Node], str]:
    return lambda writer, node: f"({sign.join(map(writer.number, node.arguments)) or empty})"


def _minus(writer: Writer, node: Node) -> str:
    if len(node.arguments) == 1:
        return f"(-{writer.number(node.arguments[0])})"
    return f"({' - '.join(map(writer.number, node.arguments))})"


def _root(writer: Writer, node: Node) -> str:
    *degree, base = map(writer.number, node.arguments)
    return f"sqrt({base})" if degree in ([], ["2"]) else f"({base}**(1/{degree[0]}))"


def _log(writer: Writer, node: Node) -> str:
    *base, value = map(writer.number, node.arguments)
    return f"(log({value})/log({base[0] if base else 10}))"


def _piecewise(writer: Writer, node: Node) -> str:
    """Each value where its condition holds and none before it."""
    arguments = node.arguments
    text = writer.number(arguments[-1]) if len(arguments) % 2 else "0"
    for i in reversed(range(0, len(arguments) - 1, 2)):
        holds = writer.chooses(writer, arguments[i + 1])
        value = writer.number(arguments[i])
        text = value if holds == "1" else text if holds == "0" else f"select({holds}, {value}, {text})"
    return text


def _quotient(writer: Writer, node: Node) -> str:
    """The quotient rounded towards zero."""
    a, b = map(writer.number, node.arguments)
    return f"(sign({a}/{b})*floor(abs({a}/{b})))"


def _remainder(writer: Writer, node: Node) -> str:
    a, b = map(writer.number, node.arguments)
    return f"({a} - {b}*{_quotient(writer, node)})"


def _factorial(writer: Writer, node: Node) -> str:
    given = _one(node)
    if given.kind != "number" or "/" in given.value or not 0 <= float(given.value) <= 100:
        raise NotExpressible("factorial of what is not a number", node.element)
    return str(math.factorial(round(float(given.value))))


def _call(writer: Writer, node: Node) -> str:
    return f"{writer.function(node.name)}({', '.join(map(writer.number, node.arguments))})"


def _extreme(writer: Writer, node: Node) -> str:
    texts = list(map(writer.number, node.arguments))
    return texts[0] if len(texts) == 1 else f"{node.kind}({', '.join(texts)})"


_UNKNOWN = {
    "delay": "delay equations",
    "infinity": "infinity or not-a-number as a value",
    "notanumber": "infinity or not-a-number as a value",
}
_SPECIAL: dict[str, Callable[[Writer, Node], str]] = {
    "number": _constant,
    "name": lambda writer, node: writer.name(node),
    "call": _call,
    "plus": _listed(" + ", "0"),
    "times": _listed("*", "1"),
    "minus": _minus,
    "divide": _listed("/", "1"),
    "power": _listed("**", "1"),
    "root": _root,
    "log": _log,
    "piecewise": _piecewise,
    "quotient": _quotient,
    "rem": _remainder,
    "factorial": _factorial,
    "rateOf": lambda writer, node: writer.rate(_one(node)),
    "max": _extreme,
    "min": _extreme,
    "time": lambda writer, node: writer.time,
    "avogadro": lambda writer, node: AVOGADRO,
    "exponentiale": lambda writer, node: "exp(1)",
    "pi": lambda writer, node: "pi",
}
