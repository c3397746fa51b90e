"""What a run is asked, from four places: the file, `--set`, and options or a call; the later place wins.

``step`` and ``tolerance`` exclude each other: the one given later removes the other. A method that the file names and
that cannot serve what a later place asks gives way to the default; asked for explicitly, it is refused. A scheme with
its own formula (:data:`OWN_FORMULA`) takes a step, and neither a method nor a relaxation: the file's give way.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from hsdsl.arithmetic import Arithmetic, Number
from hsdsl.defaults import DEFAULT_TOLERANCE, DEFAULTS
from hsdsl.errors import ModelError, UsageError
from hsdsl.integrators import AUTO, METHODS, Method, TaylorMethod
from hsdsl.names import did_you_mean
from hsdsl.program import Program
from hsdsl.simulate import SCHEMES

KEYS = ("until", "scheme", "method", "step", "tolerance", "relaxation", "scale", "samples", "max_transitions")
OWN_FORMULA = ("paoli-schatzman",)
SCALE = "scale."  # and a state: its given size
FILE, DEFAULT = "the file", "default"
# what other tools call methods of this order
ELSEWHERE = {
    **dict.fromkeys(("ode45", "rk45", "dopri", "dormandprince", "tsit5"), "dopri5"),
    **dict.fromkeys(("ode78", "dop8", "ode89"), "dop853"),
    **dict.fromkeys(("rungekutta", "rungekutta4", "rk", "ode4"), "rk4"),
    **dict.fromkeys(("ode1", "forwardeuler", "expliciteuler"), "euler"),
    **dict.fromkeys(("rk2", "ode2"), "midpoint"),
}


@dataclass(frozen=True)
class Option:
    """A value and the place that gave it."""

    value: Any
    origin: str


@dataclass(frozen=True)
class OptionSource:
    """One place and what it gives, by the names of :data:`KEYS`; None counts as not given."""

    origin: str
    values: Mapping[str, Any]


@dataclass(frozen=True)
class Options:
    """What the places agree on: ``size`` is ``step`` or ``tolerance``, and ``values`` holds it with the rest.

    ``method`` is None for a scheme with its own formula; with ``automatic`` it is what serves where nothing better is
    known (see `hsdsl.model.automatic`).
    """

    scheme: str
    method: Method | None
    size: str
    values: dict[str, Option]
    automatic: bool = False


def resolve(sources: Sequence[OptionSource]) -> Options:
    """Resolve what the places ask, lowest first.

    Raises
    ------
    UsageError
        Step and tolerance in one place, an unknown name, or a method that cannot serve.
    """
    values = {key: Option(value, DEFAULT) for key, value in DEFAULTS.items()}
    for source in sources:
        given = {key: value for key, value in _with_scales(source) if value is not None}
        for key in given:
            if key not in KEYS and not key.startswith(SCALE):
                raise UsageError(f"{source.origin}: the experiment has no setting '{key}'", did_you_mean(key, KEYS))
        if "step" in given and "tolerance" in given:
            raise UsageError(
                f"{source.origin} gives both step and tolerance, which exclude each other",
                "keep step for a fixed step size, tolerance for an adaptive one",
            )
        for size, other in (("step", "tolerance"), ("tolerance", "step")):
            if size in given:
                values.pop(other, None)
        values |= {key: Option(value, source.origin) for key, value in given.items()}
    if "step" not in values:
        values.setdefault("tolerance", Option(DEFAULT_TOLERANCE, DEFAULT))
    size = "step" if "step" in values else "tolerance"
    scheme = _scheme(values["scheme"])
    if scheme in OWN_FORMULA:
        _own_formula(scheme, values)
        return Options(scheme, None, size, values)
    method = _method(values["method"], values[size], size)
    return Options(scheme, method or METHODS[AUTO], size, values, automatic=method is None)


def _with_scales(source: OptionSource) -> Iterator[tuple[str, Any]]:
    """The settings of a source, the size of each state under a key of its own."""
    for key, value in source.values.items():
        if key != "scale" or value is None:
            yield key, value
        elif isinstance(value, Mapping):
            yield from ((f"{SCALE}{name}", size) for name, size in cast("Mapping[str, Any]", value).items())
        else:
            raise UsageError(
                f"scale ({source.origin}): expected a mapping from states to sizes", "set experiment.scale.NAME"
            )


def _own_formula(scheme: str, values: Mapping[str, Option]) -> None:
    for key, without in (("method", "auto"), ("relaxation", None)):
        if values[key].origin not in (FILE, DEFAULT) and values[key].value != without:
            raise UsageError(f"scheme '{scheme}' has its own formula and no {key} ({values[key].origin})")
    if "step" not in values:
        raise UsageError(f"scheme '{scheme}' needs a step, and keeps no tolerance", "give a step, for example 1e-3")


def _scheme(asked: Option) -> str:
    if asked.value in SCHEMES:
        return asked.value
    raise UsageError(f"there is no scheme '{asked.value}' ({asked.origin})", did_you_mean(str(asked.value), [*SCHEMES]))


def _method_meant(name: str) -> str | None:
    meant = ELSEWHERE.get(name.lower().replace("-", "").replace("_", ""))
    return f"did you mean '{meant}'?" if meant in METHODS else did_you_mean(name, ["auto", *METHODS])


def _method(asked: Option, size_asked: Option, size: str) -> Method | None:
    """The method that is named, None where that is left to us."""
    if asked.value == "auto":
        return None
    if asked.value not in METHODS:
        hint = _method_meant(str(asked.value))
        from hsdsl.source import Key

        if asked.origin == FILE and isinstance(asked.value, Key):
            raise ModelError([asked.value.place.diagnostic("HS204", f"there is no method '{asked.value}'", hint)])
        raise UsageError(f"there is no method '{asked.value}' ({asked.origin})", hint)
    table = METHODS[asked.value]
    if size == "step" or table.adaptive:
        return table
    if asked.origin == FILE and size_asked.origin not in (FILE, DEFAULT):
        return None
    raise UsageError(
        f"method '{table.name}' ({asked.origin}) has a fixed step and cannot keep a tolerance ({size_asked.origin})",
        "give a step, or use method 'auto'",
    )


def check_smooth(method: Method | None, program: Program) -> None:
    """Refuse Taylor series for a model with a flow that has none everywhere."""
    if not isinstance(method, TaylorMethod):
        return
    for mode in program.modes:
        if mode.tape is None:
            raise UsageError(
                f"method '{method.name}' needs smooth flows; that of mode {mode.name} has abs, sign, min, max or floor "
                "of a state",
                f"use method '{AUTO}'",
            )


def check_tolerance(tolerance: Number | None, arithmetic: Arithmetic) -> None:
    """Refuse a tolerance that is smaller than the last digit of the numbers of a run."""
    if tolerance is not None and tolerance < 2 * arithmetic.unit:
        kind = f"{arithmetic.digits} digits" if arithmetic.digits else "float64"
        raise UsageError(
            f"a tolerance of {float(tolerance):.3g} is below the precision of {kind}, {float(2 * arithmetic.unit):.2g}",
            "take a larger tolerance, or more digits by --precision",
        )


def check_digits(method: Method | None, arithmetic: Arithmetic) -> None:
    """Refuse a method whose coefficients have fewer digits than a run computes with."""
    if method is None or method.digits is None or (arithmetic.digits or 0) <= method.digits:
        return
    raise UsageError(
        f"the coefficients of method '{method.name}' are known to {method.digits} digits, too few for a precision of "
        f"{arithmetic.digits}",
        f"use method '{AUTO}', whose coefficients are exact",
    )
