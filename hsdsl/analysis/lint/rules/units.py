"""Rules about units: texts that are no units, and expressions whose units do not fit."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from hsdsl.analysis.lint.finding import Finding
from hsdsl.analysis.lint.subject import Subject
from hsdsl.analysis.lint.units import Unit, names_like
from hsdsl.base.names import closest, shown

CONVERT = "correct it, or give a factor that converts a name and a unit"
PLAIN = "divide by something in the same unit, or give the factor a name and its unit"
_VALUES = {
    "reset": "the new value of '{}'",
    "initial": "the initial value of '{}'",
    "scale": "the scale of '{}'",
    "parameter": "the parameter '{}'",
    "input": "the input '{}'",
    "output": "the output '{}'",
    "reference": "the value of '{}'",
    "experiment": "`{}`",
    "delay": "the delay",
}


def unknown_unit(subject: Subject) -> Iterator[Finding]:
    """Find texts that are no units."""
    for scalar, error in subject.units.misread:
        name = error.names[0] if error.names else None
        best = error.better if name is None else closest(name, names_like(name))
        hint = "write units as m, kg*m/s**2, 1/s or rad"
        if best:
            hint = f"write '{best}'" if error.better else f"did you mean '{best}'?"
        yield Finding(scalar.place.span, f"'{shown(name or scalar.value)}' is not a unit", hint)


def misfits(kind: str, hint: str | None = None) -> Callable[[Subject], Iterator[Finding]]:
    """Make the rule that finds one kind of misfit inside expressions."""

    def check(subject: Subject) -> Iterator[Finding]:
        for checked in subject.units.checked:
            for own, node, message in checked.misfits:
                if own == kind:
                    yield Finding(checked.written.span(node), message, hint)

    return check


def flow_units(subject: Subject) -> Iterator[Finding]:
    """Find flows in another unit than that of their state by time."""
    return _differing(subject, {"flow": "the flow of '{}'"})


def value_units(subject: Subject) -> Iterator[Finding]:
    """Find values in another unit than that of their name."""
    return _differing(subject, _VALUES)


def _differing(subject: Subject, roles: dict[str, str]) -> Iterator[Finding]:
    """Find expressions in another unit than they should be in."""
    for checked in subject.units.checked:
        written, expected = checked.written, checked.expected
        if written.role not in roles or expected is None or not isinstance(checked.measure, Unit):
            continue
        if not expected.same(checked.measure):
            what = "this time" if written.role in ("input", "reference") and written.unit_of else roles[written.role]
            what, unit = what.format(written.name), checked.measure.compared_with(expected)
            yield Finding(written.span(), f"{what} is in {unit}, and should be in {expected}")
