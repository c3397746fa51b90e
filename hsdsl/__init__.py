"""Hybrid systems written as mathematics in YAML: checked, simulated, measured.

Six storeys above a base; a module imports only from its own storey and those below::

    interface      Model, the command line, charts of methods, models of other tools         what people touch
    export         a model as C, FMI, Rust, MATLAB, JAX, a web page, a document
    analysis       questions about executions, and their answers as text, files, pictures
    engine         Program -> Kernel -> Execution: code, methods, the schemes, verdicts       no SymPy
    mathematics    HybridSystem -> Program: flows along guards, decisions, lowering
    language       text -> nodes -> document -> HybridSystem: every error found
    base           numbers, errors, names, cache, processes

A run reads: `language.source`, `language.schema`, `language.elaborate`, `mathematics.lower`, `engine.backends`,
`engine.simulate`. `engine.preparation.pipeline` calls them in this order. `engine.simulate.located` is the execution of
Burden, Gonzalez, Vasudevan, Bajcsy, Sastry, *Metrization and Simulation of Controlled Hybrid Systems* (2013, Fig. 8);
`relaxed` beside it is their simulation of relaxed executions (Fig. 12).
"""

from __future__ import annotations

TYPE_CHECKING = False  # that of `typing` would have it imported before the command line expects Ctrl-C

__version__ = "0.1.0"
__all__ = [
    "Execution",
    "Limits",
    "Model",
    "ModelError",
    "UsageError",
    "__version__",
    "distance",
    "load",
    "loads",
    "register",
]

if TYPE_CHECKING:
    from typing import Any

    from hsdsl.base.errors import ModelError, UsageError
    from hsdsl.base.limits import Limits
    from hsdsl.base.plugins import register
    from hsdsl.engine.execution import Execution
    from hsdsl.interface.model import Model, distance, load, loads

_HOMES = {
    "Execution": "hsdsl.engine.execution",
    "Limits": "hsdsl.base.limits",
    "Model": "hsdsl.interface.model",
    "ModelError": "hsdsl.base.errors",
    "UsageError": "hsdsl.base.errors",
    "distance": "hsdsl.interface.model",
    "load": "hsdsl.interface.model",
    "loads": "hsdsl.interface.model",
    "register": "hsdsl.base.plugins",
}
_MODULES = {"chart": "interface", "exact": "analysis", "store": "analysis", "sweep": "analysis"}  # for users too


def __dir__() -> list[str]:
    return sorted({*__all__, *_MODULES})


def __getattr__(name: str) -> Any:
    """Import public names on first use: importing one stage must not load the others."""
    from importlib import import_module

    if name in _MODULES:
        return import_module(f"hsdsl.{_MODULES[name]}.{name}")
    if name not in _HOMES:
        raise AttributeError(f"module 'hsdsl' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)
