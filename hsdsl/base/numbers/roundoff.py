"""Routines whose round-off is followed: an arithmetic for generated code, over the numbers that a run computes with.

Every number carries what rounding has made of it so far, to first order. *Traced*, an operation's own rounding is known
with its sign: a product and its rounding are exact together. What functions of the library round is bounded. So a
result that is exact has no error, and one that is all round-off is known for that. *Bounded*, all rounding counts
either way and at its most, as of a flow whose rounding changes along a step.

As ``runtime/c/roundoff.c`` does, with the same operations in the same order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, partial, reduce
from math import inf, isfinite
from operator import mul
from typing import Any

from hsdsl.base.numbers.arithmetic import Arithmetic, Number, repeated

ROUNDOFF_UNITS = 32  # below so many of the sizes of its terms a surface counts as zero
LIBRARY = 16  # units of round-off that functions of the library may be wrong by
BEYOND = {"pi": 1.2246467991473532e-16, "e": 1.4456468917292502e-16}  # what their nearest floats leave out


@dataclass(frozen=True, eq=False, slots=True)
class Rounded:
    """A number with its round-off: the exact one is ``value + error``, but for ``off`` at most."""

    of: Roundoff
    value: Number
    error: Number
    off: Number

    def __neg__(self) -> Rounded:
        return Rounded(self.of, -self.value, -self.error, self.off)

    def __add__(self, other: Rounded) -> Rounded:
        a, b = self.value, other.value
        value = a + b
        part = value - a
        lost = (a - (value - part)) + (b - part)
        return self.of.made(value, self.error + other.error, self.off + other.off, lost)

    def __sub__(self, other: Rounded) -> Rounded:
        return self + -other

    def __mul__(self, other: Any) -> Rounded:
        other = other if isinstance(other, Rounded) else self.of.exact(other)
        a, b = self.value, other.value
        value = a * b
        error = a * other.error + b * self.error + self.error * other.error
        off = abs(a) * other.off + (abs(b) + other.off) * self.off
        return self.of.made(value, error, off, self.of.lost(a, b, value))

    __rmul__ = __mul__

    def __truediv__(self, other: Rounded) -> Rounded:
        a, b = self.value, other.value
        value, least = a / b, abs(b) - other.off
        lost = (self.error - value * other.error - self.of.lost(value, b, a)) / (b + other.error)
        off = (self.off + abs(value) * other.off) / least if least > 0 else inf
        return self.of.made(value, 0, off, lost, 2)

    def __lt__(self, other: Any) -> bool:
        return self.value < (other.value if isinstance(other, Rounded) else other)

    def __gt__(self, other: Any) -> bool:
        return self.value > (other.value if isinstance(other, Rounded) else other)

    def __abs__(self) -> Rounded:
        if self.value == 0:
            return Rounded(self.of, abs(self.value), abs(self.error), self.off)
        return self if self.value > 0 else -self


class Roundoff:
    """How operations round: over a number type, ``traced`` or bounded."""

    def __init__(self, base: Arithmetic, traced: bool) -> None:
        self.base, self.traced = base, traced
        self.ulp = 2 * base.unit
        self.lost: Callable[[Number, Number, Number], Number] = _lost if base.digits is None else _lost_of(base)

    def exact(self, value: Number) -> Rounded:
        """An exact number."""
        return Rounded(self, value, self.base.zero, self.base.zero)

    def made(self, value: Number, error: Number, off: Number, lost: Number, units: int = 1) -> Rounded:
        """The result of an operation, with the error ``lost`` or a bound in units of the last place."""
        if self.traced:
            return Rounded(self, value, error + lost, off)
        return Rounded(self, value, self.base.zero, off + abs(value) * (units * self.ulp))

    def constant(self, value: Fraction) -> Rounded:
        """The nearest number to a fraction."""
        nearest = self.base.constant(value)
        if not self.base.isfinite(nearest):
            return self.exact(nearest)
        if self.base.digits is None:
            return self._around(nearest, float(value - Fraction(nearest)))
        context = nearest.context
        rest = context.fsub(value.numerator, context.fmul(nearest, value.denominator, exact=True), exact=True)
        return self._around(nearest, rest / value.denominator)

    def beyond(self, name: str) -> Rounded:
        """The nearest number to pi or e."""
        nearest = self.base.functions[name]
        return self._around(nearest, BEYOND[name] if self.base.digits is None else self.ulp * nearest)

    def _around(self, nearest: Number, error: Number) -> Rounded:
        if self.traced or error == 0:
            return Rounded(self, nearest, error, self.base.zero)
        return Rounded(self, nearest, self.base.zero, abs(nearest) * self.ulp)

    def function(self, name: str, *arguments: Rounded) -> Rounded:
        """A smooth function of the library."""
        functions, values = self.base.functions, [a.value for a in arguments]
        value, error, off = functions[name](*values), self.base.zero, self.base.zero
        for a, slope in zip(arguments, SLOPES[name](functions, value, values[0], values[-1]), strict=True):
            error = error + slope * a.error if a.error != 0 else error
            off = off + a.off * self._steepest(name, a, slope) if a.off > 0 else off
        return Rounded(self, value, error, off + abs(value) * (LIBRARY * self.base.unit))

    def _steepest(self, name: str, a: Rounded, slope: Number) -> Number:
        """How steep a function is at most where its argument may be; of those that grow little, where it is."""
        if name in ("sin", "cos", "tanh", "atan"):
            return 1
        if name == "exp":
            return self.base.functions["exp"](a.value + a.off)
        if name == "log":
            return 1 / (a.value - a.off) if a.value - a.off > 0 else inf
        return abs(slope)

    def root(self, a: Rounded) -> Rounded:
        """The square root; what it loses is known."""
        value, least = self.base.sqrt(a.value), a.value - a.off
        off = self.base.zero
        if a.off > 0:
            off = a.off * (0.5 / self.base.sqrt(least)) if least > 0 else inf
        if not self.traced:
            return Rounded(self, value, self.base.zero, off + abs(value) * (LIBRARY * self.base.unit))
        lost, beyond = a.error - self.lost(value, value, a.value), a.value + a.error
        error = lost / (value + self.base.sqrt(beyond if beyond > 0 else self.base.zero)) if lost != 0 else lost
        return Rounded(self, value, error, off)

    def power(self, base: Rounded, exponent: Rounded) -> Rounded:
        """A power: of a whole exponent a product."""
        whole = exponent.value
        if exponent.error == 0 and exponent.off == 0 and 0 < whole < 1 << 20 and whole % 1 == 0:
            return repeated(mul, int(whole), base)
        return self.function("pow", base, exponent)

    def stepped(self, name: str, a: Rounded) -> Rounded:
        """`sign` or `floor`: what round-off changes of it is a jump."""
        step = self.base.functions[name]
        value = step(a.value)
        if self.traced:
            at = a.value + a.error
            return Rounded(self, value, step(at) - value, step(at + a.off) - step(at - a.off))
        clear = abs(a.value) > a.off or a.off == 0 if name == "sign" else step(a.value - a.off) == step(a.value + a.off)
        return Rounded(self, value, self.base.zero, self.base.zero if clear else inf)

    def tangent(self, a: Rounded) -> Rounded:
        """The tangent, as a quotient."""
        return self.function("sin", a) / self.function("cos", a)

    def heaviside(self, a: Rounded) -> Rounded:
        """Half of 1 and the sign."""
        return self.constant(Fraction(1, 2)) * (self.constant(Fraction(1)) + self.stepped("sign", a))

    def least(self, a: Rounded, b: Rounded) -> Rounded:
        """The smaller of two, as round-off has it."""
        return self._chosen(min(a.value, b.value), b.value + b.error < a.value + a.error, a, b)

    def most(self, a: Rounded, b: Rounded) -> Rounded:
        """The larger of two, as round-off has it."""
        return self._chosen(max(a.value, b.value), b.value + b.error > a.value + a.error, a, b)

    def _chosen(self, value: Number, second: bool, a: Rounded, b: Rounded) -> Rounded:
        """One of two; the other one counts by how far beyond it that may be."""
        chosen, other = (b, a) if second else (a, b)
        reach = other.off - abs((other.value + other.error) - (chosen.value + chosen.error))
        off = reach if reach > chosen.off else chosen.off
        return Rounded(self, value, (chosen.value - value) + chosen.error, off)

    def below(self, number: Rounded, bound: Rounded, one: Rounded, other: Rounded) -> Rounded:
        """Choose between two numbers, as round-off has it."""
        taken = one if number.value < bound.value else other
        meant = one if number.value + number.error < bound.value + bound.error else other
        apart, blurred = abs(number.value - bound.value), number.off + bound.off
        unclear = not self.traced and blurred > 0 and apart <= blurred
        return Rounded(self, taken.value, (meant.value - taken.value) + meant.error, inf if unclear else meant.off)


_HALF = 134217729.0  # 2**27 + 1: what cuts the digits of a float in half


def _lost(a: float, b: float, product: float) -> float:
    """What a product of two numbers is beyond another number, exactly.

    In floats where no part of it can overflow or underflow (Dekker 1971, doi:10.1007/BF01397083).
    """
    p = a * b
    if 1e-270 < abs(p) < 1e270 and 1e-270 < abs(a) < 1e270 and 1e-270 < abs(b) < 1e270 and 0.5 <= product / p <= 2:
        cut, other = _HALF * a, _HALF * b
        high, head = cut - (cut - a), other - (other - b)
        low, tail = a - high, b - head
        return (p - product) + (((high * head - p) + high * tail + low * head) + low * tail)
    if not isfinite(product) or not isfinite(a) or not isfinite(b):
        return product - product
    return float(Fraction(a) * Fraction(b) - Fraction(product))


def _lost_of(base: Arithmetic) -> Callable[[Number, Number, Number], Number]:
    context = base.zero.context
    return lambda a, b, product: +context.fsub(context.fmul(a, b, exact=True), product, exact=True)


Slopes = Callable[[Mapping[str, Any], Number, Number, Number], tuple[Number, ...]]
SLOPES: dict[str, Slopes] = {  # by functions, its value and its arguments
    "exp": lambda f, v, x, y: (v,),
    "log": lambda f, v, x, y: (1 / x,),
    "sin": lambda f, v, x, y: (f["cos"](x),),
    "cos": lambda f, v, x, y: (-f["sin"](x),),
    "tanh": lambda f, v, x, y: (1 - v * v,),
    "atan": lambda f, v, x, y: (1 / (1 + x * x),),
    "asin": lambda f, v, x, y: (_over(1, f["sqrt"](1 - x * x)),),
    "acos": lambda f, v, x, y: (-_over(1, f["sqrt"](1 - x * x)),),
    "sinh": lambda f, v, x, y: (f["cosh"](x),),
    "cosh": lambda f, v, x, y: (f["sinh"](x),),
    "asinh": lambda f, v, x, y: (1 / f["sqrt"](x * x + 1),),
    "acosh": lambda f, v, x, y: (_over(1, f["sqrt"](x * x - 1)),),
    "atanh": lambda f, v, x, y: (_over(1, 1 - x * x),),
    "atan2": lambda f, v, x, y: (_over(y, y * y + x * x), _over(-x, y * y + x * x)),
    "pow": lambda f, v, x, y: (_over(v * y, x), v * f["log"](x) if x > 0 else x * 0),
}


def _over(a: Number, b: Number) -> Number:
    return a / b if b != 0 else inf


@cache
def following(base: Arithmetic, traced: bool) -> Arithmetic:
    """The arithmetic that follows the round-off of another one."""
    how = Roundoff(base, traced)
    functions: dict[str, Any] = {name: partial(how.function, name) for name in SLOPES} | {
        "sqrt": how.root,
        "pow": how.power,
        "tan": how.tangent,
        "abs": abs,
        "sign": partial(how.stepped, "sign"),
        "floor": partial(how.stepped, "floor"),
        "heaviside": how.heaviside,
        "min": partial(_folded, how.least),
        "max": partial(_folded, how.most),
        "below": how.below,
        "pi": how.beyond("pi"),
        "e": how.beyond("e"),
        "nan": how.exact(base.functions["nan"]),
    }
    return Arithmetic(
        name=f"{'traced' if traced else 'bounded'} {base.name}",
        digits=base.digits,
        bits=base.bits,
        unit=base.unit,
        constant=how.constant,
        isfinite=lambda number: base.isfinite(number.value),
        functions=functions,
    )


def _folded(choose: Callable[[Rounded, Rounded], Rounded], *values: Rounded) -> Rounded:
    return reduce(choose, values)


def exactly(arithmetic: Arithmetic, values: Iterable[Number]) -> tuple[Rounded, ...]:
    """Exact numbers, for routines over an arithmetic of `following`."""
    zero = arithmetic.zero
    return tuple(Rounded(zero.of, value, zero.error, zero.off) for value in values)


def moved(number: Rounded) -> Number:
    """A traced number moved by its round-off: at least to the next number, if it is not exact or nothing is known."""
    value, error, unit = number.value, number.error, number.of.base.unit
    by = abs(error) + number.off
    if not number.of.base.isfinite(by) or by == 0:
        return value
    least = 2 * unit * abs(value)
    by = by if by > least else least
    return value - by if error < 0 else value + by
