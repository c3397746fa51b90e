"""The C compiler: ``CC``, else `cc`, `gcc` or `clang`, else the one inside the package `ziglang`."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from hsdsl.base import limits
from hsdsl.base.names import shown

NAMES = ("cc", "gcc", "clang")
TRIAL = 5.0  # seconds for an empty function, which takes a hundredth of them
Effort = Literal["-O1", "-O2"]
EXACT = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh")
FLAGS = (
    "-std=c99",
    "-finline-small-functions",  # with -O1 as fast as -O2 for half the time that it takes to compile
    "-fstrict-aliasing",
    "-Wno-ignored-optimization-argument",  # clang does so by default
    "-ffp-contract=off",  # no a*b + c in one rounding
    "-fno-math-errno",
    "-fopenmp-simd",  # loops over the states of an implicit step, two or more at once
    "-DHS_LANES",
    "-DHS_COLUMNS",  # implicit steps of systems with derivatives, which exports do without
    *(f"-fno-builtin-{name}" for name in (*EXACT, "exp", "log", "pow", "atan2")),  # those of the library, as Python's
    "-fPIC",
    "-fvisibility=hidden",
    "-shared",
)


class NoCompiler(Exception):
    """There is no C compiler, or it does not do its work; the message says which."""


class TooSlow(NoCompiler):
    """The compiler takes more time than it may."""


@dataclass(frozen=True)
class Compiler:
    """A command that compiles C, and what tells it from another one."""

    command: tuple[str, ...]
    identity: str

    def build(
        self, sources: Sequence[Path], includes: Sequence[Path], target: Path, effort: Effort, flags: Sequence[str]
    ) -> None:
        """Compile sources to a file in a folder for temporary files, with so much effort to make it fast.

        :data:`FLAGS` make a shared library of them. Several are compiled at the same time; objects among them are
        only linked.

        Raises NoCompiler: it fails, does not end, or makes no file; the message holds the first error that it prints.
        """
        if _responding.get(self) is False:
            raise NoCompiler(self._endless())
        options = (effort, *flags, *(f"-I{folder}" for folder in includes))
        inputs = [str(source) for source in sources]
        if len(sources) > 1:
            objects = {s: s if s.endswith(".o") else str(target.with_name(f"{Path(s).stem}.o")) for s in inputs}
            made = [[*self.command, *options, "-c", "-o", o, s] for s, o in objects.items() if o != s]
            self._run(made, target.parent)
            inputs = [*objects.values()]
        self._run([[*self.command, *options, "-o", str(target), *inputs, "-lm"]], target.parent)
        if not target.is_file():
            raise NoCompiler(f"{self} made no library")

    def _run(self, commands: Sequence[Sequence[str]], folder: Path) -> None:
        """Run commands at the same time, and raise NoCompiler where one fails or does not end."""
        from hsdsl.engine.runtime import process  # what is compiled already needs none

        seconds = limits.current().compile
        try:
            ends = process.run(commands, folder, seconds, lambda: _responds(self))
        except OSError as error:
            raise NoCompiler(f"{self} cannot be run: {error.strerror}") from None
        for code, printed in ends:
            if code is None:
                slow = f"{self} takes more than {seconds:g} s; --limit compile={10 * seconds:g} allows more"
                raise TooSlow(slow) if _responding.get(self, True) else NoCompiler(self._endless())
            if code:
                raise NoCompiler(f"{self} failed: {_complaint(code, printed, folder)}")

    def _endless(self) -> str:
        return f"{self} does not end: it takes longer than a few seconds for an empty function"

    def __str__(self) -> str:
        return shown(" ".join(self.command), 80)


_responding: dict[Compiler, bool] = {}


def _responds(compiler: Compiler) -> bool:
    """Whether a compiler that has taken long ends at all."""
    from hsdsl.engine.runtime import process

    if compiler not in _responding:
        with process.workshop() as folder:
            source = folder / "empty.c"
            source.write_text("void hs_empty(void) {}\n")
            command = [*compiler.command, "-c", "-o", str(folder / "empty.o"), str(source)]
            ((code, _),) = process.run([command], folder, TRIAL, lambda: True)
            _responding[compiler] = code is not None
    return _responding[compiler]


def _complaint(code: int, printed: str, folder: Path) -> str:
    """The first line of a compiler's output that names an error."""
    lines = [line.strip() for line in printed.replace(f"{folder}{os.sep}", "").splitlines() if line.strip()]
    ended = f"exit code {code}" if code >= 0 else f"ended by signal {-code}"
    return shown(next((line for line in lines if "error" in line), (lines or [ended])[0]), 200)


def find_compiler() -> Compiler:
    """Return the compiler that is used here.

    Raises NoCompiler: none was found, or ``CC`` names none.
    """
    if given := _words(os.environ.get("CC", "")):
        path = shutil.which(given[0])
        if path is None:
            raise NoCompiler(f"CC is {shown(given[0], 80)}, which is no command here")
        return Compiler(tuple(given), _identity(path, given[1:]))
    for name in NAMES:
        if path := shutil.which(name):
            return Compiler((path,), _identity(path))
    if zig := zig_compiler():
        return zig
    raise NoCompiler("no C compiler was found (cc, gcc, clang, or the package ziglang: pip install 'hsdsl[compiler]')")


def zig_compiler() -> Compiler | None:
    """Return the compiler inside the package `ziglang`, which compiles for other machines too."""
    from importlib.util import find_spec

    spec = find_spec("ziglang")
    return Compiler((sys.executable, "-m", "ziglang", "cc"), _identity(str(spec.origin))) if spec else None


def _words(text: str) -> list[str]:
    """The words of a command line; a file's name is one, blanks and all."""
    if not text or shutil.which(text):
        return [text] * bool(text)
    import shlex

    try:
        return shlex.split(text)
    except ValueError:
        raise NoCompiler(f"CC is {shown(text, 80)}, where a quotation mark is left open") from None


def _identity(path: str, arguments: Sequence[str] = ()) -> str:
    """Tell a compiler from another by its file: to ask it for its version would start a process in every run."""
    try:
        file = Path(path).resolve()
        status = file.stat()
    except OSError as error:
        raise NoCompiler(f"{shown(path, 80)} cannot be looked at: {error.strerror}") from None
    return f"{file} {status.st_size} {status.st_mtime_ns} {' '.join(arguments)}"
