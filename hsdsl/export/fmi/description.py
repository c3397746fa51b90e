"""What the model descriptions of both versions of FMI share: the root, and what a variable is to the caller.

Texts of elements cannot be markup, and units are written by their base units.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any
from xml.etree import ElementTree

from hsdsl import __version__
from hsdsl.analysis.lint import units
from hsdsl.analysis.lint.units import BASE, UnknownUnit, read
from hsdsl.base.names import visible
from hsdsl.export.fmi.variables import Unit, Variable, dependencies, initial_dependencies

_KINDS = {  # causality, variability, initial
    "time": ("independent", "continuous", None),
    "state": ("output", "continuous", "exact"),
    "derivative": ("local", "continuous", "calculated"),
    "parameter": ("parameter", "tunable", "exact"),
    "input": ("input", "continuous", None),
    "output": ("output", "continuous", "calculated"),
    "mode": ("local", "discrete", "calculated"),
    "indicator": ("local", "continuous", "calculated"),
}


def token_of(unit: Unit, version: int) -> str:
    """A UUID of the model, its settings, its variables and this version."""
    digest = hashlib.sha256("\n".join((str(version), unit.modes, *unit.source.heading)).encode()).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def root_of(unit: Unit, version: int, **further: str) -> Element:
    """The root of ``modelDescription.xml``."""
    return element(
        None, "fmiModelDescription", fmiVersion=f"{version}.0", modelName=unit.source.name,
        **{"guid" if version == 2 else "instantiationToken": token_of(unit, version)},
        description="; ".join(unit.source.heading), generationTool=f"hsdsl {__version__}",
        variableNamingConvention="flat", **further,
    )  # fmt: skip


def define_experiment(root: Element, unit: Unit, categories: tuple[str, ...]) -> None:
    """The categories of messages, and the default experiment."""
    settings, listed = unit.problem.settings, element(root, "LogCategories")
    for category in categories:
        element(listed, "Category", name=category)
    element(root, "DefaultExperiment", startTime=0.0, stopTime=float(settings.until), tolerance=settings.tolerance)


def unit_of_measure(unit: Unit, variable: Variable) -> str | None:
    """The unit of a variable; that of a derivative is by time."""
    time = unit.source.system.units.get("t")
    if variable.kind == "time":
        return time
    return per_time(variable.unit, time) if variable.kind == "derivative" else variable.unit


def named(unit: Unit, variable: Variable, reference: int) -> dict[str, Any]:
    """The attributes of a variable: its name, and its role for the caller."""
    causality, variability, initial = _KINDS[variable.kind]
    if variable.kind == "mode":
        causality = unit.modes
    if variable.kind == "parameter" and variable.fixed:
        variability = "fixed"
    if variable.kind == "input" and variable.discrete:
        variability = "discrete"
    if variable.kind == "parameter" and variable.start is None:
        causality, initial = "calculatedParameter", "calculated"
    if variable.kind == "input" and variable.fixed:
        causality, variability, initial = "local", "continuous", "calculated"
    return {
        "name": variable.name, "valueReference": str(reference), "description": variable.about,
        "causality": causality, "variability": variability, "initial": initial,
    }  # fmt: skip


def numbers(unit: Unit, variable: Variable, offset: int) -> dict[str, Any]:
    """The attributes of a real variable: its unit, bounds, start, and the state that it is the derivative of.

    States are numbered from ``offset`` on.
    """
    derived = variable.kind == "derivative"
    return {
        "min": variable.minimum, "max": variable.maximum, "nominal": variable.nominal,
        "start": None if variable.kind == "input" and variable.fixed else variable.start,
        "derivative": str(unit.references("state")[variable.index] + offset) if derived else None,
    }  # fmt: skip


def outputs(unit: Unit) -> list[int]:
    """What the caller takes for outputs."""
    return unit.references("state", "output", *(("mode",) if unit.modes == "output" else ()))


def initial_unknowns(unit: Unit) -> list[int]:
    """What is computed at the start: derivatives, outputs, and parameters that depend on others."""
    calculated = [i for i, v in enumerate(unit.variables) if v.kind == "parameter" and v.start is None]
    states = unit.references("state")
    return sorted((*(i for i in outputs(unit) if i not in states), *unit.references("derivative"), *calculated))


def structure(
    root: Element, unit: Unit, listed: Mapping[str, tuple[Sequence[int], str]], reference: str, first: int
) -> None:
    """The structure of a model: for each list of unknowns its elements, by an attribute, with what each depends on.

    ``listed`` has for each element's tag the unknowns and the element around them, if there is one; references are
    numbered from ``first`` on.
    """
    parent, always, initially = element(root, "ModelStructure"), dependencies(unit), initial_dependencies(unit)
    for kind, (unknowns, tag) in listed.items():
        known = initially if kind.startswith("Initial") else always
        around = element(parent, kind) if unknowns and kind != tag else parent
        for unknown in unknowns:
            numbers = " ".join(str(i + first) for i in known[unknown])
            element(around, tag, **{reference: str(unknown + first)}, dependencies=numbers)


Element = ElementTree.Element


def element(parent: Element | None, tag: str, **attributes: str | float | bool | None) -> Element:
    """A new element; attributes that are None are left out."""
    given = {name.rstrip("_"): _text(value) for name, value in attributes.items() if value is not None}
    return Element(tag, given) if parent is None else ElementTree.SubElement(parent, tag, given)


def _text(value: str | float | bool) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return visible(value) if isinstance(value, str) else repr(value)


def written(root: Element) -> str:
    """The document."""
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def define_units(root: Element, names: Iterable[str | None]) -> None:
    """The definitions of these units, each once; one that has no whole powers of base units is a name alone."""
    used = sorted({name for name in names if name})
    if not used:
        return
    definitions = element(root, "UnitDefinitions")
    for name in used:
        unit = element(definitions, "Unit", name=name)
        try:
            meaning = read(name)
        except UnknownUnit:
            continue
        _define(unit, meaning)


def _define(unit: Element, meaning: units.Unit) -> None:
    powers = dict(meaning.powers)
    if powers.keys() - BASE.keys() or any(power.denominator != 1 for power in powers.values()):
        return
    base = {BASE[name]: str(power) for name, power in powers.items()}
    factor = None if meaning.factor == 1 else meaning.factor
    element(unit, "BaseUnit", **base, factor=factor)


def per_time(unit: str | None, time: str | None) -> str | None:
    """The unit of a derivative by time."""
    return None if unit is None else f"({unit})/({time or 's'})"
