"""Expansions of functions and steps in C (``expansions.c``, ``screen_view.h``): no value is beyond what they bound.

Those in Python (``verdict/flows.py``) are the same.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from engines import needs_compiler

from hsdsl.base.numbers.bernstein import around_middle, from_powers
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.compiler import FLAGS, find_compiler
from hsdsl.engine.runtime.library import print_scheme
from hsdsl.engine.simulate.verdict import flows
from hsdsl.engine.simulate.verdict.flows import EXPANDED

pytestmark = needs_compiler
ONE = """#include "screen_view.h"
HS_EXPORT void expand_one(int kind, int other, const hs_expansion *a, const hs_expansion *b, hs_expansion *to) {
  const hs_operation operation = {kind, 0, other};
  *to = expansion_of(&operation, a, b);
}
HS_EXPORT void enclose(int degree, const double *coefficients, double start, double width, double *to) {
  const double times[2] = {0.0, 1.0};
  double none = 0.0;
  int cut = 1;
  hs_range range[2];
  hs_expansion around[2], slope;
  hs_screen s = {.run = {.rows = 2, .width = 1, .degree = degree, .times = times, .values = coefficients,
                         .pieces = coefficients + 1}};
  hs_view v = {.s = &s, .n = 1, .cut = &cut, .range = range, .around = around, .slopes = &slope, .mode_error = &none};
  take_step(&v, 0);
  expand_cut(&v, 0);
  set_expanded_part(&v, 0, start, width, 0.0);
  to[0] = range[1].low, to[1] = range[1].high, to[2] = v.degree;
}
"""
POWER = 5
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b,
    "neg": lambda a, _: -a, "square": lambda a, _: a * a, "power": lambda a, _: a**POWER, "abs": lambda a, _: abs(a),
    "min": np.minimum, "max": np.maximum, "sqrt": lambda a, _: np.sqrt(a), "exp": lambda a, _: np.exp(a),
    "log": lambda a, _: np.log(a), "sin": lambda a, _: np.sin(a), "cos": lambda a, _: np.cos(a),
    "tanh": lambda a, _: np.tanh(a), "atan": lambda a, _: np.arctan(a), "sign": lambda a, _: np.sign(a),
    "floor": lambda a, _: np.floor(a),
}  # fmt: skip
IN_PYTHON: dict[str, Callable[..., Any]] = FUNCTIONS | {
    "power": lambda a, _: EXPANDED.functions["pow"](a, flows.line(POWER, 0.0)),
    **{name: EXPANDED.functions[name] for name in ("min", "max")},
    **{
        name: lambda a, _, name=name: EXPANDED.functions[name](a)
        for name in ("abs", "sqrt", "exp", "log", "sin", "cos", "tanh", "atan", "sign", "floor")
    },
}
U = np.linspace(-1, 1, 41)
Expansion = ctypes.c_double * 7


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder: Path = tmp_path_factory.mktemp("expansions")
    (folder / "one.c").write_text(ONE)
    headers = [structures.FOLDER, print_scheme(folder)]
    find_compiler().build([folder / "one.c"], headers, folder / "one.so", "-O1", (*FLAGS, "-w"))
    return ctypes.CDLL(str(folder / "one.so"))


def along(a: Any, share: Any) -> Any:
    """The values of a function that is ``share`` of its remainder away from its polynomial."""
    return a[0] + U * (a[1] + U * (a[2] + U * a[3])) + share * a[4]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_no_value_is_further_away_than_the_rest(name: str, compiled: Any) -> None:
    rng = np.random.default_rng(7)
    known = sharp = 0
    for _ in range(300):
        size = 10.0 ** rng.uniform(-3, 0.5)
        numbers = rng.normal(size=(2, 5)) * size ** np.arange(5)
        numbers[:, 0] = rng.normal(size=2) * 2
        numbers[:, 4] = abs(numbers[:, 4]) * rng.choice([0, 1], size=2)
        a, b, found = (Expansion(*each, abs(each[1])) for each in (*numbers, np.zeros(5)))
        compiled.expand_one(structures.OPERATORS.index(name), POWER, a, b, found)
        if not np.isfinite(found[4]):
            continue
        for share in rng.uniform(-1, 1, size=(5, 2, len(U))):
            values = FUNCTIONS[name](along(numbers[0], share[0]), along(numbers[1], share[1]))
            away = abs(values - along([*found[:4], 0.0], 0.0)).max()
            assert away <= found[4] + 4e-16 * abs(values).max(), numbers
        known += 1
        sharp += size < 0.03 and not numbers[:, 4].any() and found[4] <= 1e-5 * max(1.0, abs(found[0]) ** 5)
    assert known >= 60  # nothing is proved by what is never known
    assert sharp >= 5 or name in ("div", "log")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_both_languages_expand_alike(name: str, compiled: Any) -> None:
    rng = np.random.default_rng(11)
    unresolved = 0
    for _ in range(200):
        size = 10.0 ** rng.uniform(-2, 0.5)
        numbers = rng.normal(size=(2, 7)) * size ** np.array([0, 1, 2, 3, 4, 4, 1])
        numbers[:, 4:] = abs(numbers[:, 4:])
        numbers[:, 5] = numbers[:, 4] * rng.choice([0, 0.5], size=2)
        a, b, found = Expansion(*numbers[0]), Expansion(*numbers[1]), Expansion()
        compiled.expand_one(structures.OPERATORS.index(name), POWER, a, b, found)
        with np.errstate(all="ignore"):
            same = IN_PYTHON[name](*(flows.Expansion(each[:4, None], *each[4:, None]) for each in numbers))
        assert [*same.terms.ravel(), same.remainder, same.unresolved, same.error] == pytest.approx(
            [*found], rel=1e-6, abs=1e-12
        )
        unresolved += 0 < found[5] < np.inf
    assert unresolved >= 20


@pytest.mark.parametrize("width", [1e-1, 1e-3, 1e-6])
def test_a_term_that_is_as_smooth_as_the_part_hides_nothing_and_a_pulse_is_hidden(width: float, compiled: Any) -> None:
    smooth, pulse, square, found = Expansion(0, 0.9, 0, 0, 0, 0, 0), Expansion(), Expansion(), Expansion()
    for name, of, to in (("sin", smooth, found), ("square", Expansion(1, 1 / width), square), ("exp", square, pulse)):
        compiled.expand_one(structures.OPERATORS.index(name), 0, of, of, to)
        square[:] = [-each for each in square[:4]] + square[4:]
    assert found[4] > found[5] == 0
    compiled.expand_one(structures.OPERATORS.index("add"), 0, found, pulse, found)
    assert found[5] >= 0.5


def test_errors_of_states_count_where_terms_cancel(compiled: Any) -> None:
    a, b, found = Expansion(1, 3, 0, 0, 0, 0, 3), Expansion(1, -3, 0, 0, 0, 0, 3), Expansion()
    compiled.expand_one(structures.OPERATORS.index("add"), 0, a, b, found)
    assert (found[1], found[6]) == (0, 6)


@pytest.mark.parametrize("degree", [1, 4, 20])
def test_powers_around_the_middle_are_those_of_the_polynomial(degree: int) -> None:
    powers = np.random.default_rng(degree).normal(size=degree + 1)
    moved = powers @ from_powers(degree) @ around_middle(degree)
    s = (1 + U) / 2
    assert np.polynomial.polynomial.polyval(U, moved) == pytest.approx(np.polynomial.polynomial.polyval(s, powers))


@pytest.mark.parametrize("decay", [0.2, 0.6, 1.0])
@pytest.mark.parametrize("degree", [1, 3, 4, 14])
def test_boxes_of_parts_hold_the_step(degree: int, decay: float, compiled: Any) -> None:
    rng = np.random.default_rng(degree)
    sharp = 0
    for _ in range(100):
        piece = rng.normal(size=degree + 1) * decay ** np.arange(degree + 1)
        padded, found = (ctypes.c_double * 16)(*piece), (ctypes.c_double * 3)()
        width = 2.0 ** -rng.integers(0, 7)
        start = width * rng.integers(0, 1 / width)
        compiled.enclose(15, padded, ctypes.c_double(start), ctypes.c_double(width), found)
        exact = [Fraction(each) for each in piece]
        shares = [Fraction(start) + Fraction(width) * k / 16 for k in range(17)]
        values = [sum(c * s**k for k, c in enumerate(exact)) for s in shares]
        assert Fraction(found[0]) <= min(values)
        assert max(values) <= Fraction(found[1])
        assert found[2] == degree
        sharp += found[1] - found[0] <= 2 * float(max(values) - min(values)) + 1e-3
    assert sharp >= (80 if decay < 0.5 or degree < 4 else 1)
