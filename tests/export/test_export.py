"""Exports as files: names, headings, folders, refusals."""

from __future__ import annotations

import errno
import json
import os
from io import BytesIO
from pathlib import Path
from zipfile import ZipFile, is_zipfile

import pytest
from shipped import MODELS

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.export import TARGETS, files_of, source_of, write
from hsdsl.export.source import identifiers
from hsdsl.interface.cli.convert import only_text
from hsdsl.interface.cli.verbs import obey

BALL = str(MODELS / "bouncing-ball.yaml")


def texts(files: dict[str, bytes]) -> list[bytes]:
    """The contents of files, those of archives one by one."""
    found: list[bytes] = []
    for content in files.values():
        if is_zipfile(BytesIO(content)):
            with ZipFile(BytesIO(content)) as archive:
                found += [archive.read(name) for name in archive.namelist()]
        else:
            found.append(content)
    return found


# what is compiled takes long; test_web.py compiles pages twice too
LONG = {"fmi2": pytest.mark.slow, "fmi3": pytest.mark.slow, "web": pytest.mark.campaign}


@pytest.mark.parametrize("target", [pytest.param(name, marks=LONG.get(name, ())) for name in TARGETS])
def test_same_model_gives_same_bytes_and_settings_change_them(target: str) -> None:
    model = hsdsl.load(BALL)
    files = files_of(source_of(model, {}), target)
    assert files == files_of(source_of(hsdsl.load(BALL), {}), target)
    changed = files_of(source_of(model, {"parameters": {"e": "1/2"}}), target)
    assert changed != files
    assert any(b"e=1/2" in text for text in texts(changed))


def test_unknown_target_and_full_folder_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert obey(["export", BALL, "--to", "mermad", "--out", str(out)]) == 2
    assert not out.exists()
    out.mkdir()
    (out / "mine").write_text("kept")
    assert obey(["export", BALL, "--to", "mermaid", "--out", str(out)]) == 2
    assert [path.name for path in out.iterdir()] == ["mine"]
    assert obey(["export", BALL, "--to", "mermaid", "--out", str(out), "--force"]) == 0
    assert (out / "mine").read_text() == "kept"


def test_bad_settings_are_refused_like_those_of_a_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert obey(["export", BALL, "--to", "mermaid", "--set", "ee=1"]) == 2
    assert "did you mean" in capsys.readouterr().err


def test_identifiers_are_ascii_distinct_and_not_reserved() -> None:
    assert identifiers(["θ", "theta", "x", "int", "x", "é"], {"int"}) == {
        "θ": "theta", "theta": "theta_", "x": "x", "int": "int_", "é": "e",
    }  # fmt: skip


def test_no_text_of_a_model_leaves_a_label() -> None:
    text = """
hsdsl: 1
title: "x %%{init: {}}%% <script>"
modes:
  end: {flow: {x: 1}, transitions: [{name: state, when: x >= 1, to: end, reset: {x: 0}}]}
initial: {mode: end, x: 0}
experiment: {until: 1}
"""
    diagram = files_of(source_of(hsdsl.loads(text), {}), "mermaid")["n_text_.mmd"].decode()
    assert "{" not in diagram
    body = [line for line in diagram.splitlines() if not line.startswith("%%")]
    assert not any("<script" in line for line in body)
    assert "m0 --> m0 : state" in diagram


USING = """
hsdsl: 1
parameters: {k: 2}
modes: {m: {flow: {x: 1, y: -y, z: k}}}
initial: {mode: m, z: x - y, x: k*y, y: 3}
experiment: {until: 4}
"""


@pytest.mark.parametrize("initial", [{}, {"y": 5}, {"x": 0.1}, {"y": 5, "z": 1}])
def test_initial_values_of_exports_follow_those_that_are_given(initial):
    model = hsdsl.loads(USING)
    problem = source_of(model, {"initial": initial}).problem
    for k in (2.0, 7.0):
        run = model.simulate(initial=initial, parameters={"k": k})
        known = dict(zip(problem.program.initial_states, problem.kernel.constant("initial", (k,)), strict=True))
        assert known == {name: float(run.sample([0])[name][0]) for name in ("x", "y", "z")}


def test_initial_values_keep_their_expressions_in_any_order():
    """The file has z, x, y, and the mode x, y, z; what the call gives stays a number."""
    files = files_of(source_of(hsdsl.loads(USING), {"initial": {"y": 5}}), "jax")
    assert any(b"[found[1], 5.0, found[0]]" in content for content in files.values())


def test_a_printed_document_is_one_json_object_on_request(capsys: pytest.CaptureFixture[str]) -> None:
    assert obey(["export", BALL, "--to", "mermaid", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["target"] == "mermaid"
    assert found["name"] == "bouncing_ball.mmd"
    assert "stateDiagram-v2" in found["text"]


def test_the_target_is_refused_before_the_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine").write_text("kept")
    assert obey(["export", BALL, "--to", "mermad", "--out", str(tmp_path)]) == 2
    assert "there is no export target 'mermad'" in capsys.readouterr().err


def test_a_full_disk_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, files = tmp_path / "new" / "out", {"a": b"1", "sub/b": b"2", "sub/c": b"3"}
    left = iter((True, True))

    def synced(descriptor: int) -> None:
        if not next(left, False):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", synced)
    with pytest.raises(UsageError, match="No space left"):
        write(files, out)
    assert not list(tmp_path.iterdir())
    left = iter((True, True, True))
    assert write(files, out) == [out / name for name in files]
    left = iter(())
    with pytest.raises(UsageError, match="No space left"):
        write({"a": b"new", "d/e": b"5"}, out, force=True)
    assert sorted(path.relative_to(out).as_posix() for path in out.rglob("*")) == ["a", "sub", "sub/b", "sub/c"]
    assert (out / "a").read_bytes() == b"1"


TRANSITIONS = """{a: {flow: {x: 1, y: 1}, transitions: [
  {name: late, event: x >= 1, delay: 1/2, persistent: false, values: execution, reset: {x: -1}},
  {name: now, event: y >= 3, priority: 10*x, reset: {y: 0}},
  {name: walks, when: y >= 9, to: a, priority: 3, reset: {y: 0}}]}}"""
OF_ONE = f"hsdsl: 1\nmodes: {TRANSITIONS}\ninitial: {{mode: a, x: 0, y: 1}}\nexperiment: {{until: 4}}"
OF_PARTS = f"""
hsdsl: 1
automata: {{k: {{modes: {TRANSITIONS}}}}}
system: {{q: {{automaton: k, initial: {{mode: a, x: 0, y: 1}}}}}}
experiment: {{until: 4}}
"""


@pytest.mark.parametrize("text", [OF_ONE, OF_PARTS])
def test_a_diagram_has_what_decides_when_transitions_are_made(text: str) -> None:
    (diagram,) = files_of(source_of(hsdsl.loads(text), {}), "mermaid").values()
    late, now, walks = (line for line in diagram.decode().splitlines() if "--" in line and "<br/>" in line)
    assert "late<br/>event x #62;#61; 1<br/>delay 1/2<br/>values execution<br/>persistent false<br/>x " in late
    assert "now<br/>event y #62;#61; 3<br/>priority 10#8727;x<br/>y " in now
    assert "walks<br/>when y #62;#61; 9<br/>priority 3<br/>y " in walks


def test_only_one_file_of_text_is_printed() -> None:
    assert only_text({"a.mmd": "é".encode()}, "mermaid") == ("a.mmd", "é")
    with pytest.raises(UsageError, match="c has 2 files: expected --out"):
        only_text({"a": b"", "b": b""}, "c")
    with pytest.raises(UsageError, match=r"a\.fmu is not a text file: expected --out"):
        only_text({"a.fmu": b"PK\xf8"}, "fmi3")
