"""A fit in words, and as the object of `fit --json`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from hsdsl.fitting.fit import Fit
from hsdsl.names import called
from hsdsl.report.json_form import plain
from hsdsl.report.words import number


def as_json(fit: Fit) -> dict[str, Any]:
    """The object of `fit --json`; what is not determined is null."""
    names = ("values", "deviations", "covariance", "deviation", "success", "message", "evaluations", "at_bound")
    result: dict[str, Any] = {name: getattr(fit, name) for name in names}
    result["measurements"] = fit.measured.count
    result["nonsmooth"] = fit.nonsmooth
    return plain(result)


def summary(fit: Fit) -> str:
    """The fit as lines of text."""
    return "\n".join(_lines(fit))


def _lines(fit: Fit) -> Iterator[str]:
    run = fit.execution
    yield f"{called(run.title, run.model)}: {fit.measured.count} measurements, {fit.evaluations} runs"
    width = max(map(len, fit.values))
    for name, value in fit.values.items():
        deviation = fit.deviations[name]
        determined = bool(np.isfinite(deviation))
        known = f"+- {number(deviation, 3)}" if determined else "not determined by the measurements"
        bound = ", at its bound" if name in fit.at_bound else ""
        yield f"  {name:{width}}  {number(value, 12 if determined else 3)} {known}{bound}"
    yield f"left over: {number(fit.deviation, 4)} (weighted root mean square)"
    yield f"{'ended' if fit.success else 'did not end'} well: {fit.message}"
    yield from (f"not smooth: {reason}" for reason in fit.nonsmooth)
