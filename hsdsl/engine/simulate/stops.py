"""How runs end and what they remark, in sentences: one place for every loop.

A *departure* is where a run left what the theorem is about, *undecided* what could not be checked. *Remarks* are
reported first, as warnings: one for each kind of thing and what it is about.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

from hsdsl.base.defaults import MOST_WAITING
from hsdsl.base.names import without_memory
from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.execution import RunWarning, Stop
from hsdsl.engine.integrators.stepper import State
from hsdsl.mathematics.program import EdgeProgram, ModeProgram, Program

LEAVES, ENTERED = "leaves it, and no transition is possible there", "was entered outside it"


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


# The code of each kind of remark, and its sentence: of what, and when.
SENTENCES: dict[str, tuple[str, str]] = {
    "passed": ("HS701", "the surface of {of} was passed {when} while its `if` was false, and nothing fired"),
    "beyond": ("HS702", "the wall {of} is broken {when}, and was not checked"),
    "rough": ("HS702", "the wall {of} is checked only roughly {when} on"),
    "held": ("HS703", "the guard of {of} holds the state {when}"),
    "replaced": ("HS704", "the accumulating transitions of {of} are replaced by their limit {when}"),
    "sliding": ("HS705", "the run slides between {of} {when}"),
    "crowded": ("HS706", "so many transitions crowd together that each waits in a strip {when} on"),
    "assumed": ("HS707", "{of}"),
    "entered": ("HS708", "{of} {when}: its `if` prevents firing at once"),
}


class Remark(NamedTuple):
    """One thing to tell.

    Attributes
    ----------
    kind : str
        One of :data:`SENTENCES`.
    of : str
        What it is about: a transition, a wall, two modes, or an assumption.
    time : number or None
        When it was so, or began to be.
    end : number or None
        Until when it was.
    edge : str or None
        The transition.
    """

    kind: str
    of: str
    time: Number | None = None
    end: Number | None = None
    edge: str | None = None


def of_edge(kind: str, edge: str, time: Number, end: Number | None = None) -> Remark:
    """A remark about a transition."""
    return Remark(kind, edge, time, end, edge)


def warnings_of(remarks: Iterable[Remark], program: Program) -> tuple[RunWarning, ...]:
    """The warnings of a run, in the order of their codes, then of time; those that every run of a program has last."""
    remarks = (*remarks, *(Remark("assumed", text) for text in program.assumptions))
    groups: dict[tuple[str, str], list[Remark]] = {}
    for remark in remarks:
        groups.setdefault((remark.kind, remark.of), []).append(remark)
    found: list[RunWarning] = []
    for group in groups.values():
        group.sort(key=lambda remark: _when(remark.time))
        first, code = group[0], SENTENCES[group[0].kind][0]
        found.append(RunWarning.deferred(_LATER, code=code, time=first.time, edge=first.edge, _group=group))
    return tuple(sorted(found, key=lambda warning: (warning.code, _when(warning.time))))


def loop_remarks(program: Program, diagnostics: Diagnostics, stop: Stop) -> Iterator[Remark]:
    """What the loop itself has remarked of a run, but for sliding; a wall that stopped the run was noticed."""
    yield from diagnostics.remarks.values()
    modes = {mode.name: mode for mode in program.modes if diagnostics.rough}
    for (name, k), time in diagnostics.rough.items():
        if k >= len(modes[name].edges) and not (stop.reason == "left_domain" and stop.time == time):
            yield Remark("rough", wall_of(modes[name], k), time)


def codes_of(kinds: Iterable[str]) -> str:
    """The codes of kinds of remarks, with a space between two."""
    return " ".join(sorted({SENTENCES[kind][0] for kind in kinds}))


def may_be_passed(program: Program, edge: EdgeProgram) -> bool:
    """Whether a surface that is passed while its `if` is false is remarked.

    An event fires when it turns true on any of its surfaces, and beginning to slide is no transition of the file.
    """
    return edge.conditional and not edge.of_event and not program.modes[edge.target].slides


def may_come_beyond(program: Program) -> bool:
    """Whether a mode has an edge with an `if`, beyond whose surface states may come without flow."""
    return any(may_be_passed(program, edge) for mode in program.modes if not mode.slides for edge in mode.edges)


def has_remarks_at_rows(program: Program) -> bool:
    """Whether a run may end in a wall, or enter a mode beyond the surface of an edge with an `if`."""
    return may_come_beyond(program) or any(mode.final and mode.walls for mode in program.modes)


def wall_of(mode: ModeProgram, k: int) -> str:
    """The wall of surface k for a person."""
    return f"{mode.walls[k - len(mode.edges)]} of {mode.name}"


def surface_of(mode: ModeProgram, k: int) -> str:
    """Surface k for a person: the name of an edge, or a wall."""
    return mode.edges[k].name if k < len(mode.edges) else f"the wall {wall_of(mode, k)}"


def _message(group: Sequence[Remark]) -> str:
    """The text of a warning: most are counted and never read."""
    first, count = group[0], len(group)
    code, sentence = SENTENCES[first.kind]
    when = "" if first.time is None else f"at t = {show(first.time)}"
    if first.end is not None:
        when = f"from t = {show(first.time)} to t = {show(first.end)}"
    elif sentence.endswith("{when} on"):
        when = f"from t = {show(first.time)}"
    if count > 1 and when:
        when = f"{count:,} times, first {when}"
    return f"{sentence.format(of=first.of, when=when)} (hsdsl explain {code})"


_LATER: dict[str, Callable[[Any], Any]] = {"message": lambda warning: _message(warning._group)}


def _when(time: Number | None) -> Number:
    return float("-inf") if time is None else time


FREE = 16  # transitions within the relaxation that cost no time; so many are remembered
LEFT_OUT = "no requested output and no guard, condition or domain depends on them"
TWO_STEP = (
    "the theorem says nothing of the scheme paoli-schatzman",
    "only positions at the steps are the scheme's: velocities are difference quotients of them, and a last row between "
    "two steps lies on their line",
    "transitions are recognised where steps are in contact with the stop, consecutive ones as one, to about a step",
)


@dataclass
class Diagnostics:
    """What a run says of itself besides its transitions; of one kind only the first is kept.

    ``remarks`` are reported first, by the place of the departure that each is about; ``rough`` are surfaces,
    by mode and number, that are followed roughly from a time on. ``turns`` are the edges that accumulate in turn.
    """

    departures: list[str] = field(default_factory=list[str])
    remarks: dict[int, Remark] = field(default_factory=dict[int, Remark])
    rough: dict[tuple[str, int], Number] = field(default_factory=dict[tuple[str, int], Number])
    undecided: list[str] = field(default_factory=list[str])
    turns: list[str] = field(default_factory=list[str])
    _noted: set[object] = field(default_factory=set[object])
    _moved: dict[str, tuple[int, Number, Number]] = field(default_factory=dict[str, tuple[int, Number, Number]])

    def crowded(self, t: Number) -> None:
        """More transitions than cost no time fell within the relaxation."""
        if "crowded" not in self._noted:
            self._noted.add("crowded")
            self.remarks[len(self.departures)] = Remark("crowded", "", t)
            self.departures.append(
                f"more than {FREE} transitions fall within the relaxation: from t = {show(t)} on each waits in a strip"
            )

    def in_contact(self, edge: str, start: Number, end: Number, still: bool) -> None:
        """The state moved along a guard, or rested on it; for less than can be seen, that is neither.

        Motion that goes on after a transition of something else is one.
        """
        shown, at_end = show(start), show(end)
        if shown == at_end:
            return
        how, place = "at rest on" if still else "motion along", len(self.departures)
        before = self._moved.pop(edge, None)
        if before is not None and not still and before[1] == start:
            place, start = before[0], before[2]
            shown = show(start)
        self.remarks[place] = of_edge("held", edge, start, end)
        self.departures[place : place + 1] = [f"{how} the guard of {edge} from t = {shown} to t = {at_end}"]
        if not still:
            self._moved[edge] = place, end, start

    def replaced(self, edge: EdgeProgram, number: int, end: Number, left: Number) -> None:
        """The transitions after ``number`` were replaced by their limit."""
        for other, (place, until, start) in self._moved.items():
            if until >= end - 2 * left:  # meanwhile motion along other guards goes on
                self._moved[other] = place, end, start
        counts = ", ".join(without_memory(edge.target_states[i] for i in edge.counts)) if edge.counts else ""
        self.remarks[len(self.departures)] = of_edge("replaced", edge.name, end)
        self.departures.append(
            f"Zeno at t = {show(end)}: the transitions of {edge.name} after number {number} lie within {show(left)} of "
            f"each other, and their limit replaces them{counts and f'; {counts} has no limit, and keeps its value'}"
        )

    def accumulates(self, edge: str, end: Number, t: Number) -> Stop:
        """Transitions accumulate at ``end``, and no motion along the guard goes on there: the run stops at t."""
        sentence = (
            f"the transitions of {edge} accumulate at t = {show(end)}, and no motion along its guard is known there: "
            "give the motion that follows a mode of its own"
        )
        self.departures.append(f"Zeno at t = {show(end)}: {sentence}")
        return Stop("zeno", t, sentence)

    def takes_turns(self, states: Sequence[str], x: State, t: Number) -> Stop:
        """The transitions whose edges are in ``turns`` accumulate at t, at the state x: the run stops there."""
        where = ", ".join(f"{name} = {show(a)}" for name, a in zip(without_memory(states), x, strict=False))
        sentence = (
            f"the transitions of {', '.join(dict.fromkeys(self.turns))} take turns and accumulate at t = {show(t)}, "
            f"where {where}: no motion is known at this limit: give the motion that follows a mode of its own"
        )
        self.departures.append(f"Zeno at t = {show(t)}: {sentence}")
        return Stop("zeno", t, sentence)

    def coupled(self, edge: str, t: Number) -> Stop:
        """Guards hold the state together, and the forces that do so are not one choice: the run stops at t."""
        sentence = (
            f"several guards hold the state at t = {show(t)}, among them that of {edge}, and no single motion along "
            "them is known: their forces are not unique, or there are too many guards"
        )
        self.departures.append(sentence)
        return Stop("zeno", t, sentence)

    def unsettled(self, mode: str, k: int, t: Number) -> None:
        """A crossing was found on a piece of a surface that is no polynomial."""
        if (mode, k) not in self.rough:
            self.rough[mode, k] = t
            self.undecided.append(f"no polynomial fits surface {k} of mode {mode} to round-off at t = {show(t)}")


def slides(edge: str, source: ModeProgram, target: ModeProgram, t: Number) -> Stop:
    """Transitions without flow between them return to the same state: the run stops at t."""
    if source.name == target.name:
        back = f"{edge} leads back to the same state of mode {source.name}"
        how = f"{back} without end, since the flow points beyond its guard"
    else:
        how = (
            f"transitions lead from mode {source.name} to mode {target.name} and back to the same state without end, "
            "since the flow of each leads into the other; "
        )
        if source.slides or target.slides:
            how += "on an intersection of surfaces no rule gives one flow"
        else:
            how += (
                "completion: auto follows the motion if both flows point towards one surface, which both modes write "
                "alike up to a factor, and neither mode has events"
            )
    return Stop("zeno", t, f"sliding at t = {show(t)}: {how}")
