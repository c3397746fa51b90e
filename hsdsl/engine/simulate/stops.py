"""How runs end, in sentences: one place for every loop."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from hsdsl.base.defaults import MOST_WAITING
from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.execution import Stop
from hsdsl.mathematics.program import EdgeProgram, ModeProgram

LEFT, ENTERED = "leaves it, and no transition is possible there", "was entered outside it"


def show(x: Any) -> str:
    """Write a number for a person."""
    try:
        return f"{float(x):.10g}"
    except OverflowError:
        return f"{x!s:.24}"


@lru_cache(maxsize=64, typed=True)
def reached(t: Number) -> Stop:
    """The end of the experiment; many runs end alike."""
    return Stop("until", t, f"reached t = {show(t)}")


def reached_in_strip(t: Number, edge: str, on_guard: bool = False) -> Stop:
    """The end of the experiment while the state waits, or as it reaches a guard."""
    where = f"{edge} (on its guard)" if on_guard else edge
    return Stop("until", t, f"reached t = {show(t)} inside the strip of {where}, mode unchanged")


def entered_final(mode: str, t: Number) -> Stop:
    """A mode marked final."""
    return Stop("final", t, f"entered final mode {mode} at t = {show(t)}")


def endless(mode: str, t: Number) -> Stop:
    """Transitions on entry that return to where they began."""
    return Stop("zeno", t, f"at t = {show(t)} transitions return to the same state in mode {mode} without end")


def limit(most: int, t: Number) -> Stop:
    """As many transitions as the run may make."""
    return Stop("transition_limit", t, f"made max_transitions = {most} transitions by t = {show(t)}")


def too_many_wait(mode: ModeProgram, full: str, t: Number) -> Stop:
    """As many delayed executions of an event as may wait, and one more."""
    queue = next(queue for queue in mode.queues if queue.name == full)
    event = full.partition("@")[0]
    capped = queue.most < MOST_WAITING
    more = "allow more with its `waiting`" if capped else "its condition turns true too often for its delay"
    return Stop("waiting_limit", t, f"at t = {show(t)} more than {queue.most} executions of {event} wait: {more}")


def memory(most: int, t: Number) -> Stop:
    """As many rows as the run may keep."""
    full = f"the rows up to t = {show(t)} fill the {most:.3g} bytes that a run may keep (limit 'memory')"
    longer = "take longer steps (by a larger tolerance, or by --method radau where a mode is stiff)"
    ways = f"{longer}, stream the rows to a file, or allow more with --limit memory={10 * most:.0e}"
    return Stop("memory_limit", t, f"{full}: {ways}")


def reset_not_finite(edge: EdgeProgram, t: Number) -> Stop:
    """A reset without a value."""
    texts = ", ".join(f"{s} = {text}" for s, text in zip(edge.target_states, edge.reset_texts, strict=True))
    return Stop("not_finite", t, f"the reset of {edge.name} ({texts}) has no finite value at t = {show(t)}")


def interrupted(t: Number) -> Stop:
    """Ctrl-C."""
    return Stop("interrupted", t, f"interrupted at t = {show(t)}; what was computed is kept")


def left_domain(mode: ModeProgram, surface: int, t: Number, how: str) -> Stop:
    """A wall (the paper's n' = infinity)."""
    wall = mode.walls[surface - len(mode.edges)]
    return Stop("left_domain", t, f"the domain of mode {mode.name} ends at {wall}: at t = {show(t)} the state {how}")
