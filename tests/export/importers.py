"""A tool that imports units for model exchange, with the habits that tools have: when it sets inputs, how it steps."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Signal = Callable[[float, bool], float]  # of time, and whether the value behind a jump is meant
EVERY, EVENTS, ENDS = "at every evaluation", "in event mode", "at ends of steps"
SAME = 1e-11  # of times: what a search for an event ends with, and by which two are one


@dataclass(frozen=True)
class Habit:
    """When inputs are set, the size of steps, and whether steps are of Euler, events located, and steps completed.

    ``jumps`` says whether an input's jumps are events that the tool announces.
    """

    sets: str = EVERY
    step: float = 5e-3
    euler: bool = False
    locates: bool = True
    completes: bool = False
    jumps: bool = True


class Importer:
    """A unit in model exchange whose inputs are signals."""

    def __init__(self, path: str, signals: dict[str, Signal], habit: Habit, jumps: tuple[float, ...] = ()) -> None:
        description: Any = fmpy.read_model_description(path)
        self.three = description.fmiVersion.startswith("3")
        self.references: dict[str, int] = {v.name: v.valueReference for v in description.modelVariables}
        self.unit: Any = fmpy.instantiate_fmu(fmpy.extract(path), description, "ModelExchange")
        self.states, self.indicators = description.numberOfContinuousStates, description.numberOfEventIndicators
        self.signals, self.habit, self.jumps = signals, habit, jumps
        self.time, self.handled, self.ended, self.next = 0.0, 0.0, False, np.inf
        self.rows: list[tuple[float, Vector]] = []  # where states jump: before and behind
        if not self.three:
            self.unit.setupExperiment(startTime=0.0)
        self.unit.enterInitializationMode()
        self.give(0.0, True)
        self.unit.exitInitializationMode()
        self.update()
        self.unit.enterContinuousTimeMode()
        self.x = self.get(self.unit.getContinuousStates, self.states)
        self.known = self.signs(0.0, self.x)

    def get(self, function: Any, count: int) -> Vector:
        values = (ctypes.c_double * max(count, 1))()
        function(values, count)
        return np.array(values[:count])

    def value(self, name: str) -> float:
        getter = self.unit.getFloat64 if self.three else self.unit.getReal
        return getter([self.references[name]])[0]

    def give(self, time: float, behind: bool) -> None:
        setter = self.unit.setFloat64 if self.three else self.unit.setReal
        for name, signal in self.signals.items():
            setter([self.references[name]], [signal(time, behind)])

    def at(self, time: float, x: Vector) -> None:
        """Put time and states in place, and inputs if that is the habit; a jump is not ahead of its event."""
        self.unit.setTime(time)
        if self.habit.sets == EVERY:
            self.give(time, not self.habit.jumps or time == self.handled)
        self.unit.setContinuousStates((ctypes.c_double * self.states)(*x), self.states)

    def slope(self, time: float, x: Vector) -> Vector:
        self.at(time, x)
        function = self.unit.getContinuousStateDerivatives if self.three else self.unit.getDerivatives
        return self.get(function, self.states)

    def signs(self, time: float, x: Vector) -> Vector:
        self.at(time, x)
        return self.get(self.unit.getEventIndicators, self.indicators) > 0

    def stepped(self, time: float, x: Vector, h: float) -> Vector:
        """One step of Euler or of the classical method of order four."""
        k = self.slope(time, x)
        if self.habit.euler:
            return x + h * k
        total = k
        for share, weight in ((0.5, 2), (0.5, 2), (1.0, 1)):
            k = self.slope(time + share * h, x + share * h * k)
            total = total + weight * k
        return x + h / 6 * total

    def update(self) -> None:
        answer = self.unit.updateDiscreteStates() if self.three else self.unit.newDiscreteStates()
        _, self.ended, _, _, defined, time = answer
        self.next = time if defined else np.inf

    def event(self) -> None:
        """Handle an event at the present time."""
        self.handled = self.time
        self.unit.enterEventMode()
        if self.habit.sets != ENDS or self.time in self.jumps:
            self.give(self.time, True)
        self.update()
        self.unit.enterContinuousTimeMode()
        before, self.x = self.x, self.get(self.unit.getContinuousStates, self.states)
        self.rows.append((self.time, np.concatenate((before, self.x))))
        self.known = self.signs(self.time, self.x)

    def located(self, start: float, x: Vector, end: float) -> float:
        """The first time, behind it, at which an indicator has another sign."""
        low, high = start, end
        while high - low > SAME * max(1.0, high):
            middle = (low + high) / 2
            if np.array_equal(self.signs(middle, self.stepped(start, x, middle - start)), self.known):
                low = middle
            else:
                high = middle
        return high

    def go_to(self, until: float, most: int = 20_000) -> None:
        """Run until a time, by at most so many steps."""
        for _ in range(most):
            if self.ended or self.time >= until - SAME:
                return
            start, x = self.time, self.x
            stops = [
                t for t in (*self.jumps, self.next, until) if t > start + SAME and (self.habit.jumps or t == until)
            ]
            end = next((t for t in stops if abs(t - start - self.habit.step) < SAME), start + self.habit.step)
            end = min(end, self.next, *stops)
            if not np.array_equal(self.signs(start, x), self.known):  # an input that was set behind the last step
                self.event()
                continue
            self.x = self.stepped(start, x, end - start)
            found = not np.array_equal(self.signs(end, self.x), self.known)
            if found and self.habit.locates:
                end = self.located(start, x, end)
                self.x = self.stepped(start, x, end - start)
            self.time = end
            self.at(end, self.x)
            if self.habit.sets == ENDS:
                self.give(end, end not in self.jumps)
            if self.habit.completes:
                self.unit.completedIntegratorStep()
            if found or end == self.next or end in self.jumps or self.habit.sets == EVENTS:
                self.event()
        raise AssertionError(f"expected {until} to be reached, got to {self.time}")

    def counted(self, name: str) -> list[float]:
        """The times at which a state that counts has counted, each as often as it did."""
        place = self.references[name] - 1  # behind time
        changes = [(time, round(row[place + self.states] - row[place])) for time, row in self.rows]
        return [time for time, count in changes for _ in range(count)]
