"""A run as a readable `summary`, as HTML (`html`), and as the object that `--json` prints (`json_form`).

All take their sentences from `words`; `alike` joins those that differ in numbers only. `model` is a model for
notebooks: its equations (`mathml`) and its `mode_graph`, laid out by `graph_layout`; `visited` is what of it to draw.
"""

from hsdsl.analysis.report.json_form import as_json, dumps, record

__all__ = ["as_json", "dumps", "record"]
