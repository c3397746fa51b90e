"""The unit of an expression, from those of its names, and what does not fit on the way.

A number by itself takes the expected unit: `x >= 14` is right in metres. In a product it is a plain factor: `2*x` is in
metres too. A name without a unit has an unknown one, and so has every expression with it. Zero has any unit, also as a
factor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal

from hsdsl.analysis.lint.source_expressions import SourceExpression
from hsdsl.analysis.lint.units.unit import ONE, Unit, exponent_of
from hsdsl.base.functions import CONSTANTS  # pyright: ignore[reportUnknownVariableType]
from hsdsl.language.expression.parse import (
    Call,
    Comparison,
    Logic,
    Name,
    Negative,
    Not,
    Number,
    Power,
    Product,
    Sum,
    Tree,
    Truth,
)

Any_ = Literal["any", "unknown"]  # a number that takes the expected unit; an unknown unit
Measure = Unit | Any_
Kind = Literal["sum", "argument"]
_ALIKE = ("min", "max", "atan2")
_KEPT = ("abs", "floor")
_PLAIN = ("sign",)


@dataclass(frozen=True)
class Misfit:
    """A part of an expression with a unit that does not fit."""

    kind: Kind
    node: Tree
    message: str


@dataclass
class Walk:
    """Goes through one expression; what does not fit is gathered in ``misfits``."""

    unit_of: Callable[[str], Measure]
    text: str
    functions: Mapping[str, SourceExpression] = field(default_factory=dict[str, SourceExpression])
    misfits: list[Misfit] = field(default_factory=list[Misfit])

    def measure(self, tree: Tree) -> Measure:
        """The unit of a number, or of the sides of a condition."""
        match tree:
            case Number():
                return "any" if tree.value else "unknown"
            case Name():
                return "any" if tree.name in CONSTANTS else self.unit_of(tree.name)
            case Negative():
                return self.measure(tree.operand)
            case Sum():
                return self._alike([term for _, term in tree.terms], "added to")
            case Product():
                return self._product(tree)
            case Power():
                return self._power(tree)
            case Call():
                return self._call(tree)
            case Comparison():
                return self._alike(list(tree.operands), "compared with")
            case Logic():
                for operand in tree.operands:
                    self.measure(operand)
                return "unknown"
            case Not():
                return self.measure(tree.operand)
            case Truth():
                return "unknown"

    def _alike(self, parts: list[Tree], how: str) -> Measure:
        """All parts have one unit, which is the answer; the first that differs is to blame."""
        known: Unit | None = None
        unsure = False
        for part in parts:
            found = self.measure(part)
            if found == "unknown":
                unsure = True
            elif isinstance(found, Unit):
                if known is None:
                    known = found
                elif not known.same(found):
                    message = f"`{self.quoted(part)}`, in {found.compared_with(known)}, is {how} something in {known}"
                    self.misfits.append(Misfit("sum", part, message))
                    return "unknown"
        return known if known is not None else "unknown" if unsure else "any"

    def _product(self, tree: Product) -> Measure:
        result, plain, unsure = ONE, True, False
        for divided, factor in tree.factors:
            found = self.measure(factor)
            if isinstance(found, Unit):
                result = result.times(found.to(Fraction(-1 if divided else 1)))
                plain = False
            elif found == "unknown":
                unsure = True
        if unsure:
            return "unknown"
        free = any(self._number(factor) for _, factor in tree.factors)
        return "any" if plain or (free and result.pure) else result

    def _number(self, tree: Tree) -> bool:
        return isinstance(tree, Number) or (isinstance(tree, Negative) and self._number(tree.operand))

    def _power(self, tree: Power) -> Measure:
        self._pure(tree.exponent, "an exponent")
        base, exponent = self.measure(tree.base), exponent_of(tree.exponent)
        if not isinstance(base, Unit):
            return base
        if exponent is not None:
            return base.to(exponent)
        if not base.pure:
            message = f"`{self.quoted(tree.base)}`, in {base}, is raised to a power that is no plain number"
            self.misfits.append(Misfit("argument", tree.base, message))
            return "unknown"
        return base

    def _written_out(self, tree: Call, function: SourceExpression) -> Measure:
        """The unit of a function of the file with these arguments."""
        pairs = zip(function.arguments, tree.arguments, strict=True)
        given: dict[str, Measure] = {name: self.measure(argument) for name, argument in pairs}

        def unit_of(name: str) -> Measure:
            return given[name] if name in given else self.unit_of(name)

        inner = Walk(unit_of, function.scalar.value, self.functions)
        found = inner.measure(function.tree)
        if inner.misfits:
            self.misfits.append(Misfit(inner.misfits[0].kind, tree, f"in `{tree.function}` {inner.misfits[0].message}"))
        return found

    def _call(self, tree: Call) -> Measure:
        if tree.function in self.functions:
            return self._written_out(tree, self.functions[tree.function])
        if tree.function in _ALIKE:
            found = self._alike(list(tree.arguments), "compared with")
            return ONE if tree.function == "atan2" else found
        if tree.function == "sum":
            return self.measure(tree.arguments[0])
        if tree.function == "count":
            return ONE
        if tree.function == "select":
            self.measure(tree.arguments[0])
            return self._alike(list(tree.arguments[1:]), "chosen in place of")
        if tree.function in _KEPT:
            return self.measure(tree.arguments[0])
        if tree.function == "sqrt":
            found = self.measure(tree.arguments[0])
            return found.to(Fraction(1, 2)) if isinstance(found, Unit) else found
        if tree.function in _PLAIN:
            self.measure(tree.arguments[0])
            return ONE
        for argument in tree.arguments:
            self._pure(argument, f"the argument of `{tree.function}`")
        return ONE

    def _pure(self, tree: Tree, what: str) -> None:
        found = self.measure(tree)
        if isinstance(found, Unit) and not found.pure:
            message = f"`{self.quoted(tree)}`, {what}, is in {found.compared_with(ONE)} and not a plain number"
            self.misfits.append(Misfit("argument", tree, message))

    def quoted(self, tree: Tree) -> str:
        """The text of a part, cut to what a sentence carries."""
        text = self.text[tree.start : tree.end]
        return text if len(text) <= 40 else text[:37] + "..."
