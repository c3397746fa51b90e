"""The package as it is built: it holds what it needs, and runs where nothing else is."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from engines import needs_compiler

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
BESIDES = ("README.md", "LICENSE", "CHANGELOG.md", "pyproject.toml", "schemas/model.schema.json", "tests/conftest.py")
# the package ziglang has a compiler, which a bare environment lacks
BARE = "import sys; sys.modules['ziglang'] = None; from hsdsl.interface.cli import main; main()"


def build(folder: Path, *options: str, **more: str) -> Path:
    pytest.importorskip("build")
    pytest.importorskip("hatchling")
    words = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), *options, str(ROOT)]
    done = subprocess.run(words, env=os.environ | more, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in (done.stdout + done.stderr).lower()
    return folder


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    return build(tmp_path_factory.mktemp("dist"), HSDSL_SHIP_LOOP="0")


def run_there(
    wheel: Path, folder: Path, program: str, engine: str = "auto", **more: str
) -> subprocess.CompletedProcess[str]:
    """Run a model with the package of a wheel, and a cache of its own."""
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    environment = {key: value for key, value in os.environ.items() if key != "CC"} | more
    environment |= {"PYTHONPATH": str(folder / "site"), "XDG_CACHE_HOME": str(folder / "cache")}
    words = [sys.executable, "-c", program, "run", str(ROOT / "models" / "bouncing-ball.yaml"), "--engine", engine]
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done


def tracked() -> set[str]:
    listed = subprocess.run(["git", "ls-files", "hsdsl"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("this is no checkout")
    return {name for name in listed.stdout.split() if (ROOT / name).exists()}


def test_wheel_and_sdist_hold_the_package(built):
    (wheel,), (sdist,) = built.glob("*.whl"), built.glob("*.tar.gz")
    assert wheel.name.endswith("-py3-none-any.whl")  # one for every platform: the loop is compiled where it runs
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if name.startswith("hsdsl/")}
    assert (
        names == tracked() and {"hsdsl/py.typed", "hsdsl/engine/runtime/c/hs.c", "hsdsl/engine/runtime/c/hs.h"} <= names
    )
    with tarfile.open(sdist) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    assert tracked() | {*BESIDES} <= inside


def test_the_wheel_runs_without_a_compiler_and_says_what_one_adds(built, tmp_path):
    (wheel,) = built.glob("*.whl")
    done = run_there(wheel, tmp_path, BARE, PATH=str(tmp_path))
    assert done.stderr.count("slower than compiled code") == 1 and "pip install 'hsdsl[compiler]'" in done.stderr


def test_a_wheel_is_built_without_a_compiler_unless_it_must_have_the_loop(tmp_path):
    nothing = str(tmp_path / "no compiler")
    words = [sys.executable, "-m", "build", "--no-isolation", "--wheel", "--outdir", str(tmp_path), str(ROOT)]
    done, refused = (
        subprocess.run(
            words, env=os.environ | {"CC": nothing, "HSDSL_SHIP_LOOP": ship}, capture_output=True, check=False
        )
        for ship in ("", "1")
    )
    assert done.returncode == 0 and refused.returncode != 0
    assert [path.name.endswith("-py3-none-any.whl") for path in tmp_path.glob("*.whl")] == [True]


@needs_compiler
def test_an_editable_installation_has_the_loop_in_the_cache(tmp_path):
    pytest.importorskip("editables")
    cache = tmp_path / "cache"
    words = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-build-isolation", "--quiet", "-e", str(ROOT)]
    environment = {key: value for key, value in os.environ.items() if key != "HSDSL_SHIP_LOOP"}
    environment |= {"XDG_CACHE_HOME": str(cache)}
    words += ["--target", str(tmp_path / "site")]
    subprocess.run(words, env=environment, check=True)
    assert len(list((cache / "hsdsl" / "compiled").iterdir())) == 1


@needs_compiler
def test_the_wheel_of_a_platform_has_the_loop_compiled(built, tmp_path):
    (pure,) = built.glob("*.whl")
    (wheel,) = build(tmp_path / "dist", "--wheel", HSDSL_SHIP_LOOP="1").glob("*.whl")
    assert wheel.name.startswith("hsdsl-") and "-py3-none-" in wheel.name and not wheel.name.endswith("-any.whl")
    compiled = []
    for each in (pure, wheel):
        folder = tmp_path / each.name
        folder.mkdir()
        assert not run_there(each, folder, "from hsdsl.interface.cli import main; main()", engine="c").stderr
        compiled.append(len(list((folder / "cache" / "hsdsl" / "compiled").iterdir())))
    assert compiled == [2, 1]  # the loop and the model, the model alone
