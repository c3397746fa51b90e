"""What a model is made of: mathematics, program, kernels, compiled code; each is made when first needed, and once."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from hsdsl.arithmetic import Arithmetic, Number
from hsdsl.backends.python import PythonKernel
from hsdsl.integrators import METHODS
from hsdsl.limits import Limits, applied
from hsdsl.model import automatic, engines, program_cache
from hsdsl.model.options import FILE, KEYS, Options, OptionSource, resolve
from hsdsl.model.overrides import recorded
from hsdsl.model.settings import arithmetic_of, following_digits, settings_of
from hsdsl.model.values import Values, initial_state, with_parameters
from hsdsl.model.written import Written
from hsdsl.program import Program
from hsdsl.runtime.compiler import NoCompiler
from hsdsl.runtime.kernel import CompiledModel
from hsdsl.simulate import Prepared, prepare
from hsdsl.simulate.timeline import Timeline, make_timeline

if TYPE_CHECKING:
    from hsdsl.system import HybridSystem


def pipeline_of(path: str | os.PathLike[str], limits: Limits | None, text: bytes | None = None) -> Pipeline:
    """Read a model file once, or take the bytes given for it, and find what was kept of them or elaborate them."""
    began = time.perf_counter()
    written = Written.at(path, limits, text)
    found = program_cache.find(written)
    if found is not None:
        program, written = found
        return Pipeline(None, time.perf_counter() - began, written, program)
    system = written.elaborated()
    return Pipeline(system, time.perf_counter() - began, written.with_files(system.files))


class Pipeline:
    """The parts of a checked model, and runs prepared from them; ``seconds`` is what making them took.

    Pickled they are what the model was read from, where it was read, and its program.
    """

    def __init__(
        self,
        system: HybridSystem | None,
        load_seconds: float = 0.0,
        written: Written | None = None,
        program: Program | None = None,
        part: program_cache.Part = (),
        left_out: tuple[str, ...] = (),
    ) -> None:
        if system is not None:
            self.system = system
        if program is not None:
            self.program = program
        self._written, self._part, self._left_out = written, part, left_out
        self.seconds = {"load": load_seconds, "compile": 0.0}
        self._compiled: CompiledModel | NoCompiler | None = None
        self.kernels: dict[int | None, PythonKernel] = {}

    def __getstate__(self) -> dict[str, Any]:
        made = self.program  # the first thing that whoever gets it needs, and costly
        state = {key: value for key, value in vars(self).items() if key not in ("system", "_compiled", "kernels")}
        return state | {"program": made} | ({"system": self.system} if self._written is None else {})

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _compiled=None, kernels={})

    @cached_property
    def system(self) -> HybridSystem:
        """The mathematics; of a model seen before it is elaborated when it is asked for, from the bytes read then."""
        from hsdsl.elaborate.slicing import only

        assert self._written is not None
        system = self._written.elaborated()
        for names in self._part:
            system = only(system, names)
        return system

    @cached_property
    def program(self) -> Program:
        """The model lowered to routines, free of SymPy."""
        from hsdsl.lower import lower

        began = time.perf_counter()
        with applied(None if self._written is None else self._written.limits):
            program = replace(lower(self.system), left_out=self._left_out)
        self.seconds["compile"] += time.perf_counter() - began
        if program.method in (None, "auto", *METHODS):  # else it is refused, with its place
            self._keep(program, self._part)
        return program

    def _keep(self, program: Program, part: program_cache.Part) -> None:
        if self._written is not None:
            program_cache.keep(self._written, program, part)

    @property
    def columns(self) -> list[str]:
        """Names of all states and outputs."""
        states = dict.fromkeys(name for mode in self.program.modes for name in mode.states)
        return list(dict.fromkeys((*states, *self.program.initial_states, *self.program.outputs)))

    def resolve(self, settings: Mapping[str, Any] | None = None, asked: Mapping[str, Any] | None = None) -> Options:
        """Resolve what the file, ``settings`` and a call ask for."""
        program, given = self.program, self.program.constants.names
        in_file: dict[str, Any] = {"scheme": program.scheme, "method": program.method}
        in_file |= {key: key for key in KEYS if key in given and key != "scale"}  # their values are routines
        in_file["scale"] = dict.fromkeys(program.scaled_states, "scale")
        if "sample_times" in given or "sample_count" in given:
            in_file["samples"] = "samples"
        return resolve(
            (OptionSource(FILE, in_file), OptionSource("--set", settings or {}), OptionSource("the call", asked or {}))
        )

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
                with applied(None if self._written is None else self._written.limits):
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
        with applied(None if self._written is None else self._written.limits):
            chosen = replace(settings_of(request, values), overrides=recorded(parameters, initial, request))
        mode, states, x = initial_state(values, initial)
        if request.method is None:
            from hsdsl.model.mechanical import one_stop

            chosen = replace(chosen, one_stop=one_stop(values, x))
        timeline = self.timeline(values, values.parameters, chosen.until)
        if request.automatic:
            chosen = automatic.chosen(chosen, self.program, values.kernel, timeline, mode, x)
        chosen = following_digits(chosen, request, values.kernel.arithmetic)
        compiled = engines.choose(engine, chosen, precision, self._compile)
        return prepare(self.program, values.kernel, chosen, timeline, mode, states, x, compiled)

    def timeline(self, values: Values, parameters: Sequence[Number], until: Number) -> Timeline:
        """Return the inputs over time."""
        with applied(None if self._written is None else self._written.limits):
            return make_timeline(self.program, values.kernel, parameters, until)

    def prepare_single(self, asked: dict[str, Any]) -> Prepared:
        """Prepare a run in float64 from what a call asks, by name."""
        settings = {key: asked.get(key) for key in KEYS}
        engine = asked.get("engine", "auto")
        return self.prepare(asked.get("settings"), settings, asked["parameters"], asked["initial"], engine, None)

    def only(self, names: tuple[str, ...]) -> Pipeline:
        """Return the parts of the model with what these states and outputs need, this one where that is all."""
        began = time.perf_counter()
        part = (*self._part, names)
        found = None if self._written is None else program_cache.find(self._written, part)
        if found is not None:
            program, written = found
            whole = program.left_out == self.program.left_out
            return self if whole else Pipeline(None, self.seconds["load"], written, program, part)
        from hsdsl.elaborate.slicing import left_out, only

        system = only(self.system, names)
        if system is self.system:
            self._keep(self.program, part)
            return self
        spent = self.seconds["load"] + time.perf_counter() - began
        return Pipeline(system, spent, self._written, part=part, left_out=left_out(self.system, system))
