"""What is said of a run: a readable summary, a short one in HTML (`page`), and the object that `--json` prints."""

from hsdsl.report.plain import as_json, dumps
from hsdsl.report.text import summary

__all__ = ["as_json", "dumps", "summary"]
