"""Models of SBML as documents of the language, and their text: one mode, whose events are those of the file.

Amounts of species are states where their compartment varies, concentrations where it does not. A condition inside a
formula becomes a state that is 0 or 1, which two events switch. The text is YAML for people, with units and remarks.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from hsdsl import __version__
from hsdsl.base.names import visible
from hsdsl.interface.imports.sbml.document import Event, Node, NotExpressible, Quantity, Reference, SbmlModel, Species
from hsdsl.interface.imports.sbml.formulas import Facts, Writer, argument, literal
from hsdsl.language.source.xml import Element

NOTHING = "a value that nothing gives"
FIRST = 10**8  # the priority of what switches a condition inside a formula
MOST_LISTED = 3  # lines of constraints
LONGEST = 100_000  # characters of an initial value that is written out
_NAME = re.compile(r"[A-Za-z_]\w*")
Document = dict[str, Any]


class Converter(Facts):
    """What becomes of a model: conditions inside formulas by their text, in the order in which they were met."""

    def __init__(self, model: SbmlModel) -> None:
        super().__init__(model)
        self.flags: dict[str, tuple[str, Node]] = {}
        self._first: dict[str, str | None] = {}  # initial values of what rules assign; None while one is worked out

    def own(self, name: str) -> str:
        """The name of the state or parameter that holds a quantity."""
        return self.fresh(f"amount_of_{name}") if self.held_amount(name) else self.spelled(name)

    @cached_property
    def running(self) -> Writer:
        """Writes formulas that are evaluated while a run goes on."""
        rate = self.rate
        return Writer(lambda node: self.named(node.name, node), rate, self.flag, function=self.called)

    @cached_property
    def initially(self) -> Writer:
        """Writes formulas of initial values."""
        return Writer(
            lambda node: self.initial_name(node.name, node), self.initial_rate, time="0", function=self.called
        )

    def called(self, name: str) -> str:
        """The name of a function."""
        if name not in self.functions:
            raise NotExpressible(f"a function that is nowhere: {name}", self.model.element)
        return self.spelled(name)

    def named(self, name: str, node: Node | None = None) -> str:
        """A name in a formula."""
        element = node.element if node else self.quantities[name].element if name in self.quantities else None
        if name in self.unset:
            raise NotExpressible(NOTHING, element)
        if name not in self.quantities and name not in self.reactions:
            raise NotExpressible(f"a name that is nowhere: {name}", element)
        if name in self.references and self.is_number(name):
            return self.start(name)
        return self.spelled(name)

    def flag(self, writer: Writer, condition: Node) -> str:
        """The state that is 1 while a condition holds."""
        names = self.deep(condition)
        if not condition.uses("time") and not any(n in self.reactions or self.varies(n) for n in names):
            return writer.indicator(condition)
        text = writer.condition(condition)
        if text not in self.flags:
            self.flags[text] = (self.fresh(f"choice_{len(self.flags) + 1}"), condition)
        return self.flags[text][0]

    def initial_name(self, name: str, node: Node | None = None) -> str:
        """A name in an initial value: what `let` gives is written out there."""
        if name in self.unknowns:
            raise NotExpressible("an initial value by an algebraic rule", self.quantities[name].element)
        if name in self.reactions or name in self.model.assigned:
            return self._written_first(name)
        if self.held_amount(name):
            return f"({self.own(name)}/{self.initial_name(self.volume(name) or '')})"
        return self.named(name, node)

    def _written_first(self, name: str) -> str:
        """The first value of what a rule assigns, or of a reaction's rate."""
        if name not in self._first:
            self._first[name] = None
            rule = self.model.assigned.get(name)
            text = self.law(name, self.initially) if rule is None else f"({self.initially.number(rule)})"
            if len(text) > LONGEST:
                feature = f"an initial value of more than {LONGEST:,} characters"
                raise NotExpressible(feature, self.model.element)
            self._first[name] = text
        found = self._first[name]
        if found is None:
            raise NotExpressible("assignment rules in a circle", self.model.element)
        return found

    def law(self, name: str, writer: Writer) -> str:
        """The rate of a reaction."""
        return writer.number(self.laws[name]) if name in self.laws else "0"

    def rate(self, node: Node) -> str:
        """How fast a quantity changes."""
        if node.name in self.model.assigned or node.name in self.unknowns:
            raise NotExpressible("the rate of what a rule assigns", node.element)
        return f"({self.change(node.name, self.running)})"

    def initial_rate(self, node: Node) -> str:
        """How fast it changes at first."""
        return f"({self.change(node.name, self.initially)})"

    def change(self, name: str, writer: Writer) -> str:
        """The rate of change of what a name means."""
        if not self.held_amount(name):
            return self.flow(name, writer)
        v, own = self._known(self.volume(name) or "", writer), self._known(name, writer)
        return f"({self.flow(name, writer)} - {own}*({self.change(self.volume(name) or '', writer)}))/{v}"

    def _known(self, name: str, writer: Writer) -> str:
        return self.named(name) if writer is self.running else self.initial_name(name)

    def flow(self, name: str, writer: Writer) -> str:
        """The flow of the state that holds a quantity."""
        volume = self.volume(name)
        if name in self.model.rates:
            rate = writer.number(self.model.rates[name])
            if not self.held_amount(name):
                return rate
            compartment = volume or ""
            grows = self.rate(Node("name", self.quantities[name].element, name=compartment))
            grows = grows if writer is self.running else f"({self.change(compartment, writer)})"
            return f"{rate}*{self._known(compartment, writer)} + {self._known(name, writer)}*{grows}"
        if name not in self.reacting:
            return "0"
        reactions = [
            f"({sign}{self.stoichiometry(of)})*{self._known(reaction, writer)}"
            for sign, of, reaction in self.reacting[name]
        ]
        total = " + ".join(reactions)
        factor = self.species[name].factor or self.model.factor
        total = f"({total})*{self._known(factor, writer)}" if factor else total
        if volume is None or self.held_amount(name):
            return total
        return f"({total})/{self._known(volume, writer)}"

    def stoichiometry(self, reference: Reference) -> str:
        """How much of a species a reaction takes or makes."""
        if reference.math is not None:
            return self.running.number(reference.math)
        if reference.name and not self.is_number(reference.name):
            return self.named(reference.name)
        return self.start(reference.name) if reference.name else self.written(reference)

    def written(self, quantity: Quantity) -> str:
        """The number in the file for a quantity."""
        if math.isnan(quantity.value):
            raise NotExpressible(NOTHING, quantity.element)
        try:
            return literal(quantity.value)
        except NotExpressible as error:
            raise NotExpressible(str(error), quantity.element) from None

    def start(self, name: str) -> str:
        """The initial value of what a name means."""
        quantity = self.quantities[name]
        if name in self.model.starts:
            return self.initially.number(self.model.starts[name])
        value = self.written(quantity)
        if not isinstance(quantity, Species):
            return value
        volume = self.volume(name)
        if not quantity.by_concentration:
            return f"{value}/{self.initial_name(volume)}" if volume else value
        return value if volume else f"{value}*{self.initial_name(quantity.compartment)}"

    def own_start(self, name: str) -> str:
        """The initial value of the state or parameter that holds a quantity."""
        quantity = self.quantities[name]
        if not self.held_amount(name):
            return self.start(name)
        if name not in self.model.starts and isinstance(quantity, Species) and not quantity.by_concentration:
            return self.written(quantity)
        return f"({self.start(name)})*{self.initial_name(self.volume(name) or '')}"

    def document(self, outputs: Mapping[str, str], until: str) -> Document:
        """The model with what is recorded of it: names, each with ``value``, ``amount`` or ``concentration``."""
        states = [name for name in self.quantities if self.is_state(name)]
        fixed = [name for name in self.quantities if self.is_parameter(name)]
        held = [name for name in self.quantities if self.held_amount(name)]
        let = {self.spelled(name): f"{self.own(name)}/{self.named(self.volume(name) or '')}" for name in held}
        let |= {self.spelled(name): self.running.number(node) for name, node in self.model.assigned.items()}
        let |= {self.spelled(name): self.law(name, self.running) for name in self.reactions}
        recorded = {f"out_{name}": self.output(name, kind) for name, kind in outputs.items()}
        equations = [f"{self.running.number(equation)} == 0" for equation in self.model.equations]
        flow = {self.own(name): self.flow(name, self.running) for name in states}
        transitions = [self.event(event) for event in self.model.events]
        initial = {self.own(name): self.own_start(name) for name in states}
        switches, chosen = self.switches()
        parameters = {self.own(name): self.own_start(name) for name in self.ordered(fixed)}
        functions = {
            self.spelled(name): {"of": list(map(argument, known.arguments)), "is": self.function_text(known)}
            for name, known in self.functions.items()
        }
        solve = {"solve": {"unknowns": list(map(self.spelled, self.unknowns)), "equations": equations}}
        mode = {"flow": flow | dict.fromkeys(chosen, "0"), "transitions": [*switches, *transitions]}
        assumptions = list(self.assumptions())
        return {
            "hsdsl": "1",
            **({"assumptions": assumptions} if assumptions else {}),
            "parameters": parameters,
            "functions": functions,
            "let": self.sorted_lets(let),
            **(solve if equations else {}),
            "modes": {"model": {key: value for key, value in mode.items() if value or key == "flow"}},
            "outputs": recorded,
            "initial": {"mode": "model", **initial, **chosen},
            "experiment": {"until": until},
        }

    def ordered(self, names: list[str]) -> list[str]:
        """Parameters behind those that they use."""
        order: list[str] = []

        def visit(name: str) -> None:
            if name in names and name not in order:
                used = self.model.starts[name].names if name in self.model.starts else set[str]()
                used |= {self.species[name].compartment} if name in self.species else set()
                for other in sorted(used - {name}):
                    visit(other)
                order.append(name)

        for name in names:
            visit(name)
        return order

    def output(self, name: str, kind: str) -> str:
        """What is recorded of a quantity."""
        text = self.named(name)
        if name not in self.species or kind == "value":
            return text
        volume = self.volume(name)
        if kind == "amount":
            return f"{text}*{self.named(volume)}" if volume else text
        return text if volume else f"{text}/{self.named(self.species[name].compartment)}"

    def switches(self) -> tuple[list[Document], dict[str, str]]:
        """The events that switch conditions inside formulas, and the initial values of these."""
        transitions: list[Document] = []
        initial: dict[str, str] = {}
        for text, (name, condition) in self.flags.items():
            initial[name] = self.initially.indicator(condition)
            opposite = self.running.condition(condition, False)
            for word, event, value in (("begins", text, "1"), ("ends", opposite, "0")):
                entry = {"name": f"{name}_{word}", "event": event, "priority": str(FIRST), "reset": {name: value}}
                transitions.append(entry)
        return transitions, initial

    def event(self, event: Event) -> Document:
        """The transition of an event."""
        changes = {name: self.whole(node) for name, node in event.changes}
        values = {name: self.running.number(node) for name, node in changes.items()}
        reset = {self.own(name): self.assigned_value(name, text) for name, text in values.items()}
        transition: Document = {"name": self.spelled(event.name)}
        transition["event"] = self.running.condition(self.whole(event.trigger))
        if reset:
            transition["reset"] = reset
        if event.delay is not None:
            if not event.at_trigger:
                transition["values"] = "execution"
            elif any(map(self.held_amount, values)):
                feature = "values of the time of the trigger in a volume of the time of execution"
                raise NotExpressible(feature, event.element)
            transition["delay"] = self.running.number(self.whole(event.delay))
        elif event.at_trigger and self.depends_on_others(event):
            transition["delay"] = "0"  # its values are those of its trigger, before what other events do then
        if not event.persistent:
            transition["persistent"] = False
        if not event.initially:
            transition["initially"] = False
        if event.priority is not None:
            text = self.running.number(self.whole(event.priority))
            whole = re.fullmatch(r"\(?(-?\d{1,9})\)?", text)
            transition["priority"] = whole[1] if whole else text
        return transition

    def assumptions(self) -> Iterator[str]:
        """Sentences on what the model takes for granted."""
        lines = [str(one.line) for one in self.model.constraints]
        if lines:
            where = f"of line {', '.join(lines[:MOST_LISTED])}" + " and others" * (len(lines) > MOST_LISTED)
            yield f"the SBML constraints {where} are not checked: write them under `domain` to stop a run there"
        alike: dict[str, list[str]] = {}
        for event in self.model.events:
            if event.priority is not None:
                alike.setdefault(self.running.number(self.whole(event.priority)), []).append(event.name)
        for first, other, *_ in (names for names in alike.values() if len(names) > 1):
            yield (
                f"{first} and {other} have one priority: where SBML chooses at random, the first in the file goes first"
            )

    def depends_on_others(self, event: Event) -> bool:
        """Whether what an event assigns uses what another event changes."""
        used = set[str]().union(*(self.deep(self.whole(node)) for _, node in event.changes))
        used |= {self.volume(name) or "" for name in used if name in self.species}
        others = (name for other in self.model.events if other is not event for name, _ in other.changes)
        return any(name in used for name in others)

    def assigned_value(self, name: str, text: str) -> str:
        """What an event assigns to the state of a quantity; an amount is that in the compartment before."""
        return f"({text})*{self.named(self.volume(name) or '')}" if self.held_amount(name) else text

    def sorted_lets(self, let: dict[str, str]) -> dict[str, str]:
        """Definitions behind those that they use."""
        order: dict[str, str] = {}

        def visit(name: str, above: tuple[str, ...] = ()) -> None:
            if name in above:
                raise NotExpressible("assignment rules in a circle", self.model.element)
            if name in let and name not in order:
                for other in _NAME.findall(let[name]):
                    visit(other, (*above, name))
                order[name] = let[name]

        for name in let:
            visit(name)
        return order


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
