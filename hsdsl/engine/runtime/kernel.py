"""The hand-written runtime, and programs compiled to libraries that it runs."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Hashable
from functools import cache
from typing import Any

from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.library import loop
from hsdsl.engine.runtime.programs import SYMBOL, compiled
from hsdsl.mathematics.program import Program


@cache
def runtime() -> ctypes.CDLL:
    """The hand-written runtime; a run in it leaves the interpreter free.

    Raises NoCompiler: there is no compiler, or it fails.
    """
    library = loop()
    library.hs_workspace.restype = ctypes.c_int64
    library.hs_simulate.argtypes, library.hs_simulate.restype = (ctypes.c_void_p,), None
    library.hs_pack.argtypes, library.hs_pack.restype = (ctypes.c_void_p, ctypes.c_void_p), ctypes.c_int64
    sampling = *(ctypes.c_void_p,) * 5, ctypes.c_int64, *(ctypes.c_int32,) * 3, ctypes.c_void_p
    library.hs_sample_record.argtypes, library.hs_sample_record.restype = sampling, ctypes.c_int64
    library.hs_screen_run.argtypes, library.hs_screen_run.restype = (ctypes.c_void_p,) * 3, ctypes.c_int64
    library.hs_run_ensemble.argtypes, library.hs_run_ensemble.restype = (ctypes.c_void_p,), None
    return library


class CompiledModel:
    """A program compiled to a library: ``table`` is its ``hs_model``.

    Raises NoCompiler: there is no compiler, or it fails.
    """

    def __init__(self, program: Program) -> None:
        self._library = compiled(program)
        self.table = structures.Model.in_dll(self._library, SYMBOL)
        self._shared: dict[Hashable, Any] = {}

    def workspace(self, method: Any, scheme: str) -> int:
        """How many numbers a run needs for itself."""
        number = structures.SCHEMES.index(scheme)
        return runtime().hs_workspace(ctypes.byref(self.table), ctypes.byref(method), number)

    def mode(self, number: int) -> Any:
        """The ``hs_mode`` of a mode."""
        return structures.array_at(structures.Mode, self.table.mode, self.table.flows)[number]

    def shared(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """Return what runs of this model share under a key, made on first use."""
        return self._shared[key] if key in self._shared else self._shared.setdefault(key, make())
