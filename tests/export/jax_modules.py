"""Exported modules for JAX, imported, and compared with runs."""

from __future__ import annotations

import functools
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import jax
import numpy as np

from hsdsl.export import files_of, source_of, write

SETTINGS: list[dict[str, Any]] = [
    {"scheme": "located", "method": "rk4", "step": 1e-2},
    {"scheme": "relaxed", "method": "midpoint", "step": 1e-2, "relaxation": 1e-4},
]


# XLA's own emitter takes twice the time for what runs a second; its numbers are the same
FAST = {"xla_cpu_use_fusion_emitters": False, "xla_backend_optimization_level": 0}


@functools.cache
def options() -> dict[str, Any] | None:
    """Options of XLA that compile fast, where it has them."""
    try:
        jax.jit(lambda x: x, compiler_options=FAST)(1.0)
    except Exception:  # an option of another version
        return None
    return FAST


def jitted(function: Any) -> Any:
    """The function compiled, fast."""
    return jax.jit(function, compiler_options=options())


def imported(model: Any, folder: Path, **arguments: Any) -> ModuleType:
    """The module of a model with these settings."""
    (path,) = write(files_of(source_of(model, arguments), "jax"), folder)
    name = f"{path.stem}_{folder.name}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # its classes look for it
    spec.loader.exec_module(module)
    return module


def assert_same(module: ModuleType, found: Any, run: Any, within: float = 1e-9) -> None:
    """The same transitions and end as a run's, numbers within an error relative to the length of the run."""
    count = int(found.count)
    assert module.STOPS[int(found.stop)] == run.stop.reason
    assert count == len(run.transitions)
    kept = min(count, len(found.times))
    made = list(run.transitions)[:kept]
    assert [module.MODEL.edges[int(k)].name for k in found.edges[:kept]] == [t.edge for t in made]
    allowed = within * max(1.0, run.stop.time)
    for t, time, resumed, entry in zip(made, found.times, found.resumed, found.entries, strict=False):
        assert abs(time - t.time) <= allowed
        assert bool(entry) == t.entry
        assert np.isnan(resumed) if t.resumed is None else abs(resumed - t.resumed) <= allowed
    assert abs(found.t - run.stop.time) <= allowed
    final = np.array(list(run.final.state.values()), float)
    assert np.allclose(np.asarray(found.x)[: len(final)], final, rtol=1e-8, atol=1e-8)
