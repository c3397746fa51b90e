"""What a run reports first: remarks about it as warnings, one for each kind of thing and what it is about."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.execution import Execution, RunWarning, Stop
from hsdsl.engine.simulate.stops import show
from hsdsl.mathematics.program import EdgeProgram, ModeProgram, Program

if TYPE_CHECKING:
    from hsdsl.engine.simulate.diagnostics import Diagnostics

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
}


@dataclass(frozen=True)
class Remark:
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
    found = [_warning(sorted(group, key=_time)) for group in groups.values()]
    return tuple(sorted(found, key=lambda warning: (warning.code, _when(warning.time))))


def loop_remarks(program: Program, diagnostics: Diagnostics, stop: Stop) -> Iterator[Remark]:
    """What the loop itself has remarked of a run, but for sliding; a wall that stopped the run was noticed."""
    yield from diagnostics.remarks.values()
    modes = {mode.name: mode for mode in program.modes if diagnostics.rough}
    for (name, k), time in diagnostics.rough.items():
        if k >= len(modes[name].edges) and not (stop.reason == "left_domain" and stop.time == time):
            yield Remark("rough", wall_of(modes[name], k), time)


def noted(program: Program, diagnostics: Diagnostics, execution: Execution) -> str:
    """The codes of what the loop itself has remarked of a run, with a space between two."""
    slide, times = {mode.name for mode in program.modes if mode.slides}, execution.times
    kinds = {remark.kind for remark in loop_remarks(program, diagnostics, execution.stop)}
    if any(times[arc.last] > times[arc.first] for arc in execution.arcs if arc.mode in slide):
        kinds.add("sliding")
    return codes_of(kinds)


def codes_of(kinds: Iterable[str]) -> str:
    """The codes of kinds of remarks, with a space between two."""
    return " ".join(sorted({SENTENCES[kind][0] for kind in kinds}))


def may_be_passed(program: Program, edge: EdgeProgram) -> bool:
    """Whether a surface that is passed while its `if` is false is remarked.

    An event fires when it turns true on any of its surfaces, and beginning to slide is no transition of the file.
    """
    return edge.conditional and not edge.of_event and not program.modes[edge.target].slides


def wall_of(mode: ModeProgram, k: int) -> str:
    """The wall of surface k for a person."""
    return f"{mode.walls[k - len(mode.edges)]} of {mode.name}"


def _warning(group: Sequence[Remark]) -> RunWarning:
    first, count = group[0], len(group)
    code, sentence = SENTENCES[first.kind]
    when = "" if first.time is None else f"at t = {show(first.time)}"
    if first.end is not None:
        when = f"from t = {show(first.time)} to t = {show(first.end)}"
    elif sentence.endswith("{when} on"):
        when = f"from t = {show(first.time)}"
    if count > 1 and when:
        when = f"{count:,} times, first {when}"
    message = sentence.format(of=first.of, when=when)
    return RunWarning(code, first.time, first.edge, f"{message} (hsdsl explain {code})")


def _time(remark: Remark) -> Number:
    return _when(remark.time)


def _when(time: Number | None) -> Number:
    return float("-inf") if time is None else time
