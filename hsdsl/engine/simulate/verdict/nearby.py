"""States near those of a run, moved along the guard that was crossed, and where transitions take them."""

from __future__ import annotations

from collections.abc import Sequence

from hsdsl.base.names import remembered_state, without_memory
from hsdsl.engine.execution import Transition
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.simulate.verdict.place import Place
from hsdsl.engine.simulate.verdict.recorded_run import RecordedRun

FOLLOWED = 16  # transitions at one instant


def landed(run: RecordedRun, chain: Sequence[Transition], x: State) -> Place:
    """Where a state lands that makes some transitions."""
    tails = run.tails_before(chain[0]).copy()
    for made in chain:
        x = run.landed(made, tails, x)
    return run.place(chain[-1].target, chain[-1].time, x)


def landed_nearby(run: RecordedRun, chain: Sequence[Transition], error: State) -> list[Place]:
    """Where states land that an error moves along the guard of the first of some transitions; none of too many."""
    before, edge = run.before(chain[0])
    near = before.moved_by(error) if chain[0].entry else before.along_guard(edge, error)
    return [landed(run, chain, x) for x in near] if len(chain) <= FOLLOWED else []


def remembered_alike(run: RecordedRun, chain: Sequence[Transition], names: Sequence[str], error: State) -> bool:
    """Whether some states are memory of events that is the same behind transitions from all states nearby."""
    target = run.problem.program.modes[run.index(chain[-1].target)]
    waiting = {target.states[i] for queue in target.queues for i in queue.values}  # times and values that have errors
    if without_memory(names) or any(map(remembered_state, names)) or waiting.intersection(names):
        return False
    near = (dict(zip(at.mode.states, at.x, strict=True)) for at in landed_nearby(run, chain, error))
    return len({tuple(x[name] for name in names) for x in near}) == 1
