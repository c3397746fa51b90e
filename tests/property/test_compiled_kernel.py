"""The compiled kernel against the Python kernel, to the bit: the same values, and none at the same points."""

from __future__ import annotations

import ast
from functools import cache
from itertools import product

import pytest
from compiled_kernel import CompiledKernel
from engines import needs_compiler, outcome
from hypothesis import given, settings
from hypothesis import strategies as st

from hsdsl.base.functions import FUNCTIONS
from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.backends.c.routine import function_body
from hsdsl.engine.backends.python import PythonKernel
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.runtime.kernel import CompiledModel
from hsdsl.interface.model import Model
from hsdsl.language.elaborate import elaborate

pytestmark = needs_compiler
SPECIAL = [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 2.0, 3.0, 710.0, -746.0, 1e-310, 1e200, -1e308, float("inf"), float("nan")]
NUMBERS = st.one_of(st.sampled_from([*SPECIAL, -SPECIAL[-2]]), st.floats())
ONE = [name for name, (_, least, most) in FUNCTIONS.items() if most == 1]
TWO = [name for name, (_, least, most) in FUNCTIONS.items() if least == 2]
LEAVES = st.sampled_from(["x", "v", "a", "t", "u", "1/3", "0.7", "2", "pi", "1e300"])


def _grown(inner):
    return st.one_of(
        st.builds("{}({})".format, st.sampled_from(ONE), inner),
        st.builds("{}({}, {})".format, st.sampled_from(TWO), inner, inner),
        st.builds("({}) {} ({})".format, inner, st.sampled_from(["+", "-", "*", "/", "**"]), inner),
        st.builds("({})**{}".format, inner, st.sampled_from(["2", "3", "8", "9", "-1", "-2", "0.5", "1.5", "-0.5"])),
        st.builds("-({})".format, inner),
    )


EXPRESSIONS = st.recursive(LEAVES, _grown, max_leaves=6)
CONDITIONS = st.builds(
    "{} > {} {} {} <= 1/{}".format, EXPRESSIONS, LEAVES, st.sampled_from(["and", "or"]), LEAVES, LEAVES
)


MODE = """
  m{0}:
    flow: {{x: "{1}", v: "1 - x*v/4"}}
    outputs: {{y: "{1}"}}
    transitions: [{{when: "{2} >= v/3", if: "{3}", to: m{0}, reset: {{x: "{1}", v: x}}}}]"""
MODEL = """
hsdsl: 1
parameters: {{a: 0.35}}
inputs: {{u: {{times: [0, 10], values: [1, 3], hold: linear}}}}
modes:{0}
initial: {{mode: m0, x: 0, v: 0}}
experiment: {{until: 1}}
"""


def both_kernels(mode: str, *each: tuple[str, ...]) -> tuple[PythonKernel, CompiledKernel, list[float]] | None:
    """Both kernels of a model with a mode for each texts, and its data; None where it is refused."""
    text = MODEL.format("".join(mode.format(k, *texts) for k, texts in enumerate(each)))
    try:
        program = Model(elaborate("random.yaml", text=text.encode())).program
    except Exception:  # the language refuses what has no value anywhere, such as 1/0
        return None
    data = [0.35, 1.0, 0.2, 0.0, *(1.0 for _ in program.switches)]
    return PythonKernel(program, FLOAT64), CompiledKernel(program, CompiledModel(program)), data


def kernels(*each: tuple[str, str, str]) -> list[tuple[ModeKernel, ModeKernel]]:
    """A mode for each flow, guard and condition, by either kernel; none where one is refused."""
    if (made := both_kernels(MODE, *each)) is None:
        return []
    python, compiled, data = made
    return [(python.bind(k, data), compiled.bind(k, data)) for k in range(len(each))]


def routines(mode: ModeKernel) -> list:
    several = (*mode.gradients, *mode.rates, *mode.conditions, *mode.resets)
    return [mode.flow, mode.surfaces, mode.magnitudes, mode.outputs, *several]


@settings(max_examples=40, deadline=None)
@given(EXPRESSIONS, EXPRESSIONS, CONDITIONS, st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=20, max_size=20))
def test_random_routines_agree_at_any_point(flow, guard, condition, points):
    for both in kernels((flow, guard, condition)):
        for python, compiled in zip(*map(routines, both), strict=True):
            for point in points:
                assert outcome(compiled, *point) == outcome(python, *point), point
        for point in points:
            sizes = tuple(abs(x) for x in point[1:])
            assert outcome(both[1].spreads[0], *point, *sizes) == outcome(both[0].spreads[0], *point, *sizes)


ALONE = [*(f"{name}(x)" for name in ONE), *(f"{name}(x, v)" for name in TWO)]
ALONE += ["x**v", "x/v", "x**9", "x**-3", "x**0.5", "x**-1.5", "v - -x", "-x*v", "sin(x)/cos(x)", "exp(2.0) + sin(2)*x"]


@cache
def alone() -> list[tuple[ModeKernel, ModeKernel]]:
    """The routines of all of them, compiled together."""
    return kernels(*((text, text, "x > 0 or v > 0") for text in ALONE))


@pytest.mark.parametrize("text", ALONE)
def test_each_function_and_its_slopes_agree_at_special_points(text):
    both = alone()[ALONE.index(text)]
    for python, compiled in zip(*map(routines, both), strict=True):
        for x, v in product(SPECIAL, SPECIAL):
            assert outcome(compiled, 0.25, x, v) == outcome(python, 0.25, x, v), (x, v)


@pytest.mark.parametrize("text", ["import os", "return (x,)", "return (open(t), )", "return (x.y, )", "return (q_1, )"])
def test_what_is_no_routine_is_refused(text):
    definition = ast.parse(f"def routine(t):\n    {text}").body[0]
    assert isinstance(definition, ast.FunctionDef)
    with pytest.raises(ValueError):
        function_body(definition, {"t": "t"})
