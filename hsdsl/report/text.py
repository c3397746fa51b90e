"""The readable summary: plain text for a hundred columns."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

from hsdsl.execution import Execution
from hsdsl.names import shown
from hsdsl.report import words

WIDTH = 100
_LABEL = 10  # columns of the labels below the table


def summary(execution: Execution, *, limit: int = 60, width: int | None = None) -> str:
    """Sum a run up for a person.

    Parameters
    ----------
    limit : int
        How many transitions are listed at most; a longer list is cut in the middle, with a count.
    width : int, optional
        Columns, 100 unless told; at least 40.

    Returns
    -------
    str
        Lines of plain text: title, settings, transitions, stop, final state, verdict, seconds.
    """
    columns = max(40, WIDTH if width is None else width)
    lines = [*_wrapped(words.heading(execution), columns)]
    if execution.title:
        lines += _wrapped(execution.model, columns)
    lines += _wrapped(", ".join(words.settings(execution)), columns)
    if words.overrides(execution):
        lines += _wrapped(f"with {words.overrides(execution)}", columns)
    if "method_chosen" in execution.settings:
        lines += _wrapped(f"method auto is {execution.settings['method_chosen']}", columns)
    lines += [""]
    lines += [*_transitions(execution, limit, columns), ""]
    lines += _labelled("stop", words.stop(execution), columns)
    lines += _labelled("final", words.final(execution.final), columns)
    for line in (words.values(execution.final.state), words.outputs(execution.final)):
        lines += _labelled("", line, columns)
    lines += _labelled("left out", words.left_out(execution), columns) if "left_out" in execution.settings else []
    lines += _labelled("verdict", words.verdict(execution), columns)
    lines += _labelled("time", words.seconds(execution), columns)
    return "\n".join(lines)


def _wrapped(text: str, columns: int, first: str = "", rest: str = "") -> list[str]:
    """Break into lines, but never around an equals sign or an arrow; what is hidden or ends a line shows."""
    text = shown(text, None)
    for sign in ("=", "->"):
        text = text.replace(f" {sign} ", f"\xa0{sign}\xa0")
    lines = textwrap.wrap(text, columns, initial_indent=first, subsequent_indent=rest, break_on_hyphens=False)
    return [line.replace("\xa0", " ") for line in lines]


def _labelled(label: str, text: str, columns: int) -> list[str]:
    return _wrapped(text, columns, label.ljust(_LABEL), " " * _LABEL)


def _transitions(execution: Execution, limit: int, columns: int) -> Iterator[str]:
    transitions = execution.transitions
    if not transitions:
        yield "No transitions."
        return
    head, tail = words.shortened(len(transitions), limit)
    shown = [transitions[i] for i in (*head, *tail)]
    table = [
        ["#", *(str(t.index) for t in shown)],
        ["time", *words.times([t.time for t in shown])],
        ["delay", *(words.delay(t) for t in shown)],
        ["edge", *(t.edge for t in shown)],
        ["from -> to", *(f"{t.source} -> {t.target}" for t in shown)],
    ]
    if set(table[2][1:]) == {"-"}:
        del table[2]
    notes = ["state", *("; ".join(filter(None, (words.changes(t), words.remarks(t)))) for t in shown)]
    for i, (line, note) in enumerate(zip(_aligned(table), notes, strict=True)):
        yield from _row(line, note, columns)
        if i == len(head) and len(shown) < len(transitions):
            yield f"   ... {len(transitions) - len(shown)} more ..."


def _aligned(table: Sequence[Sequence[str]]) -> list[str]:
    """Set columns side by side, those of numbers flush right."""
    cells: list[list[str]] = []
    for column in ([shown(cell, None) for cell in column] for column in table):
        wide = max(len(cell) for cell in column)
        right = column[0] in ("#", "time", "delay")
        cells.append([cell.rjust(wide) if right else cell.ljust(wide) for cell in column])
    return ["  ".join(row) for row in zip(*cells, strict=True)]


def _row(line: str, note: str, columns: int) -> list[str]:
    """Put the note after the line, wrapped below itself; below the line where there is too little room for it."""
    start = len(line) + 2
    if columns - start >= 24:
        return _wrapped(note, columns, line + "  ", " " * start)
    return [line.rstrip(), *_wrapped(note, columns, " " * 6, " " * 6)]
