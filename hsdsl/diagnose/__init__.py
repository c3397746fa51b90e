"""Errors and findings as text with a caret, as JSON, as SARIF, and as annotations for GitHub."""

from hsdsl.diagnose.github import as_annotation
from hsdsl.diagnose.plain import as_json, finding, measured
from hsdsl.diagnose.sarif import as_sarif
from hsdsl.diagnose.text import render

__all__ = ["as_annotation", "as_json", "as_sarif", "finding", "measured", "render"]
