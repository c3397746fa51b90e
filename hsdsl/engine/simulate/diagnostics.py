"""Departures and undecided points of a run, in sentences, and how it ends where transitions go on without end.

A departure is where a run left what the theorem is about, undecided what could not be checked.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from hsdsl.base.names import without_memory
from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.execution import Stop
from hsdsl.engine.simulate.remarks import Remark, of_edge
from hsdsl.engine.simulate.stops import show
from hsdsl.mathematics.program import EdgeProgram, ModeProgram

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
    by mode and number, that are followed roughly from a time on.
    """

    departures: list[str] = field(default_factory=list[str])
    remarks: dict[int, Remark] = field(default_factory=dict[int, Remark])
    rough: dict[tuple[str, int], Number] = field(default_factory=dict[tuple[str, int], Number])
    undecided: list[str] = field(default_factory=list[str])
    _noted: set[object] = field(default_factory=set[object])
    _moved: dict[str, tuple[int, Number, Number]] = field(default_factory=dict[str, tuple[int, Number, Number]])

    def crowded(self, t: Number) -> None:
        """More transitions than cost no time fell within the relaxation."""
        if "crowded" not in self._noted:
            self._noted.add("crowded")
            self.remarks[len(self.departures)] = Remark("crowded", "", t)
            self.departures.append(
                f"more than {FREE} transitions within the relaxation, from t = {show(t)} on in strips"
            )

    def in_contact(self, edge: str, start: Number, end: Number, still: bool) -> None:
        """The state moved along a guard, or rested on it; for less than can be seen, that is neither.

        Motion that goes on behind a transition of something else is one.
        """
        if show(start) == show(end):
            return
        how, place = "at rest on" if still else "motion along", len(self.departures)
        before = self._moved.pop(edge, None)
        if before is not None and not still and before[1] == start:
            place, start = before[0], before[2]
        self.remarks[place] = of_edge("held", edge, start, end)
        self.departures[place : place + 1] = [f"{how} the guard of {edge} from t = {show(start)} to t = {show(end)}"]
        if not still:
            self._moved[edge] = place, end, start

    def replaced(self, edge: EdgeProgram, number: int, end: Number, left: Number) -> None:
        """The transitions after ``number`` were replaced by their limit."""
        for other, (place, until, start) in self._moved.items():
            if until >= end - 2 * left:  # meanwhile motion along other guards goes on
                self._moved[other] = place, end, start
        counts = ", ".join(without_memory(edge.target_states[i] for i in edge.counts))
        self.remarks[len(self.departures)] = of_edge("replaced", edge.name, end)
        self.departures.append(
            f"Zeno at t = {show(end)}: the transitions of {edge.name} after number {number}, all within {show(left)} "
            f"of each other, are replaced by their limit{f'; {counts} has none and keeps its value' * bool(counts)}"
        )

    def accumulates(self, edge: str, end: Number, t: Number) -> Stop:
        """Transitions accumulate at ``end``, and no motion along the guard goes on there: the run stops at t."""
        sentence = (
            f"the transitions of {edge} accumulate at t = {show(end)}, and no motion along its guard is known there: "
            "one that goes on along it needs a mode of its own"
        )
        self.departures.append(f"Zeno at t = {show(end)}: {sentence}")
        return Stop("zeno", t, sentence)

    def coupled(self, edge: str, t: Number) -> Stop:
        """Guards hold the state together, and the forces that do so are not one choice: the run stops at t."""
        sentence = (
            f"several guards hold the state at t = {show(t)}, that of {edge} among them, and no one motion along them "
            "is known: their forces are not one choice, or they are too many"
        )
        self.departures.append(sentence)
        return Stop("zeno", t, sentence)

    def unsettled(self, mode: str, k: int, t: Number) -> None:
        """A crossing was found on a piece of a surface that is no polynomial."""
        if (mode, k) not in self.rough:
            self.rough[mode, k] = t
            self.undecided.append(f"surface {k} of mode {mode} would not settle on a polynomial at t = {show(t)}")


def slides(edge: str, source: ModeProgram, target: ModeProgram, t: Number) -> Stop:
    """Transitions without flow between them return to the same state: the run stops at t."""
    if source.name == target.name:
        back = f"{edge} leads back to the same state of mode {source.name}"
        how = f"{back} without end, since the flow presses on its guard"
    else:
        how = (
            f"transitions lead from mode {source.name} to mode {target.name} and back to the same state without end, "
            "since the flow of each leads into the other; "
        )
        if source.slides or target.slides:
            how += "on an intersection of surfaces no rule gives one flow"
        else:
            how += (
                "completion: auto follows the motion where both modes press on one surface, written alike "
                "up to a factor, and neither has events"
            )
    return Stop("zeno", t, f"sliding at t = {show(t)}: {how}")
