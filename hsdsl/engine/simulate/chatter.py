"""Steps that go to and fro across a jump of the flow: how they are noticed, and where the flow jumps."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.integrators.stepper import Flow, State

MOST_CHATTER = 2000  # a step that turns the flow around counts 2, any other takes 1 back
JUMP_HALVINGS = 40  # of the way between two states: what changes as much over the last of them jumps


@dataclass
class Chatter:
    """Counts steps at whose end a component of the flow has the other sign than at their start."""

    count: int = 0

    def across(self, flow: Flow, t: Number, x: State, slope: State, t1: Number, z: State, end: State) -> bool:
        """Count a step; say whether it is one of very many across a jump. Smooth flows that turn around are none."""
        turns = any(a * b < 0 for a, b in zip(slope, end, strict=True))
        self.count = self.count + 2 if turns else max(0, self.count - 1)
        if self.count < MOST_CHATTER:
            return False
        self.count = 0
        return any(a * b < 0 and jumps(flow, k, t, x, t1, z) for k, (a, b) in enumerate(zip(slope, end, strict=True)))


def jumps(flow: Flow, k: int, t: Number, x: State, t1: Number, z: State) -> bool:
    """Whether component k of the flow jumps on the way from (t, x) to (t1, z)."""
    return jump_between(flow, k, t, x, t1, z) is not None


def jump_between(flow: Flow, k: int, t: Number, x: State, t1: Number, z: State) -> tuple[State, Number, Number] | None:
    """Return the state at which component k of the flow jumps, and its values before and behind that; None if not."""

    def at(s: Number) -> tuple[State, Number]:
        point = tuple(a + s * (b - a) for a, b in zip(x, z, strict=True))
        return point, flow(t + s * (t1 - t), *point)[k]

    try:
        low, high = t * 0, t * 0 + 1
        (_, before), (point, behind) = at(low), at(high)
        size = abs(behind - before)
        for _ in range(JUMP_HALVINGS):
            middle = (low + high) / 2
            q, value = at(middle)
            if abs(value - before) >= abs(behind - value):
                high, behind, point = middle, value, q
            else:
                low, before = middle, value
    except DOMAIN_ERRORS:
        return None
    return (point, before, behind) if size > 0 and 2 * abs(behind - before) >= size else None
