"""The model as one HTML page that runs it: sliders, live plots, transitions, scene; without server or network."""

from __future__ import annotations

import base64
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any

from hsdsl.analysis.plot.parts import filled, inert, scripts, shared
from hsdsl.base.names import visible
from hsdsl.engine.preparation.visible import visible_run
from hsdsl.engine.runtime.compiler import NoCompiler
from hsdsl.engine.runtime.kernel import CompiledModel
from hsdsl.engine.simulate import prepare
from hsdsl.export.source import Source
from hsdsl.export.web.model import model_of
from hsdsl.export.web.wasm import PARTS, wasm_module

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
