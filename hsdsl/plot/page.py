"""A self-contained HTML page: the picture and the summary, nothing fetched from anywhere."""

from __future__ import annotations

from hsdsl.execution import Execution
from hsdsl.report import words
from hsdsl.report.page import escaped, html

CSS = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 75rem; margin: 2rem auto; padding: 0 1rem }
svg { width: 100%; height: auto }
table { border-collapse: collapse; margin: 1rem 0; font-size: 14px }
th, td { text-align: left; padding: .2rem .9rem .2rem 0; vertical-align: top; border-bottom: 1px solid #eee }
td { font-variant-numeric: tabular-nums }
"""


def page(execution: Execution, svg: str, title: str | None) -> str:
    """Put an SVG picture and the run's summary on a page."""
    name = escaped(title or words.heading(execution))
    picture = svg[svg.index("<svg") :].replace("<svg", f'<svg role="img" aria-label="{name}"', 1)
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{name}</title>\n'
        f"<style>{CSS}</style>\n</head>\n<body>\n{picture}\n{html(execution)}\n</body>\n</html>\n"
    )
