"""A run as a readable `summary`, in text or HTML, and as the object that `--json` prints (`json_form`).

Both take their sentences from `words`. `model` is a model for notebooks; `mode_graph` draws its modes.
"""

from hsdsl.analysis.report.json_form import as_json, dumps, record

__all__ = ["as_json", "dumps", "record"]
