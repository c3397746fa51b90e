"""The derivatives of an execution, read off the execution of an augmented system: by name, in words, as JSON."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np

from hsdsl.analysis.report.json_form import named, plain
from hsdsl.analysis.report.words import aligned, condensed, number
from hsdsl.analysis.sensitivity.targets import (
    MEASURED,
    derivative_name,
    own,
    rate_name,
    shift_name,
    slope_name,
    still_rate_name,
)
from hsdsl.analysis.sensitivity.ties import Tie, landing, parted, ties, touched
from hsdsl.base.names import called, checks_methods, seen
from hsdsl.base.parts import numbered, present, product_name
from hsdsl.engine.execution import Array, Execution, Samples, Transition, Verdict
from hsdsl.engine.simulate import Prepared
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.run_view import RunView
from hsdsl.mathematics.program import ModeProgram

Slopes = dict[str, Any]  # a derivative by each of what it was taken by


@dataclass(frozen=True)
class TransitionSlopes:
    """The derivatives of a transition: of its ``time``, and of the states recorded ``before`` and ``after`` it."""

    index: int
    edge: str
    time: Slopes
    before: dict[str, Slopes]
    after: dict[str, Slopes]


@dataclass(frozen=True)
class EndSlopes:
    """The derivatives of the end of a run: of its ``time``, and of the states and outputs there."""

    mode: str
    time: Slopes
    state: dict[str, Slopes]
    outputs: dict[str, Slopes]


@dataclass(frozen=True)
class SampleSlopes:
    """The states and outputs at times, and their derivatives.

    ``values[name]`` has shape (n,), and ``slopes[name]`` has shape (n, number of names in ``wrt``). Both are NaN if the
    mode has no such state; a derivative that does not exist is NaN as well.
    """

    times: Array
    values: dict[str, Array]
    slopes: dict[str, Array]


@dataclass(frozen=True)
class Setting:
    """What a sensitivity was computed of: the run without derivatives, ready to be made, and what moves with a target.

    ``span`` has the derivatives of ``until``, and ``samples`` those of each sample time; empty where none moves.
    ``parameters`` has those of all parameters by each target. ``shown`` is what readers see of the run.
    """

    plain: Prepared
    augmented: Prepared
    output_names: tuple[str, ...]
    span: Slopes
    samples: Sequence[Slopes]
    parameters: Mapping[str, Sequence[Any]]
    shown: Callable[[Execution], Execution]


@checks_methods
@dataclass(frozen=True, eq=False)
class Sensitivity:
    """The derivatives of an execution with respect to parameters and initial states.

    The derivatives are those of the recorded quantities. Those of the states before and after a transition include the
    change of its time. So do those at the end, if ``until`` depends on a parameter, and those at samples whose times
    do. A derivative that does not exist is NaN; :attr:`reasons` say why.

    Attributes
    ----------
    wrt : tuple of str
        The names to differentiate with respect to, as ``c`` or ``initial.v``.
    execution : Execution
        The run of the augmented system, with the derivatives as states.
    first : tuple of str
        The edges that go first in ties; the derivatives are those of the executions on that side.
    """

    wrt: tuple[str, ...]
    execution: Execution = field(repr=False)
    setting: Setting = field(repr=False)
    first: tuple[str, ...]
    one_sided: Callable[[Sequence[str]], Sensitivity] = field(repr=False)

    @cached_property
    def run(self) -> Execution:
        """The execution itself."""
        return self.setting.shown(self._whole)

    @cached_property
    def _whole(self) -> Execution:
        """The execution, with the numbers of the modes of parts."""
        return self.setting.plain.simulate()

    @property
    def verdict(self) -> Verdict:
        """The verdict of the execution; if it is not ``holds``, a derivative may not exist."""
        return self._whole.verdict

    @cached_property
    def ties(self) -> tuple[Tie, ...]:
        """The instants at which the order of transitions may matter, with the derivatives of each order."""
        moving = [any(row) for row in zip(*self.setting.parameters.values(), strict=True)]
        return tuple(ties(RunView(self.setting.augmented, self.execution), self.wrt, moving))

    @cached_property
    def sides(self) -> dict[str, Sensitivity]:
        """The derivatives of the executions on each side of a tie, keyed by the edge that goes first."""
        firsts = dict.fromkeys(order.first for tie in self._parting for order in tie.orders)
        return {first: self.one_sided((*self.first, first)) for first in firsts}

    def as_made(self) -> Sensitivity:
        """Return the derivatives of the executions whose tied transitions have the order of this run."""
        made = self.execution.transitions
        return replace(self, first=(*self.first, *(made[tie.index].edge for tie in self._parting)))

    @cached_property
    def _parting(self) -> tuple[Tie, ...]:
        """The ties whose orders have different derivatives, but those where it is known which goes first."""
        made = self.execution.transitions
        return tuple(tie for tie in self.ties if tie.reason and made[tie.index].edge not in self.first)

    @cached_property
    def breaks(self) -> tuple[tuple[Any, str], ...]:
        """The times after which no derivative exists, with the reasons; the verdict of the run is not used."""
        return self.breaks_along({by: {by: 1.0} for by in self.wrt})

    def breaks_along(self, ways: Mapping[str, Slopes]) -> tuple[tuple[Any, str], ...]:
        """Return the same for some directions only, each given by its components along the names of :attr:`wrt`."""
        found = [(tie.time, str(tie.reason)) for tie in self._parting]
        found += self._landings(ways)
        stop = self.execution.stop
        if stop.reason == "not_finite":
            sentence = f"at t = {show(stop.time)} a guard is reached at rate zero within the error of the run"
            found.append((stop.time, f"{sentence}, or what it leads to has no derivative"))
        elif not stop.complete and stop.reason != "left_domain":
            found.append((stop.time, f"the run ends there ({stop.reason}): {stop.message}"))
        return tuple(sorted(found, key=lambda found: found[0]))

    def _landings(self, ways: Mapping[str, Slopes]) -> list[tuple[Any, str]]:
        """The first landing on a guard from which executions nearby go on in different ways."""
        view = RunView(self.setting.plain, self.execution)

        def along(row: Slopes) -> Slopes:
            return {way: sum(row[by] * part for by, part in parts.items()) for way, parts in ways.items()}

        names, own = self.setting.plain.program.parameters, self.setting.parameters
        moved = [along({by: own[by][i] for by in self.wrt}) for i in range(len(names))]
        parameters = {way: tuple(row[way] for row in moved) for way in ways}
        arcs = {jump: list(part) for jump, part in groupby(self.execution.arcs, key=lambda arc: arc.jump)}
        sizes: dict[str, float] = {}
        for made in self.execution.transitions:
            for name, size in self.execution.sizes(arcs.get(made.index, ())).items():
                sizes[name] = max(sizes.get(name, 0.0), size)
            if any(abs(made.time - tie.time) <= view.problem.tie(tie.time) for tie in self.ties):
                continue  # its orders have been examined
            after = made.after or {}
            time = self._shifts(after)
            state = self._followed(made.target, made.time, after, time, True)
            rows = {x: along(row) for x, row in state.items()}
            had = {x: {by: sizes.get(derivative_name(x, by), 0.0) for by in self.wrt} for x in rows}
            largest = {
                x: {way: sum(row[by] * abs(part) for by, part in parts.items()) for way, parts in ways.items()}
                for x, row in had.items()
            }
            if found := next(parted(view, landing(view, made), along(time), rows, parameters, largest), None):
                return [(made.time, f"at t = {show(made.time)} {made.edge} leads onto {found}")]
        return []

    @cached_property
    def starts(self) -> tuple[str, ...]:
        """The surfaces on which the run starts; the derivatives are those of the executions that start inside the
        domain.

        Beyond a guard an execution makes its transition at once, so a guard that the run crosses at once counts as
        well.
        """
        run, arc = self.execution, self.execution.arcs[0]
        at = dict(zip(arc.states, run.values[arc.first].tolist(), strict=False))
        view = RunView(self.setting.plain, run)
        time = dict.fromkeys(self.wrt, 0.0)
        state = self._followed(arc.mode, run.times[0], at, time, True)
        states = view.problem.program.modes[view.index(arc.mode)].states
        place = view.place(arc.mode, run.times[0], tuple(at[x] for x in states))
        found = parted(view, place, time, state, self.setting.parameters, crossing=True)
        return tuple(f"the run starts on {reason}" for reason in found)

    @cached_property
    def touches(self) -> tuple[str, ...]:
        """The guards that the run grazes within its error, without a transition; no derivative exists after that."""
        return tuple(reason for _, reason in touched(RunView(self.setting.plain, self._whole)))

    @cached_property
    def _smooth(self) -> Verdict:
        """The verdict of the run where motion along surfaces counts as the flow of a mode of the system."""
        if self.verdict.theorem == "holds" or self._whole.assessment is None:
            return self.verdict
        return self._whole.assessment(self._whole, None, True)

    @property
    def exists(self) -> bool | None:
        """Whether the derivatives exist; None if this is unknown, since a question about the run could not be
        decided.
        """
        if self.breaks or self.starts or self._smooth.theorem == "left":
            return False
        if self._smooth.theorem == "unknown" and self.touches:
            return False
        return True if self._smooth.theorem == "holds" else None

    @property
    def reasons(self) -> tuple[str, ...]:
        """The reasons why the derivatives do not exist, or are not known to exist."""
        own = (*self.starts, *(reason for _, reason in self.breaks))
        further = () if self._smooth.theorem == "holds" else (*self.touches, *self._smooth.reasons)
        return (*own, *(reason for reason in further if not any(reason in told for told in own)))

    @cached_property
    def final(self) -> EndSlopes:
        """The derivatives of the end of the run; there are none if the run leaves its domain."""
        run, end = self.execution, self.execution.final
        by_event = run.stop.reason == "final" and bool(run.transitions)
        time = self._shifts(end.state) if by_event else self.setting.span
        exists = not self.breaks and run.stop.reason != "left_domain"
        state = self._followed(end.mode, end.time, end.state, time, True)
        rate = still_rate_name if (not self._mode(end.mode).states) else rate_name
        outputs = {y: self._output(end.outputs, y, rate(y), time) for y in self.setting.output_names}
        mode, own = self._shown(end.mode, end.state)
        return EndSlopes(
            mode,
            self._known(time, exists),
            {x: self._known(row, exists) for x, row in state.items() if x in own},
            {y: self._known(row, exists) for y, row in outputs.items()},
        )

    @cached_property
    def transitions(self) -> tuple[TransitionSlopes, ...]:
        """The derivatives of every transition."""
        return tuple(map(self.transition, range(len(self.execution.transitions))))

    def transition(self, index: int) -> TransitionSlopes:
        """Return the derivatives of one transition."""
        made = self.execution.transitions[index]
        after, exists = made.after or {}, (not any(tie.index <= made.index for tie in self._parting))
        time = self._shifts(after)
        before = self._followed(made.source, made.time, made.before, time, False)
        reached = self._followed(made.target, made.time, after, time, True)
        reached |= {x: before[x] for x in self._kept(made) if x in before and x in reached}
        return TransitionSlopes(
            made.index,
            made.edge,
            self._known(time, exists),
            {x: self._known(row, exists) for x, row in before.items() if x in self._shown("", made.before)[1]},
            {x: self._known(row, exists) for x, row in reached.items() if x in self._shown("", after)[1]},
        )

    def _kept(self, made: Transition) -> Iterator[str]:
        """The states that a transition leaves as they are: the flow after it need not be large for theirs."""
        modes = self.setting.plain.program.modes
        edges = next((mode.edges for mode in modes if mode.name == made.source), ())
        edge = next((edge for edge in edges if edge.name == made.edge), None)
        yield from (x for i, x in enumerate(edge.target_states) if i not in edge.changes) if edge else ()

    def _shown(self, mode: str, state: Mapping[str, Any]) -> tuple[str, Collection[str]]:
        """The name of a mode and its states; of a system of parts those of the product mode at a state."""
        parts = self.setting.plain.program.parts
        if not parts or not state:
            return mode, state
        return product_name(parts, state), present(parts, state)

    def _known(self, row: Slopes, exists: bool) -> Slopes:
        return row if exists else dict.fromkeys(row, float("nan"))

    def _shifts(self, state: Mapping[str, Any]) -> Slopes:
        return {by: state.get(shift_name(by), 0.0) for by in self.wrt}

    def _followed(self, mode: str, t: Any, state: Mapping[str, Any], time: Slopes, after: bool) -> dict[str, Slopes]:
        """The derivatives of states at a time that moves: S + f T."""
        names = own(state)
        found = {x: {by: state.get(derivative_name(x, by), 0.0) for by in self.wrt} for x in names}
        if not any(moves != 0 for moves in time.values()):
            return found
        slope = self._flow(mode, t, [state[x] for x in names], after)
        if state.get(MEASURED):  # at the end of an arc
            slope = [state.get(slope_name(x), f) for x, f in zip(names, slope, strict=True)]
        return {x: {by: row[by] + f * time[by] for by in row} for (x, row), f in zip(found.items(), slope, strict=True)}

    def _flow(self, mode: str, t: Any, x: Sequence[Any], after: bool) -> Sequence[Any]:
        """The flow of a mode, with the inputs right before or after a time; that of a mode without one is zero."""
        plain = self.setting.plain
        index = plain.program.mode_names.index(mode)
        if not plain.program.modes[index].states:
            return [0] * len(x)
        segments = plain.timeline.segments
        earlier = bisect_left(segments, t, key=lambda each: each.start) - 1
        segment = plain.timeline.at(t) if after else segments[max(0, earlier)]
        return plain.kernel.bind(index, segment.data).flow(t, *x)

    def _mode(self, name: str) -> ModeProgram:
        """A mode of the run without derivatives."""
        program = self.setting.plain.program
        return program.modes[program.mode_names.index(name)]

    def _output(self, values: Mapping[str, Any], y: str, rate: str, time: Slopes) -> Slopes:
        return {by: values[derivative_name(y, by)] + (values[rate] * time[by] if time[by] else 0) for by in self.wrt}

    def sample(self, times: Any = None) -> SampleSlopes:
        """Return states, outputs and their derivatives at times.

        Parameters
        ----------
        times : numbers, optional
            Fixed times within the run; by default those of the run's ``samples``, or else of its steps.
        """
        run, moving = self.execution, self.setting.samples if times is None else ()
        given = self.setting.plain.settings.samples if times is None else None
        if times is None and given is None:
            times = np.unique(np.asarray(run.times))
        elif times is None:
            end, last = self.setting.plain.settings.until, run.times[-1]
            listed = [end * k / (given - 1) for k in range(given)] if isinstance(given, int) else list(given or ())
            times = np.array([t for t in listed if t <= last])
        table = run.sample(times)
        there = self._presence(table)
        names = [*self._all_states(), *self.setting.output_names]
        broken = min((when for when, _ in self.breaks), default=None)
        slopes: dict[str, Array] = {}
        for name in names:
            slopes[name] = np.stack([self._column(table, name, by) for by in self.wrt], axis=-1)
            if any(any(row.values()) for row in moving):
                rates = self._rates(name, table)
                shift = np.array([[row[by] for by in self.wrt] for row in moving[: len(rates)]])
                slopes[name] = slopes[name] + rates[:, None] * shift
            if name in there:
                slopes[name][~there[name]] = np.nan
            if broken is not None:
                slopes[name][np.asarray(table.time) >= broken] = np.nan
        values = {n: np.where(there[n], table[n], np.nan) if n in there else table[n] for n in names}
        return SampleSlopes(np.asarray(table.time), values, slopes)

    def _presence(self, table: Samples) -> dict[str, Array]:
        """Of a system of parts, at which samples the product mode has each state that some modes lack."""
        found: dict[str, Array] = {}
        for part in self.setting.plain.program.parts:
            for name in {x for states in part.states for x in states} if part.is_numbered else ():
                having = [k for k, states in enumerate(part.states, 1) if name in states]
                if len(having) < len(part.modes):
                    found[name] = np.isin(np.asarray(table[part.name], float), having)
        return found

    def _column(self, table: Samples, name: str, by: str) -> Array:
        """A derivative at samples: zero in modes that leave it out, NaN in those without the state."""
        known = derivative_name(name, by)
        if known not in table.names:
            return np.where(table[name] == table[name], 0.0, np.nan)
        column = table[known]
        if name in table.states:
            there, has = (table.present[:, table.states.index(each)] for each in (name, known))
            column = np.where(there & ~has, 0.0, column)
        return column

    def _rates(self, name: str, table: Any) -> Array:
        """The derivative of a state or output by time, at samples."""
        if name in self.setting.output_names:
            return table[rate_name(name)]
        rates: list[Any] = []
        for t, mode, row in zip(table.time.tolist(), table.mode.tolist(), range(len(table)), strict=True):
            states = self._mode(mode).states
            x = [table[state][row] for state in states]
            rates.append(self._flow(mode, t, x, True)[states.index(name)] if name in states else float("nan"))
        return np.array(rates)

    def _all_states(self) -> Iterator[str]:
        hidden = numbered(self.setting.plain.program.parts)
        yield from dict.fromkeys(x for arc in self.execution.arcs for x in own(arc.states) if x not in hidden)


PARTS = ("final", "transitions", "outputs")
ALWAYS = PARTS[:2]  # where no part is chosen
MOST_ROWS = 40


def as_json(found: Sensitivity, parts: Sequence[str] = ALWAYS) -> dict[str, Any]:
    """The object of `sensitivity --json`; numbers that do not exist are null."""
    run = found.execution
    result: dict[str, Any] = {
        "model": run.model,
        "wrt": list(found.wrt),
        "settings": {"method": run.method, "tolerance": run.settings.get("tolerance"), "until": run.settings["until"]},
        "stop": named(found.run.stop, "reason time"),
        "exists": found.exists,
        "reasons": list(found.reasons),
        "verdict": found.verdict.theorem,
    }
    if "final" in parts:
        result["final"] = {"at": run.final.time, **_end(found.final)}
    if "transitions" in parts:
        made = zip(run.transitions, found.transitions, strict=True)
        result["transitions"] = [
            {"at": t.time, **(vars(d) | {"before": seen(d.before), "after": seen(d.after)})} for t, d in made
        ]
    if "outputs" in parts:
        table = found.sample()
        values = {
            name: {"value": v, **{by: table.slopes[name][:, k] for k, by in enumerate(found.wrt)}}
            for name, v in table.values.items()
        }
        result["samples"] = {"times": table.times, "values": values}
    if found.ties:
        orders = ([order._asdict() for order in tie.orders] for tie in found.ties)
        result["ties"] = [named(tie, "time reason") | {"orders": o} for tie, o in zip(found.ties, orders, strict=True)]
    if found.breaks:
        result["one_sided"] = {edge: _end(side.final) for edge, side in found.sides.items()}
    return plain(result)


def _end(end: EndSlopes) -> dict[str, Any]:
    return {"mode": end.mode, "time": end.time, "state": seen(end.state), "outputs": end.outputs}


def summary(found: Sensitivity, parts: Sequence[str] = ALWAYS) -> str:
    """The derivatives as tables."""
    return "\n".join(_lines(found, parts))


def _lines(found: Sensitivity, parts: Sequence[str]) -> Iterator[str]:
    run = found.execution
    yield f"{called(run.title, run.model)}: derivatives by {', '.join(found.wrt)}"
    answer = {True: "yes", False: "no", None: "not known"}[found.exists]
    reasons = [] if found.exists else condensed(found.reasons)
    yield f"they exist: {answer}" + "".join(f"\n  {reason}" for reason in reasons)
    if "final" in parts:
        yield from _final(found)
    for edge, side in found.sides.items() if found.breaks else ():
        yield f"\nof the executions on which {edge} goes first"
        yield from _final(side)
    if "transitions" in parts and run.transitions:
        rows = zip(run.transitions, found.transitions, strict=True)
        table = [[str(t.index), t.edge, number(t.time, 10), *map(_slope, d.time.values())] for t, d in rows]
        yield from _table("transition times", ["#", "edge", "time", *_heads(found)], table)
    if "outputs" in parts:
        samples = found.sample()
        for name, values in samples.values.items():
            columns = zip(samples.times.tolist(), values.tolist(), samples.slopes[name].tolist(), strict=True)
            lines = [[number(t, 10), number(v, 10), *map(_slope, row)] for t, v, row in columns]
            yield from _table(name, ["t", "value", *_heads(found)], lines)


def _final(found: Sensitivity) -> Iterator[str]:
    run, end = found.execution, found.final
    rows = [["t", number(run.final.time, 10), *map(_slope, end.time.values())]]
    rows += [[x, number(run.final.state[x], 10), *map(_slope, row.values())] for x, row in seen(end.state).items()]
    rows += [[y, number(run.final.outputs[y], 10), *map(_slope, row.values())] for y, row in end.outputs.items()]
    yield from _table(f"end of the run, mode {end.mode}", ["", "value", *_heads(found)], rows)


def _heads(found: Sensitivity) -> list[str]:
    return [f"d/d {by}" for by in found.wrt]


def _slope(value: Any) -> str:
    return "none" if value != value else number(value, 10)


def _table(title: str, heads: list[str], rows: list[list[str]]) -> Iterator[str]:
    shown = rows[:MOST_ROWS]
    yield f"\n{title}"
    yield from (f"  {line}".rstrip() for line in aligned([heads, *shown]))
    if len(rows) > len(shown):
        yield f"  and {len(rows) - len(shown)} more (--json has all)"
