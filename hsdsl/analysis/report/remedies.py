"""What to do about a verdict that is `unknown`: one remedy for each reason."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple


class Remedy(NamedTuple):
    """Reasons as they read, ``...`` for what differs, what they mean, and what to do about them."""

    reasons: tuple[str, ...]
    meaning: str
    remedy: str


REMEDIES = (
    Remedy(
        ("a fixed step does not say how wrong it is", "the finer run was interrupted"),
        "no second run was made to measure the error",
        "`--estimate`, or a tolerance in place of a step",
    ),
    Remedy(
        ("the run is unreliable from t = ... on",),
        "from there a finer run makes other transitions, or an error exceeds a tenth of its state",
        "a smaller `--tolerance`; in chaos no tolerance helps for long: shorten `until`. Where digits cancel, as in "
        "`sqrt(x**2 + 1e18) - 1e9`, write the expression without that, or use `--precision`",
    ),
    Remedy(
        (
            "the crossing of ... would be undone by ... the error",
            "the run turns back close to ...",
            "the run turns back within the error of ...",
            "whether ... is reached close to ... could not be decided",
        ),
        "a guard is hardly crossed, or hardly missed: near grazing",
        "a smaller `--tolerance`; else change a parameter a little both ways and compare what happens there",
    ),
    Remedy(
        ("the order of ... is within the error",),
        "two guards are reached almost together",
        "separate them with `if`, or make both orders lead to one state",
    ),
    Remedy(
        ("... fired at once on entry, ... outside its domain",),
        "a reset landed beyond the guard of another transition",
        "land on the guard or inside it, or use `event` in place of `when`",
    ),
    Remedy(
        ("... fired at once on entry, ... may keep it from that",),
        "a reset or a jump leads so close to a guard that an error decides whether it fires",
        "move the threshold off the value, as halves for counters, or use a smaller `--tolerance`",
    ),
    Remedy(
        ("an input or function of time jumps ... within the error of ...",),
        "a step of an input, or of `floor(t)`, falls on a transition that reads it",
        "move the step off the transition, or read the input in the flow alone",
    ),
    Remedy(
        ("whether the condition of ... holds is within the error",),
        "an `if` is decided by round-off",
        "compare counters at halves; move the threshold off the value",
    ),
    Remedy(
        ("a transition of ... within the error of the end is undecided",),
        "`until` falls on an event, as a multiple of a sampling period does",
        "end a little earlier or later: between two samples",
    ),
    Remedy(
        ("... would not settle on a polynomial", "the surface of ... has no slope there"),
        "a guard with a kink is crossed at it (`abs`, `min`), or one that is flat",
        "split the guard into two transitions",
    ),
    Remedy(
        ("the run starts on the surface of ...",),
        "the start is on a guard, and an error decides whether that fires",
        "start off the surface",
    ),
    Remedy(
        ("the reset of ... lands ... the surface of ...", "the reset of ... jumps within the error"),
        "an error decides on which side of a guard, or of a jump of the reset, the next mode begins",
        "land clearly inside, or on the guard for all states nearby; a gap between thresholds (hysteresis) helps",
    ),
    Remedy(
        ("the flow of mode ... jumps where ...",),
        "a flow that jumps within a mode",
        "two modes with a transition between them",
    ),
    Remedy(
        ("a change of the flow of mode ... may not have been seen", "the slope of the flow of mode ... has no bound"),
        "the flow changes faster than the steps show",
        "a sampled input with the times of the pulse, or a smaller `--tolerance`",
    ),
    Remedy(
        (
            "inside a step, ... the run is beyond the surface of ...",
            "... turning points close to surfaces were not looked at",
        ),
        "a step passed over a visit beyond a guard",
        "a smaller `--tolerance`, or `--method taylor`",
    ),
    Remedy(
        ("... has no value close to ...", "... has no rate at ..."),
        "a guard or its rate has no number there, as a root of something negative",
        "write the guard so that it has a value on both sides, as h for sqrt(h)",
    ),
    Remedy(("the run did not get to its end",), "the run stopped before `until`", "what the line `stop` says"),
)


def remedies_of(reasons: Sequence[str]) -> list[str]:
    """The remedies of some reasons, each once."""
    found = (_of(reason) for reason in reasons)
    return [text for text in dict.fromkeys(found) if text]


@cache
def _patterns() -> list[tuple[re.Pattern[str], str]]:
    return [
        (re.compile(".*".join(re.escape(part.strip()) for part in reason.split("..."))), each.remedy)
        for each in REMEDIES
        for reason in each.reasons
    ]


def _of(reason: str) -> str:
    return next((remedy for pattern, remedy in _patterns() if pattern.match(reason)), "")


def table() -> str:
    """The remedies as a table in Markdown."""
    rows = (
        f"| {', '.join(f'`{reason}`' for reason in each.reasons)} | {each.meaning} | {each.remedy} |"
        for each in REMEDIES
    )
    return "\n".join(["| the reason says | what it is | what to do |", "|---|---|---|", *rows])
