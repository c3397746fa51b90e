"""What a target with tables of explicit methods runs: the table, and the settings it is run with."""

from __future__ import annotations

from dataclasses import replace

from hsdsl.base.errors import UsageError
from hsdsl.engine.integrators import AUTO, INTEGRATORS, ButcherTableau
from hsdsl.export.source import Source


def explicit(source: Source, target: str) -> tuple[Source, ButcherTableau]:
    """The source with an explicit method, and its table: where `auto` is Taylor's method, `AUTO` in its place.

    Raises UsageError: the target cannot keep the scheme or the method.
    """
    settings = source.problem.settings
    method = settings.method
    if method is None:
        raise UsageError(f"{target} has no scheme '{settings.scheme}'", "--scheme relaxed or --scheme located")
    known = ", ".join(INTEGRATORS)
    if method.implicit:
        stiff = "the model is stiff: an explicit one takes many small steps, if you want it with "
        hint = f"{'' if settings.method_chosen is None else stiff}--method {AUTO}"
        raise UsageError(f"{target} has explicit methods ({known}), not {method.name}", hint)
    if method.kind != "table" and settings.method_chosen is None:
        raise UsageError(f"{target} has the methods {known}, not {method.name}", f"--method {AUTO}")
    table = method if method.kind == "table" else INTEGRATORS[AUTO]
    return replace(source, problem=source.problem.with_settings(replace(settings, method=table))), table
