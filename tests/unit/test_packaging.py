"""The package as it is built: it holds what it needs, and runs where nothing else is."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
BESIDES = ("README.md", "LICENSE", "CHANGELOG.md", "pyproject.toml", "schemas/model.schema.json", "tests/conftest.py")
# the package ziglang has a compiler, which a bare environment lacks
BARE = "import sys; sys.modules['ziglang'] = None; from hsdsl.cli import main; main()"


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    pytest.importorskip("build")
    pytest.importorskip("hatchling")
    folder = tmp_path_factory.mktemp("dist")
    words = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in (done.stdout + done.stderr).lower()
    return folder


def tracked() -> set[str]:
    listed = subprocess.run(["git", "ls-files", "hsdsl"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("this is no checkout")
    return {name for name in listed.stdout.split() if (ROOT / name).exists()}


def test_wheel_and_sdist_hold_the_package(built):
    (wheel,), (sdist,) = built.glob("*.whl"), built.glob("*.tar.gz")
    assert wheel.name.endswith("-py3-none-any.whl")  # one for every platform: C is compiled where it runs
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if name.startswith("hsdsl/")}
    assert names == tracked() and {"hsdsl/py.typed", "hsdsl/runtime/c/hs.c", "hsdsl/runtime/c/hs.h"} <= names
    with tarfile.open(sdist) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    assert tracked() | {*BESIDES} <= inside


def test_the_wheel_runs_without_a_compiler_and_says_what_one_adds(built, tmp_path):
    (wheel,) = built.glob("*.whl")
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    environment = {key: value for key, value in os.environ.items() if key != "CC"}
    environment |= {"PATH": str(tmp_path), "PYTHONPATH": str(site), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    words = [sys.executable, "-c", BARE, "run", str(ROOT / "models" / "bouncing-ball.yaml")]
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "python engine" in done.stdout.lower() + done.stderr.lower()
    assert done.stderr.count("slower than compiled code") == 1 and "pip install 'hsdsl[compiler]'" in done.stderr
    assert (site / "hsdsl" / "cli").is_dir()
