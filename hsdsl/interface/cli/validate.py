"""``hsdsl validate``: report every error of model files, without a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hsdsl.base.names import counted
from hsdsl.base.written import written_edges, written_modes
from hsdsl.interface.cli.diagnostic_report import DiagnosticReport
from hsdsl.interface.cli.options import Answer, Formatted, Models


def validate(models: Models, *, format: Formatted = "text", answer: Answer) -> None:
    """Check model files and report every error in them."""
    report = DiagnosticReport("json" if answer.json else format, answer.quiet, "valid")
    with answer.reporting():
        report.examine(models, _look)
    report.finish()


def _look(path: Path) -> tuple[dict[str, Any], str]:
    from hsdsl.interface.model import load

    model = load(path)
    model.resolve()
    modes, parts = written_modes(model.system.modes), len(model.system.parts)
    edges = sum(len(written_edges(mode.edges)) for mode in modes)
    size = counted(parts, "part") if parts else counted(len(modes), "mode")
    return {"valid": True}, f"valid, {size}, {counted(edges, 'transition')}"
