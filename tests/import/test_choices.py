"""What an import keeps, leaves out, and says: one small automaton for each rule."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import pytest
from automata import component, location, model, param, transition

import hsdsl
from hsdsl.base.errors import ModelError, UsageError
from hsdsl.interface.cli.verbs import obey
from hsdsl.interface.imports.spaceex import imported

X, V = param("x"), param("v")


def text_of(folder: Path, cfg: str, *parts: str, urgent: bool = False, at: Sequence[str] = ()) -> str:
    path = folder / "model.xml"
    path.write_text(model(component("m", *parts)))
    path.with_suffix(".cfg").write_text(cfg)
    return imported(path, until="5", urgent=urgent, at=at)


def switches(text: str) -> list[tuple[float, str]]:
    return [(t.time, t.target) for t in hsdsl.loads(text).simulate().transitions]


EARLY = [X, location(1, "x <= 2", "x' == 1", "a"), location(2, "", "x' == 0", "b")]


def test_a_guard_off_the_facet_needs_urgent_or_asap(tmp_path: Path) -> None:
    begin = 'initially = "x == 0 & loc(m) == a"'
    jump = transition(1, 2, "x >= 1")
    with pytest.raises(ModelError, match=r"may jump there or go on"):
        text_of(tmp_path, begin, *EARLY, jump)
    text = text_of(tmp_path, begin, *EARLY, jump, urgent=True)
    assert switches(text) == [(1.0, "b")] and "SpaceEx may jump later" in text
    asap = jump.replace("<transition ", '<transition asap="true" ')
    assert switches(text_of(tmp_path, begin, *EARLY, asap)) == [(1.0, "b")]


def test_urgent_makes_an_event_of_several_inequalities(tmp_path: Path) -> None:
    ball = [X, V, param("eps", dynamics="const"), location(1, "x >= 0", "x' == v & v' == -2", "a")]
    ball.append(transition(1, 1, "x <= eps & v < 0", "v := -v"))
    begin = 'initially = "x == 4.25 & v == 0 & eps == 0.25"'
    with pytest.raises(ModelError, match="may jump there or go on"):
        text_of(tmp_path, begin, *ball)
    text = text_of(tmp_path, begin, *ball, urgent=True)
    assert "event: x <= eps and v < 0" in text
    assert [time for time, _ in switches(text)] == pytest.approx([2.0], abs=1e-12)  # the next at t = 6


def test_urgent_takes_what_holds_on_entry_at_once(tmp_path: Path) -> None:
    rest = location(2, "", "x' == 0", "b")
    parts = [X, location(1, "x <= 9", "x' == 1", "a"), rest, location(3, "", "x' == 2", "c")]
    parts += [transition(1, 2, "x >= 2"), transition(2, 3, "x >= 2"), transition(3, 1, "x >= 6", "x := 1")]
    text = text_of(tmp_path, 'initially = "x == 0 & loc(m) == a"', *parts, urgent=True)
    assert switches(text) == [(2.0, "b"), (2.0, "c"), (4.0, "a"), (5.0, "b"), (5.0, "c")]


def test_an_equation_is_met_from_both_sides(tmp_path: Path) -> None:
    parts = [X, V, location(1, "v <= 9", "x' == 1 & v' == 0", "a"), location(2, "v <= 9", "x' == -1 & v' == 0", "b")]
    parts += [transition(1, 2, "x == 1", "x := 3"), transition(2, 1, "x == 1", "x := 0")]
    text = text_of(tmp_path, 'initially = "x == 0 & v == 0 & loc(m) == a"', *parts, urgent=True)
    assert switches(text) == [(1.0, "b"), (3.0, "a"), (4.0, "b")]


def test_an_equation_of_a_counter_is_a_condition(tmp_path: Path) -> None:
    parts = [X, param("n"), location(1, "x <= 1", "x' == 1 & n' == 0", "a"), location(2, "", "x' == 0 & n' == 0", "b")]
    parts += [transition(1, 2, "x >= 1 & n == 2"), transition(1, 1, "x >= 1 & n <= 1", "x := 0 & n := n + 1")]
    text = text_of(tmp_path, 'initially = "x == 0 & n == 0 & loc(m) == a"', *parts)
    assert switches(text) == [(1.0, "a"), (2.0, "a"), (3.0, "b")]


def test_no_time_passes_in_a_location_whose_flow_is_false(tmp_path: Path) -> None:
    parts = [X, V, location(1, "x <= 1", "x' == 1 & v' == 0", "a"), location(2, "", "false", "now")]
    parts += [location(3, "", "x' == 1 & v' == 0", "c"), transition(1, 2, "x >= 1", "x := 2")]
    begin = 'initially = "x == 0 & v == {} & loc(m) == a"'
    exits = [transition(2, 3, "v >= 1", "x := 3"), transition(2, 1, "v <= 0", "x := 0.5 & v := 1")]
    text = text_of(tmp_path, begin.format(0), *parts, *exits)
    assert switches(text) == [(1.0, "now"), (1.0, "a"), (1.5, "now"), (1.5, "c")]
    run = hsdsl.loads(text_of(tmp_path, begin.format("0.5"), *parts, *exits)).simulate()
    assert (run.stop.reason, float(run.time_span[1])) == ("left_domain", 1.0)
    free = [transition(2, 3), transition(2, 1, "v <= 0", "x := 0.5")]
    with pytest.raises(ModelError, match="either may be made"):
        text_of(tmp_path, begin.format(0), *parts, *free)
    text = text_of(tmp_path, begin.format(0), *parts, *free, urgent=True)
    assert switches(text) == [(1.0, "now"), (1.0, "c")] and "here the first" in text


def test_an_initial_box_is_kept_or_a_point_of_it_chosen(tmp_path: Path) -> None:
    parts = [
        X,
        V,
        param("c", dynamics="const"),
        location(1, "x <= 2", "x' == c & v' == 0", "a"),
        location(2, "", "x' == 0 & v' == 0", "b"),
    ]
    parts.append(transition(1, 2, "x >= 2"))
    begin = 'initially = "0 <= x <= 1 & v >= x & v <= x & 0.5 <= c & c <= 1 & loc(m) == a"'
    text = text_of(tmp_path, begin, *parts)
    system = hsdsl.loads(text).system
    assert [(name, float(low), float(high)) for name, low, high in system.ranges] == [("x", 0, 1)]
    assert "v: x" in text and switches(text) == [(2.0, "b")]  # (2 - 1/2)/(3/4)
    assert "value: (0.5 + 1)/2, min: 0.5, max: 1" in text and "c may have any value" in text
    for at, time in ((["lower"], 4.0), (["upper"], 1.0), (["centre", "c=1"], 1.5), (["x=0.5", "c=0.5"], 3.0)):
        assert switches(text_of(tmp_path, begin, *parts, at=at)) == [(time, "b")]
    with pytest.raises(ModelError, match="at the point that --at chose"):
        text_of(tmp_path, begin, *parts, at=["x=3"])
    with pytest.raises(UsageError, match="no variable or constant 'y'"):
        text_of(tmp_path, begin, *parts, at=["y=3"])
    with pytest.raises(UsageError, match="expected centre, lower, upper or NAME=VALUE"):
        text_of(tmp_path, begin, *parts, at=["middle"])


def test_the_hint_for_a_set_that_is_no_box_is_a_point_of_it(tmp_path: Path) -> None:
    parts = [X, V, location(1, "", "x' == 0 & v' == 0")]
    begin = 'initially = "0 <= x <= 2 & 0 <= v <= 2 & x + v <= {}"'
    for most, word in ((3, "centre"), (1, "lower")):
        with pytest.raises(ModelError) as raised:
            text_of(tmp_path, begin.format(most), *parts)
        assert raised.value.diagnostics[0].hint == f"choose a point of it: --at {word}"
        assert hsdsl.loads(text_of(tmp_path, begin.format(most), *parts, at=[word])).simulate().stop.reason == "until"


def test_the_first_location_that_admits_the_start_is_taken(tmp_path: Path) -> None:
    parts = [
        X,
        location(1, "x >= 3", "x' == 1", "a"),
        location(2, "x <= 2", "x' == 1", "b"),
        location(3, "", "x' == 1", "c"),
    ]
    text = text_of(tmp_path, 'initially = "x == 0"', *parts)
    assert hsdsl.loads(text).system.initial.mode == "b" and "may start in other locations than b" in text
    assert "other locations" not in text_of(tmp_path, 'initially = "x == 0"', *parts[:3])


def test_a_target_invariant_says_where_a_jump_without_guard_is_made(tmp_path: Path) -> None:
    flow = "x' == -v & v' == x"
    parts = [
        X,
        V,
        location(1, "v >= 0", flow, "up"),
        location(2, "v <= 0", flow, "down"),
        transition(1, 2),
        transition(2, 1),
    ]
    text = text_of(tmp_path, 'initially = "x == 1 & v == 0 & loc(m) == up"', *parts)
    assert [time for time, _ in switches(text)] == pytest.approx([math.pi], abs=1e-9)


def test_parentheses_around_conjunctions(tmp_path: Path) -> None:
    parts = [
        X,
        V,
        location(1, "((x <= 1)) & (( true))", "(x' == (1 + v)*2) & ((v' == 0))", "a"),
        location(2, "(true)", "x' == 0 & v' == 0", "b"),
    ]
    parts.append(transition(1, 2, "(true & (x >= 1))", "(x = 3)"))
    text = text_of(tmp_path, 'initially = "((loc(m) == a & true) & (x == (0)*(1) & (v == 0)))"', *parts)
    assert switches(text) == [(0.5, "b")] and hsdsl.loads(text).simulate().final.state["x"] == 3


def test_bounds_of_a_derivative(tmp_path: Path) -> None:
    for flow in ("x' <= 1 & -x' <= -1", "1 <= x' & x' <= 1", "1 == x'"):
        text = text_of(tmp_path, 'initially = "x == 0"', X, location(1, "", flow))
        assert hsdsl.loads(text).simulate().final.state == {"x": 5}
    for flow in ("x' <= 1 & x' >= 0", "0 <= x'", "x' - v' <= 1 & v' == 0", "-x' <= 2"):
        with pytest.raises(ModelError, match="a derivative that is only bounded leaves the flow open"):
            text_of(tmp_path, 'initially = "x == 0 & v == 0"', X, V, location(1, "", flow))


def test_an_input_is_held_where_a_value_is_chosen(tmp_path: Path) -> None:
    parts = [X, param("u"), location(1, "u >= -1 & u <= 1", "x' == u")]
    with pytest.raises(ModelError, match="it may change in any way") as raised:
        text_of(tmp_path, 'initially = "x == 0"', *parts)
    assert "--at u=NUMBER" in (raised.value.diagnostics[0].hint or "")
    text = text_of(tmp_path, 'initially = "x == 0"', *parts, at=["u=0.5"])
    assert hsdsl.loads(text).simulate().final.state == {"x": 2.5} and "u may change in any way" in text
    for begin in ("x == 0 & 0 <= u <= 1", "x == 0 & u == 0.5"):
        text = text_of(tmp_path, f'initially = "{begin}"', *parts, at=["centre"])
        assert hsdsl.loads(text).simulate().final.state == {"x": 2.5}


def test_what_else_a_guard_says_is_a_condition_and_the_facet_a_wall(tmp_path: Path) -> None:
    parts = [X, V, location(1, "x <= 1", "x' == 1 & v' == 1", "a"), location(2, "", "x' == 1 & v' == 1", "b")]
    parts.append(transition(1, 2, "x >= 1 & v >= 2"))
    text = text_of(tmp_path, 'initially = "x == 0 & v == 1.5 & loc(m) == a"', *parts)
    assert "if: v >= 2" in text and "- x <= 1" in text and switches(text) == [(1.0, "b")]
    text = text_of(tmp_path, 'initially = "x == 0 & v == 0.5 & loc(m) == a"', *parts)
    run = hsdsl.loads(text).simulate()
    assert (run.stop.reason, run.transitions, float(run.time_span[1])) == ("left_domain", (), 1.0)


def test_a_jump_leads_only_into_the_invariant(tmp_path: Path) -> None:
    parts = [X, V, location(1, "x <= 1", "x' == 1 & v' == 0", "a"), location(2, "v <= 3", "x' == 1 & v' == 0", "b")]
    parts.append(transition(1, 2, "x >= 1", "v := 2*v"))
    text = text_of(tmp_path, 'initially = "x == 0 & v == 1 & loc(m) == a"', *parts)
    assert "if: (2*v) <= 3" in text and switches(text) == [(1.0, "b")]


def test_an_equation_gives_a_variable_and_modes_have_their_own_states(tmp_path: Path) -> None:
    parts = [X, V, location(1, "x <= 1 & v == 3*x", "x' == 1", "a"), location(2, "", "x' == v & v' == -v", "b")]
    parts.append(transition(1, 2, "x >= 1"))
    text = text_of(tmp_path, 'initially = "x == 0 & loc(m) == a"', *parts)
    (made,) = hsdsl.loads(text).simulate().transitions
    assert "v: (3*x)" in text and made.after == {"x": 1.0, "v": pytest.approx(3.0)}
    with pytest.raises(ModelError, match="no value after this transition"):
        text_of(tmp_path, 'initially = "x == 0 & loc(m) == a"', *(p.replace(" &amp; v == 3*x", "") for p in parts))


def test_an_equation_of_a_variable_without_derivative_is_named(tmp_path: Path) -> None:
    parts = [X, V, location(1, "x <= 1 & 3*x == v", "x' == 2 - v", "a")]
    run = hsdsl.loads(text := text_of(tmp_path, 'initially = "x == 0"', *parts)).simulate()
    assert "let:\n      v: 3*x" in text and run(5.0)["x"] == pytest.approx(2 / 3)


def test_an_equation_that_the_flow_keeps_is_a_comment(tmp_path: Path) -> None:
    parts = [
        X,
        V,
        location(1, "x == 2*v & v <= 1", "x' == 2 & v' == 1", "a"),
        transition(1, 1, "v >= 1", "x := 0 & v := 0"),
    ]
    text = text_of(tmp_path, 'initially = "x == 0 & v == 0"', *parts)
    assert "# `x == 2*v` holds all along" in text and len(switches(text)) == 5


def test_no_text_leaves_a_comment(tmp_path: Path) -> None:
    note = "<note>one&#10;modes: {}&#10;# two</note>"
    place = location(1, "x <= 1", "x' == 1", "a: {b}").replace("<invariant>", f"{note}<invariant>", 1)
    text = text_of(tmp_path, 'initially = "x == 0"\nforbidden = "x > 1"', X, place)
    assert hsdsl.loads(text).system.modes[0].name == "a___b_" and "\nmodes: {}" not in text


def test_latin_letters_in_an_old_encoding(tmp_path: Path) -> None:
    path = tmp_path / "model.xml"
    text = model(component("m", "<note>Grüße</note>", X, location(1, "", "x' == 1")))
    path.write_bytes(text.replace('version="1.0"', 'version="1.0" encoding="iso-8859-1"', 1).encode("latin-1"))
    path.with_suffix(".cfg").write_text('initially = "x == 0"')
    assert "Grüße" in imported(path, until="1")


def test_an_end_is_needed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "model.xml"
    path.write_text(model(component("m", X, location(1, "", "x' == 1"))))
    path.with_suffix(".cfg").write_text('initially = "x == 0"')
    assert obey(["import", str(path)]) == 2
    assert "--until" in capsys.readouterr().err
    assert obey(["import", str(path), "--until", "x"]) == 2
    assert obey(["import", str(path), "--until", "1"]) == 0
