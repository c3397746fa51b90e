"""The page of the gallery: in step with its records, and complete."""

from __future__ import annotations

from pathlib import Path

from gallery.page import page
from gallery.records import read, save
from gallery.scenes import entries

from hsdsl.interface.chart import PEERS

SCENES = entries()
DOCS = Path(__file__).parents[2] / "docs"
SLOW = {"diffrax"}  # compiles for a minute in each scene: the page has a dash where it has not been run


PAGE = DOCS / "gallery.md"


def test_the_page_is_in_step_with_the_records() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(read(DOCS / "gallery.json"), list(SCENES.values()))


def test_every_scene_is_recorded_with_every_tool() -> None:
    records = read(DOCS / "gallery.json")
    tools = {name for name in PEERS if name not in SLOW and records.versions[name]} | {"hsdsl c", "hsdsl python"}
    for name in SCENES:
        assert tools <= {row.setting.name for row in records.rows if row.scene == name}, name
        assert (DOCS / "images" / "gallery" / f"{name}.svg").read_text().startswith("<?xml")


def test_no_run_of_ours_is_recorded_as_wrong() -> None:
    ours = [row for row in read(DOCS / "gallery.json").rows if row.setting.name.startswith("hsdsl")]
    wrong = {(row.scene, row.setting.label) for row in ours if row.outcome.word in ("wrong", "crashes")}
    assert not wrong
    assert {row.outcome.word for row in ours} <= {"right", "warns", "stops", "refuses", "hangs", "wrong"}


def test_records_survive_their_file(tmp_path: Path) -> None:
    records = read(DOCS / "gallery.json")
    save(tmp_path / "again.json", records)
    assert read(tmp_path / "again.json").versions == records.versions
    assert (tmp_path / "again.json").read_text() == (DOCS / "gallery.json").read_text()
