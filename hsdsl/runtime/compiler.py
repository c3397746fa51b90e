"""The C compiler: ``CC``, else `cc`, `gcc` or `clang`, else the one inside the package `ziglang`."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

NAMES = ("cc", "gcc", "clang")
Effort = Literal["-O1", "-O2"]
EXACT = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh")
FLAGS = (
    "-std=c99",
    "-finline-small-functions",  # with -O1 as fast as -O2 for half the time that it takes to compile
    "-fstrict-aliasing",
    "-Wno-ignored-optimization-argument",  # clang does so unasked
    "-ffp-contract=off",  # no a*b + c in one rounding
    "-fno-math-errno",
    *(f"-fno-builtin-{name}" for name in (*EXACT, "exp", "log", "pow", "atan2")),  # those of the library, as Python's
    "-fPIC",
    "-fvisibility=hidden",
    "-shared",
)


class NoCompiler(Exception):
    """There is no C compiler, or it does not do its work; the message says which."""


@dataclass(frozen=True)
class Compiler:
    """A command that compiles C, and what tells it from another one."""

    command: tuple[str, ...]
    identity: str

    def build(self, sources: Sequence[Path], includes: Sequence[Path], target: Path, effort: Effort) -> None:
        """Compile sources to a shared library, with so much effort to make it fast.

        Raises
        ------
        NoCompiler
            It fails; the message holds the first line of what it says.
        """
        import subprocess  # what is compiled already needs none

        command = [*self.command, effort, *FLAGS, *(f"-I{folder}" for folder in includes), "-o", str(target)]
        command += [*map(str, sources), "-lm"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
        except OSError as error:
            raise NoCompiler(f"{self.command[0]} cannot be run: {error.strerror}") from None
        if done.returncode:
            said = next(iter(done.stderr.strip().splitlines()), f"exit code {done.returncode}")
            raise NoCompiler(f"{' '.join(self.command)} failed: {said}")


def find_compiler() -> Compiler:
    """Return the compiler that is used here.

    Raises
    ------
    NoCompiler
        None was found, or ``CC`` names none.
    """
    if given := _words(os.environ.get("CC", "")):
        path = shutil.which(given[0])
        if path is None:
            raise NoCompiler(f"CC is {given[0]}, which is not there")
        return Compiler(tuple(given), _identity(path, given[1:]))
    for name in NAMES:
        if path := shutil.which(name):
            return Compiler((path,), _identity(path))
    from importlib.util import find_spec

    if spec := find_spec("ziglang"):
        return Compiler((sys.executable, "-m", "ziglang", "cc"), _identity(str(spec.origin)))
    raise NoCompiler("no C compiler was found (cc, gcc, clang, or the package ziglang: pip install 'hsdsl[compiler]')")


def _words(text: str) -> list[str]:
    if not text:
        return []
    import shlex

    return shlex.split(text)


def _identity(path: str, arguments: Sequence[str] = ()) -> str:
    """Tell a compiler from another by its file: to ask it for its version would start a process in every run."""
    file = Path(path).resolve()
    status = file.stat()
    return f"{file} {status.st_size} {status.st_mtime_ns} {' '.join(arguments)}"
