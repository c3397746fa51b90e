"""What a model is made of: mathematics, program, kernels, compiled code; each is made when first needed, and once."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hsdsl.arithmetic import Arithmetic
from hsdsl.backends.python import PythonKernel
from hsdsl.errors import UsageError
from hsdsl.integrators import METHODS
from hsdsl.limits import Limits, applied
from hsdsl.model import automatic, engines, seen
from hsdsl.model.requests import FILE, KEYS, Request, Source, resolve
from hsdsl.model.settings import arithmetic_of, settings_of
from hsdsl.model.values import Values, initial_state, with_parameters
from hsdsl.program import Program
from hsdsl.runtime.compiler import NoCompiler
from hsdsl.runtime.kernel import CompiledModel
from hsdsl.simulate import Prepared, prepare
from hsdsl.simulate.timeline import make_timeline

if TYPE_CHECKING:
    from hsdsl.system import HybridSystem


def parts_of(path: str | os.PathLike[str], limits: Limits | None) -> Parts:
    """Read a model file, or find what was kept of it."""
    began = time.perf_counter()
    data = _read(path)
    key = None if data is None else seen.key_of(data, limits)
    program = None if key is None else seen.find(Path(path), key)
    if program is not None:
        return Parts(None, time.perf_counter() - began, limits, program, key)
    system = _elaborated(path, limits)
    return Parts(system, time.perf_counter() - began, limits, key=key)


def _elaborated(path: str | os.PathLike[str], limits: Limits | None) -> HybridSystem:
    from hsdsl.elaborate import elaborate

    with applied(limits):
        return elaborate(path)


def _read(path: str | os.PathLike[str]) -> bytes | None:
    """The file's bytes; what is wrong with a file that has none is said by who reads it next."""
    try:
        return Path(path).read_bytes()
    except (OSError, ValueError):
        return None


class Parts:
    """The parts of a checked model, and runs prepared from them; ``seconds`` is what making them took."""

    def __init__(
        self,
        system: HybridSystem | None,
        load_seconds: float = 0.0,
        limits: Limits | None = None,
        program: Program | None = None,
        key: str | None = None,
        left_out: tuple[str, ...] = (),
    ) -> None:
        if system is not None:
            self.system = system
        if program is not None:
            self.program = program
        self._limits, self._key, self._left_out = limits, key, left_out
        self.seconds = {"load": load_seconds, "compile": 0.0}
        self._compiled: CompiledModel | NoCompiler | None = None
        self.kernels: dict[int | None, PythonKernel] = {}

    @cached_property
    def system(self) -> HybridSystem:
        """The mathematics; of a model seen before it is read when it is asked for.

        Raises
        ------
        UsageError
            The file has changed meanwhile.
        """
        system = _elaborated(self.program.path, self._limits)
        if system.digest != self.program.digest:
            raise UsageError(f"{system.path} has changed since it was loaded", "load it again")
        return system

    @cached_property
    def program(self) -> Program:
        """The model lowered to routines, free of SymPy."""
        from hsdsl.lower import lower

        began = time.perf_counter()
        with applied(self._limits):
            program = replace(lower(self.system), left_out=self._left_out)
        self.seconds["compile"] += time.perf_counter() - began
        if self._key is not None and program.method in (None, "auto", *METHODS):  # else it is refused, with its place
            seen.keep(Path(program.path), self._key, program, self.system.files)
        return program

    @property
    def columns(self) -> list[str]:
        """Names of all states and outputs."""
        states = dict.fromkeys(name for mode in self.program.modes for name in mode.states)
        return list(dict.fromkeys((*states, *self.program.initial_states, *self.program.outputs)))

    def resolve(self, settings: Mapping[str, Any] | None = None, asked: Mapping[str, Any] | None = None) -> Request:
        """Resolve what the file, ``settings`` and a call ask for."""
        program, given = self.program, self.program.constants.names
        in_file: dict[str, Any] = {"scheme": program.scheme, "method": program.method}
        in_file |= {key: key for key in KEYS if key in given}  # their values are routines
        if "sample_times" in given or "sample_count" in given:
            in_file["samples"] = "samples"
        return resolve((Source(FILE, in_file), Source("--set", settings or {}), Source("the call", asked or {})))

    def values(self, arithmetic: Arithmetic) -> Values:
        """Return the numbers of the model in an arithmetic, without overrides."""
        program = self.program
        if arithmetic.digits not in self.kernels:
            began = time.perf_counter()
            self.kernels[arithmetic.digits] = PythonKernel(program, arithmetic)
            self.seconds["compile"] += time.perf_counter() - began
        return Values(lambda: self.system, program, self.kernels[arithmetic.digits])

    def _compile(self) -> CompiledModel:
        """Compile the model, once: what failed is not tried again."""
        if self._compiled is None:
            program = self.program
            began = time.perf_counter()
            try:
                with applied(self._limits):
                    self._compiled = CompiledModel(program)
            except NoCompiler as error:
                self._compiled = error
            self.seconds["compile"] += time.perf_counter() - began
        if isinstance(self._compiled, NoCompiler):
            raise self._compiled
        return self._compiled

    def prepare(
        self,
        settings: Mapping[str, Any] | None,
        asked: Mapping[str, Any],
        parameters: Mapping[str, Any],
        initial: Mapping[str, Any],
        engine: str,
        precision: int | None,
    ) -> Prepared:
        """Prepare a run: everything that does not change when it is run again."""
        request = self.resolve(settings, asked)
        engines.check(engine)
        values = with_parameters(self.values(arithmetic_of(precision)), parameters)
        with applied(self._limits):
            chosen = settings_of(request, values)
        mode, states, x = initial_state(values, initial)
        if request.method is None:
            from hsdsl.model.mechanical import one_stop

            chosen = replace(chosen, one_stop=one_stop(values, x))
        if request.automatic:
            timeline = make_timeline(self.program, values.kernel, values.parameters, chosen.until)
            chosen = automatic.chosen(chosen, self.program, values.kernel, timeline, mode, x)
        compiled = engines.choose(engine, chosen, precision, self._compile)
        return prepare(self.program, values.kernel, chosen, values.parameters, mode, states, x, compiled)

    def prepare_single(self, asked: dict[str, Any]) -> Prepared:
        """Prepare a run in float64 from what a call asks, by name."""
        settings = {key: asked.get(key) for key in KEYS}
        engine = asked.get("engine", "auto")
        return self.prepare(asked.get("settings"), settings, asked["parameters"], asked["initial"], engine, None)

    def only(self, names: tuple[str, ...]) -> Parts:
        """Return the parts of the model with what these states and outputs need, this one where that is all."""
        began = time.perf_counter()
        key = None if self._key is None else seen.key_of_part(self._key, names)
        program = None if key is None else seen.find(Path(self.program.path), key)
        if program is not None:
            whole = program.left_out == ()
            return self if whole else Parts(None, self.seconds["load"], self._limits, program, key)
        from hsdsl.elaborate.needed import left_out, only

        system = only(self.system, names)
        if system is self.system:
            if key is not None:
                seen.keep(Path(self.program.path), key, self.program, system.files)
            return self
        spent = self.seconds["load"] + time.perf_counter() - began
        return Parts(system, spent, self._limits, key=key, left_out=left_out(self.system, system))
