"""The summary of a run: as plain text of a hundred columns, and as HTML for notebooks and pages."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

from hsdsl.analysis.report import words
from hsdsl.base.names import shown
from hsdsl.engine.execution import Execution

WIDTH = 100
INDENT = 10  # columns of the labels below the table


def summary(execution: Execution, *, limit: int = 60, width: int | None = None, explain: bool = False) -> str:
    """Sum a run up in lines: title, settings, transitions, stop, final state, warnings, verdict, seconds.

    Parameters
    ----------
    limit : int
        The most transitions; a longer list is cut in the middle, with a count.
    width : int, optional
        Columns, 100 by default; at least 40.
    explain : bool
        Whether every reason of the verdict is given, not the conclusion alone.
    """
    columns = max(40, WIDTH if width is None else width)
    paragraphs = [words.heading(execution)]
    if execution.title:
        paragraphs.append(execution.model)
    paragraphs.append(", ".join(words.settings(execution)))
    if words.overrides(execution):
        paragraphs.append(f"with {words.overrides(execution)}")
    if "method_chosen" in execution.settings:
        paragraphs.append(f"method auto is {execution.settings['method_chosen']}")
    lines = [line for text in paragraphs for line in _wrapped(text, columns)]
    lines += ["", *_transitions(execution, limit, columns), ""]
    for label, text in _facts(execution, explain):
        first = "" if label in ("state", "outputs") else label
        lines += _wrapped(text, columns, first.ljust(INDENT), " " * INDENT)
    return "\n".join(lines)


def _facts(execution: Execution, explain: bool) -> list[tuple[str, str]]:
    """The facts; without reasons the verdict says where these are."""
    facts = list(words.facts(execution))
    if explain or "reason" not in dict(facts):
        return facts
    more = {"verdict": " (--explain)"}
    return [(label, text + more.get(label, "")) for label, text in facts if label != "reason"]


def _wrapped(text: str, columns: int, first: str = "", rest: str = "") -> list[str]:
    """Break into lines, but never around an equals sign or an arrow; hidden characters and line ends show."""
    text = shown(text, None)
    for sign in ("=", "->"):
        text = text.replace(f" {sign} ", f"\xa0{sign}\xa0")
    lines = textwrap.wrap(text, columns, initial_indent=first, subsequent_indent=rest, break_on_hyphens=False)
    return [line.replace("\xa0", " ") for line in lines]


def _transitions(execution: Execution, limit: int, columns: int) -> Iterator[str]:
    if not execution.transitions:
        yield "No transitions."
        return
    rows, cut, left_out = words.table(execution, limit)
    known = zip(words.COLUMNS, *rows, strict=True)
    *aligned, notes = [column for column in known if set(column[1:]) != {"-"} or column[0] != "delay"]
    cells: list[list[str]] = []
    for column in ([shown(cell, None) for cell in column] for column in aligned):
        wide = max(len(cell) for cell in column)
        right = column[0] in ("#", "time", "delay")
        cells.append([cell.rjust(wide) if right else cell.ljust(wide) for cell in column])
    for i, (row, note) in enumerate(zip(zip(*cells, strict=True), notes, strict=True)):
        line = "  ".join(row)
        if (start := len(line) + 2) <= columns - 24:
            yield from _wrapped(note, columns, line + "  ", " " * start)
        else:  # too little room for a note after the line
            yield from [line.rstrip(), *_wrapped(note, columns, " " * 6, " " * 6)]
        if i == cut and left_out:
            yield f"   ... {left_out} more ..."


def html(execution: Execution, *, limit: int = 60) -> str:
    """Sum a run up in a ``div``, with at most ``limit`` transitions; every text of the model is escaped."""
    facts = [("with", words.overrides(execution)), *words.facts(execution)]
    table = "<p>No transitions.</p>"
    if execution.transitions:
        chosen, cut, left_out = words.table(execution, limit)
        rows = [*map(words.html_row, chosen)]
        if left_out:
            rows.insert(cut, f'<tr><td colspan="6">&hellip; {left_out} more &hellip;</td></tr>')
        table = words.html_table(words.COLUMNS, rows)
    heading, settings = (
        words.escaped(text) for text in (words.heading(execution), ", ".join(words.settings(execution)))
    )
    return (
        f'<div class="hsdsl"><p><strong>{heading}</strong><br>{settings}</p>'
        f"{words.html_facts((name, text) for name, text in facts if text)}{table}</div>"
    )
