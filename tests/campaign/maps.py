"""Maps made at each second, drawn at random, and what they are in numbers of 60 digits.

Of `KINDS` one makes the values of states anew from those before; what happens next depends on the first of them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from math import cos
from random import Random
from typing import Any, NamedTuple

from hsdsl.base.numbers.arithmetic import multiprecision

DIGITS = 60
NUMERAL = re.compile(r"(?<![\w.])\d+\.?\d*(?:e-?\d+)?(?![\w.])")
FUNCTIONS = ("sin", "cos", "sqrt", "tanh", "floor")


class Map(NamedTuple):
    """A map: its formulas and first values by state, the level that decides, and how often it is made."""

    resets: dict[str, str]
    start: dict[str, str]
    level: str
    samples: int

    @property
    def text(self) -> str:
        """A model that makes it, by one of two edges."""
        resets = ", ".join(["tau: 0", *(f'{x}: "{formula}"' for x, formula in self.resets.items())])
        edges = "\n".join(
            f'      - {{name: {name}, when: tau >= 1, if: "z0 {sign} {self.level}", to: a, reset: {{{resets}}}}}'
            for name, sign in (("high", ">="), ("low", "<"))
        )
        return f"""
hsdsl: 1
modes:
  a:
    flow: {{tau: 1, {", ".join(f"{x}: 0" for x in self.start)}}}
    transitions:
{edges}
initial: {{mode: a, tau: 0, {", ".join(f"{x}: {value}" for x, value in self.start.items())}}}
experiment: {{until: {self.samples}.5}}
"""

    def right(self) -> tuple[list[str], list[list[Any]]]:
        """The edges that it takes, and its values before and after each."""
        context = multiprecision(DIGITS).zero.context
        names: dict[str, Any] = {name: getattr(context, name) for name in FUNCTIONS} | {"N": context.mpf}
        formulas = [compile(_exact(formula), "map", "eval") for formula in self.resets.values()]
        edges, rows = list[str](), [[context.mpf(value) for value in self.start.values()]]
        for _ in range(self.samples):
            edges.append("high" if rows[-1][0] >= context.mpf(self.level) else "low")
            known = names | dict(zip(self.start, rows[-1], strict=True))
            rows.append([eval(formula, known) for formula in formulas])
        return edges, rows


def _exact(formula: str) -> str:
    """A formula with exact numbers; exponents stay whole."""
    return re.sub(r"\*\*N\('(\d+)'\)", r"**\1", NUMERAL.sub(lambda found: f"N('{found[0]}')", formula))


def drawn(r: Random) -> Map:
    """One map."""
    resets, start, samples = r.choice(KINDS)(r)
    return Map(resets, start, f"{r.uniform(-0.6, 0.9):.3f}", samples)


Drawn = tuple[dict[str, str], dict[str, str], int]


def _number(r: Random, low: float, high: float) -> str:
    return f"{r.uniform(low, high):.3f}"


def _starts(r: Random, count: int, low: float = 0.1, high: float = 0.9) -> dict[str, str]:
    return {f"z{i}": _number(r, low, high) for i in range(count)}


def _logistic(r: Random) -> Drawn:
    return {"z0": f"{_number(r, 3.4, 4)}*z0*(1 - z0)"}, _starts(r, 1), r.choice((15, 30, 60, 120))


def _henon(r: Random) -> Drawn:
    resets = {"z0": f"1 - {_number(r, 1.2, 1.39)}*z0**2 + z1", "z1": "0.3*z0"}
    return resets, _starts(r, 2, -0.1, 0.1), r.choice((15, 30, 60, 120))


def _doubling(r: Random) -> Drawn:
    return {"z0": "2*z0 - floor(2*z0)"}, _starts(r, 1), r.choice((15, 30, 60))


def _muller(r: Random) -> Drawn:
    p, q, s = r.randint(2, 4), r.randint(5, 8), r.randint(20, 200)
    step = f"{p + q + s} - ({p * q + p * s + q * s} - {p * q * s}/z0)/z1"
    return {"z0": "z1", "z1": step}, {"z0": f"{q - 0.5}", "z1": f"{q - 0.25}"}, r.randint(3, 25)


def _filter(r: Random) -> Drawn:
    size, angle = r.uniform(0.5, 0.999), r.uniform(0.1, 3)
    first = f"{2 * size * cos(angle):.6f}*z0 - {size * size:.6f}*z1 + {_number(r, 0, 1)}"
    return {"z0": first, "z1": "z0"}, _starts(r, 2), 200


def _cancelled(r: Random) -> Drawn:
    big = f"1e{r.randint(3, 9)}"
    half = f"(sqrt(z0**2 + {big}**2) - {big})*{big}"
    return {"z0": f"{half}*{_number(r, 0.1, 0.4)} + {_number(r, 0.1, 1)}"}, _starts(r, 1), r.randint(1, 60)


def _any(r: Random) -> Drawn:
    """Polynomials, quotients and functions of up to four states, bounded or not."""
    states = [f"z{i}" for i in range(r.randint(1, 4))]
    bounded = r.random() < 0.8

    def formula() -> str:
        a, b, c = (r.choice(states) for _ in range(3))
        p, q, s = (f"{r.uniform(-2, 2):.3f}" for _ in range(3))
        sums = r.choice((
            " + ".join(f"({r.uniform(-2, 2):.3f})*{x}" for x in states),
            f"({p}) + ({q})*{a}*{b} + ({s})*{c}",
            f"({p}) + ({q})*{a}/(1 + {b}**2) + ({s})*{c}",
            f"({p})*sin({a}) + ({q})*{b}",
            f"({p})*sqrt(1 + {a}**2) - ({q})*{b}",
        ))  # fmt: skip
        return f"({sums})/(1 + ({sums})**2/9)" if bounded else f"tanh({sums})*{r.randint(1, 3)}"

    return {x: formula() for x in states}, _starts(r, len(states), -1, 1), r.choice((20, 60, 150))


KINDS: Sequence[Callable[[Random], Drawn]] = (_logistic, _henon, _doubling, _muller, _filter, _cancelled, _any, _any)
