"""The summary as HTML: for notebooks, and for pages of runs."""

from __future__ import annotations

from html import escape

from hsdsl.analysis.report import words
from hsdsl.base.names import visible_lines
from hsdsl.engine.execution import Execution


def _escaped(text: str) -> str:
    return escape(visible_lines(text))


def html(execution: Execution, *, limit: int = 60) -> str:
    """Sum a run up in a ``div``, with at most ``limit`` transitions; every text of the model is escaped."""
    facts = [("with", words.overrides(execution)), *words.facts(execution)]
    rows = "".join(f"<tr><th>{label}</th><td>{_escaped(text)}</td></tr>" for label, text in facts if text)
    settings = _escaped(", ".join(words.settings(execution)))
    return (
        f'<div class="hsdsl"><p><strong>{_escaped(words.heading(execution))}</strong><br>{settings}</p>'
        f"<table>{rows}</table>{_transitions(execution, limit)}</div>"
    )


def _transitions(execution: Execution, limit: int) -> str:
    if not execution.transitions:
        return "<p>No transitions.</p>"
    table = words.Table.of(execution, limit)
    rows = ["<tr>" + "".join(f"<td>{_escaped(cell)}</td>" for cell in row) + "</tr>" for row in table.rows]
    if table.left_out:
        rows.insert(table.cut, f'<tr><td colspan="6">&hellip; {table.left_out} more &hellip;</td></tr>')
    header = "".join(f"<th>{_escaped(name)}</th>" for name in words.COLUMNS)
    return f"<table><thead><tr>{header}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
