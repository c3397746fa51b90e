"""Large flat models: what is written for them grows as they do, and the engines agree on it to the last bit."""

from __future__ import annotations

import json
import random
import re
from pathlib import Path

import numpy as np
import pytest
from chains import chain
from engines import needs_compiler
from scipy.special import jv

import hsdsl
from hsdsl.base.graphs import elimination
from hsdsl.engine.backends.c.routine import LONGEST
from hsdsl.engine.backends.c.source import model_parts, model_source
from hsdsl.engine.runtime.kernel import SYMBOL
from hsdsl.engine.scheme.linear import sparse_factored, sparse_factored_complex, sparse_solve, sparse_solve_complex
from hsdsl.mathematics.lower.mode import ordering
from hsdsl.mathematics.program_cache import _rows

SIZES = 40, 80
RUNNER = Path(__file__).parents[2] / "models" / "pronking-runner.yaml"
FUNCTION = re.compile(r"^static .*?^}$", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def programs():
    return [hsdsl.loads(chain(n)).program for n in SIZES]


def test_text_grows_as_the_model_does(programs):
    for size in (lambda p: len(json.dumps(_rows(p))), lambda p: len(model_source(p))):
        small, large = map(size, programs)
        assert large < 2.3 * small


def test_gradients_resets_and_jacobians_hold_nonzeros_only(programs):
    for n, program in zip(SIZES, programs, strict=True):
        mode = program.modes[0]
        assert len(mode.jacobian.places) == n + 2 * (3 * n - 2)
        assert all(len(row) == 1 for row in mode.slopes)
        assert all(len(edge.changes) == 1 for edge in mode.edges)
        assert mode.jacobian.elimination.size < 40 * n


def test_functions_have_bounded_size(programs):
    for program in programs:
        longest = max(FUNCTION.findall(model_source(program)), key=lambda text: text.count("\n"))
        assert longest.count("\n") < LONGEST + 10


@needs_compiler
@pytest.mark.parametrize("method", ["taylor", "dopri5", "radau"])
def test_engines_agree_on_a_chain_with_impacts(method):
    _agree(hsdsl.loads(chain(70)), until=1, method=method, tolerance=1e-6)


@needs_compiler
def test_engines_agree_on_a_stiff_chain():
    model = hsdsl.loads(chain(40, 1e4))
    assert model.program.modes[0].jacobian.elimination is not None
    _agree(model, until=0.1, method="radau", tolerance=1e-6)


def _irregular(n, seed):
    """A model whose equations are of many shapes, some of them alike, with quotients and roots."""
    draw = random.Random(seed)

    def term():
        i, j, c = draw.randrange(n), draw.randrange(n), draw.randint(2, 9)
        shapes = f"sin(x{i})*x{j}; x{i}/({c} + x{j}**2); -x{i}/{c}; sqrt({c} + x{i}*x{j}); {c}*x{j}**3/50"
        return draw.choice(shapes.split("; "))

    flow = "".join(
        f"      x{i}: {f'({term()})*({term()}) - ({term()})' if i % 3 else 'x0*x1'} - x{i}\n" for i in range(n)
    )
    start = "".join(f", x{i}: {draw.randint(-9, 9) / 10}" for i in range(n))
    edges = "".join(
        f"      - {{when: x{i} >= {(i % 7 + 3) / 10}, to: m, reset: {{x{i}: -x{i}}}}}\n" for i in range(0, n, 9)
    )
    return (
        f"hsdsl: 1\nmodes:\n  m:\n    flow:\n{flow}    transitions:\n{edges}initial: {{mode: m{start}}}\n"
        "experiment: {until: 1}\n"
    )


@needs_compiler
@pytest.mark.parametrize("method", ["taylor", "rk4"])
def test_engines_agree_on_irregular_equations_in_pieces(method):
    model = hsdsl.loads(_irregular(100, 1))
    assert "_1(p, t, x, v, out)" in model_source(model.program)
    _agree(model, method=method, **({"step": 0.05} if method == "rk4" else {"tolerance": 1e-6}))


def _agree(model, **options):
    ours, theirs = (model.simulate(engine=engine, **options) for engine in ("c", "python"))
    assert len(ours.times) > 5
    assert np.array_equal(ours.times, theirs.times)
    assert np.array_equal(ours.values, theirs.values, equal_nan=True)
    assert ours.transitions == theirs.transitions


@pytest.mark.parametrize("seed", range(5))
def test_sparse_factors_solve_what_dense_ones_do(seed):
    draw, n = np.random.default_rng(seed), 40
    matrix = np.where(draw.random((n, n)) < 0.03, draw.normal(size=(n, n)), 0.0)
    places = tuple(int(k) for k in np.flatnonzero(matrix))
    order = ordering(places, n)
    of = elimination(places, order)
    assert sorted(order) == list(range(n))

    def entries(diagonal):
        values = [0.0] * of.size
        for at, k in zip(of.place, places, strict=True):
            values[at] = matrix.flat[k]
        for at in of.diagonal:
            values[at] += diagonal
        return values

    right, other = draw.normal(size=(2, n))
    factors, row, column, found = entries(4.0), [0.0] * n, [0.0] * n, [0.0] * n
    assert sparse_factored(n, of, factors, row)
    sparse_solve(n, of, factors, right.tolist(), row, found)
    assert np.allclose((matrix + 4 * np.eye(n)) @ found, right)
    turned = [0.0] * of.size
    for at in of.diagonal:
        turned[at] = -3.0
    factors, a, b = entries(2.0), [0.0] * n, [0.0] * n
    assert sparse_factored_complex(n, of, factors, turned, row, column)
    sparse_solve_complex(n, of, factors, turned, right.tolist(), other.tolist(), row, column, a, b)
    assert np.allclose((matrix + (2 - 3j) * np.eye(n)) @ (np.array(a) + 1j * np.array(b)), right + 1j * other)


def test_the_pattern_of_an_elimination_is_that_of_its_fill():
    n, draw = 30, random.Random(2)
    places = tuple(sorted({draw.randrange(n * n) for _ in range(60)}))
    order = tuple(draw.sample(range(n), n))
    of = elimination(places, order)
    present = np.eye(n, dtype=bool)
    for k in places:
        i, j = order.index(k // n), order.index(k % n)
        present[i, j] = present[j, i] = True
    for k in range(n):  # the definition: eliminating k joins all that follow it
        later = np.flatnonzero(present[k + 1 :, k]) + k + 1
        present[np.ix_(later, later)] = True
    assert [of.column[of.start[i] : of.start[i + 1]] for i in range(n)] == [
        np.flatnonzero(row).tolist() for row in present
    ]


def test_a_wave_through_a_chain_begins_where_numbers_have_no_digits():
    """Masses far from the one that moves are at 1e-200 and less at first, and follow Bessel functions."""
    n, middle = 51, 26
    names = ["0", *(f"x{i}" for i in range(1, n + 1)), "0"]
    rows = zip(names, names[1:-1], names[2:], strict=False)
    flow = ", ".join(f"{x}: v{x}, v{x}: {left} - 2*{x} + {right}" for left, x, right in rows)
    start = ", ".join(f"{x}: {int(x == names[middle])}, v{x}: 0" for x in names[1:-1])
    run = hsdsl.loads(f"""
hsdsl: 1
modes: {{a: {{flow: {{{flow}}}}}}}
initial: {{mode: a, {start}}}
experiment: {{until: 5, method: taylor}}
""").simulate()
    assert run.stop.reason == "until"
    assert len(run.times) < 400
    for i in (middle, middle + 1, middle - 3, n):
        assert run.final.state[f"x{i}"] == pytest.approx(jv(2 * (i - middle), 10), abs=1e-9)


def test_files_of_a_program_hold_each_function_once() -> None:
    program = hsdsl.load(RUNNER).program
    functions = re.compile(r"^(?:static )?(?:HS_APART )?int (\w+)\([^{;]*\) \{", re.MULTILINE)
    whole = functions.findall(model_source(program))
    for most in (1, 2, 3):
        parts = model_parts(program, most)
        assert len(parts) == most
        assert sorted(name for part in parts for name in functions.findall(part)) == sorted(whole)
        assert [SYMBOL in part for part in parts] == [True] + [False] * (most - 1)
