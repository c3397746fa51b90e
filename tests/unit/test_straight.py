"""Large expressions cut into small statements: the same numbers, the right derivatives, in little time."""

import math
import time

import mpmath
import pytest
import sympy as sp

from hsdsl.base.functions import absolute, atan2, below, cosh, floor, maximum, minimum, sign, sinh, tanh
from hsdsl.base.numbers.arithmetic import FLOAT64, multiprecision
from hsdsl.engine.backends.python import PythonKernel
from hsdsl.interface.model import Model
from hsdsl.language.elaborate import elaborate
from hsdsl.language.expression.algebra import derivative
from hsdsl.mathematics.lower.straight import LARGEST, WIDEST, Cut, Definition, Gradient, text_of, written_out

MANY = multiprecision(60)
X, Y = sp.symbols("x y", real=True)


def doubling(last: str, step: str, levels: int) -> str:
    """A `let` whose every name uses the one before it more than once, and what stands at its end."""
    names = ["l0: x/3 + v/5"] + [f"l{i}: {step.replace('L', f'l{i - 1}')}" for i in range(1, levels)]
    return "{" + ", ".join(f'"{n.split(": ")[0]}": "{n.split(": ")[1]}"' for n in names) + "}\n" + last


# guard, let
def nested(depth: int) -> dict[str, tuple[str, str]]:
    return {
        "nested roots": ("sqrt(1 + " * depth + "x + v" + ")" * depth, "{}"),
        "nested minima": ("min(v + 0.1, " * depth + "x" + ")" * depth, "{}"),
        "nested quotients": ("1/(1.1 + " * depth + "x*v" + ")" * depth, "{}"),
    }


LARGE = {
    **nested(16),
    "a product": ("*".join(f"(1 + sin(x*{i} + v)/{i}0)" for i in range(1, 100)), "{}"),
    "a sum of products": ("+".join(f"sin(x/{i})*cos(v*{i})" for i in range(1, 100)), "{}"),
    "squares of squares": ("l9", doubling("", "L**2/2 + 0.3", 10)),
    "doubling": ("l9", doubling("", "sin(L)*cos(L) + 0.4", 10)),
}


FORMS = [
    X * Y * sp.sin(X * Y) + 3 * X + Y,
    (X + Y) ** 5 / sp.sqrt(X**2 + Y**2 + 1),
    X**Y + Y**X + 2**X + (1 + X) ** sp.Rational(1, 3),
    sp.log(1 + X**2) * sp.exp(-X * Y) / (1 + X) ** 2,
    sp.asin(X / 9) + sp.acos(X / 9) * sp.atan(X * Y) + sp.tan(X),
    sinh(X) * cosh(X * Y) - tanh(Y) / X + atan2(X, Y * X),
    absolute(X - Y) * sign(X) + floor(X) * X + minimum(X, Y**2) * maximum(X * Y, Y),
    below(X, Y, X**2, Y * X),
    sp.pi * Y,
]


@pytest.mark.parametrize("form", FORMS, ids=str)
@pytest.mark.parametrize("symbol", [X, Y], ids=str)
def test_derivatives_are_those_of_sympy(form: sp.Expr, symbol: sp.Symbol) -> None:
    expected = form.diff(symbol)
    assert derivative(form, symbol) == expected
    assert derivative(expected, symbol) == expected.diff(symbol)


def lowered(guard: str, lets: str):
    text = f"""
hsdsl: 1
let: {lets}
modes:
  m:
    flow: {{x: v, v: "{guard}"}}
    transitions: [{{when: "{guard} >= 100", to: m, reset: {{x: "{guard}"}}}}]
initial: {{mode: m, x: 0, v: 0}}
experiment: {{until: 1}}
"""
    return Model(elaborate("large.yaml", text=text.encode())).program


@pytest.mark.parametrize(
    "case",
    [
        *(pytest.param(case, id=name) for name, case in LARGE.items()),
        *(pytest.param(case, id=f"{name}, deep", marks=pytest.mark.campaign) for name, case in nested(60).items()),
    ],
)
def test_large_expressions_are_lowered_soon_and_differentiated_rightly(case):
    began = time.process_time()
    program = lowered(*case)
    exact = PythonKernel(program, MANY).bind(0, [])
    assert time.process_time() - began < 20  # seconds; trees instead of graphs take hours
    at = [MANY.zero + mpmath.mpf(p) for p in ("0.0", "0.61", "0.37")]
    h = mpmath.mpf(10) ** -25
    for i, slope in enumerate(exact.gradients[0](*at)):
        up, down = list(at), list(at)
        up[i], down[i] = at[i] + h, at[i] - h
        difference = (exact.surfaces(*up)[0] - exact.surfaces(*down)[0]) / (2 * h)
        assert abs(difference - slope) <= 1e-30 * (1 + abs(slope))
    value = exact.surfaces(*at)[0] + 100
    assert abs(exact.flow(*at)[1] - value) < 1e-50 * (1 + abs(value))
    quick = PythonKernel(program, FLOAT64).bind(0, [])
    assert quick.flow(0.0, 0.61, 0.37)[1] == pytest.approx(float(value), rel=1e-9)


def test_small_expressions_stay_whole():
    gradient = Gradient([sp.sin(X * Y) + X / Y], (X, Y))
    assert gradient.statements == []
    assert gradient.rows == (((sp.sin(X * Y) + X / Y).diff(X), (sp.sin(X * Y) + X / Y).diff(Y)),)


def test_every_statement_is_small_and_uses_earlier_ones_only():
    expr = sp.Add(*(sp.sin(X + i) * sp.cos(Y * i) ** i for i in range(2, 200)))
    cut = Cut("g")
    result = cut.down(expr)
    known = {X, Y}
    for symbol, part in cut.statements:
        assert part.free_symbols <= known
        assert len(part.args) <= WIDEST
        assert sum(1 for _ in sp.preorder_traversal(part)) <= LARGEST
        known.add(symbol)
    for symbol, part in reversed(cut.statements):
        result = result.xreplace({symbol: part})
    assert sp.expand(result - expr) == 0


@pytest.mark.parametrize(
    "flow", ["tan(x + pi/2)", "tan((pi - x)/3)", "1/tan(x + v)", "tan(pi/2 - x)**2*tan(3*pi/2 - v)"]
)
def test_functions_that_come_up_by_themselves_have_their_values(flow):
    """SymPy makes cotangents of tangents of sums with pi."""
    text = f"hsdsl: 1\nmodes: {{A: {{flow: {{x: 0, v: '{flow}'}}}}}}\ninitial: {{mode: A, x: 0.3, v: 0.2}}\n"
    model = Model(elaborate("m.yaml", text=(text + "experiment: {until: 1}\n").encode()))
    known = {"tan": math.tan, "pi": math.pi, "x": 0.3, "v": 0.2}
    expected = eval(flow, known)
    kernel = PythonKernel(model.program, FLOAT64)
    assert kernel.bind(0, ()).flow(0.0, 0.3, 0.2)[1] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("levels", range(1, 7))
def test_derivatives_cost_as_much_as_the_function_for_each_column(levels):
    columns = sp.symbols("x0:4", real=True)
    a, b, c, d = columns
    f, g = sp.sin(a - b) * c**2 + sp.cos(a) * d, sp.sqrt(1 + sp.cos(a - b) ** 2)
    for _ in range(levels):
        f, g = (f * g + sp.sin(f)) / (1 + g**2), g + f * sp.cos(a - b) * c
    slopes = Gradient((f * g, f / g), columns)
    derivatives = tuple(slope for row in slopes.sparse for slope in row.values())
    assert operations(derivatives, slopes.statements) < (2 + len(columns)) * operations((f * g, f / g))


def operations(results, statements=()):
    known, last = written_out(results, statements)
    return sum(map(sp.count_ops, (*(expr for _, expr in known), *last)))


@pytest.mark.parametrize("numbers", [(1, 2, 3), (3, 2, 1), (9, 10, 11), (1, 10, 2), (2, 20, 100)])
def test_routines_that_differ_in_numbers_of_names_are_written_as_each_by_itself(
    numbers: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The order of names is that of their texts: x10 comes before x2, and so in sums and products."""

    def written(numbers: tuple[int, ...]) -> str:
        a, b, c = (sp.Symbol(f"x{i}", real=True) for i in numbers)
        p, v = (sp.Symbol(name, real=True) for name in ("p1", "v7"))
        first = p * (b - a) ** 2 / c + sp.sin(a * b - c) * v + below(c, sp.Rational(3, 2), a + b, a - 2 * b)
        return text_of(Definition("one", (), (first, (a - b) * first, b - a), [(v, a + b * c)], {a: 1, b: 2, c: 3}))

    monkeypatch.setattr("hsdsl.mathematics.lower.straight._texts", {})
    for others in ((1, 2, 3), (1, 10, 2), (30, 4, 200)):
        written(others)
    shared = written(numbers)
    monkeypatch.setattr("hsdsl.mathematics.lower.straight._texts", {})
    assert shared == written(numbers)
