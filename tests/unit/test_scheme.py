"""The text of the scheme, and the C that is printed from it: the same bits, and nothing outside of the subset."""

from __future__ import annotations

import ctypes
import random
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from engines import bits, needs_compiler

from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.compiler import FLAGS, find_compiler
from hsdsl.engine.runtime.library import print_scheme
from hsdsl.engine.scheme import polynomials, primitives, roots
from hsdsl.engine.scheme.printer import Refused, Scheme, Text
from hsdsl.engine.simulate.surfaces import make_roots

DEGREE = 12
AROUND = """\
#include "functions.h"
#include "primitives.h"
#include "polynomials.c"
#include "roots.c"

static double left[20], own[20], binomials[200], room[MOST_CUTS][20];
static hs_cut cuts[MOST_CUTS];

HS_EXPORT void walk(const double *c, int n, double level, int risen, double *found) {
  hs_roots room_of = {HS_UNIT, binomials, 0, own, left, cuts};
  hs_walk walk = {level, c[0] > level, risen, 0.0};
  fill_binomials(binomials, n);
  for (int i = 0; i < MOST_CUTS; i++) cuts[i].b = room[i];
  while (next_root(&room_of, &walk, c, n, 0.0, 1, found)) found[1] = slope_of(c, n, *found), found += 2;
}

HS_EXPORT void inner(const double *c, int n, double *found) {
  fill_binomials(binomials, n);
  fill_bernstein(binomials, c, n, found);
  found[n + 1] = largest_of(found, n), found[n + 2] = least_of(found, n);
}
"""


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder: Path = tmp_path_factory.mktemp("scheme")
    (folder / "around.c").write_text(AROUND)
    includes = [structures.FOLDER, print_scheme(folder)]
    find_compiler().build([folder / "around.c"], includes, folder / "around.so", "-O2", (*FLAGS, "-w"))
    return ctypes.CDLL(str(folder / "around.so"))


def polynomial(draw: random.Random) -> list[float]:
    """Of any degree, often with roots in [0, 1] close together, at its ends, or many times."""
    c = [draw.choice([-1.0, 1.0])]
    for _ in range(draw.randint(1, DEGREE)):
        root = draw.choice([0.0, 1.0, 0.5, draw.uniform(-0.2, 1.2), draw.uniform(-0.2, 1.2)])
        root += draw.choice([0.0, 1e-9 * draw.uniform(-1, 1)])
        c = [a - root * b for a, b in zip([0.0, *c], [*c, 0.0], strict=True)]
    return c


def walked(c: list[float], level: float, risen: bool) -> list[float]:
    """The rises of a polynomial, and its slopes there, by the text."""
    room, n, found = make_roots(DEGREE, FLOAT64), len(c) - 1, list[float]()
    walk = roots.Walk(level, c[0] > level, risen, 0.0)
    while (root := roots.next_root(room, walk, c, n, 0.0, True)) is not None:
        found += [root, polynomials.slope_of(c, n, root)]
    return found


def by_c(function: Callable[..., Any], c: list[float], *more: Any) -> list[float]:
    found = (ctypes.c_double * 64)(*[float("nan")] * 64)
    function((ctypes.c_double * len(c))(*c), len(c) - 1, *more, found)
    return [number for number in found if number == number]


@needs_compiler
def test_printed_c_finds_the_same_roots_to_the_last_bit(compiled: Any) -> None:
    draw, many = random.Random(30), 0
    for _ in range(2000):
        c, risen = polynomial(draw), draw.random() < 0.5
        level = draw.choice([0.0, 1e-12, 1e-3]) * max(map(abs, c))
        found = walked(c, level, risen)
        assert bits(by_c(compiled.walk, c, ctypes.c_double(level), risen)) == bits(found), c
        many += len(found) // 2
    assert many > 1000


@needs_compiler
def test_primitives_have_the_same_bits(compiled: Any) -> None:
    draw, binomials = random.Random(3), make_roots(DEGREE, FLOAT64).binomials
    for _ in range(500):
        c = polynomial(draw)
        n, b = len(c) - 1, [*c]
        primitives.fill_bernstein(binomials, c, n, b)
        expected = [*b, primitives.largest_of(b, n), primitives.least_of(b, n)]
        assert bits(by_c(compiled.inner, c)) == bits(expected)


@needs_compiler
def test_it_compiles_for_floats_of_32_bits_and_without_warnings(tmp_path: Path) -> None:
    (tmp_path / "one.c").write_text(f"{AROUND.partition('static double')[0]}")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wno-unused-function", "-Werror", "-fsyntax-only"]
    folders = [f"-I{structures.FOLDER}", f"-I{print_scheme(tmp_path)}"]
    for more in ([], ["-DHS_FLOAT32"]):
        command = [*find_compiler().command, *flags, *folders, *more, str(tmp_path / "one.c")]
        done = subprocess.run(command, capture_output=True, text=True)
        errors = [line for line in done.stderr.splitlines() if "roots.c" in line]
        assert not errors


HEAD = """\
@dataclass
class Pair:
    n: int
    m: int
def f(x: Number, n: int, v: Vector, p: Pair) -> Number:
"""
OUTSIDE = {
    "a sum of a list": "    return sum(v)\n",
    "a loop over a vector": "    for a in v:\n        x = x + a\n    return x\n",
    "a list": "    w = [x]\n    return x\n",
    "a quotient of whole numbers": "    return n / 2\n",
    "a whole number divided in place": "    n /= 2\n    return x\n",
    "a whole number that becomes another": "    k = 0\n    k = x\n    return x\n",
    "a whole number that grows by another": "    n += x\n    return x\n",
    "a loop whose bound changes": "    for k in range(n):\n        n = n + k\n    return x\n",
    "a number as a condition": "    if x:\n        return x\n    return x\n",
    "a number that is one of two conditions": "    return x if n > 0 and n else x\n",
    "the contrary of a number": "    return x if not n else x\n",
    "a number that chooses": "    return x if n else x\n",
    "a loop with another end": "    for k in range(n):\n        x = x + k\n    else:\n        x = n\n    return x\n",
    "a loop whose bound is a field that changes": "    for k in range(p.n):\n        p.n = k\n    return x\n",
    "fields that are set before they are read": "    p.n, p.m = n, p.n\n    return x\n",
    "a try that ends otherwise": "    try:\n        x = x + 1\n    except DOMAIN_ERRORS:\n        return x\n"
    "    finally:\n        x = x + 2\n    return x\n",
    "the least of a vector": "    return min(v)\n",
    "a root of two numbers": "    return sqrt(x, x)\n",
    "vectors that are compared by their values": "    return x if v == v else x\n",
    "numbers that are compared by identity": "    return x if x is x else x\n",
    "a default": "    return x\ndef g(x: Number = 0) -> Number:\n    return x\n",
    "another decorator": "    return x\n@cache\ndef g(x: Number) -> Number:\n    return x\n",
    "a loop whose step varies": "    for k in range(9, 0, n):\n        x = x + k\n    return x\n",
    "a vector in a sum": "    return v + x\n",
    "a vector as a number": "    return v\n",
    "a number that becomes a vector": "    x = v\n    return x\n",
    "bits of a whole number": "    n |= 1\n    return x\n",
    "a statement outside functions": "    return x\nif TYPE_CHECKING:\n    ONE = 1\n",
    "a name that nothing sets": "    return y\n",
    "too many results": "    return x, x\n",
    "a call of itself": "    return f(x, n, v, p)\n",
    "a second function of its name": "    return x\ndef f(x: Number) -> Number:\n    return x\n",
    "a lambda": "    g = lambda: x\n    return g()\n",
    "values that are set before they are read": "    a, b = x, x\n    a, b = b, a\n    return a\n",
    "a number in between that is computed twice": "    return x if 0 < f(x, n, v, p) < 1 else x\n",
    "a comparison with None of what never is": "    return x if x is None else x\n",
}


@pytest.mark.parametrize("name", OUTSIDE)
def test_what_is_not_of_the_subset_is_refused_with_its_line(name: str) -> None:
    text = Text.of("sample", HEAD + OUTSIDE[name])
    with pytest.raises(Refused, match=r"^sample\.py:(6|7|8|9): "):
        Scheme([text]).module(text)


def test_each_kind_of_statement_is_printed() -> None:
    source = '''\
"""A sample."""
ONE = 1


@dataclass
class Row:
    """A row."""

    v: Room


@dataclass
class Pair:
    """Two numbers."""

    a: Number
    rows: list[Row]


def first(p: Pair, n: int) -> Number | None:
    """The first one above."""
    for k in range(n, -1, -2):
        if p.rows[k].v[0] > 0.25 or not p.a < 0:  # never
            return p.rows[k].v[ONE]
    return None


def both(p: Pair, t: Time) -> tuple[Time, bool]:
    """Two results."""
    found = first(p, 3)
    if found is None:
        return t, False
    else:
        p.a = found
    return t + found, True
'''
    text = Text.of("sample", source)
    scheme = Scheme([text])
    assert "typedef struct {\n  hs_real a;\n  hs_row *rows;\n} hs_pair;\n" in scheme.header()
    assert scheme.module(text).endswith("""\
#define ONE 1

/* The first one above. (sample.py:20) */
static int first(hs_pair *p, int n, hs_real *result) {
  for (int k = n; k > -1; k -= 2) {
    if ((p->rows[k].v[0] > ((hs_real)0.25)) || !(p->a < 0)) { /* never */
      *result = p->rows[k].v[ONE];
      return 1;
    }
  }
  return 0;
}

/* Two results. (sample.py:28) */
static hs_time both(hs_pair *p, hs_time t, int *result1) {
  hs_real found;
  int has_found = first(p, 3, &found);
  if (!has_found) {
    *result1 = 0;
    return t;
  } else {
    p->a = found;
  }
  *result1 = 1;
  return t + found;
}
""")


def test_records_by_value_parts_and_records_that_may_be_none() -> None:
    source = '''\
"""A sample."""
from hsdsl.base.graphs import Elimination


@dataclass(frozen=True)
class Size:
    """A size."""

    n: int
    pattern: Elimination | None


@dataclass
class Inner:
    """Rooms."""

    rows: list[Room]


@dataclass
class Outer:
    """A record in a record."""

    inner: Inner


def fill(of: Size, by: Outer, places: Indices) -> int:
    """Count and fill."""
    pattern = of.pattern
    row = by.inner.rows[of.n // 2]
    for k in each(of.n):
        row[k] = places[k] % 3
    return 0 if pattern is None else pattern.size
'''
    text = Text.of("sample", source)
    scheme = Scheme([text])
    assert "typedef struct {\n  int n;\n  const hs_elimination *pattern;\n} hs_size;\n" in scheme.header()
    assert "typedef struct {\n  hs_inner inner;\n} hs_outer;\n" in scheme.header()
    assert scheme.module(text).endswith("""\
static int fill(hs_size of, hs_outer *by, const int *places) {
  const hs_elimination *pattern = of.pattern;
  hs_real *row = by->inner.rows[of.n / 2];
  HS_SIMD
  for (int k = 0; k < of.n; k++) {
    row[k] = places[k] % 3;
  }
  return (!pattern) ? 0 : pattern->size;
}
""")
