"""Modules that hsdsl imports late, imported here: classes of theirs are compiled then, and that is no payload."""

import difflib
import pkgutil
from importlib import import_module

import hsdsl.engine.integrators
import hsdsl.engine.simulate.verdict

LATE = [
    difflib,
    *(
        import_module(f"{package.__name__}.{module.name}")
        for package in (hsdsl.engine.integrators, hsdsl.engine.simulate, hsdsl.engine.simulate.verdict)
        for module in pkgutil.iter_modules(package.__path__)
    ),
]
