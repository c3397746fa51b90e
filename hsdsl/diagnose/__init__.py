"""Errors and findings as text with a caret, as JSON, as SARIF, and as annotations for GitHub."""

from hsdsl.diagnose.plain import as_json, finding
from hsdsl.diagnose.text import render

__all__ = ["as_json", "finding", "render"]
