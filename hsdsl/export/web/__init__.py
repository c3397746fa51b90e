"""The model as one HTML page that runs it: sliders, live plots, transitions, scene; without server or network.

The model with its runtime is a WebAssembly module without imports but a clock, for `parts/worker.js`.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any

from hsdsl.analysis.plot.parts import filled, inert, scripts, shared
from hsdsl.base import limits
from hsdsl.base.cache import find, keep, key_of
from hsdsl.base.errors import UsageError
from hsdsl.base.names import visible
from hsdsl.engine.preparation.visible import visible_run
from hsdsl.engine.runtime.compiler import Compiler, NoCompiler, zig_compiler
from hsdsl.engine.runtime.kernel import CompiledModel
from hsdsl.engine.runtime.process import workshop
from hsdsl.engine.simulate import prepare
from hsdsl.export.c import EXACT_FLAGS, c_sources
from hsdsl.export.source import Source
from hsdsl.export.web.model import model_of, page_numbers

SCRIPTS = ("controls.js", "scene.js", "facts.js", "parts.js", "page.js")


def files(source: Source) -> dict[str, bytes]:
    """One page.

    Raises UsageError: the C runtime has no such scheme, or no compiler for WebAssembly is there.
    """
    shown = with_scene(source)
    module = wasm_module(shown)
    problem = source.problem.with_settings(source.problem.settings)
    try:
        prepared = prepare(problem, CompiledModel(problem.program))
    except NoCompiler:
        prepared = prepare(problem)
    model = model_of(source, shown, visible_run(prepared.simulate(), prepared))
    return {f"{source.name}.html": page(model, module).encode()}


def with_scene(source: Source) -> Source:
    """The source with the numbers of its scene as further outputs, which the runtime then records."""
    system = source.system
    if not system.scene:
        return source
    from hsdsl.language.elaborate.modes import scene_as_outputs
    from hsdsl.mathematics.lower import lower

    system = scene_as_outputs(system)
    return replace(source, system=system, problem=replace(source.problem, program=lower(system)))


def page(model: dict[str, Any], module: bytes) -> str:
    """The page; every text of the model in it is escaped for the place where it is."""
    parts = {
        "title": escape(visible(model["title"])),
        "generator": escape(visible("; ".join(model["about"])), quote=True),
        "style": shared("page.css"),
        "pictures": shared("pictures.html"),
        "model": inert(model),
        "wasm": base64.b64encode(module).decode(),
        "worker": _part("worker.js"),
        "script": "\n".join([scripts(), *map(_part, SCRIPTS)]),
    }
    return filled(_part("page.html"), parts)


def _part(name: str) -> str:
    return (Path(PARTS) / name).read_text(encoding="utf-8")


PARTS = Path(__file__).parent / "parts"
FLAGS = ("-target", "wasm32-wasi", "-mexec-model=reactor", "-std=c99", "-Wl,--strip-all", *EXACT_FLAGS)
COMPILED = ("model.c", "problem.c", "page.c", "runtime/hs.c")
OWN = ("page.c", "page.h", "settings.c", "timeline.c")
KIND = "pages"
FIRST_TIME = 10  # times the limit: before its first module the compiler makes its C library


def wasm_module(source: Source) -> bytes:
    """Compile a model; the same model gives the same bytes with the same compiler. What was compiled before is kept.

    Raises UsageError: there is no compiler for WebAssembly, it fails, or the runtime has no such scheme.
    """
    sources = c_sources(source)  # what no C program can keep is refused first
    compiler = zig_compiler()
    if compiler is None:
        raise UsageError("a page needs a compiler for WebAssembly: the package ziglang", "pip install 'hsdsl[web]'")
    sources |= {name: (PARTS / name).read_bytes() for name in OWN}
    sources["page_numbers.h"] = page_numbers(source.problem).encode()
    key = key_of(compiler.identity, *FLAGS, *(part for item in sources.items() for part in item))
    if made := find(KIND, key):
        return made.read_bytes()
    try:
        module = _compiled(compiler, sources)
    except NoCompiler as error:
        raise UsageError(f"the page cannot be compiled: {error}") from None
    except OSError as error:
        raise UsageError(f"there is no room to compile the page: {error.strerror or error}") from None
    with suppress(OSError):  # then it is compiled again
        keep(KIND, key, ".wasm", lambda path: _write(path, module))
    return module


def _write(path: Path, module: bytes) -> None:
    path.write_bytes(module)


def _compiled(compiler: Compiler, sources: Mapping[str, bytes]) -> bytes:
    with workshop() as folder:
        for name, content in sources.items():
            path = folder / name
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(content)
        module = folder / "page.wasm"
        includes = [folder, folder / "runtime"]
        given = limits.current()
        with limits.applied(replace(given, compile=given.compile * FIRST_TIME)):
            compiler.build([folder / name for name in COMPILED], includes, module, "-O2", FLAGS)
        return module.read_bytes()
