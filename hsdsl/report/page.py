"""The summary as a piece of HTML: for Jupyter, and beside the plot of a page."""

from __future__ import annotations

from html import escape

from hsdsl.execution import Execution, Transition
from hsdsl.names import visible_lines
from hsdsl.report import words


def escaped(text: str) -> str:
    """Write any text in HTML, between tags or in an attribute: it is read as the text that it is."""
    return escape(visible_lines(text))


def html(execution: Execution, *, limit: int = 60) -> str:
    """Sum a run up in HTML (a ``div``), with at most ``limit`` transitions; every text of the model is escaped."""
    facts = [
        ("with", words.overrides(execution)),
        ("stop", words.stop(execution)),
        ("final", words.final(execution.final)),
        ("state", words.values(execution.final.state)),
        ("outputs", words.outputs(execution.final)),
        ("verdict", words.verdict(execution)),
        ("time", words.seconds(execution)),
    ]
    rows = "".join(f"<tr><th>{label}</th><td>{escaped(text)}</td></tr>" for label, text in facts if text)
    settings = escaped(", ".join(words.settings(execution)))
    return (
        f'<div class="hsdsl"><p><strong>{escaped(words.heading(execution))}</strong><br>{settings}</p>'
        f"<table>{rows}</table>{_transitions(execution, limit)}</div>"
    )


def _transitions(execution: Execution, limit: int) -> str:
    transitions = execution.transitions
    if not transitions:
        return "<p>No transitions.</p>"
    head, tail = words.shortened(len(transitions), limit)
    instants = words.times([transitions[i].time for i in (*head, *tail)])
    rows = [_row(transitions[i], time) for i, time in zip((*head, *tail), instants, strict=True)]
    left_out = len(transitions) - len(rows)
    if left_out:
        rows.insert(len(head), f'<tr><td colspan="6">&hellip; {left_out} more &hellip;</td></tr>')
    names = ("#", "time", "delay", "edge", "from &rarr; to", "state")
    header = "".join(f"<th>{name}</th>" for name in names)
    return f"<table><thead><tr>{header}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _row(transition: Transition, time: str) -> str:
    between = f"{escaped(transition.source)} &rarr; {escaped(transition.target)}"
    note = "; ".join(filter(None, (words.changes(transition), words.remarks(transition))))
    cells = (str(transition.index), time, words.delay(transition), transition.edge)
    plain = "".join(f"<td>{escaped(cell)}</td>" for cell in cells)
    return f"<tr>{plain}<td>{between}</td><td>{escaped(note)}</td></tr>"
