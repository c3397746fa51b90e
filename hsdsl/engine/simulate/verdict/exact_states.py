"""States that a run knows exactly, as counters, levels and the memory of events: no error of the flow reaches them.

A state without a flow has the value that a reset gave it. Where that reset has one value over all states and times that
the errors of the others allow, and rounds nothing to get it, the state has no error.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, FLOAT64
from hsdsl.base.numbers.bernstein import Array
from hsdsl.base.numbers.enclosures import Range, Undecided, as_range
from hsdsl.engine.execution import Transition
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.simulate.verdict.agreement import SAFE, Errors

if TYPE_CHECKING:
    from hsdsl.engine.simulate.verdict.run_view import RunView


def exactly_known(run: RunView, errors: Errors, wrong: Array) -> NDArray[np.bool_]:
    """Return which states are known exactly, the others being ``wrong`` by so much; both of shape (rows, states)."""
    known = np.zeros(wrong.shape, dtype=bool)
    still = _without_flow(run)
    if not still or run.arithmetic is not FLOAT64:
        return known
    names = [_at_start(run, still)]  # before each transition
    for arc in run.execution.arcs:
        while len(names) <= arc.jump:
            names.append(_behind(run, errors, wrong, run.transitions[len(names) - 1], names, still))
        known[arc.first : arc.last + 1, [errors.columns[name] for name in names[-1]]] = True
    return known


def _without_flow(run: RunView) -> frozenset[str]:
    """The states that flow in no mode."""
    modes = run.problem.program.modes
    moving = {name for mode in modes for name, still in zip(mode.states, mode.still, strict=True) if not still}
    return frozenset(run.execution.states) - moving


def _at_start(run: RunView, still: frozenset[str]) -> frozenset[str]:
    """Those that begin with a number which is not rounded."""
    problem = run.problem
    parameters = [
        Range(float(p), float(p)) for p in problem.timeline.at(run.times[0]).data[: len(problem.program.parameters)]
    ]
    try:
        values = problem.kernel.enclosing.constant("initial", parameters)
    except (Undecided, *DOMAIN_ERRORS):
        return frozenset()
    given = dict(zip(problem.program.initial_states, values, strict=True))
    return frozenset(
        name for name, x in zip(problem.states, problem.x, strict=True) if name in still and _is(given.get(name), x)
    )


def _behind(
    run: RunView,
    errors: Errors,
    wrong: Array,
    made: Transition,
    before: Sequence[frozenset[str]],
    still: frozenset[str],
) -> frozenset[str]:
    """Those that are known behind a transition, where those of ``before`` were before it and all that came earlier."""
    if made.after is None:
        return frozenset()
    place, k = run.before(made)
    edge, chain = place.mode.edges[k], run.cascade(made)
    changed = {edge.target_states[i] for i in edge.changes} & still

    def error(index: int) -> State:
        at, row = run.before(run.transitions[index])[0], run.row_before(run.transitions[index])
        return tuple(0.0 if x in before[index] else SAFE * wrong[row, errors.columns[x]] for x in at.mode.states)

    names = before[made.index] - changed
    if changed:
        late = SAFE * errors.time_error_at(made.time)
        try:
            values = place.enclosing().resets[k](*place.box(error(made.index), late))
            results = zip(edge.target_states, values, made.after.values(), strict=True)
            known = {name for name, value, x in results if name in changed and _is(value, x)}
            names |= known | {x for x in changed - known if run.remembered_alike(chain, [x], error(chain[0].index))}
        except (Undecided, *DOMAIN_ERRORS):
            pass
    return (names - _taken_from_queues(run, made)) & frozenset(made.after)


def _taken_from_queues(run: RunView, made: Transition) -> set[str]:
    """The times and values of executions that were behind the first before a transition, and are the first after it."""
    target, after = run.problem.program.modes[run.index(made.target)], made.after or {}
    counts = ((queue, target.states[queue.waiting]) for queue in target.queues)
    made_one = (queue for queue, name in counts if 1 <= after.get(name, 0) < made.before.get(name, 0))
    return {target.states[i] for queue in made_one for i in queue.values}


def _is(value: Any, x: Any) -> bool:
    """Whether a range is one number, and which."""
    found = as_range(value)
    return bool(found.low == found.high == x)
