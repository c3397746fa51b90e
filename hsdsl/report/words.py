"""How the parts of a run are put into words, the same in text, in HTML and on a plot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hsdsl import decimals
from hsdsl.defaults import kept_digits
from hsdsl.execution import Execution, Point, Transition


def number(x: Any, digits: int = 6) -> str:
    """Write a number for reading, to a few significant digits; text and None as they are."""
    if isinstance(x, bool) or not (isinstance(x, (int, float)) or decimals.is_multiprecision(x)):
        return str(x)
    return str(x) if isinstance(x, int) else f"{float(x):.{digits}g}"


def heading(execution: Execution) -> str:
    """Name the run: the model's title, or its file."""
    return execution.title or execution.model


def settings(execution: Execution) -> list[str]:
    """List what the run was done with."""
    chosen = [f"{execution.scheme} {execution.method}"]
    shown = {"scheme", "method", "engine", "method_chosen"}
    for name, value in execution.settings.items():
        if name not in shown and value is not None and not isinstance(value, (Mapping, list, tuple)):
            chosen.append(f"{name} {number(value)}")
    if execution.digits is not None and "precision" not in execution.settings:
        chosen.append(f"{execution.digits} digits{_kept(execution)}")
    return [*chosen, f"engine {execution.engine}"]


def _kept(execution: Execution) -> str:
    """Say how many digits the tolerance keeps, where these are far fewer than there are."""
    tolerance, digits = execution.settings.get("tolerance"), execution.digits
    if tolerance is None or digits is None:
        return ""
    kept = len(str(int(1 / tolerance + 0.5))) - 1
    return f", of which the tolerance keeps {kept}" if kept < kept_digits(digits) else ""


def overrides(execution: Execution) -> str:
    """Write which parameters and initial values are not those of the file; settings are told with the others."""
    return values({n: v for n, v in execution.overrides.items() if not n.startswith("experiment.")})


def left_out(execution: Execution) -> str:
    """Say which states were not integrated, and why that cannot matter."""
    found = execution.settings["left_out"]
    return f"{', '.join(found['states'])}: {found['reason']}"


def times(values: Sequence[Any]) -> list[str]:
    """Write times with one number of decimals, about ten significant digits for the largest."""
    finite = [float(t) for t in values if decimals.is_finite(t)]
    largest = max((abs(t) for t in finite), default=0.0)
    if largest >= 1e9 or 0.0 < largest < 1e-3:
        return [f"{float(t):.10g}" for t in values]
    places = 10 - len(str(int(largest)))
    return [f"{float(t):.{places}f}" for t in values]


def changes(transition: Transition) -> str:
    """Say what a transition did to the state: only what it changed, added or dropped."""
    before, after = transition.before, transition.after
    if after is None:
        return "the run ended in the strip"
    words = [
        f"{name}: {number(before[name])} -> {number(value)}"
        for name, value in after.items()
        if name in before and before[name] != value
    ]
    words += [f"{name}: {number(value)} (new)" for name, value in after.items() if name not in before]
    words += [f"{name} dropped" for name in before if name not in after]
    return ", ".join(words) or "unchanged"


def remarks(transition: Transition) -> str:
    """Say what is special about a transition."""
    words = ["at once on entering the mode"] if transition.entry else []
    if transition.alternatives:
        words.append("reached too: " + ", ".join(transition.alternatives))
    return "; ".join(words)


def delay(transition: Transition) -> str:
    """Write how long the strip took, ``-`` where there was none."""
    if transition.resumed is None:
        return "open"
    waited = float(transition.resumed - transition.time)
    return f"{waited:.2e}" if waited else "-"


def stop(execution: Execution) -> str:
    """Say why and when the run ended."""
    reason, message = execution.stop.reason, execution.stop.message
    when = "" if "t = " in message else f" at t = {number(execution.stop.time, 10)}"
    return f"{reason}{when}: {message}"


def values(named: Mapping[str, Any]) -> str:
    """Write named values for reading."""
    return ", ".join(f"{name} = {number(value, 10)}" for name, value in named.items())


def outputs(point: Point) -> str:
    """Write the outputs that have a value in the point's mode."""
    return values({name: value for name, value in point.outputs.items() if value == value})


def final(point: Point) -> str:
    """Say in which mode the run ended."""
    count = f"{point.jump} transition{'' if point.jump == 1 else 's'}"
    waiting = ", waiting in a strip" if point.kind == "strip" else ""
    return f"mode {point.mode} after {count}{waiting}"


def verdict(execution: Execution) -> str:
    """Say what is known of the theorem's hypotheses."""
    reasons = "; ".join(execution.verdict.reasons)
    return execution.verdict.theorem + (f": {reasons}" if reasons else "")


def seconds(execution: Execution) -> str:
    """Write how long each stage took."""
    return ", ".join(f"{stage} {value:.3g} s" for stage, value in execution.seconds.items())


def shortened(count: int, limit: int) -> tuple[range, range]:
    """Choose which of ``count`` items are shown: the first and the last, ``limit`` in all."""
    if count <= limit:
        return range(count), range(0)
    head = (limit + 1) // 2
    return range(head), range(count - (limit - head), count)
