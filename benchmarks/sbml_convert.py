# pyright: basic
"""Models of SBML as models of the language: one mode, whose events are those of the file.

Amounts of species are states where their compartment varies, concentrations where it does not. A condition inside a
formula becomes a state that is 0 or 1, which two events switch.
"""

from __future__ import annotations

import math
import re
import sys
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import libsbml
import yaml
from sbml_math import Node, NotExpressible, Writer, literal
from sbml_model import Facts, names_in, plain_functions, prepared, raw, spelled, uses_time, written_function

NOTHING = "a value that nothing gives"
FIRST = 10**8  # the priority of what switches a condition inside a formula


def convert(path: str | Path, outputs: dict[str, str] | None = None, until: float = 10.0) -> dict[str, Any]:
    """The document of a model file.

    ``outputs`` are the names of SBML to record, each with ``value``, ``amount`` or ``concentration``.
    Raises NotExpressible: the language has no words for a feature.
    """
    document = libsbml.readSBMLFromFile(str(path))
    prepared(document, str(Path(path).parent))
    return Converter(document.getModel()).document(outputs or {}, until)


def convert_text(text: str, outputs: dict[str, str] | None = None, until: float = 10.0) -> dict[str, Any]:
    """As `convert`, from the text of a file."""
    document = libsbml.readSBMLFromString(text)
    prepared(document, ".")
    return Converter(document.getModel()).document(outputs or {}, until)


@dataclass
class Converter(Facts):
    """What becomes of a model: conditions inside formulas by their text, in the order they were met."""

    flags: dict[str, tuple[str, Node]] = field(default_factory=dict)

    def own(self, name: str) -> str:
        """The name of the state or parameter that holds a quantity."""
        return f"amount_of_{name}" if self.held_amount(name) else spelled(name)

    @cached_property
    def running(self) -> Writer:
        return Writer(self.name, self.rate, self.flag)

    @cached_property
    def initially(self) -> Writer:
        return Writer(self.initial_name, self.initial_rate, time="0")

    def name(self, name: str) -> str:
        if name in self.unset:
            raise NotExpressible(NOTHING)
        if name not in self.quantities and name not in self.reactions:
            raise NotExpressible(f"a name that is nowhere: {name}")
        if name in self.references and self.is_number(name):
            return self.start(name, self.references[name])
        return spelled(name)

    def flag(self, writer: Writer, condition: Node) -> str:
        """The state that is 1 while a condition holds."""
        names = self.deep(condition)
        if not uses_time(condition) and not any(n in self.reactions or self.varies(n) for n in names):
            return writer.indicator(condition)
        text = writer.condition(condition)
        if text not in self.flags:
            self.flags[text] = (f"choice_{len(self.flags) + 1}", condition)
        return self.flags[text][0]

    def initial_name(self, name: str) -> str:
        """A name in an initial value: what `let` gives is written out there."""
        if name in self.reactions:
            return self.law(name, self.initially)
        if name in self.unknowns:
            raise NotExpressible("an initial value by an algebraic rule")
        if name in self.assigned:
            return f"({self.initially.number(self.assigned[name])})"
        if self.held_amount(name):
            return f"({self.own(name)}/{self.initial_name(self.volume(name) or '')})"
        return self.name(name)

    def law(self, name: str, writer: Writer) -> str:
        """The rate of a reaction."""
        law = self.reactions[name].getKineticLaw()
        if law is None or not law.isSetMath():
            return "0"
        return writer.number(law.getMath())

    def rate(self, name: str) -> str:
        """How fast a quantity changes."""
        if name in self.assigned or name in self.unknowns:
            raise NotExpressible("the rate of what a rule assigns")
        return f"({self.change(name, self.running)})"

    def initial_rate(self, name: str) -> str:
        return f"({self.change(name, self.initially)})"

    def change(self, name: str, writer: Writer) -> str:
        """The rate of change of what a name means."""
        if not self.held_amount(name):
            return self.flow(name, writer)
        volume = self.volume(name) or ""
        v = writer.name(volume)
        return f"({self.flow(name, writer)} - {writer.name(name)}*{writer.rate(volume)})/{v}"

    def flow(self, name: str, writer: Writer) -> str:
        """The flow of the state that holds a quantity."""
        volume = self.volume(name)
        if name in self.rates:
            rate = writer.number(self.rates[name])
            if not self.held_amount(name):
                return rate
            return f"{rate}*{writer.name(volume or '')} + {writer.name(name)}*{writer.rate(volume or '')}"
        if name not in self.reacting:
            return "0"
        laws = self.name if writer is self.running else self.initial_name
        terms = [f"({sign}{self.stoichiometry(of)})*{laws(reaction)}" for sign, of, reaction in self.reacting[name]]
        total = " + ".join(terms)
        species = self.species[name]
        factor = species.getConversionFactor() or self.model.getConversionFactor()
        total = f"({total})*{writer.name(factor)}" if factor else total
        if volume is None or self.held_amount(name):
            return total
        return f"({total})/{writer.name(volume)}"

    def stoichiometry(self, reference: Any) -> str:
        if reference.getId() and not self.is_number(reference.getId()):
            return self.name(reference.getId())
        return self.start(reference.getId(), reference) if reference.getId() else self.written(reference)

    def written(self, quantity: Any) -> str:
        """The number in the file for a parameter, a compartment or a species reference."""
        if math.isnan(raw(quantity)):
            raise NotExpressible(NOTHING)
        return literal(raw(quantity))

    def start(self, name: str, quantity: Any) -> str:
        """The initial value of what a name means."""
        if name in self.starts:
            return self.initially.number(self.starts[name])
        if name not in self.species:
            return self.written(quantity)
        volume = self.volume(name)
        compartment = quantity.getCompartment()
        if quantity.isSetInitialAmount():
            value = literal(quantity.getInitialAmount())
            return f"{value}/{self.initial_name(volume)}" if volume else value
        if quantity.isSetInitialConcentration():
            value = literal(quantity.getInitialConcentration())
            return value if volume else f"{value}*{self.initial_name(compartment)}"
        raise NotExpressible(NOTHING)

    def own_start(self, name: str) -> str:
        """The initial value of the state or parameter that holds a quantity."""
        quantity = self.quantities[name]
        if not self.held_amount(name):
            return self.start(name, quantity)
        if name not in self.starts and quantity.isSetInitialAmount():
            return literal(quantity.getInitialAmount())
        return f"({self.start(name, quantity)})*{self.initial_name(self.volume(name) or '')}"

    def document(self, outputs: dict[str, str], until: float) -> dict[str, Any]:
        """The model with what is recorded of it."""
        states = [n for n in self.quantities if self.is_state(n)]
        fixed = [n for n in self.quantities if self.is_parameter(n)]
        held = [n for n in self.quantities if self.held_amount(n)]
        let = {spelled(n): f"{self.own(n)}/{self.name(self.volume(n) or '')}" for n in held}
        let |= {spelled(n): self.running.number(math) for n, math in self.assigned.items()}
        let |= {spelled(n): self.law(n, self.running) for n in self.reactions}
        recorded = {f"out_{n}": self.output(n, kind) for n, kind in outputs.items()}
        equations = [f"{self.running.number(e)} == 0" for e in self.equations]
        flow = {self.own(n): self.flow(n, self.running) for n in states}
        transitions = [self.event(i, event) for i, event in enumerate(self.events)]
        initial = {self.own(n): self.own_start(n) for n in states}
        switches, chosen = self.switches()
        parameters = {self.own(n): self.own_start(n) for n in self.ordered(fixed)}
        solve = {"unknowns": list(map(spelled, self.unknowns)), "equations": equations}
        return {
            "hsdsl": 1,
            "parameters": parameters,
            "functions": {f.getId(): written_function(f) for f in plain_functions(self.model)},
            "let": sorted_lets(let),
            **({"solve": solve} if equations else {}),
            "modes": {"model": {"flow": flow | dict.fromkeys(chosen, "0"), "transitions": switches + transitions}},
            "outputs": recorded,
            "initial": {"mode": "model", **initial, **chosen},
            "experiment": {"until": until},
        }

    def ordered(self, names: list[str]) -> list[str]:
        """Parameters behind those that they use."""
        order: list[str] = []

        def visit(name: str) -> None:
            if name in names and name not in order:
                used = names_in(self.starts[name]) if name in self.starts else set[str]()
                used |= {self.species[name].getCompartment()} if name in self.species else set()
                for other in sorted(used - {name}):
                    visit(other)
                order.append(name)

        for name in names:
            visit(name)
        return order

    def output(self, name: str, kind: str) -> str:
        """What is recorded of a quantity."""
        text = self.name(name)
        if name not in self.species or kind == "value":
            return text
        volume = self.volume(name)
        if kind == "amount":
            return f"{text}*{self.name(volume)}" if volume else text
        return text if volume else f"{text}/{self.name(self.species[name].getCompartment())}"

    def switches(self) -> tuple[list[dict[str, Any]], dict[str, str]]:
        """The events that switch conditions inside formulas, and the initial values of these."""
        transitions: list[dict[str, Any]] = []
        initial: dict[str, str] = {}
        for text, (name, condition) in self.flags.items():
            initial[name] = self.initially.indicator(condition)
            opposite = self.running.condition(condition, False)
            for word, event, value in (("begins", text, 1), ("ends", opposite, 0)):
                common = {"name": f"{name}_{word}", "event": event, "priority": FIRST, "reset": {name: value}}
                transitions.append(common)
        return transitions, initial

    def event(self, index: int, event: Any) -> dict[str, Any]:
        """The transition of an event."""
        trigger = event.getTrigger()
        assignments = [a for a in event.getListOfEventAssignments() if a.isSetMath()]
        values = {a.getVariable(): self.running.number(a.getMath()) for a in assignments}
        reset = {self.own(n): self.assigned_value(n, text) for n, text in values.items()}
        name = spelled(event.getId() or f"event_{index + 1}")
        transition: dict[str, Any] = {"name": name, "event": self.running.condition(trigger.getMath())}
        if reset:
            transition["reset"] = reset
        if event.isSetDelay() and event.getDelay().isSetMath():
            if not event.getUseValuesFromTriggerTime():
                transition["values"] = "execution"
            elif any(map(self.held_amount, values)):
                raise NotExpressible("values of the time of the trigger in a volume of the time of execution")
            transition["delay"] = self.running.number(event.getDelay().getMath())
        elif event.getUseValuesFromTriggerTime() and self.depends_on_others(event):
            transition["delay"] = 0  # its values are those of its trigger, before what other events do then
        if not trigger.getPersistent():
            transition["persistent"] = False
        if trigger.isSetInitialValue() and not trigger.getInitialValue():
            transition["initially"] = False
        if event.isSetPriority() and event.getPriority().isSetMath():
            text = self.running.number(event.getPriority().getMath())
            whole = re.fullmatch(r"\(?(-?\d{1,9})\)?", text)
            transition["priority"] = int(whole[1]) if whole else text
        return transition

    def depends_on_others(self, event: Any) -> bool:
        """Whether what an event assigns uses what another event changes."""
        used = set[str]().union(*(self.deep(a.getMath()) for a in event.getListOfEventAssignments() if a.isSetMath()))
        used |= {self.volume(name) or "" for name in used if name in self.species}
        others = [a for e in self.events if e is not event for a in e.getListOfEventAssignments()]
        return any(a.getVariable() in used for a in others)

    def assigned_value(self, name: str, text: str) -> str:
        """What an event assigns to the state of a quantity; an amount is that in the compartment before."""
        return f"({text})*{self.name(self.volume(name) or '')}" if self.held_amount(name) else text


def sorted_lets(let: dict[str, str]) -> dict[str, str]:
    """Definitions behind those that they use."""
    order: dict[str, str] = {}

    def visit(name: str, above: tuple[str, ...] = ()) -> None:
        if name in above:
            raise NotExpressible("assignment rules in a circle")
        if name in let and name not in order:
            for other in re.findall(r"[A-Za-z_]\w*", let[name]):
                visit(other, (*above, name))
            order[name] = let[name]

    for name in let:
        visit(name)
    return order


if __name__ == "__main__":  # python benchmarks/sbml_convert.py model.xml > model.yaml
    print(yaml.safe_dump(convert(sys.argv[1]), sort_keys=False, width=120), end="")
