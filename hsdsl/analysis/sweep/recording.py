"""What is kept of each run of a sweep: always how it ended; the rest on request.

======================= ==============================================================================
``final``               states and outputs at the end
``transitions``         every transition: time, name, states before and after, as lists
``outputs:every=0.1``   states and outputs at the multiples of a time, an expression of parameters
``outputs:count=101``   or at so many equally spaced times from 0 to the end
``verdict``             whether the theorem holds, with its reasons; each run is looked at by itself
======================= ==============================================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean, shown

WORDS = ("final", "transitions", "outputs", "verdict")
EXAMPLE = "for example --record final,transitions,outputs:every=0.1"


@dataclass(frozen=True)
class Recording:
    """What is kept: ``samples`` is a number of samples, the time between them, or None.

    ``warnings`` are always kept; datasets of earlier versions have none.
    """

    final: bool = False
    transitions: bool = False
    samples: int | str | None = None
    verdict: bool = False
    warnings: bool = False

    def plain(self) -> dict[str, Any]:
        """As in a manifest."""
        return asdict(self)


def read(given: str | Sequence[str]) -> Recording:
    """Read a text, or its parts.

    Raises UsageError: an unknown word, or samples without their number.
    """
    parts = given.split(",") if isinstance(given, str) else given
    found: dict[str, Any] = {"warnings": True}
    for part in (part.strip() for part in parts):
        word, colon, how = part.partition(":")
        if word not in WORDS or (word == "outputs") != bool(colon):
            raise UsageError(
                f"--record: expected {', '.join(WORDS)}, outputs with :every=TIME or :count=N, got '{shown(part)}'",
                did_you_mean(word, WORDS) if word not in WORDS else EXAMPLE,
            )
        found |= {"samples": _samples(how)} if word == "outputs" else {word: True}
    return Recording(**found)


def _samples(text: str) -> int | str:
    key, _, value = (part.strip() for part in text.partition("="))
    if key == "count" and value.isdecimal() and int(value) >= 2:
        return int(value)
    if key == "every" and value:
        return value
    raise UsageError(
        f"--record outputs: expected every=TIME or count=N with N at least 2, got '{shown(text)}'", EXAMPLE
    )
