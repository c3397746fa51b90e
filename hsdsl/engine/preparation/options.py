"""Options of a run: the values of the file, ``--set`` and a call, resolved to one each and recorded; the later wins.

``step`` and ``tolerance`` exclude each other: the one given later removes the other. A method of the file that cannot
serve a later option gives way to the default; an explicit one is refused. A scheme with its own formula
(:data:`OWN_FORMULA`) takes a step, and neither a method nor a relaxation: those of the file give way.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from hsdsl.base.defaults import COMPLETIONS, DEFAULT_TOLERANCE, DEFAULTS, SCHEMES, SETTINGS
from hsdsl.base.errors import ModelError, UsageError
from hsdsl.base.names import closest, did_you_mean
from hsdsl.base.numbers import decimals
from hsdsl.base.parts import for_all, numbered
from hsdsl.engine.integrators import FALLBACK, METHODS, Method, method_name
from hsdsl.mathematics.program import Program

KEYS = tuple(SETTINGS)
ARGUMENTS = (*KEYS, "parameters", "initial", "settings", "engine", "precision")  # of a single run
OWN_FORMULA = ("paoli-schatzman",)
SCALE = "scale."  # and a state: its given size
FILE, DEFAULT = "the file", "default"
# what other tools call methods of this order
ELSEWHERE = {
    **dict.fromkeys(("ode45", "rk45", "dopri", "dormandprince", "tsit5", "ode23", "rk23", "bs3", "rkf45"), "dopri5"),
    **dict.fromkeys(("ode78", "dop8", "ode89", "rk78", "rk8", "vern7", "vern8", "vern9", "ode113", "adams"), "dop853"),
    **dict.fromkeys(("ode15s", "ode15i", "ode23s", "ode23t", "ode23tb", "radau5", "radauiia", "radauiia5"), "radau"),
    **dict.fromkeys(("bdf", "cvode", "ida", "dassl", "rodas", "rodas5", "rodas5p", "trbdf2", "stiff"), "radau"),
    **dict.fromkeys(("lsoda", "lsodar", "odeint", "default"), "auto"),
    **dict.fromkeys(("rungekutta", "rungekutta4", "rk", "ode4"), "rk4"),
    **dict.fromkeys(("ode1", "forwardeuler", "expliciteuler"), "euler"),
    **dict.fromkeys(("rk2", "ode2"), "midpoint"),
}


@dataclass(frozen=True)
class Option:
    """A value and its origin."""

    value: Any
    origin: str


@dataclass(frozen=True)
class Options:
    """Resolved options: ``size`` is ``step`` or ``tolerance``, and ``values`` has it with the rest.

    ``method`` is None for a scheme with its own formula; with ``automatic`` it is what serves where nothing better is
    known (see `hsdsl.engine.preparation.automatic`).
    """

    scheme: str
    method: Method | None
    size: str
    values: dict[str, Option]
    automatic: bool = False


def check_arguments(given: Iterable[str], what: str, without: Collection[str]) -> None:
    """Refuse arguments that a single run does not take, or that a run of this kind does not."""
    known = [name for name in ARGUMENTS if name not in without]
    for name in given:
        if name not in known:
            raise UsageError(f"{what} has no argument '{name}'", did_you_mean(name, known))


def overrides_of(arguments: Mapping[str, Any], group: str, program: Program) -> dict[str, Any]:
    """The overrides of a group, ``parameters``, ``initial`` or ``scale``, among the arguments of a run.

    One for all instances of a `count` (`leg.k`) is given to each.
    """
    given: Mapping[str, Any] | None = arguments.get(group)
    return for_all(given or {}, names_of(program, group)) if program.parts else dict(given or {})


def names_of(program: Program, group: str) -> tuple[str, ...]:
    """The names of a group's overrides, without `mode`."""
    if group == "parameters":
        return program.parameters
    modes = (f"{part.name}.mode" for part in program.parts) if group == "initial" else ()
    hidden = frozenset(numbered(program.parts))
    return (*(name for name in program.all_states if name not in hidden), *modes)


def resolve(sources: Mapping[str, Mapping[str, Any]], states: Sequence[str] = ()) -> Options:
    """Resolve options: for each origin, the weakest first, its values by the names of :data:`KEYS`, None for no value.

    A size for all instances of a `count` (`scale.leg.x`) is given to each of these ``states``.

    Raises UsageError: step and tolerance of one origin, an unknown name, or a method that cannot serve.
    """
    values = {key: Option(value, DEFAULT) for key, value in DEFAULTS.items()}
    for origin, source in sources.items():
        given = {key: value for key, value in _with_scales(origin, source) if value is not None}
        if states and any(key.startswith(SCALE) for key in given):
            given = for_all(given, (*KEYS, *(f"{SCALE}{name}" for name in states)))
        for key in given:
            if key not in KEYS and not key.startswith(SCALE):
                raise UsageError(f"{origin}: the experiment has no setting '{key}'", did_you_mean(key, KEYS))
        if "step" in given and "tolerance" in given:
            raise UsageError(
                f"{origin} gives both step and tolerance, which exclude each other",
                "keep step for a fixed step size, tolerance for an adaptive one",
            )
        for size, other in (("step", "tolerance"), ("tolerance", "step")):
            if size in given:
                values.pop(other, None)
        values |= {key: Option(value, origin) for key, value in given.items()}
    if "step" not in values:
        values.setdefault("tolerance", Option(DEFAULT_TOLERANCE, DEFAULT))
    size = "step" if "step" in values else "tolerance"
    scheme, origin = values["scheme"].value, values["scheme"].origin
    if scheme not in SCHEMES:
        raise UsageError(f"there is no scheme '{scheme}' ({origin})", did_you_mean(str(scheme), [*SCHEMES]))
    completion, by = values["completion"].value, values["completion"].origin
    if completion not in COMPLETIONS:
        hint = did_you_mean(str(completion), COMPLETIONS)
        raise UsageError(f"there is no completion '{completion}' ({by})", hint)
    if scheme in OWN_FORMULA:
        _own_formula(scheme, values)
        return Options(scheme, None, size, values)
    method = _method(values["method"], size, values[size].origin)
    return Options(scheme, method or METHODS[FALLBACK], size, values, automatic=method is None)


def _with_scales(origin: str, source: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """The options of an origin, the size of each state under a key of its own."""
    for key, value in source.items():
        if key != "scale" or value is None:
            yield key, value
        elif isinstance(value, Mapping):
            yield from ((f"{SCALE}{name}", size) for name, size in cast("Mapping[str, Any]", value).items())
        else:
            raise UsageError(f"scale ({origin}): expected a mapping from states to sizes", "set experiment.scale.NAME")


def _own_formula(scheme: str, values: Mapping[str, Option]) -> None:
    for key, without in (("method", "auto"), ("relaxation", None)):
        if values[key].origin not in (FILE, DEFAULT) and values[key].value != without:
            raise UsageError(f"scheme '{scheme}' has its own formula and no {key} ({values[key].origin})")
    if "step" not in values:
        raise UsageError(f"scheme '{scheme}' needs a step, and keeps no tolerance", "give a step, for example 1e-3")


def _method(option: Option, size: str, size_origin: str) -> Method | None:
    """The named method; None for `auto`."""
    name = method_name(option.value)
    if name == "auto":
        return None
    table = METHODS.get(name)
    if table is None:
        raise _unknown_method(option)
    if size == "step" or table.adaptive:
        return table
    if option.origin == FILE and size_origin not in (FILE, DEFAULT):
        return None
    raise UsageError(
        f"method '{table.name}' ({option.origin}) has a fixed step and cannot keep a tolerance ({size_origin})",
        "give a step, or use method 'auto'",
    )


def _unknown_method(option: Option) -> Exception:
    from hsdsl.language.source import Key

    name = option.value
    hint = method_meant(str(name))
    if option.origin == FILE and isinstance(name, Key):
        return ModelError([name.place.diagnostic("HS204", f"there is no method '{name}'", hint)])
    origin = f" ({option.origin})" if option.origin == FILE else ""  # else it is before the reader's eyes
    return UsageError(f"there is no method '{name}'{origin}", hint)


def method_meant(name: str) -> str:
    """The hint for a method that does not exist: one of its kind, or all."""
    known = ("auto", *METHODS)
    meant = ELSEWHERE.get(re.sub("[^a-z0-9]", "", name.lower())) or closest(name, known)
    return f"did you mean '{meant}'?" if meant else f"choose from {', '.join(known)}"


def split_overrides(pairs: Sequence[str]) -> tuple[dict[str, str], dict[str, str], dict[str, str]]:
    """Sort ``NAME=VALUE`` texts into parameters, initial values and settings; of a repeated name the last counts.

    Raises UsageError: a text is not of that form.
    """
    groups: dict[str, dict[str, str]] = {"": {}, "initial": {}, "experiment": {}}
    for pair in pairs:
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not (name and equals and value):
            parts = re.fullmatch(r"([\w.\[\]]+)\s*:=?\s*(\S.*)", pair)
            meant = f"write --set {parts[1]}={parts[2]}" if parts else ""
            hint = meant or "for example --set c=0.8 or --set initial.v=20"
            raise UsageError(f"--set: expected NAME=VALUE, got '{pair}'", hint)
        group, dot, rest = name.partition(".")
        if dot and group not in groups and closest(group, groups):
            hint = did_you_mean(group, ("initial", "experiment"))
            raise UsageError(f"--set reaches NAME, initial.NAME and experiment.NAME, not '{name}'", hint)
        known = dot and group in groups  # else a parameter of a part, by its full name
        groups[group if known else ""][rest if known else name] = value
    parameters, initial, settings = groups.values()
    return parameters, initial, settings


def recorded(parameters: Mapping[str, Any], initial: Mapping[str, Any], options: Options) -> dict[str, Any]:
    """The overrides of a run, by the names of `--set`, each value as it was written."""
    given = {key: option.value for key, option in options.values.items() if option.origin not in (FILE, DEFAULT)}
    overrides = dict(parameters)
    for group, values in (("initial", initial), ("experiment", given)):
        overrides |= {f"{group}.{name}": value for name, value in values.items()}
    return {name: as_written(value) for name, value in overrides.items()}


def as_written(value: Any) -> Any:
    """A value as plain data: what has no such form, such as a fraction, becomes the text of an expression."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, (list, tuple)):
        return [as_written(item) for item in cast("Sequence[Any]", value)]
    return value if isinstance(value, (str, int, float)) or decimals.is_multiprecision(value) else str(value)


def arguments_of(overrides: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The arguments of a run with recorded overrides."""
    found: dict[str, dict[str, Any]] = {"parameters": parameters_of(overrides), "initial": {}, "settings": {}}
    for name, value in overrides.items():
        if name not in found["parameters"]:
            group, _, rest = name.partition(".")
            found["initial" if group == "initial" else "settings"][rest] = value
    return found


def parameters_of(overrides: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters among recorded overrides."""
    return {name: value for name, value in overrides.items() if not name.startswith(("initial.", "experiment."))}
