"""``--set NAME=VALUE``: what an override reaches, and how a run records what it was asked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

from hsdsl import decimals
from hsdsl.errors import UsageError
from hsdsl.model.options import DEFAULT, FILE, Options
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


def recorded(parameters: Mapping[str, Any], initial: Mapping[str, Any], request: Options) -> dict[str, Any]:
    """Gather what a run is asked beyond its file, by the names of `--set`, each value as it was written."""
    asked = {key: given.value for key, given in request.values.items() if given.origin not in (FILE, DEFAULT)}
    found = {**parameters, **_below("initial", initial), **_below("experiment", asked)}
    return {name: _written(value) for name, value in found.items()}


def _below(group: str, given: Mapping[str, Any]) -> dict[str, Any]:
    return {f"{group}.{name}": value for name, value in given.items()}


def _written(value: Any) -> Any:
    """A value as plain data: what has no such form, such as a fraction, becomes the text of an expression."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, (list, tuple)):
        return [_written(item) for item in cast("Sequence[Any]", value)]
    return value if isinstance(value, (str, int, float)) or decimals.is_multiprecision(value) else str(value)


def parameters_of(overrides: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters among recorded overrides."""
    return {name: value for name, value in overrides.items() if "." not in name}
