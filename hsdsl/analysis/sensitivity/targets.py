"""What a derivative is taken by: a parameter, or the initial value of a state; names that an augmented system adds.

A model's names are identifiers, and none of the added names is.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from hsdsl.base.errors import UsageError
from hsdsl.base.names import INITIAL
from hsdsl.base.parts import meant_alone, numbered
from hsdsl.mathematics.program import Program

EXAMPLE = "for example c or initial.v"


class Target(NamedTuple):
    """A parameter, or with ``initial`` the initial value of a state; ``label`` is how it is written."""

    label: str
    name: str
    initial: bool


def listed(wrt: str | Sequence[str]) -> tuple[str, ...]:
    """One name or several, as plain text: names of a file know their places.

    Raises UsageError: neither.
    """
    try:
        return (wrt,) if isinstance(wrt, str) else tuple(map(str, wrt))
    except TypeError:
        raise UsageError(f"expected names to differentiate by, got {wrt!r}", EXAMPLE) from None


def targets(wrt: str | Sequence[str], program: Program, states: Sequence[str]) -> tuple[Target, ...]:
    """Read names such as ``c`` and ``initial.v``, in a text with commas or one by one; ``states`` are the initial ones.

    Raises UsageError: a name that is neither, or none at all.
    """
    given = [name.strip() for text in listed(wrt) for name in text.split(",")]
    hidden = numbered(program.parts)
    states = [name for name in states if name not in hidden]
    labels = list(dict.fromkeys(name for name in given if name))
    if not labels:
        raise UsageError("expected names to differentiate by, got none", EXAMPLE)
    return tuple(_target(label, program, states) for label in labels)


def _target(label: str, program: Program, states: Sequence[str]) -> Target:
    if label in program.parameters:
        return Target(label, label, False)
    name = label.removeprefix(INITIAL)
    if name != label and name in states:
        return Target(label, name, True)
    known = [*program.parameters, *(INITIAL + state for state in states)]
    hint = f"did you mean '{INITIAL}{label}'?" if label in states else meant_alone(label, known)
    if label in (given.name for given in program.inputs):
        hint = "an input is no number; differentiate by a parameter that its expression or samples depend on"
    if name == "mode" and name != label:
        hint = "the initial mode is no number"
    raise UsageError(f"the model has no parameter or initial state '{label}'", hint)


UNIT, SPAN, ERROR = "unit round-off", "length of the run", "error of the run"  # parameters, given by numbers
LAST = "time of the last transition"
MEASURED = "slopes are measured"  # 1 where a step's end told them


def own(names: Iterable[str]) -> tuple[str, ...]:
    """The names that are a model's."""
    return tuple(name for name in names if " " not in name)


derivative_name = "d {} / d {}".format  # of a state or output, by a target
rate_name = "d {} / d t".format  # of an output along the flow
still_rate_name = "d {} / d t at rest".format  # of an output by time, where states rest
slope_name = "slope of {}".format  # of a state, as the end of a step tells it
shift_name = "d time / d {}".format  # of the last transition, by a target
