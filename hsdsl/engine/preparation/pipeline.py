"""The stages of a model: mathematics, program, kernels, compiled code; each is made when first needed, and once.

From them runs are prepared, for the compiled loop or for the readable one.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING, Any

from hsdsl.base.errors import UsageError
from hsdsl.base.limits import Limits, applied, uncollected
from hsdsl.base.names import did_you_mean
from hsdsl.base.numbers.arithmetic import FLOAT64, TIE, Arithmetic, Number
from hsdsl.base.numbers.roundoff import following, moved
from hsdsl.base.parts import numbered
from hsdsl.engine import ahead
from hsdsl.engine.backends.python import PythonKernel
from hsdsl.engine.integrators import METHODS
from hsdsl.engine.preparation import automatic
from hsdsl.engine.preparation.experiment import (
    following_digits,
    initial_state,
    initial_waits,
    settings_of,
    waiting_apart,
)
from hsdsl.engine.preparation.options import FILE, KEYS, Options, overrides_of, recorded, resolve
from hsdsl.engine.preparation.values import Values, arithmetic_of, with_parameters
from hsdsl.engine.runtime import kernel
from hsdsl.engine.runtime.compiler import NoCompiler
from hsdsl.engine.runtime.kernel import CompiledModel
from hsdsl.engine.runtime.structures import COMPILED_SCHEMES
from hsdsl.engine.simulate import Prepared, Problem, Settings, prepare
from hsdsl.engine.simulate.input_segments import Timeline, UnorderedTimes, make_timeline, samples_of
from hsdsl.engine.simulate.moving import Start, moved_time
from hsdsl.language.files import ModelFiles
from hsdsl.mathematics import program_cache
from hsdsl.mathematics.program import Program
from hsdsl.mathematics.program_cache import SLIDING

if TYPE_CHECKING:
    from hsdsl.language.system import HybridSystem


# what compiles, runs and reports a model
_RUNNING = (
    "pickle",
    "hsdsl.engine.backends.c",
    "hsdsl.engine.runtime.process",
    "hsdsl.engine.simulate.verdict",
    "hsdsl.analysis.report",
)


@uncollected()
def pipeline_of(path: str | os.PathLike[str], limits: Limits | None, text: bytes | None = None) -> Pipeline:
    """Read a model file once, or take the bytes given for it, and find its program in the cache or elaborate them."""
    began = time.perf_counter()
    files = ModelFiles.read(path, limits, text)
    program = system = None
    if (cached := program_cache.find(files)) is not None:
        program, files = cached
    elif (lowered := ahead.taken(files, _RUNNING)) is not None and _method_exists(lowered.program):
        program, sliding, files = lowered
        program_cache.keep(files, program)
        if sliding is not None:
            program_cache.keep(files, sliding, (SLIDING,))
    else:
        from hsdsl.language.elaborate import elaborate_files

        system = elaborate_files(files).system
        files = files.with_data(system.files)
    return Pipeline(system, time.perf_counter() - began, files, program)


def _method_exists(program: Program) -> bool:
    """Whether its method is one of our own; else it may be refused with its place, which no kept program has."""
    return program.method in (None, "auto", *METHODS.own)


class Pipeline:
    """The stages of a checked model, and runs prepared from them; ``seconds`` is the time spent on them.

    Pickled it is the model's files and its program. ``part`` has the names that it was reduced to, and ``left_out`` the
    states that it lost by that; it has `SLIDING` where surfaces on which modes press have modes of their own.
    """

    def __init__(
        self,
        system: HybridSystem | None,
        load_seconds: float = 0.0,
        files: ModelFiles | None = None,
        program: Program | None = None,
        part: program_cache.Part = (),
        left_out: tuple[str, ...] = (),
    ) -> None:
        if system is not None:
            self.system = system
        if program is not None:
            self.program = program
        self._files, self._part, self._left_out = files, part, left_out
        self.seconds = {"load": load_seconds, "compile": 0.0}
        self._compiled: CompiledModel | NoCompiler | None = None
        self.kernels: dict[int | None, PythonKernel] = {}

    def __getstate__(self) -> dict[str, Any]:
        program = self.program  # needed first by whoever gets it, and costly
        state = {
            key: value for key, value in vars(self).items() if key not in ("system", "sliding", "_compiled", "kernels")
        }
        return state | {"program": program} | ({"system": self.system} if self._files is None else {})

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _compiled=None, kernels={})

    @property
    def files(self) -> ModelFiles | None:
        """The bytes of the model; None of a system made otherwise."""
        return self._files

    @contextmanager
    def _stage(self) -> Generator[None]:
        """Apply the model's limits, and count the time."""
        began = time.perf_counter()
        try:
            with applied(None if self._files is None else self._files.limits), uncollected():
                yield
        finally:
            self.seconds["compile"] += time.perf_counter() - began

    @cached_property
    def system(self) -> HybridSystem:
        """The mathematics; of a cached model it is elaborated from the bytes read at first."""
        from hsdsl.language.elaborate import elaborate_files

        assert self._files is not None
        return self._part_of(elaborate_files(self._files).system)

    def _part_of(self, system: HybridSystem) -> HybridSystem:
        from hsdsl.language.elaborate.derived import only

        for names in self._part:
            system = self._with_sliding(system) if names == SLIDING else only(system, names)
        return system

    def _with_sliding(self, system: HybridSystem) -> HybridSystem:
        from hsdsl.mathematics.completion import with_sliding

        with self._stage():
            return with_sliding(system)

    @cached_property
    def sliding(self) -> Pipeline:
        """The pipeline of the model with a mode for each surface that two modes press on."""
        if SLIDING in self._part:
            return self
        part = (*self._part, SLIDING)
        if kept := self._kept(part, lambda program: len(program.modes) == len(self.program.modes)):
            return kept
        system = self._with_sliding(self.system)
        if system is self.system:
            self.keep(self.program, part)
            return self
        return Pipeline(system, self.seconds["load"], self._files, None, part, self._left_out)

    @cached_property
    def program(self) -> Program:
        """The model lowered to routines, free of SymPy."""
        from hsdsl.mathematics.lower import lower

        system = self.system
        with self._stage():
            program = replace(lower(system), left_out=self._left_out)
        self.keep(program, self._part)
        return program

    def keep(self, program: Program, part: program_cache.Part = ()) -> None:
        """Keep a program for later runs."""
        if self._files is not None and _method_exists(program):
            program_cache.keep(self._files, program, part)

    def _kept(self, part: program_cache.Part, is_whole: Callable[[Program], bool]) -> Pipeline | None:
        """The pipeline of a program that was kept, this one where that is the whole model; None if there is none."""
        found = None if self._files is None else program_cache.find(self._files, part)
        if found is None or is_whole(found[0]):
            return found and self
        program, files = found
        return Pipeline(None, self.seconds["load"], files, program, part, program.left_out)

    @property
    def columns(self) -> list[str]:
        """Names of all states and outputs."""
        hidden = numbered(self.program.parts)
        names = (*self.program.all_states, *self.program.outputs)
        return list(dict.fromkeys(name for name in names if name not in hidden))

    def resolve(self, settings: Mapping[str, Any] | None = None, call: Mapping[str, Any] | None = None) -> Options:
        """Resolve the options of the file, of ``settings`` and of a call."""
        program, given = self.program, self.program.constants.names
        in_file: dict[str, Any] = {"scheme": program.scheme, "method": program.method}
        in_file["completion"] = program.completion
        in_file |= {key: key for key in KEYS if key in given}  # their values are routines
        in_file["scale"] = dict.fromkeys(program.scaled_states, "scale")
        if not {"sample_times", "sample_count", "every"}.isdisjoint(given):
            in_file["samples"] = "samples"
        states = program.all_states if program.parts else ()
        return resolve({FILE: in_file, "--set": settings or {}, "the call": call or {}}, states)

    def slides(self, arguments: Mapping[str, Any]) -> bool:
        """Whether a run with these arguments slides on surfaces that two modes press on: its completion is `auto`."""
        call = {"completion": arguments.get("completion")}
        return self.resolve(arguments.get("settings"), call).values["completion"].value == "auto"

    def values(self, arithmetic: Arithmetic = FLOAT64, parameters: Mapping[str, Any] | None = None) -> Values:
        """The numbers of the model in an arithmetic, with overrides of parameters where there are any."""
        if arithmetic.digits not in self.kernels:
            program = self.program
            with self._stage():
                self.kernels[arithmetic.digits] = PythonKernel(program, arithmetic)
        values = Values(lambda: self.system, self.program, self.kernels[arithmetic.digits])
        return values if parameters is None else with_parameters(values, parameters)

    def _compile(self) -> CompiledModel:
        """Compile the model, once: a failure is kept as well."""
        if self._compiled is None:
            program = self.program
            with self._stage():
                try:
                    self._compiled = CompiledModel(program)
                except NoCompiler as error:
                    self._compiled = error
        if isinstance(self._compiled, NoCompiler):
            raise self._compiled
        return self._compiled

    def prepare(self, arguments: Mapping[str, Any]) -> Prepared:
        """Prepare a run from the arguments of `Model.simulate`: everything that does not change in a second run."""
        parameters, initial = (overrides_of(arguments, group, self.program) for group in ("parameters", "initial"))
        engine, precision = arguments.get("engine", "auto"), arguments.get("precision")
        options = self.resolve(arguments.get("settings"), {key: arguments.get(key) for key in KEYS})
        if engine not in ENGINES:
            raise UsageError(f"there is no engine '{engine}'", did_you_mean(engine, ENGINES))
        if options.values["completion"].value == "auto" and self.sliding is not self:
            return self.sliding.prepare(arguments)
        values = self.values(arithmetic_of(precision), parameters)
        with applied(None if self._files is None else self._files.limits):
            settings = settings_of(options, values, recorded(parameters, initial, options))
        initial, waiting = waiting_apart(self.program, initial)
        mode, states, x = initial_state(values, initial)
        waits = initial_waits(values, self.program.modes[mode], x, waiting)
        if options.method is None:
            from hsdsl.engine.preparation.mechanical import one_stop

            settings = replace(settings, one_stop=one_stop(values, x))
        timeline = self.timeline(values, values.parameters, settings.until)
        if options.automatic:
            settings = automatic.chosen(settings, self.program, values.kernel, timeline, mode, x)
        settings = following_digits(settings, options, values.kernel.arithmetic)
        start = cache(partial(self._moved, parameters, initial, arithmetic_of(precision), settings.until))
        problem = Problem(self.program, values.kernel, settings, timeline, mode, states, x, waits, start)
        judge = automatic.judge_of(problem) if options.automatic else None
        return prepare(problem, choose(engine, settings, precision, self._compile), judge)

    def _moved(
        self, parameters: Mapping[str, Any], initial: Mapping[str, Any], arithmetic: Arithmetic, until: Number
    ) -> Start | None:
        """Where round-off of parameters, samples and initial values moves the start of a run with these overrides."""
        plain = self.values(arithmetic)
        try:
            traced = with_parameters(
                replace(plain, kernel=plain.kernel.over(following(arithmetic, traced=True))), parameters
            )
            x = tuple(map(moved, initial_state(traced, initial)[2]))
            numbers, tie = tuple(map(moved, traced.parameters)), TIE * until
            samples = [
                (tuple(moved_time(t.value, moved(t), tie) for t in times), tuple(map(moved, values)))
                for times, values in samples_of(self.program, traced.kernel, traced.parameters)
            ]
            return Start(x, make_timeline(self.program, plain.kernel, numbers, until, samples))
        except UsageError:
            return None

    def timeline(self, values: Values, parameters: Sequence[Number], until: Number) -> Timeline:
        """The inputs over time."""
        with applied(None if self._files is None else self._files.limits):
            try:
                return make_timeline(self.program, values.kernel, parameters, until)
            except UnorderedTimes as error:
                raise UsageError(f"{self._place_of(error)}{error}", error.hint) from None

    def _place_of(self, error: UnorderedTimes) -> str:
        """Where the file has a sample, with a colon; nothing where there is no file."""
        if self._files is None:
            return ""
        from hsdsl.language.elaborate import elaborate_files

        document: Any = elaborate_files(self._files).document
        given = document.inputs[error.name]
        span = (given.times[error.k] if hasattr(given, "times") else given.file).place.span
        return f"{span.path}:{span.line}:{span.column}: "

    def drivable(self) -> Pipeline:
        """The pipeline of the same model with inputs that can be driven from outside."""
        from hsdsl.language.elaborate import drivable

        assert self._files is not None
        return Pipeline(self._part_of(drivable(self._files)))

    def derived(self, name: tuple[str, ...], make: Callable[[], HybridSystem]) -> Pipeline:
        """The pipeline of a system made of this one, whose program is kept under a name of its own."""
        part = (*self._part, name)
        return self._kept(part, lambda _: False) or Pipeline(make(), 0.0, self._files, part=part)

    def only(self, names: tuple[str, ...]) -> Pipeline:
        """The pipeline of these states and outputs with what they need; this one where that is the whole model."""
        began = time.perf_counter()
        part = (*self._part, names)
        if kept := self._kept(part, lambda program: program.left_out == self.program.left_out):
            return kept
        from hsdsl.language.elaborate.derived import left_out, only

        system = only(self.system, names)
        if system is self.system:
            self.keep(self.program, part)
            return self
        spent = self.seconds["load"] + time.perf_counter() - began
        return Pipeline(system, spent, self._files, part=part, left_out=left_out(self.system, system))


ENGINES = ("auto", "c", "python")


def choose(
    engine: str, settings: Settings, precision: int | None, make: Callable[[], CompiledModel]
) -> CompiledModel | None:
    """The compiled model that a run is for, None where the Python loop is to run it.

    By ``auto`` the compiled loop runs where it can serve, else the Python loop.

    Raises UsageError: ``c`` is given and cannot serve.
    """
    if engine == "python":
        return None
    if precision is not None:
        why = "it computes with float64 only, and a precision is given"
    elif settings.scheme not in COMPILED_SCHEMES:
        why = f"scheme '{settings.scheme}' has no compiled loop"
    else:
        try:
            compiled = make()
            kernel.runtime()
            return compiled
        except NoCompiler as error:
            why = str(error)
        if engine == "auto":
            _warn_once(why)
    if engine == "c":
        raise UsageError(f"engine 'c' cannot run this: {why}", "use engine 'python', or 'auto'")
    return None


@cache
def _warn_once(why: str) -> None:
    print(f"hsdsl: the Python engine runs this, 50 or more times slower than compiled code: {why}", file=sys.stderr)
