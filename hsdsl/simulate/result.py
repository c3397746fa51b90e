"""What a run has written, as an execution."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hsdsl.arithmetic import Number
from hsdsl.execution import Arc, Array, Execution, Point, Stop, Verdict
from hsdsl.integrators.stepper import State
from hsdsl.runtime.sampling import Sampler
from hsdsl.simulate import notes
from hsdsl.simulate.chunks import arcs_of, transitions_of
from hsdsl.simulate.compiled import CompiledPlan
from hsdsl.simulate.run import Run
from hsdsl.simulate.settings import Settings

COLUMNS = ("times", "values", "outputs", "depth", "coefficients")


def from_recorder(run: Run, stop: Stop, seconds: dict[str, float]) -> Execution:
    """Make the execution of what the Python loop has recorded."""
    columns, transitions = run.recorder.columns(), tuple(run.recorder.transitions)
    execution = Execution.deferred(
        {"verdict": _verdict},
        **_about(run, stop, seconds, "python"),
        settings=described(run.settings, run.program.left_out),
        transitions=transitions,
        final=_final(columns["arcs"][-1], columns, run.program.outputs),
        **columns,
    )
    execution.check()
    return execution


@dataclass(frozen=True, eq=False)
class Written:
    """What the compiled loop has written."""

    run: Run
    plan: CompiledPlan
    whole: dict[str, Array]

    def execution(self, stop: Stop, seconds: dict[str, float]) -> Execution:
        """Make the execution: its arrays now, what is made of objects when it is first asked for.

        Of a short run those objects would take longer than the run.
        """
        whole = self.whole
        about, arrays = _about(self.run, stop, seconds, "c"), {name: whole[name] for name in COLUMNS}
        layouts, arcs, found = self.plan.layouts, whole["arc"], None
        if layouts.one:
            about["states"] = layouts.kinds[0]
        else:
            found = layouts.of_arcs(arcs["mode"])
            about["states"] = layouts.names(found)
            _trim(arrays, layouts.width(found))
        sampler = Sampler(self.plan.sampled, arrays, arcs, layouts.kinds, found)
        return Execution.deferred(self._later(), sampler=sampler, **about, **arrays)

    def _later(self) -> dict[str, Callable[[Execution], Any]]:
        return {
            "settings": lambda _: described(self.run.settings, self.run.program.left_out),
            "transitions": lambda _: tuple(transitions_of(self.whole, self.run.program)),
            "arcs": lambda _: self._arcs(),
            "final": self._final,
            "verdict": _verdict,
        }

    def _arcs(self) -> tuple[Arc, ...]:
        return tuple(arcs_of(self.whole, self.run.program, self.plan.layouts))

    def _final(self, execution: Execution) -> Point:
        return _final(execution.arcs[-1], self.whole, execution.output_names)


def _trim(arrays: dict[str, Array], width: int) -> None:
    """Cut arrays to as many states as the largest mode has that the run was in."""
    if width < arrays["values"].shape[1]:
        for name in ("values", "coefficients"):
            arrays[name] = np.ascontiguousarray(arrays[name][..., :width])


def _about(run: Run, stop: Stop, seconds: dict[str, float], engine: str) -> dict[str, Any]:
    program, method = run.program, run.settings.method
    return {
        "model": program.path,
        "digest": program.digest,
        "engine": engine,
        "scheme": run.settings.scheme,
        "method": method.name if method else "two-step",
        "stop": stop,
        "output_function": partial(output_values, run),
        "assessment": partial(_assessment, run),
        "output_names": program.outputs,
        "seconds": seconds,
        "title": program.title,
        "digits": run.arithmetic.digits,
    }


def _native(value: Any) -> Number:
    """Return a column's number as Python's own (NumPy has its own float)."""
    return float(value) if isinstance(value, np.float64) else value


def _final(last: Arc, columns: Mapping[str, Any], outputs: tuple[str, ...]) -> Point:
    row, width = last.last, len(last.states)
    return Point(
        time=_native(columns["times"][row]),
        mode=last.mode,
        jump=last.jump,
        kind=last.kind,
        state={s: _native(v) for s, v in zip(last.states, columns["values"][row][:width], strict=True)},
        outputs={name: _native(v) for name, v in zip(outputs, columns["outputs"][row], strict=True)},
    )


def output_values(run: Run, mode: str, t: Number, x: State) -> State:
    """Outputs at a state of a run, the input taken on the segment that starts at or holds t."""
    index = [m.name for m in run.program.modes].index(mode)
    if len(run.program.modes[index].states) != len(x):
        return (run.arithmetic.functions["nan"],) * len(run.program.outputs)
    return run.kernel.bind(index, run.timeline.at(t).data).outputs(t, *x)


def described(settings: Settings, left_out: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the settings that governed the run, by the names of the model file, and what was left out of it."""
    samples = settings.samples if isinstance(settings.samples, int | None) else list(settings.samples)
    size = {"step": settings.step} if settings.tolerance is None else {"tolerance": settings.tolerance}
    return {
        "until": settings.until,
        **size,
        **({"relaxation": settings.relaxation} if settings.method else {}),
        "max_transitions": settings.max_transitions,
        **({} if samples is None else {"samples": samples}),
        **({} if settings.method_chosen is None else {"method_chosen": settings.method_chosen}),
        **({"left_out": {"states": list(left_out), "reason": notes.LEFT_OUT}} if left_out else {}),
    }


def _verdict(execution: Execution) -> Verdict:
    assert execution.assessment is not None
    return execution.assessment(execution, None)


def _assessment(run: Run, execution: Execution, error: Mapping[str, Number] | None) -> Verdict:
    if run.settings.one_stop is not None:
        return Verdict("unknown", notes.TWO_STEP)
    from hsdsl.simulate.verdict import Looking, assess  # not every run is asked for it

    return assess(Looking(run, execution, error), run.recorder.departures, run.recorder.doubts)
