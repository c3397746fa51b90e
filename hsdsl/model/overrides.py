"""``--set NAME=VALUE``: what an override reaches."""

from __future__ import annotations

from collections.abc import Sequence

from hsdsl.errors import UsageError
from hsdsl.names import did_you_mean


def split_overrides(pairs: Sequence[str]) -> tuple[dict[str, str], dict[str, str], dict[str, str]]:
    """Sort ``NAME=VALUE`` texts into parameters, initial values and settings; of a repeated name the last counts.

    Raises
    ------
    UsageError
        A text is not of that form.
    """
    parameters: dict[str, str] = {}
    initial: dict[str, str] = {}
    settings: dict[str, str] = {}
    for pair in pairs:
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not (name and equals and value):
            raise UsageError(f"--set wants NAME=VALUE, not '{pair}'", "for example --set c=0.8 or --set initial.v=20")
        group, dot, rest = name.partition(".")
        if not dot:
            parameters[name] = value
        elif group == "initial":
            initial[rest] = value
        elif group == "experiment":
            settings[rest] = value
        else:
            hint = did_you_mean(group, ("initial", "experiment"))
            raise UsageError(f"--set reaches NAME, initial.NAME and experiment.NAME, not '{name}'", hint)
    return parameters, initial, settings
