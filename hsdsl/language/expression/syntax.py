"""The tree of an expression. Every node has the range of its characters."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal, Protocol

Expected = Literal["number", "condition", "inequality"]


class Ranged(Protocol):
    """A token or a node: it has a range of characters."""

    @property
    def start(self) -> int: ...
    @property
    def end(self) -> int: ...


class ExpressionError(Exception):
    """A fault at the characters ``start`` to ``end`` of an expression."""

    def __init__(self, code: str, message: str, start: int, end: int, hint: str | None = None) -> None:
        super().__init__(message)
        self.code = code
        self.message = message
        self.start = start
        self.end = end
        self.hint = hint

    @classmethod
    def at(cls, node: Ranged, code: str, message: str, hint: str | None = None) -> ExpressionError:
        """A fault at a token or a node."""
        return cls(code, message, node.start, node.end, hint)


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
class Negative:
    """``-operand``."""

    operand: Tree
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Sum:
    """Terms added (False) or subtracted (True), from left to right."""

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
    """Conditions joined by `and` or by `or`."""

    operator: Literal["and", "or"]
    operands: tuple[Tree, ...]
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Not:
    """``not operand``."""

    operand: Tree
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Truth:
    """`true` or `false`."""

    value: bool
    start: int
    end: int


Tree = Number | Name | Negative | Sum | Product | Power | Call | Comparison | Logic | Not | Truth
CONDITIONS = (Comparison, Logic, Not, Truth)


def children(tree: Tree) -> tuple[Tree, ...]:
    """The nodes directly below one."""
    match tree:
        case Number() | Name() | Truth():
            return ()
        case Negative() | Not():
            return (tree.operand,)
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
        case Negative() | Not():
            return replace(tree, operand=change(tree.operand))
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
