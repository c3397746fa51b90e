"""The parts of a run in words, the same in text, in HTML and on a plot.

Sentences that differ in numbers only are told once, and each reason of `unknown` has a remedy.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

from hsdsl.base.defaults import kept_digits
from hsdsl.base.names import called, seen, visible_lines, without_memory
from hsdsl.base.numbers import decimals
from hsdsl.base.parts import change, compact, of_all
from hsdsl.engine.execution import Execution, Transition

DIGITS = 10  # of a run without a tolerance, whose error nothing says
_LEAST_DIGITS, _MOST_DIGITS = 3, 16
MOST_WORDS = 25  # of a sentence
_CLAUSE = re.compile(r"[:;,] ")
COLUMNS = ("#", "time", "delay", "edge", "from -> to", "state")


def number(x: Any, digits: int = 6) -> str:
    """Write a number to a few significant digits, zero without a sign; text and None as they are."""
    if isinstance(x, (bool, int)) or not (isinstance(x, float) or decimals.is_multiprecision(x)):
        return str(x)
    return f"{float(x) + 0.0:.{digits}g}"


def values(named: Mapping[str, Any], digits: int = DIGITS) -> str:
    """Write named values."""
    return ", ".join(f"{name} = {number(value, digits)}" for name, value in named.items())


def escaped(text: str) -> str:
    """A text of a model for HTML."""
    return escape(visible_lines(text))


def html_row(cells: Iterable[str], kind: str = "td") -> str:
    """Cells as a row of a table in HTML."""
    return f"<tr>{''.join(f'<{kind}>{escaped(cell)}</{kind}>' for cell in cells)}</tr>"


def html_table(names: Iterable[str], rows: Iterable[str]) -> str:
    """Rows of HTML as a table with a heading."""
    return f"<table><thead>{html_row(names, 'th')}</thead><tbody>{''.join(rows)}</tbody></table>"


def html_facts(facts: Iterable[tuple[str, str]]) -> str:
    """Named facts as a table in HTML."""
    rows = (f"<tr><th>{escaped(name)}</th><td>{escaped(text)}</td></tr>" for name, text in facts)
    return f"<table>{''.join(rows)}</table>"


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of cells as lines, with columns as wide as their widest cell."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def meant_digits(execution: Execution) -> int:
    """How many digits of its times and states a run means: those of its tolerance and one more, where it has one."""
    tolerance = execution.settings.get("tolerance")
    if not tolerance:
        return DIGITS
    finest = 10.0 ** (1 - _MOST_DIGITS)  # of many digits it may be below all floats
    return max(_LEAST_DIGITS, 1 - math.floor(math.log10(max(tolerance, finest))))


def heading(execution: Execution) -> str:
    """Name the run: the model's title, or its file."""
    return called(execution.title, execution.model)


def settings(execution: Execution) -> list[str]:
    """List the scheme, the method and the settings of a run, which has equal bits by either engine."""
    chosen = [f"{execution.scheme} {execution.method}"]
    shown = {"scheme", "method", "engine", "method_chosen"}
    for name, value in execution.settings.items():
        if name not in shown and value is not None and not isinstance(value, (Mapping, list, tuple)):
            chosen.append(f"{name} {number(value)}")
    if execution.digits is not None and "precision" not in execution.settings:
        chosen.append(f"{execution.digits} digits{_kept(execution)}")
    return chosen


def _kept(execution: Execution) -> str:
    """The number of digits that the tolerance keeps, where these are far fewer than there are."""
    tolerance, digits = execution.settings.get("tolerance"), execution.digits
    if tolerance is None or digits is None:
        return ""
    kept = len(str(int(1 / tolerance + 0.5))) - 1
    return f", of which the tolerance keeps {kept}" if kept < kept_digits(digits) else ""


def overrides(execution: Execution) -> str:
    """Parameters and initial values that are not those of the file; `settings` has the others."""
    given = {n: v for n, v in execution.overrides.items() if not n.startswith("experiment.")}
    alike = Counter((of_all(name), values({"": value})) for name, value in given.items())
    found: dict[str, Any] = {}
    for name, value in given.items():
        count = alike[of_all(name), values({"": value})]
        found[name if count == 1 else f"{of_all(name)} of {count} instances"] = value
    return values(found)


def facts(execution: Execution) -> Iterator[tuple[str, str]]:
    """Labels and texts of the end of a run: warnings, verdict, its reasons where it has more to say, and seconds."""
    final, left_out = execution.final, execution.settings.get("left_out")
    count = f"{final.jump} transition{'' if final.jump == 1 else 's'}"
    waiting = ", waiting in a strip" if final.kind == "strip" else ""
    yield "stop", stop(execution)
    yield "final", f"mode {compact(final.mode)} after {count}{waiting}"
    digits = meant_digits(execution)
    yield "state", values(seen(final.state), digits)
    yield "outputs", values({name: value for name, value in final.outputs.items() if value == value}, digits)
    if left_out is not None:
        yield "left out", f"{', '.join(left_out['states'])}: {left_out['reason']}"
    yield from (("warning", each) for each in condensed([warning.message for warning in execution.warnings]))
    yield "verdict", conclusion(execution)
    if conclusion(execution) != ": ".join((execution.verdict.theorem, *reasons(execution))):
        yield from (("reason", each) for each in reasons(execution))
    if execution.verdict.theorem == "unknown":
        yield from (("remedy", each) for each in remedies_of(execution.verdict.reasons))
    yield "time", ", ".join(f"{stage} {value:.3g} s" for stage, value in execution.seconds.items())


def conclusion(execution: Execution) -> str:
    """The verdict with its first reason, as many clauses of that as make one short sentence."""
    theorem, first = execution.verdict.theorem, next(iter(reasons(execution)), "")
    if not first:
        return theorem
    most = MOST_WORDS - 2  # the theorem, and where to read more
    clauses = [first[: place.start()] for place in _CLAUSE.finditer(first)]
    fitting = [clause for clause in (*clauses, first) if len(clause.split()) <= most]
    return f"{theorem}: {fitting[-1] if fitting else ' '.join(first.split()[:most])}"


def reasons(execution: Execution) -> list[str]:
    """The reasons of the verdict; a stop that the lines above describe is only named."""
    reason, message = execution.stop.reason, execution.stop.message
    stops = f"the run stops ({reason})"
    named = [text.replace(message, stops) for text in execution.verdict.reasons]
    return condensed([text for text in named if text != stops or sum(stops in other for other in named) == 1])


def stop(execution: Execution) -> str:
    """The reason and time of the run's end."""
    reason, message = execution.stop.reason, execution.stop.message
    when = "" if "t = " in message else f" at t = {number(execution.stop.time, 10)}"
    return f"{reason}{when}: {message}"


def table(execution: Execution, limit: int) -> tuple[list[tuple[str, ...]], int, int]:
    """The first and the last transitions, ``limit`` in all, as rows by `COLUMNS`.

    Returns the rows, and after how many of them how many transitions are left out.
    """
    transitions, digits = execution.transitions, meant_digits(execution)
    count = len(transitions)
    cut = (limit + 1) // 2 if count > limit else count
    chosen = [*transitions[:cut], *(transitions[cut - limit :] if limit < count and cut < limit else ())]
    instants = times([t.time for t in chosen], digits)
    rows = [
        (str(t.index), instant, _delay(t), t.edge, change(t.source, t.target, t.edge), _changes(t, min(6, digits)))
        for t, instant in zip(chosen, instants, strict=True)
    ]
    return rows, cut, count - len(chosen)


def times(values: Sequence[Any], digits: int) -> list[str]:
    """Write times with equal decimals, and about ``digits`` significant digits for the largest."""
    finite = [float(t) for t in values if decimals.is_finite(t)]
    largest = max((abs(t) for t in finite), default=0.0)
    if largest >= 1e9 or 0.0 < largest < 1e-3:
        return [f"{float(t):.{digits}g}" for t in values]
    zeros = max(0, -math.floor(math.log10(largest)) - 1) if largest else 0  # after the point, before its digits
    places = max(0, digits - len(str(int(largest)))) + zeros
    return [f"{float(t):.{places}f}" for t in values]


def _delay(transition: Transition) -> str:
    """The duration of the strip, ``-`` where there was none."""
    if transition.resumed is None:
        return "open"
    waited = float(transition.resumed - transition.time)
    return f"{waited:.2e}" if waited else "-"


def _changes(transition: Transition, digits: int) -> str:
    """What a transition changed in the state, and what is special about it."""
    words = [_state(transition, digits)]
    if transition.entry:
        words.append("at once on entering the mode")
    if transition.alternatives:
        words.append("reached too: " + ", ".join(transition.alternatives))
    return "; ".join(words)


def _state(transition: Transition, digits: int) -> str:
    before, after = transition.before, transition.after
    if after is None:
        return "the run ended in the strip"
    old, new = without_memory(before), without_memory(after)
    words = [
        f"{name}: {number(before[name], digits)} -> {number(after[name], digits)}"
        for name in new
        if name in before and before[name] != after[name]
    ]
    words += [f"{name}: {number(after[name], digits)} (new)" for name in new if name not in before]
    words += [f"{name} dropped" for name in old if name not in after]
    return ", ".join(words) or "unchanged"


_NUMBER = re.compile(r"(?<![\w.\-])-?\d+(?:,\d{3})*(?:\.\d+)?(?:e[+-]?\d+)?(?!\w)")
_MARK = "\0"
_TIME = f"t = {_MARK}"
_WHEN = re.compile(f"(?:^|,? )(?:from {_TIME} (?:on|to {_TIME})|(?:at|close to) {_TIME})")
MOST_LISTED = 3  # of indices


def condensed(sentences: Sequence[str]) -> list[str]:
    """The same sentences, those that differ in numbers only as one."""
    groups: dict[str, list[str]] = {}
    for sentence in sentences:
        groups.setdefault(form(sentence), []).append(sentence)
    return [alike[0] if len(alike) == 1 else _joined(each, alike) for each, alike in groups.items()]


def form(sentence: str) -> str:
    """A sentence without its numbers: the same for all that are alike."""
    return _NUMBER.sub(_MARK, sentence)


def _joined(form: str, alike: Sequence[str]) -> str:
    """One sentence for several, with the times before it."""
    columns = list(zip(*map(_NUMBER.findall, alike), strict=True))
    place, times, kept = 0, list[str](), ""
    for piece in re.split(f"({_WHEN.pattern})", form):
        own = columns[place : place + piece.count(_MARK)]
        place += len(own)
        moves = any(len(set(column)) > 1 for column in own)
        if moves and _WHEN.fullmatch(piece):
            times += [text for column in own for text in column]
        else:
            first, *rest = piece.split(_MARK)
            texts = [_span(column, first if k == 0 else rest[k - 1]) for k, column in enumerate(own)]
            kept += first + "".join(text + after for text, after in zip(texts, rest, strict=True))
    when = f" between t = {_least(times)} and {_largest(times)}" if times else ""
    return f"{len(alike)} times{when}: {kept.strip()}"


def _span(column: Sequence[str], before: str) -> str:
    distinct = list(dict.fromkeys(column))
    if len(distinct) == 1:
        return distinct[0]
    if before.endswith("["):  # an index
        inner = sorted(distinct, key=_value)
        return ", ".join(inner) if len(inner) <= MOST_LISTED else f"{inner[0]}..{inner[-1]}"
    return f"{_least(distinct)} to {_largest(distinct)}"


def _least(texts: Sequence[str]) -> str:
    return min(texts, key=_value)


def _largest(texts: Sequence[str]) -> str:
    return max(texts, key=_value)


def _value(text: str) -> float:
    return float(text.replace(",", ""))


def remedies_of(reasons: Sequence[str]) -> list[str]:
    """The remedies of some reasons, each once."""
    found = (next((remedy for pattern, remedy in _patterns() if pattern.match(reason)), "") for reason in reasons)
    return [text for text in dict.fromkeys(found) if text]


@cache
def _patterns() -> list[tuple[re.Pattern[str], str]]:
    return [
        (re.compile(".*".join(re.escape(part.strip()) for part in reason.split("..."))), remedy)
        for reason, remedy in remedy_of().items()
    ]


@cache
def remedy_of() -> dict[str, str]:
    """What to do about each reason as it reads, ``...`` for what differs: the last column of ``remedies.md``."""
    _, _, *rows = Path(__file__).with_name("remedies.md").read_text("utf-8").splitlines()
    columns = [row.strip("| ").split(" | ") for row in rows]
    return {reason: remedy for reasons, _, remedy in columns for reason in re.findall("`(.*?)`", reasons)}
