"""The settings of an experiment: what the command line says of them, words and defaults of each; other defaults."""

from __future__ import annotations

from fractions import Fraction
from typing import Any, NamedTuple

SCHEMES = ("relaxed", "located", "paoli-schatzman")
COMPLETIONS = ("contact", "auto", "none")


class Setting(NamedTuple):
    """A setting: its value in help texts, what it is, its default, and whether it says how a run is computed."""

    metavar: str = ""
    about: str = ""
    default: Any = None
    numerical: bool = False


SETTINGS = {
    "until": Setting("T", "End of the run."),
    "scheme": Setting("S", "relaxed, located or paoli-schatzman.", "located", numerical=True),
    "method": Setting("M", "A method's name, such as dopri5 or taylor, or auto.", "auto", numerical=True),
    "step": Setting("H", "Fixed step size. Not with --tolerance.", numerical=True),
    "tolerance": Setting("TOL", "Bound on the local error, relative to the states' scales.", numerical=True),
    "relaxation": Setting(
        "EPS", "The paper's epsilon: a depth beyond guards, and a time.", Fraction("1e-6"), numerical=True
    ),
    "scale": Setting(),
    "samples": Setting(numerical=True),
    "max_transitions": Setting(default=10**6),
    "completion": Setting(
        "C",
        "Where transitions accumulate, contact moves along guards, auto also slides between two modes, none stops.",
        "contact",
    ),
}
DEFAULTS = {name: setting.default for name, setting in SETTINGS.items() if setting.default is not None}
NUMERICAL = [name for name, setting in SETTINGS.items() if setting.numerical]
MOST_WAITING = 10**6  # executions of one event
DEFAULT_TOLERANCE = Fraction("1e-9")
_FOR_ROUNDOFF = 7  # digits: of the 16 of float64 the default tolerance keeps 9


def kept_digits(digits: int) -> int:
    """How many of ``digits`` decimal digits the default tolerance of a method of any order keeps."""
    return digits - _FOR_ROUNDOFF


def least_relaxation(relaxation: Any, until: Any) -> Any:
    """The default relaxation of a run that ends at ``until``: the general one, or if smaller as large a part of it."""
    return min(relaxation, relaxation * until) if until > 0 else relaxation
