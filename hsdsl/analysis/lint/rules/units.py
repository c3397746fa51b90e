"""Rules about units: texts that are no units, and expressions whose units do not fit."""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.analysis.lint.finding import Finding
from hsdsl.analysis.lint.subject import Subject
from hsdsl.analysis.lint.units import Unit, names_like
from hsdsl.base.names import closest, shown

CONVERT = "correct it, or give a factor that converts a name and a unit"
PLAIN = "divide by something in the same unit, or give the factor a name and its unit"
FLOWS = {"flow": "the flow of '{}'"}
VALUES = {
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


def misfits(subject: Subject, kind: str, hint: str) -> Iterator[Finding]:
    """Find one kind of misfit inside expressions."""
    for checked in subject.units.checked:
        for own, node, message in checked.misfits:
            if own == kind:
                yield Finding(checked.written.span(node), message, hint)


def differing(subject: Subject, roles: dict[str, str]) -> Iterator[Finding]:
    """Find expressions of some roles in another unit than they should be in, as flows in that of the state by time."""
    for checked in subject.units.checked:
        written, expected = checked.written, checked.expected
        if written.role not in roles or expected is None or not isinstance(checked.measure, Unit):
            continue
        if not expected.same(checked.measure):
            what = "this time" if written.role in ("input", "reference") and written.unit_of else roles[written.role]
            what, unit = what.format(written.name), checked.measure.compared_with(expected)
            yield Finding(written.span(), f"{what} is in {unit}, and should be in {expected}")
