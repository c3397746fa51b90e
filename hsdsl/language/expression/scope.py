# pyright: basic
"""Scopes: the meaning of names in an expression."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import sympy as sp

from hsdsl.base.functions import CONSTANTS, FUNCTIONS
from hsdsl.base.names import SINCE, WORDS, did_you_mean, shown
from hsdsl.language.expression.parse import Call, ExpressionError, Name, Number, Product, Tree, explained, walk

TIME = sp.Symbol("t", real=True)
_MISSING: Any = object()
RESERVED = (TIME.name, *CONSTANTS, *FUNCTIONS, *WORDS)


@dataclass(frozen=True)
class Value:
    """The meaning of an expression.

    ``expr`` is over states, inputs, parameters and time. ``number`` is its value with the file's own parameters (an
    mpmath number; NaN where it has none), None where a state, input or time is in it. ``constant`` says that not even a
    parameter is in it, and ``uses`` has the states it was written with. ``size`` counts its nodes and ``depth`` the
    nesting of its parentheses, written out in full; ``bits`` is the length of its exact numbers once products and
    powers are multiplied out.
    """

    expr: Any
    number: Any = None
    constant: bool = False
    uses: frozenset[str] = frozenset()
    size: int = 1
    depth: int = 0
    bits: int = 0


class Refusal(NamedTuple):
    """A name that exists and cannot be used here."""

    code: str
    message: str
    hint: str | None = None


@dataclass(frozen=True, eq=False)
class Function:
    """A function that a file defines, written out where it is called.

    ``tree`` is its expression, written as ``text``, over its arguments and the names of ``others``; None where that is
    broken. ``made`` has its values so far, by those of its arguments.
    """

    name: str
    arguments: tuple[str, ...]
    tree: Tree | None
    text: str
    others: Mapping[str, Meaning]
    made: dict[tuple[Value, ...], Value] = field(default_factory=dict)

    def scope(self, given: Mapping[str, Value]) -> Scope:
        """The names of its expression where its arguments have these values."""
        return Scope(ChainMap(dict(given), self.others))  # pyright: ignore[reportArgumentType]

    @property
    def example(self) -> str:
        """A call of it, with the names of its arguments."""
        return f"{self.name}({', '.join(self.arguments)})"


Meaning = Value | Refusal | Function | None


@dataclass(frozen=True)
class Scope:
    """The names that can be used in an expression.

    ``values`` has the meaning of each name: a value, a function, a refusal, or None where its own definition is broken.
    ``states`` are those of the mode of the expression, None where every state may be used; ``place`` names the mode in
    sentences. ``expanded`` writes sums over parts out; None where there are no parts, and names have no dots.
    """

    values: Mapping[str, Meaning]
    states: Set[str] | None = None
    place: str = "here"
    expanded: Callable[[Tree], Tree] | None = None

    def faults(self, tree: Tree) -> list[ExpressionError]:
        """Every name of an expression that cannot be used, and every function that cannot be called so."""
        faults: list[ExpressionError] = []
        passed, measured = 0, set[int]()  # where factors after a number begin: the unit of a quantity stands there
        for node in walk(tree):
            if isinstance(node, Product):
                pairs = pairwise(factor for _, factor in node.factors)
                measured |= {factor.start for before, factor in pairs if isinstance(before, Number)}
            if node.start < passed or not isinstance(node, (Name, Call)):
                continue
            name = node.name if isinstance(node, Name) else node.function
            start, end = node.start, node.end
            if "." in name and (isinstance(node, Call) or self.expanded is None):
                start += name.index(".")
                fault, end = _DOTTED, start + 1
            elif isinstance(node, Name):
                fault = self._name(name, start in measured)
            elif fault := self._call(name, node.arguments):
                passed = end if explained("timed", name, None) else passed  # its units mean nothing here
                end = start + len(name) if fault.code == "HS112" else end
            if fault and fault.message not in [other.message for other in faults]:
                faults.append(ExpressionError(fault.code, fault.message, start, end, fault.hint))
        return faults

    def broken(self, tree: Tree) -> bool:
        """Whether a name in it has a definition that is reported already."""
        called = (self.values.get(name) for name in functions_called(tree))
        return any(isinstance(n, Name) and self.values.get(n.name, _MISSING) is None for n in walk(tree)) or any(
            isinstance(function, Function) and function.tree is None for function in called
        )

    def _name(self, name: str, measured: bool) -> Refusal | None:
        """Why a name cannot be used; one that is ``measured`` is the factor after a number."""
        if name in CONSTANTS:
            return None
        value = self.values.get(name, _MISSING)  # of parts it is worked out at each look
        if name in FUNCTIONS or isinstance(value, Function):
            return Refusal("HS112", f"`{name}` is a function and needs its arguments", f"write {name}(...)")
        if value is _MISSING:
            known = [n for n, value in self.values.items() if isinstance(value, Value) and self._reachable(value)]
            hint = explained("unknown_name", name, known, measured)
            return Refusal("HS111", f"nothing here is called '{shown(name)}'", hint)
        if not isinstance(value, Value) or self._reachable(value):
            return value if isinstance(value, Refusal) else None
        assert self.states is not None
        lacking = ", ".join(f"'{s}'" for s in sorted(value.uses - self.states))
        message = f"'{name}' needs the state {lacking}, which {self.place} does not have"
        flow = ", ".join(f"{s}: 0" for s in sorted(value.uses - self.states))
        hint = f"add {flow} to its flow, where it then keeps its value"
        if value.uses == {name}:
            message = f"{self.place} has no state '{name}'"
            hint = did_you_mean(name, sorted(self.states - {SINCE}), hint)
        return Refusal("HS117", message, hint)

    def _call(self, name: str, arguments: Sequence[Tree]) -> Refusal | None:
        """Why a function cannot be called with these arguments."""
        known, given = self.values.get(name), len(arguments)
        if isinstance(known, Function):
            fewest = most = len(known.arguments)
            example = known.example
        elif name in FUNCTIONS:
            _, fewest, most = FUNCTIONS[name]
            example = f"{name}({'x' if most == fewest == 1 else 'x, y'})"
        elif name in self.values or name in CONSTANTS:
            return Refusal("HS112", f"'{shown(name)}' is not a function", _product_or_value(name, arguments))
        else:
            own = [name for name, value in self.values.items() if isinstance(value, Function)]
            first = arguments[0] if arguments else None
            time = f"{float(first.value):g}" if isinstance(first, Number) else getattr(first, "name", None)
            hint = explained("unknown_function", name, time, own)
            return Refusal("HS112", f"there is no function '{shown(name)}'", hint)
        broken = isinstance(known, Function) and known.tree is None
        if broken or (given >= fewest and (most is None or given <= most)):
            return None
        return Refusal("HS113", *explained("miscounted", name, given, fewest, most, example))

    def _reachable(self, value: Value) -> bool:
        return self.states is None or value.uses <= self.states


_DOTTED = Refusal("HS109", "names have no dots in an expression", "write the name or the function alone: sin(x)")


def _product_or_value(name: str, arguments: Sequence[Tree]) -> str:
    match arguments:
        case (Number(value),) if name == SINCE:
            return f"write since >= {float(value):g}: it is the time since the mode was entered"
        case _ if name == SINCE:
            return "write since alone: it is the time since the mode that the run is in was entered"
        case (Name("t"),):
            return f"write {name}: every name has its value at the present time"
        case (argument,) if any(isinstance(part, Name) and part.name == "t" for part in walk(argument)):
            return "a name has its value at the present time: there are no delays"
        case _:
            return f"write {name}*(...)"


def functions_called(tree: Tree) -> Iterator[str]:
    """The name of every function that an expression calls."""
    return (node.function for node in walk(tree) if isinstance(node, Call))


@lru_cache(maxsize=1 << 17)  # a system of thousands of parts has tens of thousands of names
def symbol(name: str) -> sp.Symbol:
    """The symbol of a state, parameter or sampled input: real, and never a thing of SymPy's own."""
    return sp.Symbol(name, real=True)


def slope_symbol(name: str) -> sp.Symbol:
    """The symbol of how fast a sampled input changes, by no name that a file can have."""
    return sp.Symbol(f"{name}'", real=True)


def state(name: str) -> Value:
    """A state's value."""
    return Value(symbol(name), uses=frozenset((name,)))
