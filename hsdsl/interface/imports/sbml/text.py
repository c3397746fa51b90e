"""The text of a model of SBML: YAML for people, with units, and with names, terms and notes of the file as comments."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, cast

from hsdsl import __version__
from hsdsl.base.names import shown, visible
from hsdsl.interface.imports.sbml.convert import Converter
from hsdsl.interface.imports.sbml.document import Species
from hsdsl.interface.imports.sbml.readable import readable
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


LONGEST_NOTE = 100


def written(converter: Converter, document: dict[str, Any], path: str) -> str:
    """The model's text."""
    renamed = [f"{old} -> {new}" for old, new in converter.spelling.items() if old != new]
    notes = [f"Imported by hsdsl {__version__} from SBML.", *filter(None, [_note(converter.model.element)])]
    notes += [f"Renamed, since the language has words of that spelling: {', '.join(renamed)}."] if renamed else []
    endless = [f"{name} = {value}" for name, value in converter.endless.items()]
    notes += [f"Left out, since every number is finite here: {', '.join(endless)}."] if endless else []
    elements = {name: one.element for name, one in converter.quantities.items()}
    elements |= {name: one.element for name, one in converter.reactions.items()}
    elements |= {event.name: event.element for event in converter.model.events}
    found = {converter.spelled(name): _remark(name, element) for name, element in elements.items()}
    found |= {converter.own(name): found[converter.spelled(name)] for name in converter.quantities}
    remarks, units = {name: f"  # {remark}" for name, remark in found.items() if remark}, _units(converter)
    lines = ["hsdsl: 1", f"title: {_quoted(converter.model.name)}", f"source: {_quoted(Path(path).name)}", ""]
    lines += [f"# {visible(note)}" for note in notes]
    for key, value in document.items():
        if key == "modes":  # one mode, of formulas and transitions
            (name, mode), *_ = value.items()
            inner = (line for part in mode for line in _entry(part, mode[part], remarks))
            lines += ["modes:", f"  {name}:", *(f"    {line}" for line in inner), ""]
        elif key != "hsdsl" and value:
            formula = str if key == "assumptions" else readable
            lines += [*_entry(key, value, remarks if key in ("parameters", "functions", "let") else {}, formula), ""]
        if key == "outputs" and units:
            lines += [*_entry("units", units, {}, str), ""]
    return "\n".join(lines).rstrip() + "\n"


def _remark(name: str, element: Element) -> str:
    given = element.attributes.get("name", "").strip()
    words = [given if given != name else "", element.attributes.get("sboTerm", ""), _note(element)]
    return "; ".join(shown(word, LONGEST_NOTE) for word in words if word)


def _note(element: Element) -> str:
    """The text of an element's notes."""
    return shown(" ".join(text for notes in element.all("notes") for text in _said(notes)), LONGEST_NOTE)


def _said(element: Element) -> Iterator[str]:
    yield from (text for text, *_ in element.pieces)
    for child in element.children:
        yield from _said(child)


def _entry(
    key: str, value: Any, remarks: Mapping[str, str], formula: Callable[[str], str] = readable, remark: str = ""
) -> list[str]:
    """The lines of a key; ``remarks`` are on what is directly below it."""
    if isinstance(value, bool):
        return [f"{_text(key)}: {str(value).lower()}{remark}"]
    if not isinstance(value, dict | list):
        return [f"{_text(key)}: {_text(formula(str(value)))}{remark}"]
    if not value:
        return [f"{_text(key)}: {{}}"]
    return [f"{_text(key)}:{remark}", *(f"  {line}" for line in _lines(value, remarks, formula))]


def _lines(value: Any, remarks: Mapping[str, str], formula: Callable[[str], str]) -> Iterable[str]:
    if isinstance(value, dict):
        for key, inner in cast(dict[str, Any], value).items():
            yield from _entry(key, inner, {}, formula, remarks.get(key, ""))
        return
    for item in value:
        first, *rest = _lines(item, {}, formula) if isinstance(item, dict | list) else [_text(str(item))]
        yield f"- {first}{remarks.get(cast(dict[str, Any], item)['name'], '') if isinstance(item, dict) else ''}"
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
        if unit in model.units:
            parts = [part for list_ in model.units[unit].all("listOfUnits") for part in list_.all("unit")]
            texts = [_part(part) for part in parts]
            return "*".join(text for text in texts if text) or None if all(texts) else None
        if unit in _BASE:
            return _SHORT.get(unit, _BASE[unit])
        return _OLD.get(unit) if model.level < 3 else None

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
    return {**({"t": time} if time else {}), **known} if known or "timeUnits" in attributes else {}


def _size(converter: Converter, compartment: str) -> str:
    given = converter.quantities[compartment].unit
    word = {3.0: "volume", 2.0: "area", 1.0: "length"}.get(converter.model.dimensions.get(compartment, 3.0), "")
    return given or converter.model.element.attributes.get(f"{word}Units", word)


def _factor(unit: str | None) -> str:
    return f"({unit})" if unit and re.search(r"[*/]", unit) else unit or ""


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
