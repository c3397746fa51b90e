"""Random automata and hostile files: an import runs inside its invariants, or says in one message why it is none."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path

import pytest
from automata import component, location, model, param, transition
from hypothesis import given, settings
from hypothesis import strategies as st

import hsdsl
from hsdsl.base.errors import ModelError, UsageError
from hsdsl.base.limits import Limits, applied
from hsdsl.interface.imports.spaceex import imported

FOLDER = Path(__file__).parent
RATES = st.sampled_from(["1", "-1", "0.5", "v", "-v", "x - v", "-2*x + 0.3", "0"])
SETS = st.sampled_from(["x >= 0", "x <= 1", "v <= 2", "x + v <= 3", "v >= -2", "", "x >= 0 & x <= 1", "x - v >= -5"])
GUARDS = st.sampled_from(
    [
        "x <= 0",
        "x >= 1",
        "v >= 2",
        "x + v >= 3",
        "x == 0",
        "x == 1 & v >= 0",
        "v <= -2",
        "x <= 0 & v < 0",
        "",
        "x >= 0.5",
    ]
)
RESETS = st.sampled_from(["", "v := -0.5*v", "x := 0.5", "x := 0.5 & v := 0", "v := v - 1"])


def put(folder: Path, text: str | bytes, cfg: str = "") -> Path:
    path = folder / "model.xml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    path.with_suffix(".cfg").write_text(cfg)
    return path


def taken(path: Path, urgent: bool = False) -> str | None:
    """The model's text, None where it is refused with at least one message."""
    try:
        return imported(path, until="3", urgent=urgent)
    except ModelError as error:
        assert error.diagnostics and all(d.span and d.message for d in error.diagnostics)
    except UsageError as error:
        assert str(error)
    return None


@st.composite
def automata(draw: st.DrawFn) -> str:
    count = draw(st.integers(1, 3))
    keys = range(1, count + 1)
    sets = {k: draw(SETS) for k in keys}
    parts = [location(k, sets[k], f"x' == {draw(RATES)} & v' == {draw(RATES)}") for k in keys]
    ends = st.tuples(st.sampled_from(keys), st.sampled_from(keys))
    for source, target in draw(st.lists(ends, max_size=4)):
        edge = draw(st.sampled_from(sets[source].split(" & "))).translate(str.maketrans("<>", "><"))
        parts.append(transition(source, target, draw(st.just(edge) | GUARDS), draw(RESETS)))
    return model(component("any", param("x"), param("v"), *parts))


@settings(max_examples=60)
@given(text=automata(), urgent=st.booleans())
def test_a_run_stays_in_its_invariants(text: str, urgent: bool, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = put(tmp_path_factory.mktemp("any"), text, 'initially = "x == 0.25 & v == 0.5 & loc(any)==l1"')
    got = taken(path, urgent)
    if got is None:
        return
    rows = hsdsl.loads(got).simulate(max_transitions=200).rows()
    for name in set(rows.mode):
        inside = unescape(text.split(f'name="{name}"><invariant>')[1].split("</invariant>")[0])
        columns = {key: rows[key][rows.mode == name] for key in ("x", "v")}
        for bound in filter(None, inside.split(" & ")):
            left, sign, right = re.split(" (<=|>=) ", bound)
            excess = (eval(left, {}, columns) - float(right)) * (1 if sign == "<=" else -1)  # the test's own text
            assert max(excess) <= 1e-6, (bound, got)


GO = '<param name="go" type="label" local="{}"/>'


def joined(together: bool, rate: float, period: float) -> str:
    """Two clocks that are reset together, as a network and by hand."""
    x, y, end = param("x"), param("y"), f"x >= {period}"
    if not together:
        one = location(1, f"x <= {period}", f"x' == 1 & y' == {rate}", "a")
        return model(component("all", x, y, one, transition(1, 1, end, "x := 0 & y := y/2")))
    parts = location(1, f"x <= {period}", "x' == 1", "a"), transition(1, 1, end, "x := 0", "go")
    first = component("first", x, GO.format("false"), *parts)
    parts = location(1, "", f"u' == {rate}", "b"), transition(1, 1, "", "u := u/2", "go")
    second = component("second", param("u"), GO.format("false"), *parts)
    maps = {"first": '<map key="x">x</map>', "second": '<map key="u">y</map>'}
    binds = [f'<bind component="{c}" as="i_{c}">{m}<map key="go">go</map></bind>' for c, m in maps.items()]
    return model(first, second, component("all", x, y, GO.format("true"), *binds))


@settings(max_examples=8)
@given(rate=st.floats(0.1, 5).map(lambda v: round(v, 3)), period=st.floats(0.2, 0.9).map(lambda v: round(v, 3)))
def test_a_network_runs_like_its_product(rate: float, period: float, tmp_path_factory: pytest.TempPathFactory) -> None:
    runs = []
    for together in (False, True):
        folder = tmp_path_factory.mktemp("clocks")
        text = imported(
            put(folder, joined(together, rate, period), 'system = all\ninitially = "x == 0 & y == 1"'), until="3"
        )
        runs.append([(t.time, t.before, t.after) for t in hsdsl.loads(text).simulate().transitions])
    assert runs[0] == runs[1] and len(runs[0]) >= 3


BYTES = [path.read_bytes() for path in sorted(FOLDER.glob("*.xml"))]
CFGS = [path.read_text() for path in sorted(FOLDER.glob("*.cfg"))]
PIECES = [
    b"<",
    b">",
    b"&",
    b"&amp;",
    b"'",
    b"==",
    b"]]>",
    b"<![CDATA[",
    b"<!DOCTYPE x>",
    b"\xff",
    b"\0",
    b"(" * 300,
    b"x'",
    b"1e999",
]


@settings(max_examples=150)
@given(data=st.data())
def test_damaged_files_are_refused_with_a_message(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    which = data.draw(st.integers(0, len(BYTES) - 1))
    text, cfg = bytearray(BYTES[which]), CFGS[which]
    for _ in range(data.draw(st.integers(0, 3))):
        at, length = data.draw(st.integers(0, len(text))), data.draw(st.integers(0, 30))
        text[at : at + length] = data.draw(st.sampled_from(PIECES) | st.binary(max_size=6))
    if data.draw(st.booleans()):
        at = data.draw(st.integers(0, len(cfg)))
        cfg = cfg[:at] + data.draw(st.text(max_size=6)) + cfg[at + data.draw(st.integers(0, 9)) :]
    folder = tmp_path_factory.mktemp("damaged")
    (folder / "model.cfg").write_bytes(cfg.encode("utf-8", "surrogatepass"))
    (folder / "model.xml").write_bytes(bytes(text))
    got = taken(folder / "model.xml")
    if got is not None:
        try:
            hsdsl.loads(got)
        except ModelError as error:
            assert error.diagnostics


def test_limits_hold(tmp_path: Path) -> None:
    clocks = component(
        "c", param("x"), *(location(k, "", "x' == 1") for k in (1, 2)), transition(1, 2), transition(2, 1)
    )
    binds = [f'<bind component="c" as="i{k}"><map key="x">x{k}</map></bind>' for k in range(30)]
    many = model(clocks, component("all", *(param(f"x{k}") for k in range(30)), *binds))
    begin = " &amp; ".join(f"loc(i{k})==l1 & x{k} == 0" for k in range(30)).replace("&amp;", "&")
    path = put(tmp_path, many, f'system = all\ninitially = "{begin}"')
    with applied(Limits(modes=50)), pytest.raises(ModelError, match="more than 50 locations"):
        imported(path, until="1")
    with applied(Limits(values=10)), pytest.raises(ModelError, match="more than 10 elements"):
        imported(path, until="1")
    with applied(Limits(bytes=100)), pytest.raises(ModelError, match="larger than 100 bytes"):
        imported(path, until="1")
