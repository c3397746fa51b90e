"""Inputs of floor, sign, abs, min and max: runs against exact integrals of piecewise affine functions."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import pytest
from engines import COMPILER

import hsdsl

END = Fraction(4)
Piece = tuple[Fraction, Fraction, Fraction]  # from a time on, a + b t


@dataclass(frozen=True)
class Affine:
    """A piecewise affine function of t on [0, END], and its text."""

    text: str
    pieces: tuple[Piece, ...]

    def ends(self) -> list[tuple[Fraction, Fraction, Fraction, Fraction]]:
        starts = [p[0] for p in self.pieces]
        return [(s, e, a, b) for (s, a, b), e in zip(self.pieces, [*starts[1:], END], strict=True)]

    def cut(self, times: set[Fraction]) -> Affine:
        return Affine(
            self.text, tuple((t, a, b) for s, e, a, b in self.ends() for t in sorted({s, *times}) if s <= t < e)
        )

    def mapped(
        self, text: str, levels: Callable[[Fraction, Fraction], set[int]], value: Callable[..., tuple]
    ) -> Affine:
        """Cut where the function meets levels, and replace each piece by a function of it and its middle value."""
        cuts: set[Fraction] = set()
        for s, e, a, b in self.ends():
            if b:
                cuts |= {t for n in levels(*sorted((a + b * s, a + b * e))) if s < (t := (n - a) / b) < e}
        rows = self.cut(cuts).ends()
        return Affine(text, tuple((s, *value(a, b, a + b * (s + e) / 2)) for s, e, a, b in rows))

    def floor(self) -> Affine:
        whole = lambda low, high: set(range(low.__ceil__(), high.__floor__() + 1))  # noqa: E731
        return self.mapped(f"floor({self.text})", whole, lambda a, b, m: (Fraction(m.__floor__()), Fraction(0)))

    def sign(self) -> Affine:
        return self.mapped(f"sign({self.text})", _zero, lambda a, b, m: (Fraction((m > 0) - (m < 0)), Fraction(0)))

    def abs(self) -> Affine:
        return self.mapped(f"abs({self.text})", _zero, lambda a, b, m: (a, b) if m >= 0 else (-a, -b))

    def plus(self, other: Affine, factor: Fraction = Fraction(1)) -> Affine:
        times = {p[0] for p in (*self.pieces, *other.pieces)}
        pairs = zip(self.cut(times).pieces, other.cut(times).pieces, strict=True)
        text = f"{self.text} + ({factor})*({other.text})"
        return Affine(text, tuple((s, a + factor * c, b + factor * d) for (s, a, b), (_, c, d) in pairs))

    def max(self, other: Affine) -> Affine:
        gap = self.plus(other, Fraction(-1)).abs()
        total = self.plus(other).plus(gap)
        half = tuple((s, a / 2, b / 2) for s, a, b in total.pieces)
        return Affine(f"max({self.text}, {other.text})", half)

    def min(self, other: Affine) -> Affine:
        gap = self.plus(other, Fraction(-1)).abs()
        total = self.plus(other).plus(gap, Fraction(-1))
        return Affine(f"min({self.text}, {other.text})", tuple((s, a / 2, b / 2) for s, a, b in total.pieces))

    def integral(self) -> Fraction:
        return sum((a * (e - s) + b * (e * e - s * s) / 2 for s, e, a, b in self.ends()), Fraction(0))


def _zero(low: Fraction, high: Fraction) -> set[int]:
    return {0} if low <= 0 <= high else set()


def drawn(rng: random.Random, depth: int) -> Affine:
    if depth == 0:
        a, b = Fraction(rng.randint(-30, 30), rng.randint(1, 12)), Fraction(rng.randint(-20, 20), rng.randint(1, 9))
        return Affine(f"({a}) + ({b})*t", ((Fraction(0), a, b),))
    one = drawn(rng, depth - 1)
    kind = rng.choice(["floor", "sign", "abs", "plus", "min", "max"])
    return getattr(one, kind)(*([drawn(rng, depth - 1)] if kind in ("plus", "min", "max") else []))


@pytest.mark.parametrize("seed", [*range(25), *(pytest.param(s, marks=pytest.mark.campaign) for s in range(25, 300))])
def test_runs_integrate_inputs_exactly(seed: int) -> None:
    rng = random.Random(seed)
    u, v = drawn(rng, rng.randint(1, 4)), drawn(rng, rng.randint(1, 3))
    text = (
        f'hsdsl: 1\ninputs: {{u: "{u.text}"}}\n'
        f'modes: {{a: {{flow: {{x: u, y: "{v.text}"}}}}}}\n'
        f"initial: {{mode: a, x: 0, y: 0}}\nexperiment: {{until: {END}}}\n"
    )
    model = hsdsl.loads(text)
    for scheme in ("located", "relaxed"):
        for method in ("auto", "dopri5", "radau", "midpoint"):
            step = {"step": 0.37} if method == "midpoint" else {}
            run = model.simulate(scheme=scheme, method=method, engine="c" if COMPILER else "python", **step)
            for name, function in (("x", u), ("y", v)):
                size = max(1, *(abs(a) + abs(b) * END for _, a, b in function.pieces))
                assert abs(Fraction(run.final.state[name]) - function.integral()) <= Fraction(1, 10**11) * size
