"""Random expressions: what is printed and read again has the value Python's own arithmetic gives it."""

import contextlib
from fractions import Fraction

from hypothesis import given, settings
from hypothesis import strategies as st

from hsdsl.base.errors import ModelError
from hsdsl.language.elaborate import elaborate
from hsdsl.language.expression import ExpressionError, parse, symbolic
from hsdsl.language.expression.scope import Scope, state, symbol

VALUES = {"x": Fraction(3, 7), "beta": Fraction(-2), "E": Fraction(5, 2)}
SCOPE = Scope({name: state(name) for name in VALUES})
LEAVES = st.one_of(st.integers(0, 99).map(str), st.decimals(0, 10, places=2).map(str), st.sampled_from(sorted(VALUES)))


def grown(inner):
    binary = st.tuples(inner, st.sampled_from(["+", "-", "*", "/", " - ", "+ -"]), inner).map("".join)
    return st.one_of(
        binary,
        inner.map("({})".format),
        inner.map("-{}".format),
        inner.map("({})".format).flatmap(lambda base: st.integers(-3, 3).map(lambda n: f"{base}**{n}")),
        st.tuples(st.sampled_from(["2", "x"]), st.integers(0, 3)).map(lambda p: f"-{p[0]}**{p[1]}"),
    )


EXPRESSIONS = st.recursive(LEAVES, grown, max_leaves=12)


def by_python(text):
    """The value by Python's own parser and exact arithmetic; its numbers are made exact first."""
    import ast

    class Exact(ast.NodeTransformer):
        def visit_Constant(self, node):
            segment = ast.get_source_segment(text, node)
            return ast.Call(ast.Name("F", ast.Load()), [ast.Constant(segment)], [])

    tree = ast.fix_missing_locations(Exact().visit(ast.parse(text, mode="eval")))
    return eval(compile(tree, "test", "eval"), {"F": Fraction, "__builtins__": {}}, dict(VALUES))


@settings(max_examples=300, deadline=None)
@given(EXPRESSIONS)
def test_same_value_as_python(text):
    try:
        expected = by_python(text)
    except (ZeroDivisionError, SyntaxError):
        return
    try:
        made = symbolic.number(parse(text), SCOPE, text).expr
    except ExpressionError as error:
        assert error.code in ("HS118", "HS119", "HS120"), text
        return
    exact = made.subs(
        {symbol(name): value.numerator / symbol("one") / value.denominator for name, value in VALUES.items()}
    )
    exact = exact.subs(symbol("one"), 1)
    assert Fraction(int(exact.p), int(exact.q)) == expected


@settings(max_examples=300, deadline=None)
@given(st.one_of(st.text(max_size=40), st.text(alphabet="x2.0+-*/()<>=!&,^ 'eandorsin", max_size=40)))
def test_any_text_is_read_or_refused_at_a_place(text):
    for right in ("number", "condition", "inequality"):
        try:
            tree = parse(text, right)
            if not SCOPE.faults(tree):
                (symbolic.condition if right == "condition" else symbolic.number)(tree, SCOPE, text)
        except ExpressionError as error:
            assert 0 <= error.start < error.end <= max(1, len(text) + 1)
            assert str(error)


MODEL = """hsdsl: 1
parameters: {a: 1}
modes:
  A:
    flow: {x: a*x}
    transitions: [{when: x >= 1, to: A, reset: {x: 0}}]
initial: {mode: A, x: 0}
experiment: {until: 1}
"""


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=200))
def test_any_bytes_are_a_model_error(data):
    with contextlib.suppress(ModelError):
        elaborate("m.yaml", text=data)


@settings(max_examples=300, deadline=None)
@given(
    st.integers(0, len(MODEL)), st.integers(0, 12), st.text(alphabet="{}[]:,-?#&*!|>'\"%@` \n\tax1>=()+", max_size=8)
)
def test_any_damage_to_a_model_is_a_model_error(at, length, inserted):
    damaged = MODEL[:at] + inserted + MODEL[at + length :]
    try:
        elaborate("m.yaml", text=damaged.encode())
    except ModelError as error:
        assert error.diagnostics
        for diagnostic in error.diagnostics:
            assert diagnostic.span is None or 1 <= diagnostic.span.line <= damaged.count("\n") + 1
