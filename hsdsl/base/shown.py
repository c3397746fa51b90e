"""How runs show and save themselves: functions of the analysis, by name, imported when they are called.

The data of a run does not import its pictures: this table is the one place that looks up.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

HOMES = {
    "axes": "hsdsl.analysis.plot",
    "ensemble_html": "hsdsl.analysis.plot.notebook",
    "run_html": "hsdsl.analysis.plot.notebook",
    "save": "hsdsl.analysis.store",
}


def shown(name: str, *given: Any, **options: Any) -> Any:
    """Call the function of this name."""
    return getattr(import_module(HOMES[name]), name)(*given, **options)
