"""A run as a readable `summary`, as HTML (`html`), and as the object that `--json` prints."""

from hsdsl.report.json_form import as_json, dumps, record

__all__ = ["as_json", "dumps", "record"]
