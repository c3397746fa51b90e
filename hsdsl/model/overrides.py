"""``--set NAME=VALUE``: reading of overrides, and their record in a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

from hsdsl import decimals
from hsdsl.errors import UsageError
from hsdsl.model.options import DEFAULT, FILE, Options
from hsdsl.names import did_you_mean


def split_overrides(pairs: Sequence[str]) -> tuple[dict[str, str], dict[str, str], dict[str, str]]:
    """Sort ``NAME=VALUE`` texts into parameters, initial values and settings; of a repeated name the last counts.

    Raises UsageError: a text is not of that form.
    """
    groups: dict[str, dict[str, str]] = {"": {}, "initial": {}, "experiment": {}}
    for pair in pairs:
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not (name and equals and value):
            hint = "for example --set c=0.8 or --set initial.v=20"
            raise UsageError(f"--set: expected NAME=VALUE, got '{pair}'", hint)
        group, dot, rest = name.partition(".")
        if dot and group not in ("initial", "experiment"):
            hint = did_you_mean(group, ("initial", "experiment"))
            raise UsageError(f"--set reaches NAME, initial.NAME and experiment.NAME, not '{name}'", hint)
        groups[group if dot else ""][rest if dot else name] = value
    parameters, initial, settings = groups.values()
    return parameters, initial, settings


def recorded(parameters: Mapping[str, Any], initial: Mapping[str, Any], options: Options) -> dict[str, Any]:
    """The overrides of a run, by the names of `--set`, each value as it was written."""
    given = {key: option.value for key, option in options.values.items() if option.origin not in (FILE, DEFAULT)}
    overrides = dict(parameters)
    for group, values in (("initial", initial), ("experiment", given)):
        overrides |= {f"{group}.{name}": value for name, value in values.items()}
    return {name: _written(value) for name, value in overrides.items()}


def _written(value: Any) -> Any:
    """A value as plain data: what has no such form, such as a fraction, becomes the text of an expression."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, (list, tuple)):
        return [_written(item) for item in cast("Sequence[Any]", value)]
    return value if isinstance(value, (str, int, float)) or decimals.is_multiprecision(value) else str(value)


def parameters_of(overrides: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters among recorded overrides."""
    return {name: value for name, value in overrides.items() if "." not in name}
