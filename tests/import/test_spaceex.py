"""Models of SpaceEx, written by hand from published equations: imported, run, and compared with exact switch times."""

from __future__ import annotations

from pathlib import Path
from shutil import copy

import pytest
from automata import model
from shipped import assert_golden
from switch_times import BY_NAME

import hsdsl
from hsdsl.interface.cli.verbs import obey
from hsdsl.interface.imports.spaceex import imported

FOLDER = Path(__file__).parent


@pytest.mark.parametrize("name", BY_NAME)
def test_switches_at_the_exact_times(name: str) -> None:
    run = hsdsl.loads(imported(FOLDER / f"{name}.xml")).simulate()
    found = [(t.source, t.target) for t in run.transitions]
    expected = [entry for entry in BY_NAME[name]() if entry[0] <= run.time_span[1]]
    assert found == [entry[1:] for entry in expected] and len(found) >= 3
    for transition, (time, *_) in zip(run.transitions, expected, strict=True):
        assert transition.time == pytest.approx(float(time), abs=1e-13)


@pytest.mark.parametrize("name", BY_NAME)
def test_text_is_readable_and_stays(name: str) -> None:
    assert_golden(imported(FOLDER / f"{name}.xml"), FOLDER / "golden" / f"{name}.yaml")


@pytest.mark.parametrize("name", BY_NAME)
def test_result_is_valid(name: str, tmp_path: Path) -> None:
    out = tmp_path / "model.yaml"
    assert obey(["import", str(FOLDER / f"{name}.xml"), "--out", str(out), "--quiet"]) == 0
    assert obey(["validate", str(out), "--quiet"]) == 0
    assert obey(["import", str(FOLDER / f"{name}.xml"), "--out", str(out)]) == 2  # it is there


@pytest.mark.parametrize("case", sorted((FOLDER / "bad").glob("*.xml")), ids=lambda path: path.stem)
def test_says_what_cannot_be_kept(
    case: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = case.read_text(encoding="utf-8")
    Path(case.name).write_text(model(text[:-1]) if text.startswith("<component") else text, encoding="utf-8")
    if case.with_suffix(".cfg").exists():
        copy(case.with_suffix(".cfg"), tmp_path)
    assert obey(["import", case.name, "--until", "1"]) in (1, 2)
    out, err = capsys.readouterr()
    assert out == "" and "Traceback" not in err
    assert_golden(err, case.with_suffix(".txt"))
