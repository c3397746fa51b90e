"""C text to a loaded library: compiled at first use, kept by content in the user's cache folder."""

from __future__ import annotations

import ctypes
import platform
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

from hsdsl.cache import find, keep, key_of
from hsdsl.runtime.compiler import FLAGS, Compiler, Effort, NoCompiler, find_compiler

RUNTIME = Path(__file__).parent / "c"
PRINTER = Path(__file__).parents[1] / "backends" / "c"
KIND = "compiled"


def load(content: str, source: Callable[[], str], effort: Effort) -> ctypes.CDLL:
    """Load the library that ``source`` compiles to; ``content`` stands for it in the cache, so it need not be written.

    Raises
    ------
    NoCompiler
        There is no compiler, or it fails.
    """
    compiler = find_compiler()
    key = _key(content, compiler, effort)
    path = find(KIND, key)
    if path is not None:
        try:
            return ctypes.CDLL(str(path))
        except OSError:
            pass  # made for something else than what runs now: it is made again
    try:
        return ctypes.CDLL(str(keep(KIND, key, ".so", lambda target: _compile(compiler, source(), target, effort))))
    except OSError as refusal:
        return _load_unkept(compiler, source(), refusal, effort)


def is_kept(content: str, effort: Effort) -> bool:
    """Whether the library that ``content`` stands for was compiled before.

    Raises
    ------
    NoCompiler
        There is no compiler.
    """
    return find(KIND, _key(content, find_compiler(), effort)) is not None


def _key(content: str, compiler: Compiler, effort: Effort) -> str:
    return key_of(content, _our_text(), compiler.identity, " ".join((effort, *FLAGS)), _processor())


@cache
def _our_text() -> bytes:
    """The hand-written C and what writes the rest: closer than a version to what a library was made by."""
    paths = (*sorted(RUNTIME.glob("*.[ch]")), *sorted(PRINTER.glob("*.py")))
    return b"".join(path.read_bytes() for path in paths)


def _processor() -> str:
    return f"{sys.platform} {platform.machine()} {sys.maxsize}"


def _compile(compiler: Compiler, source: str, target: Path, effort: Effort) -> None:
    import shutil
    import tempfile

    with tempfile.TemporaryDirectory(prefix="hsdsl-") as folder:
        text, library = Path(folder) / "model.c", Path(folder) / "model.so"
        text.write_text(source)
        compiler.build([text], [RUNTIME], library, effort)
        shutil.copyfile(library, target)


def _load_unkept(compiler: Compiler, source: str, refusal: OSError, effort: Effort) -> ctypes.CDLL:
    """Compile for this process alone where nothing can be kept."""
    import tempfile

    print(f"hsdsl: compiled code is not kept: {refusal}", file=sys.stderr)
    with tempfile.TemporaryDirectory(prefix="hsdsl-") as folder:
        library = Path(folder) / "model.so"
        _compile(compiler, source, library, effort)
        try:
            return ctypes.CDLL(str(library))
        except OSError as error:
            raise NoCompiler(f"what {' '.join(compiler.command)} made cannot be loaded: {error}") from None
