"""The summary as HTML: for Jupyter, and with its picture as a self-contained page."""

from __future__ import annotations

from html import escape

from hsdsl.execution import Execution
from hsdsl.names import visible_lines
from hsdsl.program import Program
from hsdsl.report import mode_graph, words

CSS = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 75rem; margin: 2rem auto; padding: 0 1rem }
svg { width: 100%; height: auto }
table { border-collapse: collapse; margin: 1rem 0; font-size: 14px }
th, td { text-align: left; padding: .2rem .9rem .2rem 0; vertical-align: top; border-bottom: 1px solid #eee }
td { font-variant-numeric: tabular-nums }
"""


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
    table = words.Table.of(execution.transitions, limit)
    rows = ["<tr>" + "".join(f"<td>{_escaped(cell)}</td>" for cell in row) + "</tr>" for row in table.rows]
    if table.left_out:
        rows.insert(table.cut, f'<tr><td colspan="6">&hellip; {table.left_out} more &hellip;</td></tr>')
    header = "".join(f"<th>{_escaped(name)}</th>" for name in words.COLUMNS)
    return f"<table><thead><tr>{header}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def page(execution: Execution, svg: str, title: str | None, program: Program | None = None) -> str:
    """A page with an SVG picture, the summary and a program's mode graph; nothing is fetched."""
    name = _escaped(title or words.heading(execution))
    graph = "" if program is None else mode_graph.mode_graph(program, execution)
    picture = svg[svg.index("<svg") :].replace("<svg", f'<svg role="img" aria-label="{name}"', 1)
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{name}</title>\n'
        f"<style>{CSS}{mode_graph.CSS}</style>\n</head>\n<body>\n{picture}\n{html(execution)}\n{graph}\n"
        "</body>\n</html>\n"
    )
