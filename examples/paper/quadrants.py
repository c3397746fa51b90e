"""Fig. 1 and Sec. V-A: executions that pass the corner on either side, in our metric and in its rivals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import references.digital_control as exact

from hsdsl.analysis.metrics.curves import rho
from hsdsl.analysis.metrics.points import SpaceMetric, SpacePoint
from hsdsl.analysis.metrics.space import make_space
from hsdsl.engine.execution import Execution
from hsdsl.interface.model import Model
from hsdsl.interface.model.distances import distance_of_runs as distance
from paper.results import Desk, Finding, say

DELTAS = tuple(Fraction(1, 10**k) for k in range(1, 7))
RELAXATION = 1e-10
GAP = 1e-7  # between the bounds of rho, relative
PAIRS = (("x", "y"), ("x", "z"), ("y", "z"))
RIVALS = ("sup", "skorokhod", "tau-epsilon")
HEADER = ("executions", "delta", "pair", "metric", "lower", "upper", "time")
KNOWN = {("x", "y"): "1.019804", ("x", "z"): "1.044031", ("y", "z"): "1.414214"}

Row = tuple[str, float, str, str, float, float, Any]


def digital_control(desk: Desk) -> list[Finding]:
    """Measure the distances of x, y_delta and z_delta against delta, exact executions and simulated ones."""
    from paper.drawing.quadrants import draw

    model = desk.model("digital-control.yaml")
    rows: list[Row] = []
    for delta in DELTAS[::5] if desk.quick else DELTAS:
        say(f"  delta = {float(delta):g}")
        rows += measured("exact", delta, executions(model, delta), model, PAIRS[2:] if desk.quick else PAIRS)
        rows += measured("relaxed", delta, simulated(model, delta), model, ())
    desk.table("digital-control", HEADER, rows)
    pictured = executions(model, Fraction(1, 4))
    desk.picture("fig01-digital-control", lambda: draw(pictured, rows))
    return findings(rows)


def executions(model: Model, delta: Fraction) -> dict[str, Execution]:
    """Return x, y_delta and z_delta, exactly."""
    starts = {"x": {}, "y": {"x": -1 - delta}, "z": {"y": -1 - delta}}
    digest = model.program.digest
    return {name: replace(exact.digital_control(**start), digest=digest) for name, start in starts.items()}


def simulated(model: Model, delta: Fraction) -> dict[str, Execution]:
    """Return the same by the relaxed scheme."""
    start = {"x": {}, "y": {"x": f"-1 - {delta}"}, "z": {"y": f"-1 - {delta}"}}
    return {
        name: model.simulate(initial=initial, scheme="relaxed", method="midpoint", step=0.5, relaxation=RELAXATION)
        for name, initial in start.items()
    }


def measured(
    kind: str, delta: Fraction, runs: dict[str, Execution], model: Model, rivals_of: Sequence[tuple[str, str]]
) -> list[Row]:
    """Measure every pair, some with the rivals too, and y and z at their end."""
    rows: list[Row] = []
    space = SpaceMetric(make_space(model.system, []), None)
    for a, b in PAIRS:
        found = {"rho": rho(runs[a], runs[b], space, gap=GAP)}
        if (a, b) in rivals_of:
            found |= {metric: distance(runs[a], runs[b], metric, model=model) for metric in RIVALS}
        for metric, d in found.items():
            rows.append((kind, float(delta), f"{a} {b}", metric, d.lower, d.upper, d.time))
    ends = [SpacePoint(run.final.mode, tuple(run.final.state.values())) for run in (runs["y"], runs["z"])]
    point = model.distance(*ends).interval
    rows.append((kind, float(delta), "y(2) z(2)", "quotient", point.lower, point.upper, 2.0))
    return rows


def findings(rows: list[Row]) -> list[Finding]:
    """Say how distances go with delta, at the smallest one."""
    smallest = min(row[1] for row in rows)
    upper = {(row[0], row[2], row[3]): row[5] for row in rows if row[1] == smallest}
    lower = {(row[0], row[2], row[3]): row[4] for row in rows if row[1] == smallest}
    found: list[Finding] = []
    at = f"delta = {smallest:g}"
    for kind in ("exact", "relaxed"):
        for pair, known in KNOWN.items():
            value = upper[kind, " ".join(pair), "rho"] / smallest
            found.append(Finding("Sec. V-A", f"rho({', '.join(pair)})/delta, {kind}, {at}", f"{value:.6f}", known))
        value = upper[kind, "y(2) z(2)", "quotient"] / smallest
        found.append(Finding("Sec. V-A", f"d(y(2), z(2))/delta, {kind}, {at}", f"{value:.6f}", "1.063015"))
    for metric in RIVALS:
        found.append(Finding("Sec. V-A", f"{metric}(y, z), exact, {at}", lower["exact", "y z", metric], ">= 1"))
    return found
