# pyright: basic
"""Units: what names are measured in, by our own grammar and pint's names, and what follows for expressions.

Units are checked and never converted: metres and millimetres are two units, and their sum is a finding. The unit of `t`
is given like any other. By default it is the second where some unit of the model has time in it, and unknown elsewhere.
A temperature in degC counts as one in kelvin: differences are what equations are made of.

A number by itself takes the expected unit: `x >= 14` is right in metres. In a product it is a plain factor: `2*x` is in
metres too. A name without a unit has an unknown one, and so has every expression with it. Zero has any unit, also as a
factor.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache, cached_property
from typing import Any, Literal, NamedTuple

from hsdsl.analysis.lint.source_expressions import TIME, SourceExpression
from hsdsl.base.functions import CONSTANTS  # pyright: ignore[reportUnknownVariableType]
from hsdsl.base.names import SINCE
from hsdsl.language.expression import ExpressionError, parse
from hsdsl.language.expression.parse import Call, Comparison, Logic, Name, Number, Power, Product, Sum, Tree, Truth
from hsdsl.language.schema.documents import AutomatonDocument, ModelDocument, ParameterEntry
from hsdsl.language.source import Scalar

_LONGEST = 100  # characters
_LARGEST_POWER = 100
_MOST_NAMES = 6  # of units that a message carries; beyond that it has base units
Powers = tuple[tuple[str, Fraction], ...]


@dataclass(frozen=True)
class Unit:
    """What something is measured in: its size in SI base units, and its dimensions, sorted, without those of power 0.

    ``names`` are the units of the file it is made of, as ``mV/ms``: how messages say it.
    """

    factor: float = 1.0
    powers: Powers = ()
    names: Powers = field(default=(), compare=False)

    def times(self, other: Unit) -> Unit:
        """The product."""
        powers, names = _joined(self.powers, other.powers), _joined(self.names, other.names)
        return Unit(self.factor * other.factor, tuple(sorted(powers)), names)

    def to(self, exponent: Fraction) -> Unit:
        """A power."""
        try:
            factor = self.factor ** float(exponent)
        except (OverflowError, ZeroDivisionError):
            factor = float("inf")
        powers, names = (tuple((n, p * exponent) for n, p in of if exponent) for of in (self.powers, self.names))
        return Unit(factor, powers, names)

    def same(self, other: Unit) -> bool:
        """Whether both are one unit, by size too."""
        return self.powers == other.powers and abs(self.factor - other.factor) <= 1e-9 * abs(self.factor)

    @property
    def pure(self) -> bool:
        """Whether it is that of a plain number, or the radian."""
        return not self.powers and abs(self.factor - 1) <= 1e-9

    def __str__(self) -> str:
        """In the units of the file, as ``mV/ms``, or in base units, as ``1000 kg*m/s**2``."""
        if 0 < len(self.names) <= _MOST_NAMES:
            return _quotient(self.names)
        parts = [(BASE.get(name, name.strip("[]")), power) for name, power in sorted(self.powers, key=_order)]
        whole, size = _quotient(parts), f"{self.factor:.6g}"
        if abs(self.factor - 1) <= 1e-9:
            return whole
        return size + whole[1:] if whole.startswith("1") else f"{size} {whole}"

    def compared_with(self, other: Unit) -> str:
        """As text, with its size where the dimensions are equal: ``V (1000 mV)``."""
        if self.powers != other.powers or not other.factor:
            return str(self)
        return f"{self} ({self.factor / other.factor:.6g}{'' if other == ONE else f' {other}'})"


def _joined(one: Powers, other: Powers) -> Powers:
    powers = dict(one)
    for name, power in other:
        powers[name] = powers.get(name, Fraction(0)) + power
    return tuple((name, power) for name, power in powers.items() if power)


def _quotient(parts: Iterable[tuple[str, Fraction]]) -> str:
    above, below = ([(name, abs(power)) for name, power in parts if (power > 0) is up] for up in (True, False))
    over, under = ("*".join(n if p == 1 else f"{n}**{_plain(p)}" for n, p in part) for part in (above, below))
    under = f"({under})" if len(below) > 1 else under
    return (over or "1") + (f"/{under}" if under else "")


def _order(item: tuple[str, Fraction]) -> tuple[bool, str]:
    return item[0] != "[mass]", item[0]  # kg*m, as people write it


ONE = Unit()
_ELSEWHERE = {ord(sign): f"**{digit}" for digit, sign in zip("123456789", "¹²³⁴⁵⁶⁷⁸⁹", strict=True)}
_ELSEWHERE |= str.maketrans({"⁻": "**-", "^": "**", "·": "*", "⋅": "*", "µ": "u"})
BASE = {"[length]": "m", "[mass]": "kg", "[time]": "s", "[current]": "A"}
BASE |= {"[temperature]": "K", "[substance]": "mol", "[luminosity]": "cd"}


def _plain(power: Fraction) -> str:
    return str(power) if power.denominator == 1 else f"({power})"


class UnknownUnit(Exception):
    """A text that is no unit; carries the names in it that nobody knows."""

    def __init__(self, names: tuple[str, ...] = (), better: str | None = None) -> None:
        super().__init__(", ".join(names))
        self.names = names
        self.better = better  # how it is written here, where that is known


def read(text: str) -> Unit:
    """The unit that a text such as ``kg*m/s**2`` means; raises :class:`UnknownUnit` for another text or name."""
    if len(text) > _LONGEST:
        raise UnknownUnit
    try:
        tree = parse(text)
    except ExpressionError:
        raise UnknownUnit(better=_better(text)) from None
    return _of(tree)


def _better(text: str) -> str | None:
    """A unit written as elsewhere (``m/s^2``, ``N·m``, ``kg m/s²``) as it is written here; None where it is none."""
    plain = text.translate(_ELSEWHERE).replace("**-**", "**-")
    plain = re.sub(r"(?<=[\w)])\s+(?=[A-Za-z(])", "*", plain.strip())
    try:
        return plain if plain != text and _of(parse(plain)) else None
    except (ExpressionError, UnknownUnit):
        return None


def _of(tree: Tree) -> Unit:
    match tree:
        case Name():
            return replace(_named(tree.name), names=((tree.name, Fraction(1)),))
        case Number():
            if tree.value <= 0:
                return _refuse()
            return Unit(
                float(tree.value), names=() if tree.value == 1 else ((f"{float(tree.value):.6g}", Fraction(1)),)
            )
        case Product():
            result = ONE
            for divided, factor in tree.factors:
                result = result.times(_of(factor).to(Fraction(-1 if divided else 1)))
            return result
        case Power():
            return _of(tree.base).to(exponent_of(tree.exponent) or _refuse())
    return _refuse()


def exponent_of(tree: Tree) -> Fraction | None:
    """An exponent that is written as a number: ``2``, ``-1``, ``(1/2)``."""
    match tree:
        case Number():
            return tree.value if abs(tree.value) <= _LARGEST_POWER else None
        case Sum(((True, operand),)):
            inner = exponent_of(operand)
            return None if inner is None else -inner
        case Product():
            result = Fraction(1)
            for divided, factor in tree.factors:
                part = exponent_of(factor)
                if part is None or (divided and not part):
                    return None
                result = result / part if divided else result * part
            return result
    return None


def _refuse() -> Any:
    raise UnknownUnit


@cache
def _named(name: str) -> Unit:
    import pint

    registry = _registry()
    try:
        factor, _ = registry.get_base_units(name, check_nonmult=False)
        powers = registry.get_dimensionality(name)
    except (pint.UndefinedUnitError, pint.DefinitionSyntaxError, ValueError, TypeError):
        raise UnknownUnit((name,)) from None
    return Unit(float(factor), tuple(sorted((n, Fraction(p).limit_denominator(1000)) for n, p in powers.items())))


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


def names_like(name: str) -> list[str]:
    """Names of units, and plurals, that begin like a name and are about as long."""
    known = sorted(other for other in _registry() if other.isascii())
    known += [f"{other}s" for other in known if len(other) > 2]
    return [other for other in known if other[:1] == name[:1] and abs(len(other) - len(name)) <= 2]


Any_ = Literal["any", "unknown"]  # a number that takes the expected unit; an unknown unit
Measure = Unit | Any_
Kind = Literal["sum", "argument"]
_ALIKE = ("min", "max", "atan2")
_KEPT = ("abs", "floor")
_PLAIN = ("sign",)


Misfit = tuple[Kind, Tree, str]  # a part of an expression with a unit that does not fit, and what to say


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
                    self.misfits.append(("sum", part, message))
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
        """Whether a factor is a number, perhaps with signs."""
        match tree:
            case Sum(((True, operand),)):
                return self._number(operand)
            case _:
                return isinstance(tree, Number)

    def _power(self, tree: Power) -> Measure:
        self._pure(tree.exponent, "an exponent")
        base, exponent = self.measure(tree.base), exponent_of(tree.exponent)
        if not isinstance(base, Unit):
            return base
        if exponent is not None:
            return base.to(exponent)
        if not base.pure:
            message = f"`{self.quoted(tree.base)}`, in {base}, is raised to a power that is no plain number"
            self.misfits.append(("argument", tree.base, message))
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
            kind, _, message = inner.misfits[0]
            self.misfits.append((kind, tree, f"in `{tree.function}` {message}"))
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
            self.misfits.append(("argument", tree, message))

    def quoted(self, tree: Tree) -> str:
        """The text of a part, cut to what a sentence carries."""
        text = self.text[tree.start : tree.end]
        return text if len(text) <= 40 else text[:37] + "..."


_INDEX = re.compile(r"\[[^\]]*\]")
_VALUES = ("parameter", "input", "reset", "output", "initial", "scale", "reference", "experiment", "delay")


class Checked(NamedTuple):
    """An expression, its unit, the one that it should have, if that is known, and what does not fit in it."""

    written: SourceExpression
    measure: Measure
    expected: Unit | None
    misfits: tuple[Misfit, ...]


class Units:
    """The units of one model, or of one of its automata, from what gives units and its expressions.

    ``of_parts`` has the units of names of instances, which others use.
    """

    def __init__(
        self,
        document: ModelDocument,
        expressions: tuple[SourceExpression, ...],
        automaton: AutomatonDocument | None = None,
        of_parts: Mapping[str, str] | None = None,
    ) -> None:
        self._expressions = expressions
        self._of_parts = {_INDEX.sub("", name): unit for name, unit in (of_parts or {}).items() if "." in name}
        self._functions = {str(e.name): e for e in expressions if e.role == "function"}
        self._lets: dict[str, dict[str | None, Measure]] = {}  # by name, and by the mode that has it
        self._texts = _texts(document)
        if automaton is not None:
            states = (state for mode in automaton.modes.values() for state in mode.flow or ())
            own = {*map(str, (*automaton.parameters, *automaton.inputs, *states))}
            outer = {name: text for name, text in self._texts.items() if name not in own}
            self._texts = outer | _texts(automaton)

    @property
    def given(self) -> bool:
        """Whether the file gives units at all."""
        return bool(self._texts or self._of_parts)

    @cached_property
    def _read(self) -> tuple[Mapping[str, Unit], tuple[tuple[Scalar, UnknownUnit], ...]]:
        known: dict[str, Unit] = {}
        wrong: list[tuple[Scalar, UnknownUnit]] = []
        for name, scalar in self._texts.items():
            try:
                known[name] = read(scalar.value)
            except UnknownUnit as error:
                wrong.append((scalar, error))
        if "t" not in self._texts and any(n == "[time]" for unit in known.values() for n, _ in unit.powers):
            known["t"] = read("s")
        return known, tuple(wrong)

    @property
    def misread(self) -> tuple[tuple[Scalar, UnknownUnit], ...]:
        """The texts that are no units."""
        return self._read[1]

    def of(self, name: str) -> Unit | None:
        """The unit of a state, a parameter, an input, an output, `t` or `since`; None where it is not known."""
        known = self._read[0]
        if "." in name:
            return known.get(name) or self._of_part(_INDEX.sub("", name))
        return known.get("t") if name == SINCE and name not in known else known.get(name)

    def _of_part(self, name: str) -> Unit | None:
        try:
            return read(self._of_parts[name]) if name in self._of_parts else None
        except UnknownUnit:  # reported with its automaton
            return None

    @cached_property
    def checked(self) -> tuple[Checked, ...]:
        """Every expression but functions, which have units where they are called."""
        return tuple(self._check(e) for e in self._expressions if e.role != "function") if self.given else ()

    def _check(self, written: SourceExpression) -> Checked:
        walk = Walk(lambda name: self._name(written.mode, name), written.scalar.value, self._functions)
        measure = walk.measure(written.tree)
        if written.role == "let":
            self._lets.setdefault(str(written.name), {})[written.mode] = measure
        return Checked(written, measure, self._expected(written), tuple(walk.misfits))

    def _expected(self, written: SourceExpression) -> Unit | None:
        own, time = self.of(str(written.unit_of or written.name)), self.of(TIME)
        if written.role == "flow":
            return None if own is None or time is None else own.times(time.to(Fraction(-1)))
        return own if written.role in _VALUES else None

    def _name(self, mode: str | None, name: str) -> Measure:
        unknown: Any_ = "unknown"
        lets = self._lets.get(name)
        if lets is None:
            return self.of(name) or unknown
        if mode is not None:
            return lets.get(mode, lets.get(None, unknown))
        first, *others = lets.values()  # an output of the whole model is read in every mode
        return first if all(other == first for other in others) else unknown


def _texts(document: ModelDocument | AutomatonDocument) -> dict[str, Scalar]:
    """What is written for the unit of each name."""
    found = {str(key): scalar for key, scalar in document.units.items() if scalar is not None}
    for key, entry in document.parameters.items():
        if isinstance(entry, ParameterEntry) and entry.unit is not None:
            found.setdefault(str(key), entry.unit)
    return found
