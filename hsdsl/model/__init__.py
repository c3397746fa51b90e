"""A model: a YAML file turned into something that runs. The pipeline in one place."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hsdsl.arithmetic import FLOAT64, Arithmetic, Number, multiprecision
from hsdsl.backends.python import PythonKernel
from hsdsl.errors import UsageError
from hsdsl.execution import Ensemble, Execution
from hsdsl.integrators import METHODS, TaylorMethod
from hsdsl.limits import Limits, applied
from hsdsl.model import automatic, engines, seen
from hsdsl.model.remembered import Remembered, key_of
from hsdsl.model.requests import FILE, KEYS, Request, Source, check_digits, check_smooth, resolve
from hsdsl.model.values import Values, initial_state, with_parameters
from hsdsl.model.values import samples as samples_of
from hsdsl.names import did_you_mean
from hsdsl.program import Program
from hsdsl.runtime.kernel import CompiledModel
from hsdsl.simulate import Prepared, Settings, prepare
from hsdsl.simulate.recorder import Progress
from hsdsl.simulate.timeline import make_timeline

if TYPE_CHECKING:
    from hsdsl.metrics.points import Place, PointDistance
    from hsdsl.model.estimate import Estimate
    from hsdsl.model.stream import Streamed
    from hsdsl.system import HybridSystem

LEAST_DIGITS, MOST_DIGITS = 16, 10_000
MOST_PREPARED = 16


def load(path: str | os.PathLike[str], limits: Limits | None = None) -> Model:
    """Read a model file.

    Parameters
    ----------
    path : path
        A YAML file in the language.
    limits : Limits, optional
        What the file may ask for, and where its data may lie, where the defaults are not to hold.

    Raises
    ------
    ModelError
        The model has errors; all of them are carried.
    UsageError
        The file cannot be read.
    """
    began = time.perf_counter()
    data = _read(path)
    key = None if data is None else seen.key_of(data, limits)
    program = None if key is None else seen.find(Path(path), key)
    if program is not None:
        return Model(None, time.perf_counter() - began, limits, program, key)
    system = _elaborate(path, limits)
    return Model(system, time.perf_counter() - began, limits, key=key)


def _elaborate(path: str | os.PathLike[str], limits: Limits | None) -> HybridSystem:
    from hsdsl.elaborate import elaborate

    with applied(limits):
        return elaborate(path)


def _read(path: str | os.PathLike[str]) -> bytes | None:
    """The file's bytes; what is wrong with a file that has none is said by who reads it next."""
    try:
        return Path(path).read_bytes()
    except (OSError, ValueError):
        return None


class Model:
    """A checked model. ``system`` is the mathematics, ``program`` what an engine runs."""

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
        self._key, self._left_out = key, left_out
        self._smaller: dict[tuple[str, ...], Model] = {}
        self._limits = limits
        self._seconds = {"load": load_seconds, "compile": 0.0}
        self._compiled: CompiledModel | None = None
        self._kernels: dict[int | None, PythonKernel] = {}
        self._prepared: Remembered[Prepared] = Remembered(MOST_PREPARED)

    def __repr__(self) -> str:
        modes = ", ".join(mode.name for mode in self.program.modes[:8])
        return f"<hsdsl model {Path(self.program.path).name}: modes {modes}{', ...' * (len(self.program.modes) > 8)}>"

    @cached_property
    def system(self) -> HybridSystem:
        """The mathematics; of a model seen before it is read when it is asked for.

        Raises
        ------
        UsageError
            The file has changed meanwhile.
        """
        system = _elaborate(self.program.path, self._limits)
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
        self._seconds["compile"] += time.perf_counter() - began
        if self._key is not None and program.method in (None, "auto", *METHODS):  # else it is refused, with its place
            seen.keep(Path(program.path), self._key, program, self.system.files)
        return program

    def simulate(
        self,
        until: Any = None,
        *,
        scheme: str | None = None,
        method: str | None = None,
        step: Any = None,
        tolerance: Any = None,
        relaxation: Any = None,
        samples: Any = None,
        max_transitions: Any = None,
        parameters: Mapping[str, Any] | None = None,
        initial: Mapping[str, Any] | None = None,
        settings: Mapping[str, Any] | None = None,
        engine: str = "auto",
        precision: int | None = None,
        outputs: Sequence[str] | None = None,
        watch: Callable[[Progress], None] | None = None,
    ) -> Execution:
        """Run the model from t = 0.

        Every number may be given as a number or as an expression of the model's parameters, such as ``"40*pi"``.

        Parameters
        ----------
        until : number or str, optional
            End of the run.
        scheme, method : str, optional
            A name of :data:`hsdsl.simulate.SCHEMES`; a name of :data:`hsdsl.integrators.METHODS`, or ``auto``.
        step, tolerance : number or str, optional
            Fixed step, or bound on the local error relative to 1 + |x|; they exclude each other.
        relaxation : number or str, optional
            The paper's epsilon: a depth in the model's own units, and a time.
        samples : int, str or sequence, optional
            How many equally spaced samples, or their times; what files are written at.
        max_transitions : int or str, optional
            Stop rather than make more.
        parameters, initial : mapping, optional
            Overrides by name; ``initial`` may name ``mode``. Derived parameters are computed anew.
        settings : mapping, optional
            Settings below the ones above but above the file's (what ``--set experiment.NAME`` reaches).
        engine : {"auto", "c", "python"}
            What runs it: compiled code, or the readable loop; ``auto`` is ``c`` where there is a compiler.
        precision : int, optional
            Decimal digits (mpmath numbers) instead of float64.
        outputs : sequence of str, optional
            States and outputs that are asked for; states that none of them depends on are not integrated. The run is
            that of :meth:`only`.
        watch : callable, optional
            Given the recorder before the run starts.

        Returns
        -------
        Execution

        Raises
        ------
        UsageError
            A name, value or combination that cannot be served.
        """
        if outputs is not None:
            smaller = self.only(outputs)
            given = {
                k: v for k, v in (initial or {}).items() if k in ("mode", *smaller.columns) or k not in self.columns
            }
            return smaller.simulate(
                until, scheme=scheme, method=method, step=step, tolerance=tolerance, relaxation=relaxation,
                samples=samples, max_transitions=max_transitions, parameters=parameters, initial=given,
                settings=settings, engine=engine, precision=precision, watch=watch,
            )  # fmt: skip
        asked = dict(
            until=until,
            scheme=scheme,
            method=method,
            step=step,
            tolerance=tolerance,
            relaxation=relaxation,
            samples=samples,
            max_transitions=max_transitions,
        )
        key = key_of(*asked.values(), parameters, initial, settings, engine, precision)
        ready = self._prepared.find(key)
        if ready is None:
            ready = self._prepare(settings, asked, parameters or {}, initial or {}, engine, precision)
            self._prepared.keep(key, ready)
        return ready.simulate(watch, self._seconds)

    def _prepare(
        self,
        settings: Mapping[str, Any] | None,
        asked: Mapping[str, Any],
        parameters: Mapping[str, Any],
        initial: Mapping[str, Any],
        engine: str,
        precision: int | None,
    ) -> Prepared:
        request = self.resolve(settings, asked)
        engines.check(engine)
        values = with_parameters(self._values(_arithmetic(precision)), parameters)
        chosen = self._settings(request, values)
        mode, states, x = initial_state(values, initial)
        if request.method is None:
            from hsdsl.model.mechanical import one_stop

            chosen = replace(chosen, one_stop=one_stop(values, x))
        if request.automatic:
            timeline = make_timeline(self.program, values.kernel, values.parameters, chosen.until)
            chosen = automatic.chosen(chosen, self.program, values.kernel, timeline, mode, x)
        compiled = engines.choose(engine, chosen, precision, self._compile)
        return prepare(self.program, values.kernel, chosen, values.parameters, mode, states, x, compiled)

    def stream(
        self,
        path: str | os.PathLike[str],
        *,
        every: int = 1,
        columns: Sequence[str] | None = None,
        watch: Callable[[Progress], None] | None = None,
        **asked: Any,
    ) -> Streamed:
        """Run the model with its rows going to a CSV file while it runs, in constant memory.

        The file has the first row, every k-th, both rows of each jump and the last; it holds whole lines at any moment,
        so that what a run that was killed has written can be read. A file of this name is written over.

        Parameters
        ----------
        path : path
            A name ending in .csv.
        every : int
            k.
        columns : names, optional
            Which states and outputs; left out, all of them.
        watch : callable, optional
            As for :meth:`simulate`.
        **asked
            What else :meth:`simulate` takes, but ``precision`` and ``samples``.

        Raises
        ------
        UsageError
            What cannot be served: no compiled engine, a file that cannot be written, a full disk.
        """
        from hsdsl.execution.samples import split
        from hsdsl.model.stream import stream

        known = (*KEYS, "settings", "parameters", "initial", "engine")
        for name in asked:
            if name == "samples" or name not in known:
                raise UsageError(f"a streamed run has no argument '{name}'", did_you_mean(name, known))
        target = Path(path)
        if target.suffix.lower() != ".csv":
            raise UsageError(f"{target} should end in .csv: only such a file can be written while a run goes on")
        if every < 1:
            raise UsageError(f"every must be at least 1, not {every}")
        plain: dict[str, Any] = {"parameters": {}, "initial": {}}
        prepared = self._prepare_single(plain | asked | {"engine": "c"})
        if columns is not None:
            split(columns, tuple(self.columns), self.program.outputs)
        return stream(prepared, target, every, columns, watch)

    def ensemble(
        self,
        *,
        parameters: Mapping[str, Any] | None = None,
        initial: Mapping[str, Any] | None = None,
        samples: Any = None,
        transition_times: int = 0,
        threads: int | None = None,
        progress: Callable[[int, int], None] | None = None,
        **asked: Any,
    ) -> Ensemble:
        """Run many instances of the model, on all cores where there is a compiler.

        Every instance gives what :meth:`simulate` gives, to the last bit. Ctrl-C keeps those that are done.

        Parameters
        ----------
        parameters, initial : mapping, optional
            Overrides by name: numbers, expressions, or arrays of numbers. Arrays are brought to a common shape, as
            NumPy does; each of its elements is an instance.
        samples : int or sequence of float, optional
            Sample every run: at so many equally spaced times from 0 to its ``until``, or at these times.
        transition_times : int
            Keep the times of so many first transitions of each run.
        threads : int, optional
            How many; left out, as many as there are cores for this process.
        progress : callable, optional
            Called now and then with how many instances are done and how many there are.
        **asked
            What else :meth:`simulate` takes for every instance: ``until``, ``scheme``, ``method``, ``step``,
            ``tolerance``, ``relaxation``, ``max_transitions``, ``settings``, ``engine``.

        Raises
        ------
        UsageError
            What cannot be served: a name, arrays of different shapes, no instance that can be run.
        """
        from hsdsl.model.ensemble import Asked, check, cores, ready

        check(asked, threads, transition_times)
        sorted_out = Asked.of(parameters or {}, initial or {}, samples, transition_times, asked)
        values = self._values(FLOAT64)
        return ready(self, values, sorted_out, self._prepare_single).run(threads or cores(), progress)

    def _prepare_single(self, asked: dict[str, Any]) -> Prepared:
        """Prepare what :meth:`simulate` would run."""
        settings = {key: asked.get(key) for key in KEYS}
        engine = asked.get("engine", "auto")
        return self._prepare(asked.get("settings"), settings, asked["parameters"], asked["initial"], engine, None)

    def only(self, asked: Sequence[str]) -> Model:
        """Return the model with the states and outputs asked for and those they, or any transition, depend on.

        What stays runs as a model written without the rest: adaptive steps follow what stays alone, and a state that
        is left out can neither stop a run nor keep one from coming to rest.

        Parameters
        ----------
        asked : sequence of str
            Names of states and outputs.

        Raises
        ------
        UsageError
            A name that the model does not have.
        """
        names = tuple(sorted(set(asked)))
        for name in names:
            if name not in self.columns:
                raise UsageError(f"the model has no state or output '{name}'", did_you_mean(name, self.columns))
        if names not in self._smaller:
            self._smaller[names] = self._without_the_rest(names)
        return self._smaller[names]

    def _without_the_rest(self, names: tuple[str, ...]) -> Model:
        began = time.perf_counter()
        key = None if self._key is None else seen.key_of_part(self._key, names)
        program = None if key is None else seen.find(Path(self.program.path), key)
        if program is not None:
            whole = program.left_out == ()
            return self if whole else Model(None, self._seconds["load"], self._limits, program, key)
        from hsdsl.elaborate.needed import left_out, only

        system = only(self.system, names)
        if system is self.system:
            if key is not None:
                seen.keep(Path(self.program.path), key, self.program, system.files)
            return self
        spent = self._seconds["load"] + time.perf_counter() - began
        return Model(system, spent, self._limits, key=key, left_out=left_out(self.system, system))

    def estimate(self, execution: Execution, **asked: Any) -> Estimate:
        """Run again, finer, and compare: ``asked`` is what :meth:`simulate` was given for ``execution``."""
        from hsdsl.model.estimate import compare, finer_settings

        finer = finer_settings(execution)
        asked |= {"step": None, "tolerance": None, "watch": None, **finer}
        if execution.method in METHODS:
            asked["method"] = execution.method
        return compare(execution, self.simulate(**asked), finer)

    def plot(
        self, execution: Execution, path: str | os.PathLike[str], parameters: Mapping[str, Any] | None = None
    ) -> None:
        """Draw an execution of this model, with the levels of its guards; see `hsdsl.plot`.

        Parameters
        ----------
        execution : Execution
            What to draw.
        path : path
            A name ending in .png, .svg or .html.
        parameters : mapping, optional
            The overrides the execution was run with: guards' levels depend on them.
        """
        from hsdsl.model.guards import guard_lines
        from hsdsl.plot import plot

        values = with_parameters(self._values(FLOAT64), parameters or {})
        plot(execution, path, guards=guard_lines(values), units=self.program.units)

    def distance(
        self,
        p: str | Place,
        q: str | Place,
        *,
        metric: str = "quotient",
        relaxation: Any = None,
        parameters: Mapping[str, Any] | None = None,
        hops: int | None = None,
        seconds: float = 60.0,
        plot: str | os.PathLike[str] | None = None,
    ) -> PointDistance:
        """Return how far apart two points are: the length of the shortest curve that may pass through guards.

        Parameters
        ----------
        p, q : str or Place
            A mode and all its states, as ``"free x=13 v=5"``; values are expressions of parameters.
        metric : {"quotient", "relaxed"}
            The paper's d_M (Def. 12), or that of the relaxed space (Def. 19).
        relaxation : number or str, optional
            The paper's epsilon; left out, the file's or 1e-6.
        parameters : mapping, optional
            Overrides by name.
        hops : int, optional
            The most passages of a path.
        seconds : float
            About how long the search may take; then the interval is what is known by then, and ``certified`` says so.
        plot : path, optional
            Draw the shortest path found there (.png or .svg), where its modes have two coordinates.

        Raises
        ------
        UsageError
            A point or a number that does not fit the model, or a point outside its mode's domain.
        """
        from hsdsl.model.between_runs import budget_of
        from hsdsl.model.places import distance_of_points

        values = with_parameters(self._values(FLOAT64), parameters or {})
        return distance_of_points(values, p, q, metric, relaxation, hops, budget_of(seconds), plot)

    @property
    def columns(self) -> list[str]:
        """Names of all states and outputs."""
        states = dict.fromkeys(name for mode in self.program.modes for name in mode.states)
        return list(dict.fromkeys((*states, *self.program.initial_states, *self.program.outputs)))

    def resolve(self, settings: Mapping[str, Any] | None = None, asked: Mapping[str, Any] | None = None) -> Request:
        """Resolve what the file, ``settings`` and a call ask for (see `hsdsl.model.requests`)."""
        program, given = self.program, self.program.constants.names
        in_file: dict[str, Any] = {"scheme": program.scheme, "method": program.method}
        in_file |= {key: key for key in KEYS if key in given}  # their values are routines
        if "sample_times" in given or "sample_count" in given:
            in_file["samples"] = "samples"
        return resolve((Source(FILE, in_file), Source("--set", settings or {}), Source("the call", asked or {})))

    def _values(self, arithmetic: Arithmetic) -> Values:
        program = self.program
        if arithmetic.digits not in self._kernels:
            began = time.perf_counter()
            self._kernels[arithmetic.digits] = PythonKernel(program, arithmetic)
            self._seconds["compile"] += time.perf_counter() - began
        return Values(lambda: self.system, program, self._kernels[arithmetic.digits])

    def _compile(self) -> CompiledModel:
        if self._compiled is None:
            program = self.program
            began = time.perf_counter()
            self._compiled = CompiledModel(program)
            self._seconds["compile"] += time.perf_counter() - began
        return self._compiled

    def _settings(self, request: Request, values: Values) -> Settings:
        def number(key: str) -> Number:
            asked = request.values[key]
            if asked.place == FILE:
                return values.constant(key)[0]
            return values.number(asked.value, key)

        def positive(key: str) -> Number:
            value = number(key)
            if not value > 0:
                raise UsageError(f"{key} must be positive, not {value}")
            return value

        until = number("until")
        if until < 0:
            raise UsageError(f"until must not be negative, not {until}")
        most = number("max_transitions")
        if most < 0 or most != int(most):
            raise UsageError(f"max_transitions must be a whole number, not {most}")
        step = positive("step") if request.size == "step" else None
        if step is not None and until > 0 and until + step == until:
            raise UsageError(f"a step of {step} is lost in round-off beside until = {until}", "take a larger step")
        check_digits(request.method, values.kernel.arithmetic)
        check_smooth(request.method, self.program)
        tolerance = positive("tolerance") if request.size == "tolerance" else None
        method = request.method
        if isinstance(method, TaylorMethod):
            method = method.for_tolerance(tolerance, values.kernel.arithmetic)
        return Settings(
            scheme=request.scheme,
            method=method,
            step=step,
            tolerance=tolerance,
            relaxation=positive("relaxation"),
            until=until,
            max_transitions=int(most),
            samples=self._samples(request, values),
        )

    def _samples(self, request: Request, values: Values) -> int | tuple[Number, ...] | None:
        asked = request.values.get("samples")
        if asked is None:
            return None
        if asked.place != FILE:
            return samples_of(values, asked.value)
        if values.has("sample_times"):
            return values.constant("sample_times")
        return samples_of(values, values.constant("sample_count")[0])


def split_overrides(pairs: Sequence[str]) -> tuple[dict[str, str], dict[str, str], dict[str, str]]:
    """Sort ``NAME=VALUE`` texts into parameters, initial values and settings; of a repeated name the last counts.

    Raises
    ------
    UsageError
        A text is not of that form.
    """
    parameters: dict[str, str] = {}
    initial: dict[str, str] = {}
    settings: dict[str, str] = {}
    for pair in pairs:
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not (name and equals and value):
            raise UsageError(f"--set wants NAME=VALUE, not '{pair}'", "for example --set c=0.8 or --set initial.v=20")
        group, dot, rest = name.partition(".")
        if not dot:
            parameters[name] = value
        elif group == "initial":
            initial[rest] = value
        elif group == "experiment":
            settings[rest] = value
        else:
            hint = did_you_mean(group, ("initial", "experiment"))
            raise UsageError(f"--set reaches NAME, initial.NAME and experiment.NAME, not '{name}'", hint)
    return parameters, initial, settings


def _arithmetic(precision: int | None) -> Arithmetic:
    if precision is None:
        return FLOAT64
    if not LEAST_DIGITS <= precision <= MOST_DIGITS:
        raise UsageError(f"precision is {LEAST_DIGITS} to {MOST_DIGITS} decimal digits, not {precision}")
    return multiprecision(precision)
