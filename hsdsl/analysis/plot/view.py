"""What a picture shows of runs: columns, pairs of a phase plot, levels of guards, units, title, labels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from hsdsl.analysis.plot.curves import GuardLine
from hsdsl.base.errors import UsageError
from hsdsl.base.names import SINCE, checks_methods, did_you_mean, without_memory
from hsdsl.base.numbers.decimals import number_of
from hsdsl.engine.execution import Execution
from hsdsl.mathematics.program import ModeProgram, Program

Pair = tuple[str, str]


@checks_methods
@dataclass(frozen=True)
class View:
    """What is shown of one run, or of several in one picture.

    Attributes
    ----------
    columns : sequence of str or None
        The states and outputs over time, in this order; None for all but those that only tell the time.
    phases : sequence of pairs or None
        States or outputs against each other, across and up; None for one pair where all modes
        have the same two that flow, clocks aside.
    guards : sequence of GuardLine
        Levels at which transitions fire.
    units : mapping
        Units of states and outputs, and of time under the name ``t``.
    title : str or None
        Replaces the model's title (or its path, where it has none).
    labels : sequence of str
        A name for each of several runs.
    program : Program or None
        The model, whose mode graph is in a page.
    """

    columns: Sequence[str] | None = None
    phases: Sequence[Pair] | None = None
    guards: Sequence[GuardLine] = ()
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    title: str | None = None
    labels: Sequence[str] = ()
    program: Program | None = None

    def names(self, runs: Sequence[Execution]) -> list[str]:
        """Return the columns over time.

        Raises UsageError: a run has none of the name; the closest one is suggested.
        """
        known = names_of(runs)
        if self.columns is None:
            return [name for name in known if name not in self._timers(known)]
        return [checked(name, known) for name in dict.fromkeys(self.columns)]

    def pairs(self, runs: Sequence[Execution]) -> list[Pair]:
        """Return the pairs of phase plots.

        Raises UsageError: as :meth:`names`.
        """
        known = names_of(runs)
        if self.phases is not None:
            return [(checked(across, known), checked(up, known)) for across, up in dict.fromkeys(self.phases)]
        without = self._timers(known) | self._with_flow(0)  # counters, and what a controller holds

        def moving(states: Sequence[str]) -> list[str]:
            return [name for name in without_memory(states) if name not in without]

        states = list(dict.fromkeys(name for run in runs for name in moving(run.states)))
        shown = len(states) == 2 and all(
            len(moving(each)) == 2 for each in {a.states for run in runs for a in run.arcs}
        )
        return [(states[0], states[1])] if shown and set(states) <= set(self.names(runs)) else []

    def _timers(self, known: Sequence[str]) -> set[str]:
        """Names that only tell the time: `since`, and clocks that transitions set back; none where no other is known.

        A clock has the flow 1 wherever it flows, and a transition that sets it to a number.
        """
        made = [(edge.target_states[k], text) for mode in self._modes for edge in mode.edges
                for k, text in zip(edge.changes, edge.change_texts, strict=True)]  # fmt: skip
        clocks = {name for name, text in made if number_of(text) is not None} & self._with_flow(1)
        found = {name for name in known if name.rpartition(".")[2] == SINCE or name in clocks}
        return found if found < set(known) else set()

    @property
    def _modes(self) -> Sequence[ModeProgram]:
        return () if self.program is None else self.program.modes

    def _with_flow(self, number: float) -> set[str]:
        """States whose flow is a number wherever they flow."""
        flows = [(name, text) for mode in self._modes for name, text in zip(mode.states, mode.flow_texts, strict=False)]
        return {name for name, _ in flows} - {name for name, text in flows if number_of(text) != number}

    def called(self, runs: Sequence[Execution]) -> list[str]:
        """Return a label for each run.

        Raises UsageError: there are labels, but not one for each.
        """
        if self.labels and len(self.labels) != len(runs):
            raise UsageError(f"expected {len(runs)} labels, one for each run, got {len(self.labels)}")
        return list(self.labels) or [f"run {k}" for k in range(1, len(runs) + 1)]


def names_of(runs: Iterable[Execution]) -> list[str]:
    """Return the states of all runs, then their outputs."""
    kept = list(runs)
    states = [name for run in kept for name in without_memory(run.states)]
    return list(dict.fromkeys([*states, *(name for run in kept for name in run.output_names)]))


def checked(name: str, known: Sequence[str]) -> str:
    """Refuse a name that is not among those known."""
    if name not in known:
        hint = did_you_mean(name, known) or "there are none"
        raise UsageError(f"no state or output is called {name}", hint)
    return name
