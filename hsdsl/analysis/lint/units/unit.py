# pyright: basic
"""Units as a factor and powers of base dimensions, read by our own grammar; pint knows the names.

A temperature in degC counts as one in kelvin: differences are what equations are made of.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache
from typing import Any

from hsdsl.language.expression import ExpressionError, parse
from hsdsl.language.expression.parse import Name, Negative, Number, Power, Product, Tree

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
        parts = [(_BASE.get(name, name.strip("[]")), power) for name, power in sorted(self.powers, key=_order)]
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
_BASE = {"[length]": "m", "[mass]": "kg", "[time]": "s", "[current]": "A"}
_BASE |= {"[temperature]": "K", "[substance]": "mol", "[luminosity]": "cd"}


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
        case Negative():
            inner = exponent_of(tree.operand)
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
