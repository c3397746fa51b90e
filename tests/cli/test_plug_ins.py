"""An installed package that adds a method, a rule, a target, a peer and a metric by entry points, and broken ones."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import hsdsl
from hsdsl.base.plugins import TABLES

ROOT = Path(__file__).parent.parent.parent
LAB = ROOT / "examples" / "plug-in"
BALL = str(ROOT / "models" / "bouncing-ball.yaml")
RUNNER = str(ROOT / "models" / "pronking-runner.yaml")
PENDULUM = str(ROOT / "models" / "constrained-pendulum.yaml")


def installed(folder: Path, points: dict[str, dict[str, str]]) -> Path:
    """A folder with the metadata of an installed package that has these entry points."""
    info = folder / "lab-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab\nVersion: 1.0\n", encoding="utf-8")
    lines = [line for group, of in points.items() for line in (f"[{group}]", *(f"{k} = {v}" for k, v in of.items()))]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def hsdsl_with(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(folder), str(LAB), str(ROOT)])
    return subprocess.run(
        [sys.executable, "-m", "hsdsl", *words],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    project = tomllib.loads((LAB / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return installed(tmp_path_factory.mktemp("site"), project["entry-points"])


COMMANDS = {
    "methods": (["run", BALL, "--method", "bs3", "--tolerance", "1e-8"], 0, "located bs3, until"),
    "rules": (["lint", RUNNER, "--select", "plug-ins"], 0, "LAB001"),
    "pages": (["explain", "still-state"], 0, "A state that never moves."),
    "targets": (["export", BALL, "--to", "dot"], 0, '"fly" -> "fly" [label="bounce"];'),
    "peers": (["chart", PENDULUM, "--schemes", "located", "--methods", "bs3", "--engines", "c", "--tolerances", "1e-7",
               "--against", "lsoda", "--rounds", "1"], 0, "lsoda"),
    "metrics": (["distance", BALL, BALL, "--metric", "ends"], 0, "ends: 0"),
    "doctor": (["doctor"], 0, "plug-ins: metrics ends"),
    "misspelt": (["run", BALL, "--method", "bs4"], 2, "did you mean 'bs3'?"),
}  # fmt: skip


@pytest.mark.parametrize("what", COMMANDS)
def test_each_entry_of_the_example_package_works(lab, what):
    words, code, expected = COMMANDS[what]
    done = hsdsl_with(lab, *words)
    assert done.returncode == code, done.stderr
    assert expected in done.stdout + done.stderr


def test_the_example_package_has_an_entry_for_every_table(lab):
    groups = tomllib.loads((LAB / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
    assert set(groups) == {f"hsdsl.{table}" for table in TABLES}


BROKEN = {
    "nowhere:X": "does not load: ModuleNotFoundError",
    "lab.method:BS4": "does not load: AttributeError",
    "lab.metric:ends": "expected a ButcherTableau, got function",
    "lab.method:BS3": "expected the method's own name 'bs3', got 'broken'",
}


@pytest.mark.parametrize("place", BROKEN)
def test_a_broken_plug_in_is_named_with_its_package_when_it_is_used(tmp_path, place):
    folder = installed(tmp_path, {"hsdsl.methods": {"broken": place, "dopri5": "nowhere:X"}})
    done = hsdsl_with(folder, "run", BALL, "--method", "broken")
    assert done.returncode == 2 and f"the plug-in {place} of the package lab" in done.stderr
    assert BROKEN[place] in done.stderr
    assert hsdsl_with(folder, "run", BALL, "--method", "dopri5", "--quiet").returncode == 0  # ours stays


def test_python_registers_what_is_of_the_right_kind_under_a_name_that_is_free():
    for table, name, value, message in (
        ("method", "x", None, "there is no table 'method'"),
        ("methods", "dopri5", None, "taken by hsdsl itself"),
        ("methods", "mine", 3, "expected a ButcherTableau, got int"),
        ("rules", "LAB001", 3, "expected a Rule with a check and a page"),
        ("targets", "mine", 3, "expected a function files"),
    ):
        with pytest.raises(hsdsl.UsageError, match=message):
            hsdsl.register(table, name, value)
