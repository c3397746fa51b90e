"""A periodic orbit in words, and as the object of `orbit --json`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from hsdsl.analysis.orbits.orbit import LEAST_MARGIN, Orbit
from hsdsl.analysis.report.alike import condensed
from hsdsl.analysis.report.json_form import plain
from hsdsl.analysis.report.words import number, values
from hsdsl.base.names import called, seen
from hsdsl.engine.execution import Array


def as_json(orbit: Orbit) -> dict[str, Any]:
    """The object of `orbit --json`; a complex number is its real and its imaginary part."""
    result = {
        name: getattr(orbit, name)
        for name in ("section", "laps", "mode", "state", "phase", "period", "drift", "residual", "verdict", "reasons")
    }
    result["state"] = seen(orbit.state)
    result["multipliers"] = _pairs(orbit.multipliers)
    if orbit.sides:
        result["sides"] = {edge: _pairs(found) for edge, found in orbit.sides.items()}
    return plain(result)


def _pairs(found: Array) -> list[dict[str, float]]:
    return [{"real": float(m.real), "imaginary": float(m.imag), "size": float(np.abs(m))} for m in found]


def summary(orbit: Orbit) -> str:
    """The orbit as lines of text."""
    return "\n".join(f"{label:12}{text}" for label, text in _facts(orbit))


def _facts(orbit: Orbit) -> Iterator[tuple[str, str]]:
    run = orbit.execution
    closing = "" if orbit.laps == 1 else f", closed by {orbit.laps} of them"
    yield "orbit", f"{called(run.title, run.model)}: right after {orbit.section}{closing}"
    yield "period", number(orbit.period, 12)
    if orbit.phase is not None:
        yield "phase", f"t = {number(orbit.phase, 12)} within the period of the forcing"
    yield "state", f"mode {orbit.mode}, {values(seen(orbit.state))}"
    if orbit.drift:
        yield "drift", f"{values(orbit.drift)} in a period; nothing depends on it"
    yield "multipliers", shown(orbit.multipliers)
    for edge, found in orbit.sides.items():
        yield "", f"{shown(found)} where {edge} goes first"
    yield "verdict", f"{orbit.verdict}: {'; '.join(condensed(orbit.reasons))}"


def shown(found: Array) -> str:
    """Multipliers, a pair of conjugate ones as one; what is not known from zero is zero."""
    parts: list[str] = []
    for m in np.where(np.abs(found) < LEAST_MARGIN, 0.0, found):
        if m.imag == 0:
            parts.append(number(float(m.real), 12))
        elif m.imag > 0:
            size = number(float(np.abs(m)), 12)
            parts.append(f"{number(float(m.real), 12)} +- {number(float(m.imag), 12)}i (size {size})")
    return ", ".join(parts) or "none"
