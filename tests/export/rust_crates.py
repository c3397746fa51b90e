"""Crates for Rust, built and run. The loop in C is compiled once for all of them: it is the same in every crate."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from shutil import which
from typing import Any

import pytest
from export.c_builds import cached_compiler, exported

from hsdsl.analysis.report import as_json
from hsdsl.interface.model import Model

CARGO = which("cargo")
needs_cargo = [pytest.mark.tools, pytest.mark.skipif(CARGO is None, reason="there is no cargo")]


def needs_tools(test: Any) -> Any:
    """A test that runs cargo."""
    for mark in needs_cargo:
        test = mark(test)
    return test


def cargo(crate: Path, *words: str) -> str:
    """What cargo prints; crates are built once, and not debugged."""
    environment = {**os.environ, "CARGO_NET_OFFLINE": "true", "RUSTFLAGS": "-D warnings", "CC": cached_compiler()}
    environment |= {"CARGO_INCREMENTAL": "0", "CARGO_PROFILE_DEV_DEBUG": "0", "CFLAGS": "-Wall -Wextra -Werror"}
    made = subprocess.run(["cargo", *words], cwd=crate, env=environment, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    return made.stdout


def assert_prints(folder: Path, model: Model, **arguments: Any) -> Any:
    """A run and what its crate prints, which must be equal: transitions, the end, and the last state."""
    run = as_json(model.simulate(**arguments, engine="c"))
    crate = exported(model, folder, "rust", **arguments)
    found = json.loads(cargo(crate, "run", "-q", "--example", "transitions"))
    assert found["transitions"] == run["transitions"]
    assert found["stop"] == {key: run["stop"][key] for key in ("reason", "time")}
    assert found["final"] == {key: run["final"][key] for key in ("mode", "state", "outputs")}
    return found
