"""A stiff two-state model with switching: two exponentials a mode, one of them over within a millionth of a second."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Execution, Verdict
from references.closed_form import ClosedForm, as_execution
from references.interpolation import Number, Stretch, Vector, mp, number

SOURCE = "closed form: two exponentials a mode; its switches by Newton's method in eighty digits"
DEGREE = 8
STATES = {"rising": ("y1", "y2"), "falling": ("y1", "y2")}
MOST_ITERATIONS = 20
CUTS = (0, 4, 8, 16, 32, 64, 128, 256)  # in fast time: between them one bound on derivatives serves


@dataclass(frozen=True)
class Mode:
    """The flow y1' = fast (y2 + shift - y1), y2' = slow (goal - y2), up or down to ``level``."""

    name: str
    edge: str
    fast: Number
    slow: Number
    shift: Number
    goal: Number
    level: Number


@dataclass(frozen=True)
class Solution:
    """The solution of a mode: y1 = shift + goal + lagging exp(-slow s) + gone exp(-fast s), s the time since ``start``.

    y2 is goal + left exp(-slow s).
    """

    mode: Mode
    start: Number
    left: Number
    lagging: Number
    gone: Number

    @staticmethod
    def of(mode: Mode, start: Number, x: Vector) -> Solution:
        """Solve from a state."""
        left = x[1] - mode.goal
        lagging = left * mode.fast / (mode.fast - mode.slow)
        return Solution(mode, start, left, lagging, x[0] - mode.shift - mode.goal - lagging)

    def __call__(self, t: Number) -> Vector:
        """The state at a time."""
        slowly, fast = (mp.exp(-rate * (t - self.start)) for rate in (self.mode.slow, self.mode.fast))
        goal = self.mode.goal
        return self.mode.shift + goal + self.lagging * slowly + self.gone * fast, goal + self.left * slowly

    def switch(self) -> Number:
        """When y1 is at the level: Newton's method from where it would be without the fast part."""
        mode = self.mode
        s = mp.log(self.lagging / (mode.level - mode.shift - mode.goal)) / mode.slow
        for _ in range(MOST_ITERATIONS):
            slowly, fast = mp.exp(-mode.slow * s), mp.exp(-mode.fast * s)
            off = mode.shift + mode.goal + self.lagging * slowly + self.gone * fast - mode.level
            change = off / (mode.slow * self.lagging * slowly + mode.fast * self.gone * fast)
            s = s + change
            if abs(change) <= mp.eps * 16:
                break
        return self.start + s

    def stretches(self, end: Number, last: Vector, edge: str | None) -> Iterator[Stretch]:
        """The solution up to ``end``, where ``edge`` goes, cut so that each part has a bound on derivatives."""
        cuts = [self.start + k / self.mode.fast for k in CUTS]
        for begin, until in pairwise([*(t for t in cuts if t < end), end]):
            is_last = until == end
            yield Stretch(
                self.mode.name,
                begin,
                until,
                self(begin),
                last if is_last else self(until),
                self,
                self._bounds(begin),
                edge if is_last else None,
            )

    def _bounds(self, begin: Number) -> Any:
        slowly, fast = (mp.exp(-rate * (begin - self.start)) for rate in (self.mode.slow, self.mode.fast))

        def bounds(n: int) -> Vector:
            slow = self.mode.slow**n * slowly
            return abs(self.lagging) * slow + abs(self.gone) * self.mode.fast**n * fast, abs(self.left) * slow

        return bounds


def stiff_switch(
    y1: Any = "4.2",
    y2: Any = "0.3",
    *,
    fast: Any = 2_700_000,
    slow: Any = "3.5651205",
    high: Any = "5.8",
    low: Any = "2.5",
    until: Any = 5,
) -> Execution:
    """The two-state model of ARGESIM benchmark C5, starting in mode ``rising``, exactly.

    In mode ``rising`` y1' = fast (y2 + 0.4 - y1) and y2' = slow (5.5 - y2) until y1 rises to ``high``; in ``falling``
    the constants are -0.3 and 2.73, until y1 falls to ``low``.

    Parameters
    ----------
    y1, y2, fast, slow, high, low : int, float or str
        The start, with y1 below ``high`` and y2 below ``high`` - 0.4; rates with ``fast`` at least 1000 times ``slow``;
        levels with 2.43 < ``low`` < ``high`` < 5.9, at least 1 apart. Text is taken as decimals, exactly.
    until : int, float or str
        End of the execution.

    Returns
    -------
    Execution
        In modes ``rising`` and ``falling`` with states ``y1`` and ``y2``; ``settings["error"]`` bounds its error at any
        time. In the fast decay behind a switch that is mostly what half a unit in the last place of its time makes.

    Raises UsageError: a number is out of range.
    """
    named = {"y1": y1, "y2": y2, "fast": fast, "slow": slow, "high": high, "low": low, "until": until}
    given = {name: number(value, name) for name, value in named.items()}
    start, end = (given["y1"], given["y2"]), given["until"]
    rates, levels = (given["fast"], given["slow"]), (given["low"], given["high"])
    apart = mp.mpf("2.43") < levels[0] <= levels[1] - 1 and levels[1] < mp.mpf("5.9")
    below = start[0] < levels[1] and start[1] < levels[1] - mp.mpf("0.4")
    if not (apart and below and rates[1] > 0 and rates[0] >= 1000 * rates[1] and end >= 0):
        raise UsageError(
            "the two-state model needs y1 < high, y2 < high - 0.4, 2.43 < low <= high - 1, high < 5.9, "
            "0 < slow <= fast/1000 and until not below 0"
        )
    rising = Mode("rising", "switch_down", *rates, mp.mpf("0.4"), mp.mpf("5.5"), levels[1])
    falling = Mode("falling", "switch_up", *rates, mp.mpf("-0.3"), mp.mpf("2.73"), levels[0])
    slowest = rates[1] * min(mp.mpf("5.9") - levels[1], levels[0] - mp.mpf("2.43"))
    verdict = Verdict("holds", (f"every switch is crossed at a rate of about {float(slowest):.4g} or more",))
    found = list(_stretches((rising, falling), start, end))
    title = "Stiff two-state model with switching"
    scene = ClosedForm("stiff-switch.yaml", title, SOURCE, STATES, found, verdict, DEGREE)
    return as_execution(scene)


def _stretches(modes: tuple[Mode, Mode], x: Vector, until: Number) -> Iterator[Stretch]:
    start, (mode, other) = mp.mpf(0), modes
    while True:
        solution = Solution.of(mode, start, x)
        end = solution.switch()
        if end > until:
            yield from solution.stretches(until, solution(until), None)
            return
        x = mode.level, solution(end)[1]
        yield from solution.stretches(end, x, mode.edge)
        start, mode, other = end, other, mode
