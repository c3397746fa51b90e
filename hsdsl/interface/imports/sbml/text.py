"""The text of a model of SBML: YAML for people, with units, and with names, terms and notes of the file as comments.

Formulas have no more parentheses, signs and factors than they need: the same operations in the same order.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, cast

from hsdsl import __version__
from hsdsl.base.names import shown, visible
from hsdsl.interface.imports.sbml.convert import Converter
from hsdsl.interface.imports.sbml.document import Species
from hsdsl.interface.imports.sbml.order import MODULUS
from hsdsl.language.expression.parse import (
    Call,
    Comparison,
    ExpressionError,
    Logic,
    Number,
    Power,
    Product,
    Sum,
    Tree,
    parse,
)
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
_LONGEST_NOTE = 100
_OR, _AND, _NOT, _COMPARE, _ADD, _NEGATIVE, _MULTIPLY, _POWER, _ATOM = range(9)
Written = tuple[str, int]  # a text, and how strongly its weakest operator binds


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
    found[converter.order.seed_name] = f"from 1 to {MODULUS - 1}: draws the order of simultaneous events"
    remarks, units = {name: f"  # {remark}" for name, remark in found.items() if remark}, _units(converter)
    lines = ["hsdsl: 1", f"title: {_quoted(converter.model.name)}", f"source: {_quoted(Path(path).name)}", ""]
    lines += [f"# {visible(note)}" for note in notes]
    for key, value in document.items():
        if key == "modes":  # one mode, of formulas and transitions
            (name, mode), *_ = value.items()
            inner = (line for part in mode for line in _entry(part, mode[part], remarks, readable))
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
    return "; ".join(shown(word, _LONGEST_NOTE) for word in words if word)


def _note(element: Element) -> str:
    """The text of an element's notes."""
    said = (text for notes in element.all("notes") for one in notes.within() for text, *_ in one.pieces)
    return shown(" ".join(said), _LONGEST_NOTE)


def _entry(
    key: str, value: Any, remarks: Mapping[str, str], formula: Callable[[str], str], remark: str = ""
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
    if exponent == 1:
        return name
    return f"{name}**({exponent:.0f})" if exponent < 0 else f"{name}**{exponent:.0f}"


def readable(text: str) -> str:
    """A formula as people write it; a text that is no formula, or too long, is returned unchanged."""
    try:
        return _Printer(text).written(parse(text, "condition"))[0]
    except ExpressionError:
        return text


class _Printer:
    def __init__(self, text: str) -> None:
        self.text = text

    def written(self, tree: Tree) -> Written:
        match tree:
            case Sum(((True, Sum(((True, operand),))),)):
                return self.written(operand)
            case Sum(((True, operand),)):
                return self.negative(self.written(operand))
            case Sum():
                return self.sum(tree)
            case Product():
                return self.product(tree)
            case Power():
                return f"{self.within(tree.base, _ATOM)}**{self.within(tree.exponent, _POWER)}", _POWER
            case Call():
                return f"{tree.function}({', '.join(self.within(part, _OR) for part in tree.arguments)})", _ATOM
            case Comparison():
                first, *others = (self.within(part, _ADD) for part in tree.operands)
                pairs = zip(tree.operators, others, strict=True)
                return first + "".join(f" {sign} {other}" for sign, other in pairs), _COMPARE
            case Logic("not", (operand,)):
                return f"not {self.within(operand, _COMPARE)}", _NOT
            case Logic():
                binding = _OR if tree.operator == "or" else _AND
                return f" {tree.operator} ".join(self.within(part, binding) for part in tree.operands), binding
            case _:
                return self.text[tree.start : tree.end], _ATOM

    def within(self, tree: Tree, weakest: int) -> str:
        return _enclosed(self.written(tree), weakest)

    def negative(self, operand: Written) -> Written:
        """The opposite: of a product it is that of its first factor, with the same rounding."""
        if operand[0].startswith("-") and operand[1] >= _NEGATIVE:
            return operand[0][1:], _MULTIPLY
        return f"-{_enclosed(operand, _MULTIPLY)}", _NEGATIVE

    def sum(self, tree: Sum) -> Written:
        text = ""
        for minus, term in tree.terms:
            one, binding = self.written(term)
            if not text:
                text = one if binding >= _ADD else f"({one})"
                continue
            if one.startswith("-") and binding == _NEGATIVE:
                minus, one, binding = not minus, one[1:], _MULTIPLY
            text += f" {'-' if minus else '+'} {_enclosed((one, binding), _MULTIPLY)}"
        return text, _ADD

    def product(self, tree: Product) -> Written:
        """A product without its factors of 1, and with the sign of one of -1 before it."""
        factors, sign = list(tree.factors), False
        while len(factors) > 1 and not factors[1][0] and (one := _unit(factors[0][1])):
            sign ^= one < 0
            del factors[0]
        factors = [factors[0], *(pair for pair in factors[1:] if _unit(pair[1]) != 1)]
        text, binding = self.written(factors[0][1])
        if len(factors) > 1:
            text = _enclosed((text, binding), _NEGATIVE)
            text += "".join(f"{'/' if below else '*'}{self.within(factor, _POWER)}" for below, factor in factors[1:])
            binding = _NEGATIVE if text.startswith("-") else _MULTIPLY
        return self.negative((text, binding)) if sign else (text, binding)


def _enclosed(written: Written, weakest: int) -> str:
    return written[0] if written[1] >= weakest else f"({written[0]})"


def _unit(tree: Tree) -> int:
    """1 or -1 where a factor is that number, else 0."""
    match tree:
        case Sum(((True, operand),)):
            return -_unit(operand)
        case _:
            return int(isinstance(tree, Number) and tree.value == 1)
