"""The row counts at which the method of a run that is under way is judged again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from hsdsl.base.numbers.arithmetic import Number

FIRST = 2048  # rows

# what is found of the mode of this number at a time and a state, for steps of this mean length; None lets the run go on
Judge = Callable[[int, Number, Sequence[Number], Number], Any]


class Judged(Exception):
    """The judge's ``finding``, which ends the run; `hsdsl.engine.simulate.plan` hands it to who has asked."""

    def __init__(self, finding: Any) -> None:
        super().__init__(finding)
        self.finding = finding


@dataclass
class Review:
    """When a run is looked at again: after its first rows, then whenever it has more than twice as many.

    Looks are at exact numbers of rows, so that every engine judges the same states. ``due`` is the next one.
    """

    judge: Judge
    due: int = FIRST
    _rows: int = 0
    _time: Number = 0

    def look(self, mode: int, t: Number, x: Sequence[Number]) -> None:
        """Judge the last of the rows that are due.

        Raises Judged: there is a finding.
        """
        finding = self.judge(mode, t, x, (t - self._time) / (self.due - self._rows))
        if finding is not None:
            raise Judged(finding)
        self._rows, self._time, self.due = self.due, t, 2 * self.due + FIRST
