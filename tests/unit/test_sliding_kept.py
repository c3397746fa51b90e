"""Models whose runs slide are kept like others: the same runs, without SymPy."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import hsdsl

GALLERY = Path(__file__).parents[2] / "models" / "gallery"
SECOND = """
import sys, hsdsl
run = hsdsl.load(sys.argv[1]).simulate(engine="python")
print(repr(run.final.state), run.final.mode, "sympy" in sys.modules)
"""


@pytest.mark.parametrize("name", ["relay", "stick-slip", "bouncing-ball"])
def test_a_run_that_slides_is_the_same_from_the_cache(name, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    path = tmp_path / f"{name}.yaml"
    source = GALLERY / f"{name}.yaml"
    text = (source if source.exists() else GALLERY.parent / f"{name}.yaml").read_text()
    path.write_text(text if "completion:" in text else text.replace("experiment: {", "experiment: {completion: auto, "))
    first = hsdsl.load(path).simulate(engine="python")
    done = subprocess.run([sys.executable, "-c", SECOND, str(path)], capture_output=True, text=True, check=True)
    assert done.stdout == f"{first.final.state!r} {first.final.mode} False\n"
    assert hsdsl.load(path).simulate(completion="none", engine="python").final.mode != "sliding_positive_negative"


def test_parts_of_a_model_that_slides_are_kept_apart(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    path = GALLERY / "relay.yaml"
    sliding = [hsdsl.load(path).sliding.pipeline.only(("x",)).program for _ in range(2)]
    plain = hsdsl.load(path).pipeline.only(("x",)).program
    assert sliding[0] == sliding[1] and len(sliding[0].modes) == len(plain.modes) + 1
