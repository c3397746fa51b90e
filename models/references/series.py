"""Power series in time that compute themselves: each coefficient follows from lower ones, on demand and once.

The solution of x' = f(x) is the series whose coefficient n + 1 is coefficient n of f(x) over n + 1; f written with
these operations gives all of them (R. E. Moore, *Interval Analysis*, 1966, ch. 11).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from references.interpolation import Number, Vector, mp

States = Mapping[str, Any]  # name: Series
Flow = Callable[[States], Mapping[str, Any]]


class Series:
    """A power series; ``series[n]`` is its coefficient of s^n, ``rule(n)`` computes it from lower ones."""

    def __init__(self, rule: Callable[[int], Number]) -> None:
        self._rule = rule
        self._known: list[Number] = []

    @classmethod
    def constant(cls, value: Any) -> Series:
        """The series of a number."""
        number = mp.convert(value)
        return cls(lambda n: number if n == 0 else mp.zero)

    def __getitem__(self, n: int) -> Number:
        while len(self._known) <= n:
            self._known.append(self._rule(len(self._known)))
        return self._known[n]

    def upto(self, n: int) -> list[Number]:
        """Coefficients 0 to n."""
        self[n]
        return self._known[: n + 1]

    def __add__(self, other: Any) -> Series:
        b = _series(other)
        return Series(lambda n: self[n] + b[n])

    def __mul__(self, other: Any) -> Series:
        if not isinstance(other, Series):
            factor = mp.convert(other)
            return Series(lambda n: factor * self[n])
        return Series(lambda n: mp.fdot(self.upto(n), reversed(other.upto(n))))

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Series:
        return Series(lambda n: -self[n])

    def __sub__(self, other: Any) -> Series:
        return self + -_series(other)

    def __rsub__(self, other: Any) -> Series:
        return _series(other) - self

    def __truediv__(self, other: Series) -> Series:
        """Q = a/b, from a = b q."""

        def rule(n: int) -> Number:
            known = mp.fdot(quotient.upto(n - 1), reversed(other.upto(n)[1:])) if n else mp.zero
            return (self[n] - known) / other[0]

        quotient = Series(rule)
        return quotient


def _series(value: Any) -> Series:
    return value if isinstance(value, Series) else Series.constant(value)


def sqrt(a: Series) -> Series:
    """The root r, from a = r r."""

    def rule(n: int) -> Number:
        if n == 0:
            return mp.sqrt(a[0])
        inner = root.upto(n - 1)[1:]
        return (a[n] - mp.fdot(inner, reversed(inner))) / (2 * root[0])

    root = Series(rule)
    return root


def sin_cos(a: Series) -> tuple[Series, Series]:
    """Sine and cosine, from s' = a' c and c' = -a' s."""

    def turned(other: Callable[[], Series], n: int) -> Number:
        rates = [k * a[k] for k in range(1, n + 1)]
        return mp.fdot(rates, reversed(other().upto(n - 1))) / n

    sine = Series(lambda n: turned(lambda: cosine, n) if n else mp.sin(a[0]))
    cosine = Series(lambda n: -turned(lambda: sine, n) if n else mp.cos(a[0]))
    return sine, cosine


def solution(flow: Flow, start: Mapping[str, Number]) -> dict[str, Series]:
    """The solution of x' = flow(x) from a start."""
    states: dict[str, Series] = {}
    rates: Mapping[str, Any] = {}

    def coefficient(name: str, n: int) -> Number:
        return rates[name][n - 1] / n if n else start[name]

    for name in start:
        states[name] = Series(lambda n, name=name: coefficient(name, n))
    rates = {name: _series(rate) for name, rate in flow(states).items()}
    return states


def value(coefficients: list[Number], s: Number) -> Number:
    """A polynomial at s, lowest coefficient first."""
    return mp.polyval(coefficients[::-1], s)


def values(columns: list[list[Number]], s: Number) -> Vector:
    """Several polynomials at s."""
    return tuple(value(column, s) for column in columns)
