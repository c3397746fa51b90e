"""JSON text keeps every value."""

from __future__ import annotations

import json
from unittest.mock import patch

from hypothesis import given
from hypothesis import strategies as st

from hsdsl.analysis.report import json_form

FINITE = st.floats(allow_nan=False, allow_infinity=False)
LEAVES = st.none() | st.booleans() | st.integers() | FINITE | st.text()
ANY = st.recursive(LEAVES, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=30)
ALIKE = {"n%": FINITE | st.none(), "list": st.lists(LEAVES, max_size=3), "own": st.dictionaries(st.text(), FINITE)}
VALUES = ANY | st.lists(st.fixed_dictionaries(ALIKE) | LEAVES, max_size=5)


@given(VALUES, st.integers(10, 120))
def test_what_is_read_back_is_what_was_written(value, width):
    with patch.object(json_form, "WIDTH", width):
        assert json.loads(json_form.dumps(value)) == value


@given(VALUES)
def test_the_text_is_the_standard_library_s_up_to_white_space(value):
    assert json.loads(json_form.dumps(value)) == json.loads(json.dumps(value))
    with patch.object(json_form, "WIDTH", 10**9):
        assert json_form.dumps(value) == json.dumps(value)
