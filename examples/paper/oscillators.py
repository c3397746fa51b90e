"""Table I and Fig. 14a to 14c: the oscillator with a stop, its two examples and their exact trajectories."""

from __future__ import annotations

import math
from typing import Any

from hsdsl.engine.execution import Execution
from hsdsl.interface.model import Model
from paper.results import Desk, Finding

TABLE = {  # as printed; u at t = 0 and t = 1
    1: {"a": 0.05, "c": 0.9, "t_max": 40 * math.pi, "u(0)": 20.0, "u(1)": 20 * math.cos(2.5), "x_0": 11.36,
        "v_0": 31.4, "x_max": 14.0, "omega": 2.5},
    2: {"a": 0.95, "c": 0.5, "t_max": 4 * math.pi, "u(0)": 1.0, "u(1)": math.cos(1), "x_0": -0.8,
        "v_0": 0.0, "x_max": -0.8, "omega": 1.0},
}  # fmt: skip


def table_1(desk: Desk) -> list[Finding]:
    """Read Table I off the models, from what they do and not from their text."""
    rows: list[tuple[object, ...]] = []
    found: list[Finding] = []
    for example, model in desk.oscillators.items():
        read = parameters(model)
        rows.append((example, *(read[name] for name in TABLE[example])))
        worst = max(abs(read[name] - value) for name, value in TABLE[example].items())
        where = f"example {example}: largest difference of the model's parameters"
        found.append(Finding("Table I", where, worst, "0"))
    desk.table("table-1", ("example", *TABLE[1]), rows)
    return found


def parameters(model: Model) -> dict[str, float]:
    """Return what Table I lists; the force is what is left of the acceleration at x = v = 0."""
    system = model.system
    found = {parameter.name: float(parameter.value) for parameter in system.parameters}
    found["t_max"] = float(system.experiment.until)
    found |= {f"{name}_0": float(value) for name, value in system.initial.values}
    acceleration: Any = system.modes[0].flow[1]
    for t in (0, 1):
        at = {"t": t, "x": 0, "v": 0} | found
        force = acceleration.subs({symbol: at[symbol.name] for symbol in acceleration.free_symbols})
        found[f"u({t})"] = float(force)
    return found


def stop(desk: Desk) -> list[Finding]:
    """Draw the oscillator."""
    from paper.drawing.stop import draw

    desk.picture("fig14a-stop", draw)
    return []


def exact(desk: Desk) -> list[Finding]:
    """Draw the exact trajectories, and list their impacts."""
    from paper.drawing.trajectories import draw

    runs = desk.truths
    for example, run in runs.items():
        rows = [(t.index, t.time, t.before["v"], (t.after or {})["v"]) for t in run.transitions]
        desk.table(f"impacts-{example}", ("index", "time", "velocity before", "velocity after"), rows)
    stops = {example: TABLE[example]["x_max"] for example in runs}
    desk.picture("fig14bc-exact", lambda: draw(runs, stops))
    first, second = runs[1], runs[2]
    ends = [f"{first.final.state[name]:.10g}" for name in ("x", "v")]
    return [
        Finding("Fig. 14b", "example 1: impacts", len(first.transitions), "49"),
        Finding("Fig. 14b", "example 1: time of the last impact", f"{first.transitions[-1].time:.10g}"),
        Finding("Fig. 14b", "example 1: (x, v) at 40 pi", f"({ends[0]}, {ends[1]})"),
        Finding("Fig. 14c", "example 2: first impact after release", f"{second.transitions[0].time:.10g}"),
        Finding("Fig. 14b", "example 1: bound on the error of what is drawn", first.settings["error"]),
        Finding("Fig. 14c", "example 2: bound on the error of what is drawn", second.settings["error"]),
        *(Finding("Fig. 14c", "example 2: " + sentence.partition(";")[0], "yes") for sentence in _rests(second)),
    ]


def _rests(run: Execution) -> list[str]:
    """Say from when to when a run rests on the stop."""
    spans = [(run.times[a.first], run.times[a.last]) for a in run.arcs if not run.values[a.first : a.last + 1, 1].any()]
    return [f"rests on the stop from t = {begin:.10g} to {end:.10g}" for begin, end in spans if end > begin]
