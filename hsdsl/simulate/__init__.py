"""From a program to an execution. `relaxed` is the paper's algorithm; `SCHEMES` is what a model may name.

==================  ===========================================================================================
`relaxed`           the loop: step, strip, reset (Fig. 12)
`located`           the other loop: step, crossing, reset (Fig. 8)
`spans`             its steps, with states and surfaces as polynomials along them
`along`, `isolate`  surfaces along a step; where polynomials change sign
`rest`, `tails`     rest on a guard, and Zeno tails that end in it (M11)
`entry`             entering a mode: transitions that fire at once
`surfaces`          round-off, depth, and where a step crossed a surface
`control`           the step size
`patience`          when to stop trying shorter steps
`timeline`          sampled inputs as segments no step crosses
`paoli_schatzman`   the rival: a two-step formula for one mass and one stop
`run`               what stays for a whole run, and where it stands
`recorder`          rows, arcs and transitions, and the execution's columns
`stops`, `notes`    how runs end, and what else they say of themselves, in sentences
`compiled`          the same loop in C: what it is given and what it says
`chunks`            what the compiled loop writes to
`interrupt`         Ctrl-C while it runs
==================  ===========================================================================================
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from hsdsl.arithmetic import Number
from hsdsl.execution import Execution, Point, Stop, Transition, Verdict
from hsdsl.integrators.stepper import State
from hsdsl.kernel import Kernel
from hsdsl.program import Program
from hsdsl.runtime.kernel import CompiledModel
from hsdsl.simulate.chunks import execution_columns, transitions_of
from hsdsl.simulate.compiled import CompiledRun
from hsdsl.simulate.control import make_control
from hsdsl.simulate.entry import enter
from hsdsl.simulate.located import located
from hsdsl.simulate.paoli_schatzman import NOTES, paoli_schatzman
from hsdsl.simulate.recorder import Progress, Recorder
from hsdsl.simulate.relaxed import relaxed
from hsdsl.simulate.run import Here, Run
from hsdsl.simulate.settings import Settings
from hsdsl.simulate.stops import interrupted, show
from hsdsl.simulate.timeline import make_timeline

SCHEMES: dict[str, Callable[[Run, Here | Stop], Stop]] = {
    "relaxed": relaxed,
    "located": located,
    "paoli-schatzman": paoli_schatzman,
}

__all__ = ["SCHEMES", "Settings", "simulate"]


def simulate(
    program: Program,
    kernel: Kernel,
    settings: Settings,
    parameters: Sequence[Number],
    mode: int,
    states: tuple[str, ...],
    x: State,
    watch: Callable[[Progress], None] | None = None,
    compiled: CompiledModel | None = None,
    seconds: Mapping[str, float] | None = None,
) -> Execution:
    """Run a program from mode and state ``x`` at t = 0, by the compiled loop where ``compiled`` is given.

    ``watch`` is given the recorder before the run starts, so that another thread can show how far it is.
    An interrupt (Ctrl-C) ends the run with what was computed. ``seconds`` is what was spent before.
    """
    spent = dict(seconds or {})
    timeline = make_timeline(program, kernel, parameters, settings.until)
    degree = settings.method.degree if settings.method else 0
    recorder = Recorder(kernel.arithmetic, settings.until, degree, len(program.outputs))
    run = Run(program, kernel, timeline, settings, make_control(settings, kernel.arithmetic), recorder)
    if compiled is not None:
        return _by_compiled_loop(CompiledRun(run, compiled, mode, x), states, spent, watch)
    if watch is not None:
        watch(recorder)
    zero = kernel.arithmetic.zero
    began = time.perf_counter()
    try:
        here = enter(run, mode, states, zero, x, tuple(zero for _ in x))
        stop = SCHEMES[settings.scheme](run, here)
    except KeyboardInterrupt:
        if not recorder.arcs:
            raise
        stop = interrupted(recorder.now)
    spent["simulate"] = time.perf_counter() - began
    return _execution(run, stop, spent, recorder.columns(), recorder.transitions)


def _by_compiled_loop(
    compiled: CompiledRun,
    states: tuple[str, ...],
    spent: dict[str, float],
    watch: Callable[[Progress], None] | None,
) -> Execution:
    if watch is not None:
        watch(compiled)
    began = time.perf_counter()
    stop = compiled.follow()
    spent["simulate"] = time.perf_counter() - began
    columns = execution_columns(compiled.whole, compiled.run.program, states)
    transitions = tuple(transitions_of(compiled.whole, compiled.run.program))
    return _execution(compiled.run, stop, spent, columns, transitions, engine="c")


def _native(value: Any) -> Number:
    """Return a column's number as Python's own (NumPy has its own float)."""
    return float(value) if isinstance(value, np.float64) else value


def _execution(
    run: Run,
    stop: Stop,
    seconds: dict[str, float],
    columns: dict[str, Any],
    transitions: Sequence[Transition],
    engine: str = "python",
) -> Execution:
    program, settings = run.program, run.settings
    last, width = columns["arcs"][-1], len(columns["arcs"][-1].states)
    row = last.last
    final = Point(
        time=_native(columns["times"][row]),
        mode=last.mode,
        jump=last.jump,
        kind=last.kind,
        state={s: _native(v) for s, v in zip(last.states, columns["values"][row][:width], strict=True)},
        outputs={name: _native(v) for name, v in zip(program.outputs, columns["outputs"][row], strict=True)},
    )
    return Execution(
        model=program.path,
        digest=program.digest,
        engine=engine,
        scheme=settings.scheme,
        method=settings.method.name if settings.method else "two-step",
        settings=described(settings),
        stop=stop,
        transitions=tuple(transitions),
        final=final,
        verdict=verdict(transitions, run.recorder) if settings.one_stop is None else Verdict("unknown", NOTES),
        output_function=partial(output_values, run),
        output_names=program.outputs,
        seconds=seconds,
        title=program.title,
        digits=run.arithmetic.digits,
        **columns,
    )


def output_values(run: Run, mode: str, t: Number, x: State) -> State:
    """Outputs at a state of a run, the input taken on the segment that starts at or holds t."""
    index = [m.name for m in run.program.modes].index(mode)
    if len(run.program.modes[index].states) != len(x):
        return (run.arithmetic.functions["nan"],) * len(run.program.outputs)
    return run.kernel.bind(index, run.timeline.at(t).data).outputs(t, *x)


def described(settings: Settings) -> dict[str, Any]:
    """Return the settings that governed the run, by the names of the model file."""
    samples = settings.samples if isinstance(settings.samples, int | None) else list(settings.samples)
    size = {"step": settings.step} if settings.tolerance is None else {"tolerance": settings.tolerance}
    return {
        "until": settings.until,
        **size,
        **({"relaxation": settings.relaxation} if settings.method else {}),
        "max_transitions": settings.max_transitions,
        **({} if samples is None else {"samples": samples}),
    }


def verdict(transitions: Sequence[Transition], recorder: Recorder) -> Verdict:
    """Say what is known of the theorem's hypotheses for this run: what nothing checks yet is said."""
    if recorder.departures:
        return Verdict("left", (*recorder.departures, *recorder.doubts))
    reasons = [*recorder.doubts, "nothing checks yet whether the theorem's hypotheses hold for this run"]
    at_once = [t for t in transitions if t.entry]
    if at_once:
        first = at_once[0]
        reasons.append(
            f"{len(at_once)} transition{'s' * (len(at_once) > 1)} fired at once on entry, the first {first.edge} at "
            f"t = {show(first.time)}: the state entered {first.source} outside its domain"
        )
    return Verdict("unknown", tuple(reasons))
