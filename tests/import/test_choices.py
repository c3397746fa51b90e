"""What an import keeps, leaves out, and says: one small automaton for each rule."""

from __future__ import annotations

from pathlib import Path

import pytest
from automata import component, location, model, param, transition

import hsdsl
from hsdsl.base.errors import ModelError
from hsdsl.interface.cli.verbs import obey
from hsdsl.interface.imports.spaceex import imported

X, V = param("x"), param("v")


def text_of(folder: Path, cfg: str, *parts: str, urgent: bool = False) -> str:
    path = folder / "model.xml"
    path.write_text(model(component("m", *parts)))
    path.with_suffix(".cfg").write_text(cfg)
    return imported(path, until="5", urgent=urgent)


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


def test_urgent_is_refused_where_no_single_inequality_decides(tmp_path: Path) -> None:
    parts = [X, V, location(1, "x <= 2", "x' == 1 & v' == 1", "a"), transition(1, 1, "x >= 1 & v >= 3", "x := 0")]
    with pytest.raises(ModelError, match="the first time at which this guard holds"):
        text_of(tmp_path, 'initially = "x == 0 & v == 0"', *parts, urgent=True)


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
