"""The derivatives of a run in words, and as the object of `sensitivity --json`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from hsdsl.analysis.report.alike import condensed
from hsdsl.analysis.report.json_form import plain
from hsdsl.analysis.report.words import aligned, number
from hsdsl.analysis.sensitivity.result import EndSlopes, Sensitivity, TransitionSlopes
from hsdsl.analysis.sensitivity.ties import Tie
from hsdsl.base.names import called, seen

PARTS = ("final", "transitions", "outputs")
ALWAYS = PARTS[:2]  # where no part is chosen
MOST_ROWS = 40


def as_json(found: Sensitivity, parts: Sequence[str] = ALWAYS) -> dict[str, Any]:
    """The object of `sensitivity --json`; numbers that do not exist are null."""
    run = found.execution
    result: dict[str, Any] = {
        "model": run.model,
        "wrt": list(found.wrt),
        "settings": {"method": run.method, "tolerance": run.settings.get("tolerance"), "until": run.settings["until"]},
        "stop": {"reason": found.run.stop.reason, "time": found.run.stop.time},
        "exists": found.exists,
        "reasons": list(found.reasons),
        "verdict": found.verdict.theorem,
    }
    if "final" in parts:
        result["final"] = {"at": run.final.time, **_end(found.final)}
    if "transitions" in parts:
        made = zip(run.transitions, found.transitions, strict=True)
        result["transitions"] = [{"at": t.time, **_transition(d)} for t, d in made]
    if "outputs" in parts:
        table = found.sample()
        values = {name: {"value": v, **_columns(found, table.slopes[name])} for name, v in table.values.items()}
        result["samples"] = {"times": table.times, "values": values}
    if found.ties:
        result["ties"] = [_tie(tie) for tie in found.ties]
    if found.breaks:
        result["one_sided"] = {edge: _end(side.final) for edge, side in found.sides.items()}
    return plain(result)


def _tie(tie: Tie) -> dict[str, Any]:
    return {"time": tie.time, "reason": tie.reason, "orders": [vars(order) for order in tie.orders]}


def _end(end: EndSlopes) -> dict[str, Any]:
    return {"mode": end.mode, "time": end.time, "state": seen(end.state), "outputs": end.outputs}


def _transition(made: TransitionSlopes) -> dict[str, Any]:
    return vars(made) | {"before": seen(made.before), "after": seen(made.after)}


def _columns(found: Sensitivity, slopes: Any) -> dict[str, Any]:
    return {by: slopes[:, k] for k, by in enumerate(found.wrt)}


def summary(found: Sensitivity, parts: Sequence[str] = ALWAYS) -> str:
    """The derivatives as tables."""
    return "\n".join(_lines(found, parts))


def _lines(found: Sensitivity, parts: Sequence[str]) -> Iterator[str]:
    run = found.execution
    yield f"{called(run.title, run.model)}: derivatives by {', '.join(found.wrt)}"
    answer = {True: "yes", False: "no", None: "not known"}[found.exists]
    reasons = [] if found.exists else condensed(found.reasons)
    yield f"they exist: {answer}" + "".join(f"\n  {reason}" for reason in reasons)
    if "final" in parts:
        yield from _final(found)
    for edge, side in found.sides.items() if found.breaks else ():
        yield f"\nof the executions on which {edge} goes first"
        yield from _final(side)
    if "transitions" in parts and run.transitions:
        rows = zip(run.transitions, found.transitions, strict=True)
        table = [[str(t.index), t.edge, number(t.time, 10), *map(_slope, d.time.values())] for t, d in rows]
        yield from _table("transition times", ["#", "edge", "time", *_heads(found)], table)
    if "outputs" in parts:
        yield from _samples(found)


def _final(found: Sensitivity) -> Iterator[str]:
    run, end = found.execution, found.final
    rows = [["t", number(run.final.time, 10), *map(_slope, end.time.values())]]
    rows += [[x, number(run.final.state[x], 10), *map(_slope, row.values())] for x, row in seen(end.state).items()]
    rows += [[y, number(run.final.outputs[y], 10), *map(_slope, row.values())] for y, row in end.outputs.items()]
    yield from _table(f"end of the run, mode {end.mode}", ["", "value", *_heads(found)], rows)


def _samples(found: Sensitivity) -> Iterator[str]:
    table = found.sample()
    for name, values in table.values.items():
        columns = zip(table.times.tolist(), values.tolist(), table.slopes[name].tolist(), strict=True)
        rows = [[number(t, 10), number(v, 10), *map(_slope, row)] for t, v, row in columns]
        yield from _table(name, ["t", "value", *_heads(found)], rows)


def _heads(found: Sensitivity) -> list[str]:
    return [f"d/d {by}" for by in found.wrt]


def _slope(value: Any) -> str:
    return "none" if value != value else number(value, 10)


def _table(title: str, heads: list[str], rows: list[list[str]]) -> Iterator[str]:
    shown = rows[:MOST_ROWS]
    yield f"\n{title}"
    yield from (f"  {line}".rstrip() for line in aligned([heads, *shown]))
    if len(rows) > len(shown):
        yield f"  and {len(rows) - len(shown)} more (--json has all)"
