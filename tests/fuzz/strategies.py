"""Hypothesis strategies for the three kinds of input: structure that shrinks to the smallest input that still fails."""

from __future__ import annotations

import json

from hypothesis import strategies as st

from fuzz import generators, seeds

NAMES = st.sampled_from((*generators.VARIABLES, *seeds.NAMES))
NUMBERS = st.one_of(st.sampled_from(generators.NUMBERS), st.integers(-(10**20), 10**20).map(str), st.floats().map(repr))
LEAVES = st.one_of(NAMES, NUMBERS, st.sampled_from(seeds.PAYLOADS), st.text(max_size=6))


def _larger(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    operator = st.sampled_from(("+", "-", "*", "/", "**", " and ", " or ", " < ", " >= ", ", ", "^", ""))
    function = st.sampled_from((*generators.FUNCTIONS, "not ", "-", "x", "min"))
    return st.one_of(
        st.tuples(inner, operator, inner).map("".join),
        inner.map("({})".format),
        st.tuples(function, inner).map("{0[0]}({0[1]})".format),
        st.tuples(function, inner, inner).map("{0[0]}({0[1]}, {0[2]})".format),
        st.tuples(inner, st.integers(1, 300)).map(lambda p: "(" * p[1] + p[0] + ")" * p[1]),
    )


EXPRESSIONS = st.recursive(LEAVES, _larger, max_leaves=10)
BYTES = st.one_of(
    st.binary(max_size=200),
    st.lists(st.one_of(st.sampled_from(generators.YAML_TOKENS), LEAVES), max_size=30).map(
        lambda parts: "".join(parts).encode("utf-8", "surrogatepass")
    ),
)
SCALARS = st.one_of(st.none(), EXPRESSIONS, NUMBERS, st.booleans())
TREES = st.recursive(
    SCALARS, lambda t: st.one_of(st.lists(t, max_size=3), st.dictionaries(NAMES, t, max_size=3)), max_leaves=6
)
SIMPLE = st.sampled_from(("1", "x", "-x", "0.5", "v", "x*v", "sin(t)", "a"))
TRANSITIONS = st.fixed_dictionaries(
    {"when": st.one_of(st.just("x >= 1"), EXPRESSIONS), "to": st.one_of(st.just("A"), NAMES)},
    optional={"if": EXPRESSIONS, "reset": st.dictionaries(NAMES, SIMPLE, max_size=2), "priority": TREES, "name": TREES},
)
MODELS = st.fixed_dictionaries(
    {
        "hsdsl": st.just(1),
        "modes": st.fixed_dictionaries(
            {
                "A": st.fixed_dictionaries(
                    {"flow": st.fixed_dictionaries({"x": st.one_of(SIMPLE, EXPRESSIONS), "v": SIMPLE})},
                    optional={"transitions": st.lists(TRANSITIONS, max_size=2), "domain": TREES, "let": TREES},
                )
            },
            optional={"B": TREES},
        ),
        "initial": st.fixed_dictionaries({"mode": st.just("A"), "x": SIMPLE, "v": st.just(0)}),
        "experiment": st.fixed_dictionaries({"until": st.one_of(st.just("1"), NUMBERS)}, optional={"step": TREES}),
    },
    optional={"parameters": st.one_of(st.just({"a": 1}), TREES), "inputs": TREES, "units": TREES, "reference": TREES},
)
DOCUMENTS = MODELS.map(lambda model: json.dumps(model, ensure_ascii=False).encode("utf-8", "surrogatepass"))
