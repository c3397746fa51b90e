"""Exports built by a C compiler and run."""

from __future__ import annotations

import contextlib
import io
import json
import subprocess
import sys
import tempfile
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from shutil import which
from typing import Any

from export import cached_cc

from hsdsl.engine.runtime.library import RUNTIME, print_scheme, runtime_text
from hsdsl.export import files_of, source_of, write
from hsdsl.export.c import COMPILED, EXACT_FLAGS
from hsdsl.interface.model import Model

WARNINGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
COMPILERS: dict[str, list[str]] = {name: [path] for name in ("gcc", "clang") if (path := which(name))}
OF_PACKAGES = {"clang"} if find_spec("ziglang") and "clang" not in COMPILERS else set[str]()
if OF_PACKAGES:
    COMPILERS["clang"] = [sys.executable, "-m", "ziglang", "cc", "-Wno-unused-command-line-argument"]
USING = """
hsdsl: 1
parameters: {k: 2}
modes:
  up: {flow: {x: 1, y: -y, z: k}, transitions: [{when: x >= 99, to: up, reset: {x: z - y}}]}
initial: {mode: up, z: x - y, x: k*y, y: 3}
experiment: {until: 2, tolerance: 1e-11}
"""  # initial values that use each other


def exported(model: Model, folder: Path, target: str = "c", **arguments: Any) -> Path:
    """Export a model to a folder."""
    write(files_of(source_of(model, arguments), target), folder, force=True)
    return folder


@cache
def _objects() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="hsdsl-objects-")


@cache
def cached_compiler() -> str:
    """The words of a compiler that compiles the loop once."""
    return f"{sys.executable} {cached_cc.__file__}"


@cache
def runtime_object(command: tuple[str, ...]) -> str:
    """The runtime compiled by a command, once for all tests: it is the same in every export."""
    target = Path(_objects().name) / f"hs{runtime_object.cache_info().currsize}.o"
    headers = [f"-I{RUNTIME}", f"-I{print_scheme(target.parent)}"]
    written = io.StringIO()
    with contextlib.redirect_stderr(written):
        code = cached_cc.compile_once(list(command), headers, str(RUNTIME / "hs.c"), target)
    assert code == 0 and not written.getvalue(), written.getvalue()[:4000]
    return str(target)


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:4000]
    assert not done.stderr


def objects(folder: Path, compiler: list[str], *options: str, main: str = "") -> list[Path]:
    """Compile the files of an export, and a main one where it is named, with all warnings as errors."""
    command = [*compiler, "-O1", *WARNINGS, *EXACT_FLAGS, *options]
    sources = [name for name in (main, *COMPILED) if name not in ("", "runtime/hs.c")]
    assert all(path.read_text() == runtime_text(path.name) for path in (folder / "runtime").iterdir())
    made = [(folder / name).with_suffix(".o") for name in sources]
    for name, target in zip(sources, made, strict=True):
        _run([*command, f"-I{folder}", f"-I{folder / 'runtime'}", "-c", "-o", str(target), str(folder / name)])
    return [*made, Path(runtime_object(tuple(command)))]


def built(folder: Path, compiler: list[str], *options: str, main: str = "main.c") -> Path:
    """Compile and link an export."""
    program = folder / "model"
    _run([*compiler, "-o", str(program), *map(str, objects(folder, compiler, *options, main=main)), "-lm"])
    return program


def output(program: Path) -> Any:
    """What a program prints, read as JSON."""
    done = subprocess.run([str(program)], capture_output=True, text=True, timeout=300)
    assert done.returncode in (0, 1), done
    return json.loads(done.stdout)
