"""XML of a description: elements whose texts cannot be markup, and units as their base units."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

from hsdsl.analysis.lint.units import Unit, UnknownUnit, read
from hsdsl.base.names import visible

Element = ElementTree.Element
_BASE = {
    "[mass]": "kg",
    "[length]": "m",
    "[time]": "s",
    "[current]": "A",
    "[temperature]": "K",
    "[substance]": "mol",
    "[luminosity]": "cd",
}


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


def _define(unit: Element, meaning: Unit) -> None:
    powers = dict(meaning.powers)
    if powers.keys() - _BASE.keys() or any(power.denominator != 1 for power in powers.values()):
        return
    base = {_BASE[name]: str(power) for name, power in powers.items()}
    factor = None if meaning.factor == 1 else meaning.factor
    element(unit, "BaseUnit", **base, factor=factor)


def per_time(unit: str | None, time: str | None) -> str | None:
    """The unit of a derivative by time."""
    return None if unit is None else f"({unit})/({time or 's'})"
