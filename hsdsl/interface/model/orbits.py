"""Periodic orbits of a model, from sections and guesses of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.orbits.continuation import CIRCLE, Branch, Follower, branch
from hsdsl.analysis.orbits.mathematics import PHASE, Level, forced, forcing_period, level_of, quantity, shifted
from hsdsl.analysis.orbits.orbit import Orbit, judged, multipliers_of, returning
from hsdsl.analysis.orbits.section import (
    COARSER,
    LONGER,
    Closed,
    NoReturn,
    NotClosed,
    Return,
    Section,
    closed,
    without_noise,
)
from hsdsl.analysis.sensitivity.result import Sensitivity
from hsdsl.base.errors import UsageError
from hsdsl.base.names import counted, did_you_mean, without_memory
from hsdsl.base.numbers.arithmetic import TIE
from hsdsl.base.parts import meant_alone, numbers_of, written_edges
from hsdsl.engine.execution import Execution
from hsdsl.engine.preparation.options import check_arguments, overrides_of
from hsdsl.engine.preparation.pipeline import Pipeline
from hsdsl.engine.preparation.values import whole, with_parameters
from hsdsl.interface.model.differentiate import FINEST, LOCATED_ALONE, located_arguments

if TYPE_CHECKING:
    from hsdsl.engine.execution import Array
    from hsdsl.interface.model.runs import Runs


MOST_GUESSES = 6
MOST_NAMED = 4  # transitions in a hint
MOST_OFFERED = 8  # states of a start in a hint
ENOUGH = 16  # times as many transitions as the guess makes, in a lap that another one is looked for
SHORTER = "passages become ever shorter, so the execution ends in a point"
NO_TIME = "Newton's method goes to where a passage takes no time"
CLOSER = "begin closer to it with --set initial.NAME=VALUE, or try more laps"
COMPLETE = (
    f"{CLOSER}; where the run moves along a guard, give it the model that `hsdsl complete` writes, with "
    "--set contact_time=1e-4"
)
SHRUNK = 1e-6  # a period below this share of the guess is none


Entered = tuple[str, tuple[str, ...]]
Progress = Callable[[int, float | None], None]


@dataclass(frozen=True)
class Guess:
    """A state after a transition of the section, at a time, and how long it took to come back.

    ``entered`` has its mode and the states of that, ``sizes`` the largest sizes that states have nearby, ``most`` how
    many transitions are made there.
    """

    point: Array
    phase: float
    time: float
    entered: Entered
    sizes: Mapping[str, float] = field(default_factory=dict[str, float])
    most: int = 0


class Orbits:
    """The orbits of a model through one section, with the arguments of its runs."""

    def __init__(
        self,
        model: Runs,
        section: str,
        laps: int,
        period: Any,
        progress: Progress | None,
        arguments: Mapping[str, Any],
        keep: str | None = None,
    ) -> None:
        check_arguments(arguments, "an orbit", LOCATED_ALONE)
        self.model, self.laps, self.arguments = model, whole(laps, "laps", 1), dict(arguments)
        names = [edge.name for mode in model.program.modes for edge in written_edges(mode.edges)]
        if section not in names:
            hint = did_you_mean(section, names)
            if section in model.columns:
                hint = "a section is a transition, by its name; " + (hint or "")
            raise UsageError(f"the model has no transition '{section}'", hint)
        self.edge = section
        given = overrides_of(arguments, "parameters", model.program)
        values = model.pipeline.values(parameters=given)
        self._parameters = {name: values.parameters[model.program.parameters.index(name)] for name in given}
        self.forced = forced(model.system)
        if period is not None and not self.forced:
            raise UsageError("the model does not depend on time, so its forcing has no period")
        self._period = period
        self._phase = PHASE if self.forced else None
        self._moving: Runs = type(model)(Pipeline(shifted(model.system))) if self.forced else model
        self._stiff = False
        self._progress, self._runs, self._followed = progress, 0, ""
        self._guess: Guess | None = None
        self._keep = keep
        self._first: Execution | None = None

    def _level(self, guess: Guess, parameters: Mapping[str, Any]) -> Level | None:
        """The level that an orbit near a guess is to be on."""
        if self._keep is None:
            return None
        name, states = guess.entered
        system = self.model.system
        mode = system.modes[0] if self.model.program.parts else next(m for m in system.modes if m.name == name)
        values = self.model.pipeline.values(parameters=parameters)
        expr = quantity(system, mode, states, self._keep)
        first = self._first
        begins = first is not None and first.arcs[0].mode == name  # its start has the value of the level
        start = first.values[0][: len(states)].astype(float) if first and begins else guess.point
        return level_of(expr, self._keep, states, values.evaluate, start)

    def forcing(self, parameters: Mapping[str, Any]) -> float | None:
        """The period of the forcing with these parameters."""
        if not self.forced:
            return None
        values = self.model.pipeline.values(parameters=parameters)
        if self._period is not None:
            found = float(values.number(self._period, "period"))
        else:
            found = abs(float(values.evaluate({"period": forcing_period(self.model.system)})["period"]))
        if not found > 0:
            raise UsageError(f"the period of the forcing must be positive, not {found:g}")
        return found

    def section(self, parameters: Mapping[str, Any], tolerance: float | None = None) -> Section:
        """The section and its map with these parameters."""
        mode, states = self._entered()
        arguments = {k: v for k, v in self.arguments.items() if k not in ("until", "initial", "parameters")}
        if tolerance is not None:
            arguments["tolerance"] = tolerance
        elif arguments.get("tolerance") is None and not self._stiff:
            arguments["tolerance"] = FINEST

        def run(start: Mapping[str, float], phase: float, until: float, most: int, wrt: Sequence[str]) -> Sensitivity:
            given = dict(parameters) | ({self._phase: phase} if self._phase else {})
            call: dict[str, Any] = {"max_transitions": most, **arguments}
            self._runs += 1
            if self._progress:
                self._progress(self._runs, parameters.get(self._followed))
            return self._moving.sensitivity(wrt, until=until, initial={"mode": mode, **start}, parameters=given, **call)

        parts, near = self.model.program.parts, self._guess
        assert near is not None
        numbers = numbers_of(parts, mode) if parts else {}
        sizes = np.array([near.sizes.get(x, 0.0) for x in states])
        most = ENOUGH * (near.most + 1)
        return Section(self.edge, mode, states, self.laps, self._phase, run, numbers, sizes, most)

    def _entered(self) -> Entered:
        """The mode and the states that a lap begins with; after a final mode without a flow, those of the start."""
        if self._guess is not None:
            return self._guess.entered
        program = self.model.program
        edge = next(edge for edge in program.edges if edge.name == self.edge)
        target = program.modes[edge.target]
        if not target.final:
            return target.name, target.states
        start = program.modes[program.initial_mode]
        if set(start.states) - set(edge.target_states):
            raise UsageError(
                f"{self.edge} leads to the final mode {target.name}, whose states are not those of the start",
                "choose a section whose transition the execution goes on from",
            )
        return start.name, start.states

    def guesses(self, run: Execution) -> list[Guess]:
        """States after the section's transitions in a run, those first that a lap changes least."""
        passed = [made for made in run.transitions if made.edge == self.edge and made.after is not None]
        parts = self.model.program.parts
        places = [(made.target, tuple(made.after or {})) if parts else self._entered() for made in passed]
        points = [np.array([(made.after or {})[x] for x in states], float)
                  for made, (_, states) in zip(passed, places, strict=True)]  # fmt: skip
        times = [float(made.time) for made in passed]
        found: list[tuple[float, Guess]] = []
        for k, place in enumerate(places[: -self.laps]):
            if places[k + self.laps] == place:
                alike = [point for other, point in zip(places, points, strict=True) if other == place]
                size = np.max(np.abs(alike), axis=0)
                moved = np.abs(points[k + self.laps] - points[k]) / np.where(size > 0, size, 1.0)
                change = float(np.max(moved, initial=0.0))
                found.append((change, Guess(points[k], times[k], times[k + self.laps] - times[k], place)))
        first = run.arcs[0]
        if places and first.mode == places[0][0]:  # the run may begin on the orbit
            start = np.array(run.values[0][: len(places[0][1])], float)
            found.append((np.inf, Guess(start, 0.0, times[0], places[0])))
        if len(points) == 1:
            found.append((np.inf, Guess(points[0], times[0], times[0], places[0])))
        least = run.settings["until"] * TIE
        lasting = [(change, guess) for change, guess in found if guess.time > least]
        return [_with_sizes(guess, run) for _, guess in sorted(lasting, key=lambda each: each[0])[:MOST_GUESSES]]

    def find(self) -> Orbit:
        """Find the orbit that the model's own run comes closest to.

        Raises UsageError: the run does not pass the section, or no orbit is found.
        """
        run = self.model.simulate(**located_arguments(self.model.pipeline, self.arguments))
        self._stiff, self._first = run.method == "radau", run
        guesses = self.guesses(run)
        ending = "" if run.stop.complete else f"; the run stops at t = {run.times[-1]:g}: {run.stop.message}"
        if not guesses:
            how, hint = self._passes(run)
            end = f"up to t = {run.times[-1]:g}{ending or f' ({run.stop.reason})'}"
            raise UsageError(f"the run {how} {end}", hint)
        problem = ""
        for guess in guesses:
            try:
                return self.shoot(guess, self._parameters)
            except NotClosed as error:
                problem = problem or str(error)
        problem = SHORTER if problem == NO_TIME and self._shortens(run) else problem
        rests = any(mode.held is not None for mode in self.model.program.modes)
        hint = COMPLETE if rests else CLOSER
        hint += f", or at the run's last passage: {offered}" if (offered := self._start(run)) else ""
        raise UsageError(f"no periodic orbit was found near the run: {problem}{ending}", hint)

    def _start(self, run: Execution) -> str:
        """The state after the last passage of the section, as options; nothing where the time counts as well."""
        passed = [made for made in run.transitions if made.edge == self.edge and made.after is not None]
        if self.forced or not passed or self.model.program.parts or self.model.program.modes[0].final:
            return ""
        mode, states = self._entered()
        after = passed[-1].after or {}
        named = [name for name in without_memory(states) if name in after]
        if len(named) > MOST_OFFERED:
            return ""
        sets = ([f"initial.mode={mode}"] if len(self.model.program.modes) > 1 else []) + [
            f"initial.{name}={float(after[name]):.10g}" for name in named
        ]
        return " ".join(f"--set {each}" for each in sets)

    def _passes(self, run: Execution) -> tuple[str, str]:
        """What the run makes of the section where that gives no guess, and a hint."""
        targets = [made.target for made in run.transitions if made.edge == self.edge]
        if len(set(targets)) > 1:
            return f"makes the transition {self.edge} into other modes of parts each time", "try more laps"
        made = list(dict.fromkeys(made.edge for made in run.transitions if made.edge != self.edge))
        other = f"choose another section ({', '.join(made[:MOST_NAMED])})" if made else "choose another section"
        hint = f"{other}, a later end, or other initial values"
        if not targets:
            return f"does not make the transition {self.edge}", hint
        if len(targets) > self.laps:
            return f"makes the transition {self.edge} at one instant only", hint
        hint = f"{counted(self.laps, 'lap')} need {self.laps + 1} of them: choose a later end"
        return f"makes the transition {self.edge} only {counted(len(targets), 'time')}", hint

    def _shortens(self, run: Execution) -> bool:
        """Whether each passage of a run is shorter than the one before it."""
        passed = [float(made.time) for made in run.transitions if made.edge == self.edge]
        lasted = np.diff(passed)
        return len(lasted) > 1 and bool(np.all(np.diff(lasted) < 0))

    def shoot(self, guess: Guess, parameters: Mapping[str, Any]) -> Orbit:
        """Find the orbit near a guess.

        Raises NotClosed: there is none.
        """
        self._guess = guess
        forcing = self.forcing(parameters)
        multiple = None if forcing is None else forcing * max(1, round(guess.time / forcing))
        phase = guess.phase if forcing is None else guess.phase % forcing
        sections = self.section(parameters), self.section(parameters, COARSER)
        level = self._level(guess, parameters)
        found = closed(*sections, guess.point, phase, 1.5 * guess.time, multiple, level)
        if not found.passage.time > SHRUNK * guess.time:
            raise NotClosed(NO_TIME)
        if self.forced is False and _still(found):
            raise NotClosed("it closes where the flow is at rest, so the execution ends in a point")
        return self.judge(found, parameters, forcing)

    def continued(self, parameter: str, start: Any, end: Any) -> Branch:
        """Follow the orbit of the model's run in a parameter; see `Model.continuation`."""
        low, high, value = self._range(parameter, start, end)
        self._parameters = self._parameters | {parameter: value}
        self.arguments["parameters"] = self._parameters
        first, self._followed = self.find(), parameter
        kept = first.closed.level

        def level(at: float) -> Level:
            assert kept is not None and self._guess is not None
            found = self._level(self._guess, self._parameters | {parameter: at})
            assert found is not None
            return found._replace(value=kept.value)

        multiple = None if first.phase is None else round(first.period / (self.forcing(self._parameters) or 1.0))
        lasted = first.period

        def passage(point: Array, phase: float, at: float) -> tuple[Return, float | None, float]:
            nonlocal lasted
            parameters = self._parameters | {parameter: at}
            try:
                found = self.section(parameters).follow(point, phase, 1.5 * lasted, parameter, longer=1)
            except UsageError as error:  # beyond the bounds of the file
                raise NoReturn(str(error)) from None
            if not found.time > SHRUNK * first.period:
                raise NoReturn(SHORTER)
            lasted = found.time if lasted / LONGER < found.time < lasted * LONGER else lasted
            if multiple is None:
                return found, None, 0.0
            step = 1e-6 * abs(high - low)  # within the range, which may end at a bound of the file
            ends = max(at - step, min(at, low, high)), min(at + step, max(at, low, high))
            before, here, behind = (
                multiple * (self.forcing(parameters | {parameter: each}) or 0.0) for each in (ends[0], at, ends[1])
            )
            return found, here, (behind - before) / (ends[1] - ends[0])

        try:
            follower = Follower(passage, first.closed, value, (low, high), level if kept else None)
            parts = [branch(follower, -1.0)]
            lasted = first.period
            parts.append(branch(follower, 1.0) if parts[0][-1] != CIRCLE else (parts[0][0][-1:], [], CIRCLE))
        except NoReturn as error:
            raise UsageError(f"the orbit at {parameter} = {value:g} cannot be followed: {error}") from None
        (back, behind, _), (onward, ahead, _) = parts
        began = len(back) - 1
        points = (*reversed(back), *onward[1:])
        bifurcations = [replace(each, after=began - each.after - 1) for each in reversed(behind)]
        bifurcations += [replace(each, after=began + each.after) for each in ahead]
        ends = tuple(why for *_, why in parts)
        return Branch(self.edge, parameter, self._entered()[1], points, tuple(bifurcations), ends, first)

    def _range(self, parameter: str, start: Any, end: Any) -> tuple[float, float, float]:
        """The ends of a parameter's range, and the value in it that a branch begins at."""
        known = self.model.program.parameters
        if parameter not in known:
            raise UsageError(f"the model has no parameter '{parameter}'", meant_alone(parameter, known))
        values = self.model.pipeline.values(parameters=self._parameters)
        low, high = (float(values.number(value, f"the range of {parameter}")) for value in (start, end))
        if not low != high:
            raise UsageError(f"expected a range of {parameter}, got {low:g} to {high:g}")
        for end in (low, high):
            with_parameters(values, {parameter: end})  # within the bounds of the file
        own = float(values.parameters[known.index(parameter)])
        return low, high, own if min(low, high) <= own <= max(low, high) else low

    def judge(self, found: Closed, parameters: Mapping[str, Any], forcing: float | None) -> Orbit:
        """Say what is known of an orbit."""
        forced, passage = forcing is not None, found.passage
        multipliers = multipliers_of(found, passage.slopes, forced)
        verdict, reason = judged(multipliers, self._error(found, parameters, multipliers, forced))
        breaks = passage.sensitivity.breaks_along(returning(found, forced))
        broken = tuple(why for when, why in breaks if when <= passage.time * (1 + TIE))
        verdict, reasons = "undecided" if broken else verdict, (reason, *broken)
        mode, states = self._entered()
        sides: dict[str, Array] = {}
        sensitivity = found.passage.sensitivity
        for edge, side in (sensitivity.sides if sensitivity.breaks else {}).items():
            passed = [made.index for made in side.execution.transitions if made.edge == self.edge]
            if len(passed) >= self.laps:
                slopes = self.section({}).slopes(side, passed[self.laps - 1], side.wrt, None)
                if not np.isnan(slopes).any():
                    sides[edge] = multipliers_of(found, slopes, forced)
        return Orbit(
            self.edge,
            self.laps,
            mode,
            dict(zip(states, without_noise(found.point, found.sizes).tolist(), strict=True)),
            None if forcing is None else found.phase % forcing,
            passage.time,
            multipliers,
            {states[k]: float(passage.point[k] - found.point[k]) for k in found.symmetry.drifting},
            found.residual,
            verdict,
            reasons,
            sides,
            dict(parameters),
            found,
        )

    def _error(self, found: Closed, parameters: Mapping[str, Any], multipliers: Array, forced: bool) -> float:
        """How far the largest multiplier moves with a coarser tolerance."""
        try:
            again = self.section(parameters, COARSER).follow(found.point, found.phase, 1.5 * found.passage.time)
        except NoReturn:
            return float("inf")
        other = multipliers_of(found, again.slopes, forced)
        return abs(float(np.abs(other[0])) - float(np.abs(multipliers[0]))) if len(multipliers) else 0.0


def _with_sizes(guess: Guess, run: Execution) -> Guess:
    """A guess with what the run does from a lap before it to a lap after it."""
    start, end = guess.phase - guess.time, guess.phase + guess.time
    made = sum(start <= float(each.time) <= end for each in run.transitions)
    return replace(guess, sizes=run.sizes(None, start, end), most=made)


def _still(found: Closed) -> bool:
    """Whether an orbit is a point that does not move: its states change by none of their sizes."""
    run, names = found.passage.execution, [by.removeprefix("initial.") for by in found.passage.sensitivity.wrt]
    moved = np.zeros(len(found.point))
    for arc in run.arcs:
        rows = [row for row in range(arc.first, arc.last + 1) if run.times[row] <= found.passage.time]
        for k, name in enumerate(names[: len(moved)]):
            if name in arc.states and rows:
                column = np.asarray(run.values[rows, arc.states.index(name)], float)
                moved[k] = max(moved[k], float(np.max(np.abs(column - found.point[k]))) / found.sizes[k])
    return bool(np.max(moved, initial=0.0) <= SHRUNK)
