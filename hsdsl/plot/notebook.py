"""Runs as notebooks display them: summary, verdict, and a picture inside the text; nothing is fetched."""

from __future__ import annotations

import base64
from html import escape
from io import BytesIO

from hsdsl.execution import Execution
from hsdsl.names import visible
from hsdsl.plot.style import styled, write_figure
from hsdsl.plot.view import View
from hsdsl.report import words
from hsdsl.report.html import html

MOST = 12  # rows of a table of transitions
DOTS = 90  # an inch


def run_html(run: Execution) -> str:
    """Return a run's summary and picture; every text of the model is escaped."""
    return f"{html(run, limit=MOST)}\n{picture(run, View(**run.view()))}"


def picture(run: Execution, view: View) -> str:
    """Return a picture as an element of HTML that holds its own bytes."""
    with styled():
        from hsdsl.plot import figure

        file = BytesIO()
        write_figure(figure.picture([run], view), file, "png", DOTS)
    name = escape(visible(words.heading(run)), quote=True)
    data = base64.b64encode(file.getvalue()).decode()
    return f'<img alt="{name}" style="max-width: 100%" src="data:image/png;base64,{data}">'
