"""Hybrid systems written as mathematics in YAML: checked, simulated, measured.

One pipeline, each stage a module that imports only from below::

    text --source--> nodes --schema--> document --elaborate--> HybridSystem     SymPy, the mathematics
         --lower--> Program --backends--> Kernel                                numbers, free of SymPy
         --simulate--> Execution --report, plot, store--> what people see

`hsdsl.model` runs it from end to end; `hsdsl.simulate.relaxed` is the algorithm of Burden, Gonzalez, Vasudevan,
Bajcsy, Sastry, *Metrization and Simulation of Controlled Hybrid Systems* (2013).
"""

from __future__ import annotations

TYPE_CHECKING = False  # that of `typing` would have it imported before the command line expects Ctrl-C

__version__ = "0.1.0"
__all__ = ["Execution", "Limits", "Model", "ModelError", "UsageError", "__version__", "distance", "load", "loads"]

if TYPE_CHECKING:
    from typing import Any

    from hsdsl.errors import ModelError, UsageError
    from hsdsl.execution import Execution
    from hsdsl.limits import Limits
    from hsdsl.model import Model, load, loads
    from hsdsl.model.distances import distance

_HOMES = {
    "Execution": "hsdsl.execution",
    "Limits": "hsdsl.limits",
    "Model": "hsdsl.model",
    "ModelError": "hsdsl.errors",
    "UsageError": "hsdsl.errors",
    "distance": "hsdsl.model.distances",
    "load": "hsdsl.model",
    "loads": "hsdsl.model",
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
