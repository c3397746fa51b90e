"""Hybrid systems written as mathematics in YAML: checked, simulated, measured.

One pipeline, each stage a module that imports only from below::

    text --source--> nodes --schema--> document --elaborate--> HybridSystem     SymPy, the mathematics
         --lower--> Program --backends--> Kernel                                numbers, free of SymPy
         --simulate--> Execution --report, plot, store--> what people see

`hsdsl.interface.model` runs it from end to end; `hsdsl.engine.simulate.relaxed` is the algorithm of Burden, Gonzalez, Vasudevan,
Bajcsy, Sastry, *Metrization and Simulation of Controlled Hybrid Systems* (2013).
"""

from __future__ import annotations

TYPE_CHECKING = False  # that of `typing` would have it imported before the command line expects Ctrl-C

__version__ = "0.1.0"
__all__ = ["Execution", "Limits", "Model", "ModelError", "UsageError", "__version__", "distance", "load", "loads"]

if TYPE_CHECKING:
    from typing import Any

    from hsdsl.base.errors import ModelError, UsageError
    from hsdsl.base.limits import Limits
    from hsdsl.engine.execution import Execution
    from hsdsl.interface.model import Model, load, loads
    from hsdsl.interface.model.distances import distance

_HOMES = {
    "Execution": "hsdsl.engine.execution",
    "Limits": "hsdsl.base.limits",
    "Model": "hsdsl.interface.model",
    "ModelError": "hsdsl.base.errors",
    "UsageError": "hsdsl.base.errors",
    "distance": "hsdsl.interface.model.distances",
    "load": "hsdsl.interface.model",
    "loads": "hsdsl.interface.model",
}
_MODULES = ("exact", "store", "sweep")  # those with functions for users


def __dir__() -> list[str]:
    return sorted({*__all__, *_MODULES})


def __getattr__(name: str) -> Any:
    """Import public names on first use: importing one stage must not load the others."""
    from importlib import import_module

    if name in _MODULES:
        return import_module(f"hsdsl.{name}")
    if name not in _HOMES:
        raise AttributeError(f"module 'hsdsl' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)
