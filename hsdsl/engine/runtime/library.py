"""C text to a loaded library: compiled at first use, kept by content in the user's cache folder. A program is one.

A wheel for one platform has the hand-written loop compiled already, in ``shipped``; another loop than that of the
wheel's own C is not taken from there.
"""

from __future__ import annotations

import ctypes
import os
import platform
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path

from hsdsl.base import limits
from hsdsl.base.cache import find, keep, key_of, making
from hsdsl.base.names import shown
from hsdsl.engine.runtime.compiler import FLAGS, Compiler, Effort, NoCompiler, TooSlow, find_compiler
from hsdsl.mathematics.program import ModeProgram, Program

RUNTIME = Path(__file__).parent / "c"
BACKENDS = Path(__file__).parents[1] / "backends"
SCHEME = Path(__file__).parents[1] / "scheme"
SHIPPED = Path(__file__).parent / "shipped"
KIND = "compiled"
GIVEN_UP = "given-up"  # entries for models that took too long to compile: the seconds that the compiler had


LOOP = '#include "library.c"\n', "hs_simulate"  # its text and symbol
EFFORT: Effort = "-O1"  # of models and exports: -O2 compiles 1.5 times as long, for code that is a hundredth faster
OF_LOOP: Effort = "-O2"  # which is compiled when the package is installed: its runs are 5 to 7 % faster
_OPTIONS = " ".join((EFFORT, OF_LOOP, *FLAGS))


def loop_object(folder: Path) -> Path:
    """The loop as an object in a folder, to be linked into another library: compiled at first use, and kept.

    Raises NoCompiler: there is no compiler, or it fails.
    """
    compiler, made = find_compiler(), folder / "hs.o"
    key = _key("object", compiler)
    with making(KIND, key):
        if kept := find(KIND, key):
            _copy(kept, made)
            return made
        flags = ("-c", *(flag for flag in FLAGS if flag != "-shared"))
        compiler.build([RUNTIME / "hs.c"], [RUNTIME, print_scheme(folder)], made, EFFORT, flags)
        _keep(key, made)
    return made


def runtime_text(name: str) -> str:
    """A file of the runtime: written by hand, or printed."""
    path = RUNTIME / name
    return path.read_text() if path.exists() else _printed()[name]


def print_scheme(folder: Path) -> Path:
    """Write the files that are printed into a folder, for a compiler to include; returns the folder."""
    for name, text in _printed().items():
        (folder / name).write_text(text)
    return folder


def _printed() -> dict[str, str]:
    from hsdsl.engine.scheme.printer import printed  # what is compiled already needs none

    return printed()


def ship(folder: Path) -> Path:
    """Compile the loop into a folder, for a wheel.

    Raises NoCompiler: there is no compiler, or it fails.
    """
    text, symbol = LOOP
    library = folder / _shipped(text).name
    _compile(find_compiler(), [text], library, OF_LOOP, [RUNTIME, print_scheme(folder)])
    _tried(find_compiler(), library, symbol)
    return library


def loop() -> ctypes.CDLL:
    """Load the loop: that of this package, or what is compiled at first use.

    Raises NoCompiler: there is no compiler, or it fails.
    """
    text, symbol = LOOP
    return load(text, symbol, lambda: [text])


def _shipped(content: str) -> Path:
    """Where a library would be that came with this package."""
    return SHIPPED / f"{key_of(content, _our_own(), _OPTIONS, _processor())}.so"


def load(content: str, symbol: str, source: Callable[[], Sequence[str]], further: tuple[str, ...] = ()) -> ctypes.CDLL:
    """Load the library that ``source`` compiles to, with ``further`` flags, and that has ``symbol``.

    ``content`` is the source's name in the cache; the source, one text or several that are compiled at the same time,
    is written only where it must be compiled.

    Raises NoCompiler: there is no compiler, or it fails.
    """
    shipped = _shipped(content)
    loaded = _loaded(shipped) if shipped.exists() else None
    if loaded is not None:
        return loaded
    compiler = find_compiler()
    key = _key(content, compiler, further)
    loaded = _kept(key)
    if loaded is not None:
        return loaded
    with making(KIND, key):
        return _kept(key) or _made(compiler, key, symbol, source, further)


def _kept(key: str) -> ctypes.CDLL | None:
    path = find(KIND, key)
    return None if path is None else _loaded(path)


def _loaded(path: Path) -> ctypes.CDLL | None:
    try:
        return ctypes.CDLL(str(path))
    except OSError:
        return None  # made for something else than what runs now: it is made again


def _key(content: str, compiler: Compiler, further: tuple[str, ...] = ()) -> str:
    return key_of(content, _our_own(), compiler.identity, " ".join((_OPTIONS, *further)), _processor())


@cache
def _our_own() -> str:
    """The checksum of the hand-written C and of what prints the rest: closer than a version to what made a library."""
    printers = (
        BACKENDS / "printer.py",
        BACKENDS / "taylor.py",
        *sorted((BACKENDS / "c").glob("*.py")),
        *sorted(SCHEME.glob("*.py")),
    )
    paths = (*sorted(RUNTIME.glob("*.[ch]")), *printers)
    return key_of(*(path.read_bytes() for path in paths))


def _processor() -> str:
    return f"{sys.platform} {platform.machine()} {sys.maxsize}"


def _made(
    compiler: Compiler, key: str, symbol: str, source: Callable[[], Sequence[str]], further: tuple[str, ...]
) -> ctypes.CDLL:
    """Compile a library, try it, and keep it where anything can be kept."""
    from hsdsl.engine.runtime.process import workshop

    allowed, is_loop = limits.current().compile, symbol == LOOP[1]
    if not is_loop and (seconds := _given_up(key)) >= allowed:
        again = f"--limit compile={10 * seconds:g} allows more, hsdsl doctor --forget has it tried again"
        raise TooSlow(f"{compiler} took more than {seconds:g} s before; {again}")
    texts = source()
    try:
        with workshop() as folder:
            library = folder / "model.so"
            try:
                if symbol == SYMBOL:  # whose routines include nothing of the scheme
                    _compile(compiler, texts, library, EFFORT, [RUNTIME], further)
                else:
                    _compile(compiler, texts, library, OF_LOOP, [RUNTIME, print_scheme(folder)], further)
            except TooSlow:
                if not is_loop:  # which is compiled in seconds, unless much else runs
                    _give_up(key, allowed)
                raise
            loaded = _tried(compiler, library, symbol)
            _keep(key, library)
            return loaded
    except OSError as error:
        raise NoCompiler(f"there is no room to compile: {error.strerror or error}") from None


def _given_up(key: str) -> float:
    path = find(GIVEN_UP, key)
    return 0.0 if path is None else float(path.read_text())


def _give_up(key: str, seconds: float) -> None:
    with suppress(OSError):
        keep(GIVEN_UP, key, ".txt", lambda path: _write(path, f"{seconds!r}"))


def _write(path: Path, text: str) -> None:
    path.write_text(text)


def _compile(
    compiler: Compiler,
    texts: Sequence[str],
    library: Path,
    effort: Effort,
    includes: Sequence[Path],
    further: tuple[str, ...] = (),
) -> None:
    sources = [library.with_name(f"model{number or ''}.c") for number in range(len(texts))]
    for source, text in zip(sources, texts, strict=True):
        source.write_text(text)
    compiler.build(sources, includes, library, effort, (*FLAGS, *further))


def _tried(compiler: Compiler, library: Path, symbol: str) -> ctypes.CDLL:
    try:
        loaded = ctypes.CDLL(str(library))
    except OSError as error:
        complaint = str(error).replace(f"{library.parent}{os.sep}", "")
        raise NoCompiler(f"what {compiler} made cannot be loaded: {shown(complaint, 200)}") from None
    if not hasattr(loaded, symbol):
        raise NoCompiler(f"what {compiler} made has no {symbol}")
    return loaded


def _keep(key: str, library: Path) -> None:
    try:
        keep(KIND, key, library.suffix, lambda target: _copy(library, target))
    except OSError as refusal:
        _say_unkept(str(refusal))


def _copy(library: Path, target: Path) -> None:
    target.write_bytes(library.read_bytes())


@cache
def _say_unkept(refusal: str) -> None:
    print(f"hsdsl: compiled code is not kept: {refusal}", file=sys.stderr)


SYMBOL = "hs_the_model"


def compiled(program: Program) -> ctypes.CDLL:
    """The library of a program, from the cache or compiled for it.

    Raises NoCompiler: there is no compiler, or it fails.
    """
    try:
        return load(_content(program), SYMBOL, lambda: _source(program))
    except TooSlow as error:
        raise NoCompiler(f"{error}; {_longest(program)}") from None


LANES = "hs_the_lanes"
VECTORS = (("avx512f", "avx512dq", "avx512vl"), ("avx2", "fma"))  # what a processor must have, and flags


def compiled_lanes(program: Program, compiles: bool) -> ctypes.CDLL | None:
    """The library of a program's lanes, likewise; None where it has none, or is not kept and one does not compile it.

    Raises NoCompiler: there is no compiler, or it lacks vectors.
    """
    flags, content = vectors(), f"lanes of {_content(program)}"
    if flags is None:
        return None
    loaded = _kept(_key(content, find_compiler(), flags))
    if loaded is not None or not compiles:
        return loaded
    from hsdsl.engine.backends.c.lanes import lane_source

    text = lane_source(program)
    return None if text is None else load(content, LANES, lambda: [text], flags)


@cache
def vectors() -> tuple[str, ...] | None:
    """The flags for the vectors of this processor; None where it has none, or does not say."""
    try:
        flags = Path("/proc/cpuinfo").read_text().split("flags", 1)[-1].split("\n", 1)[0].split()
    except OSError:
        return None
    found = next((names for names in VECTORS if {*names} <= {*flags}), None)
    return found and tuple(f"-m{name}" for name in found)


def _content(program: Program) -> str:
    data = len(program.parameters), len(program.inputs), len(program.switches)
    return repr(((*data, len(program.outputs), program.initial_states), list(map(_briefly, program.flows))))


def _briefly(mode: ModeProgram) -> ModeProgram:
    """A mode without the names of the states that edges lead to: of many parts every edge has those of all."""
    edges = (replace(edge, target_states=(str(len(edge.target_states)),)) for edge in mode.edges)
    return replace(mode, edges=tuple(edges))


def _longest(program: Program) -> str:
    """Say where most of the work of a model is."""
    flows = (
        (text, f"the flow of {state} in mode {mode.name}")
        for mode in program.modes
        for state, text in zip(mode.states, mode.flow_texts, strict=True)
    )
    guards = ((edge.text, f"the guard of {edge.name}") for mode in program.modes for edge in mode.edges)
    text, where = max((*flows, *guards), key=lambda pair: len(pair[0]), default=("", "none"))
    return f"the longest expression is {where}, with {len(text):,} characters"


def _source(program: Program) -> list[str]:
    from hsdsl.engine.backends.c.source import model_parts  # what is compiled already needs none

    return model_parts(program, limits.cores())
