"""The text of a model from SBML: its document as YAML for people, with units and remarks."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hsdsl import __version__
from hsdsl.base.names import visible
from hsdsl.interface.imports.sbml.convert import Converter
from hsdsl.interface.imports.sbml.document import Species
from hsdsl.language.source.xml import Element

_PLAIN = re.compile(r"[A-Za-z0-9_.(-][\w .()*/+<>=-]*")
_BASE = {
    **{kind: kind for kind in ("ampere", "coulomb", "farad", "gram", "henry", "hertz", "joule", "kelvin", "kilogram")},
    **{kind: kind for kind in ("mole", "newton", "ohm", "pascal", "radian", "siemens", "tesla", "volt", "watt")},
    **{"metre": "m", "meter": "m", "litre": "L", "liter": "L", "second": "s", "dimensionless": "1"},
}
_SHORT = {"mole": "mol", "gram": "g", "kilogram": "kg", "kelvin": "K", "volt": "V", "ampere": "A", "joule": "J"}
_SCALES = {-15: "f", -12: "p", -9: "n", -6: "u", -3: "m", -2: "c", -1: "d", 3: "k", 6: "M"}
_OLD = {"substance": "mol", "volume": "L", "area": "m**2", "length": "m", "time": "s"}  # of Level 2


def written(converter: Converter, document: dict[str, Any], path: str) -> str:
    """The model's text."""
    renamed = [f"{old} -> {new}" for old, new in converter.spelling.items() if old != new]
    notes = [f"Imported by hsdsl {__version__} from SBML."]
    notes += [f"Renamed, since the language has words of that spelling: {', '.join(renamed)}."] if renamed else []
    units = _units(converter)
    lines = ["hsdsl: 1", f"title: {_quoted(converter.model.name)}", f"source: {_quoted(Path(path).name)}", ""]
    lines += [f"# {visible(note)}" for note in notes]
    for key, value in document.items():
        if key != "hsdsl" and value:
            lines += [*_entry(key, value), ""]
        if key == "outputs" and units:
            lines += [*_entry("units", units), ""]
    return "\n".join(lines).rstrip() + "\n"


def _entry(key: str, value: Any) -> list[str]:
    if not isinstance(value, dict | list):
        return [f"{_text(key)}: {str(value).lower() if isinstance(value, bool) else _text(str(value))}"]
    if not value:
        return [f"{_text(key)}: {{}}"]
    return [f"{_text(key)}:", *(f"  {line}" for line in _lines(value))]


def _lines(value: Any) -> Iterable[str]:
    if isinstance(value, dict):
        for key, inner in value.items():  # pyright: ignore[reportUnknownVariableType]
            yield from _entry(str(key), inner)  # pyright: ignore[reportUnknownArgumentType]
        return
    for item in value:
        first, *rest = _lines(item) if isinstance(item, dict | list) else [_text(str(item))]
        yield f"- {first}"
        yield from (f"  {line}" for line in rest)


def _text(text: str) -> str:
    """An expression or a name as YAML."""
    return text if _PLAIN.fullmatch(text) and text.lower() != "null" and not text.startswith("- ") else _quoted(text)


def _quoted(text: str) -> str:
    return json.dumps(visible(text), ensure_ascii=False)


def _units(converter: Converter) -> dict[str, str]:
    """The units of states and parameters that the file gives, where the language has them."""
    model, found = converter.model, dict[str, str | None]()
    attributes = model.element.attributes

    def meant(unit: str) -> str | None:
        return _unit(unit, model.units, model.level)

    for name, one in converter.quantities.items():
        if isinstance(one, Species):
            amount = meant(one.unit or attributes.get("substanceUnits", "substance"))
            volume = converter.volume(name)
            size = None if volume is None else meant(_size(converter, volume))
            unit = amount if volume is None else f"{_factor(amount)}/{_factor(size)}" if amount and size else None
        else:
            unit = meant(_size(converter, name) if one.kind == "compartment" else one.unit)
        if not converter.held_amount(name) and (converter.is_state(name) or converter.is_parameter(name)):
            found[converter.spelled(name)] = unit
    known = {name: unit for name, unit in found.items() if unit}
    time = meant(attributes.get("timeUnits", "time"))
    return {**({"t": time} if time else {}), **known} if known else {}


def _size(converter: Converter, compartment: str) -> str:
    given = converter.quantities[compartment].unit
    words = {3.0: "volume", 2.0: "area", 1.0: "length"}
    word = words.get(converter.model.dimensions.get(compartment, 3.0), "")
    return given or converter.model.element.attributes.get(f"{word}Units", word)


def _factor(unit: str | None) -> str:
    return f"({unit})" if unit and re.search(r"[*/]", unit) else unit or ""


def _unit(unit: str, definitions: dict[str, Element], level: int) -> str | None:
    """A unit in the language; None where it is not known."""
    if unit in definitions:
        parts = [part for list_ in definitions[unit].all("listOfUnits") for part in list_.all("unit")]
        texts = [_part(part) for part in parts]
        return "*".join(text for text in texts if text) or None if all(texts) else None
    if unit in _BASE:
        return _SHORT.get(unit, _BASE[unit])
    return _OLD.get(unit) if level < 3 else None


def _part(element: Element) -> str | None:
    """One factor of a unit: (multiplier * 10**scale * kind)**exponent."""
    given = element.attributes
    kind = _BASE.get(given.get("kind", ""))
    try:
        exponent, scale = float(given.get("exponent", "1")), int(given.get("scale", "0"))
        multiplier = float(given.get("multiplier", "1"))
    except ValueError:
        return None
    if kind is None or not exponent.is_integer() or not multiplier > 0:
        return None
    name = _SHORT.get(kind, kind)
    if scale in _SCALES and name not in ("1", "kg"):
        name, scale = f"{_SCALES[scale]}{name}", 0
    size = multiplier * 10.0**scale
    name = name if size == 1 else f"({size!r}*{name})"
    return name if exponent == 1 else f"{name}**{_exponent(int(exponent))}"


def _exponent(exponent: int) -> str:
    return f"({exponent})" if exponent < 0 else str(exponent)
