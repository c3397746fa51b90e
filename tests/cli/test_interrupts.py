"""Ctrl-C at any moment of a command: a word, exit code 130, and no traceback."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from shipped import MODELS
from signals import interruptible

BALL = str(MODELS / "bouncing-ball.yaml")
START = """
import os
from hsdsl.base import interrupts
interrupts.expect()
os.write(1, b".")
from hsdsl.interface.cli import main
main()
"""
COMMANDS = {
    "run": ["run", BALL, "--engine", "python", "--json"],
    "plot": ["run", BALL, "--engine", "python", "--out", "run.csv", "--plot", "run.png", "--json"],
    "lint": ["lint", BALL, "--format", "json"],
    "distance": ["distance", BALL, "--from", "fly h=1 v=0", "--to", "fly h=2 v=0", "--json"],
    "doctor": ["doctor", "--json"],
}
MANY = [2, pytest.param(200, marks=pytest.mark.campaign)]


def started(arguments: list[str], folder: Path) -> subprocess.Popen[bytes]:
    """A command of which the interpreter is there: what is imported after that is ours."""
    process = subprocess.Popen(
        [sys.executable, "-c", START, *arguments], stdout=-1, stderr=-1, cwd=folder, **interruptible()
    )
    assert process.stdout is not None and process.stdout.read(1) == b"."
    return process


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("times", MANY)
@pytest.mark.parametrize("verb", COMMANDS)
def test_control_c_at_any_moment(verb, times, tmp_path):
    rng, began = random.Random(verb), time.monotonic()
    undisturbed = started(COMMANDS[verb], tmp_path)
    undisturbed.communicate()
    assert undisturbed.returncode in (0, 1)
    lasts = time.monotonic() - began
    for _ in range(times):
        process = started(COMMANDS[verb], tmp_path)
        time.sleep(rng.uniform(0, lasts))
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60)
        printed = error.decode()
        assert process.returncode in (undisturbed.returncode, 130), printed
        assert "Traceback" not in printed and "Exception ignored" not in printed, printed
        if process.returncode == 130:
            assert "interrupted" in printed or json.loads(out)["stop"]["reason"] == "interrupted"
    left = [path.name for path in tmp_path.iterdir() if path.name.endswith(".part")]
    assert len(left) <= 1  # what is left by one is removed by the next


def test_next_to_nothing_is_imported_before_control_c_is_expected():
    code = "import sys; before = {*sys.modules}; import hsdsl.interface.cli; print(*sys.modules.keys() - before)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert {name for name in loaded if name.startswith("hsdsl")} == {
        "hsdsl",
        "hsdsl.interface",
        "hsdsl.interface.cli",
        "hsdsl.base",
        "hsdsl.base.interrupts",
    }
    assert not {"dataclasses", "re", "typing"} & {*loaded}  # the first of what takes long


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_in_the_background_of_a_shell_control_c_is_not_for_us(tmp_path):
    command = [sys.executable, "-c", START, *COMMANDS["run"]]
    ignored = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)}
    process = subprocess.Popen(command, stdout=-1, stderr=-1, cwd=tmp_path, **ignored)
    assert process.stdout is not None and process.stdout.read(1) == b"."
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 0
