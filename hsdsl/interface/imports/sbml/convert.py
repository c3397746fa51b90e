"""Models of SBML as documents of the language: one mode, whose events are those of the file.

Amounts of species are states where their compartment varies, concentrations where it does not. A condition inside a
formula becomes a state that is 0 or 1, which two events switch.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any

from hsdsl.interface.imports.sbml.document import (
    Event,
    Lambda,
    Node,
    NotExpressible,
    Quantity,
    Reference,
    SbmlModel,
    Species,
    Undefined,
)
from hsdsl.interface.imports.sbml.formulas import FACTORIAL, TAKEN, Facts, Writer, literal
from hsdsl.interface.imports.sbml.order import FIRST, Order

NOTHING = "a value that nothing gives"
ENDLESS = "infinity or not-a-number as a value"
MOST_LISTED = 3  # lines of constraints
LONGEST = 100_000  # characters of an initial value that is written out
_NAME = re.compile(r"[A-Za-z_]\w*")
Document = dict[str, Any]


class Converter(Facts):
    """What becomes of a model: conditions inside formulas by their text, in the order in which they were met."""

    def __init__(self, model: SbmlModel, seed: int = 1) -> None:
        super().__init__(model)
        self.order = Order(self, lambda node: self.running.number(node), seed)
        self.flags: dict[str, tuple[str, Node]] = {}
        self._first: dict[str, str | None] = {}  # initial values of what rules assign; None while one is worked out

    def own(self, name: str) -> str:
        """The name of the state or parameter that holds a quantity."""
        return self.fresh(f"amount_of_{name}") if self.held_amount(name) else self.spelled(name)

    @cached_property
    def running(self) -> Writer:
        """Writes formulas that are evaluated while a run goes on."""
        return Writer(lambda node: self.named(node.name, node), self.rate, self.flag, function=self.called)

    @cached_property
    def initially(self) -> Writer:
        """Writes formulas of initial values."""
        return Writer(
            lambda node: self.initial_name(node.name, node), self.initial_rate, time="0", function=self.called
        )

    def called(self, name: str) -> str:
        """The name of a function."""
        if name not in self.functions:
            raise Undefined(f"no function in this file is called '{name}'", self.model.element)
        return self.spelled(name)

    def named(self, name: str, node: Node | None = None) -> str:
        """A name in a formula."""
        element = node.element if node else self.quantities[name].element if name in self.quantities else None
        if name in self.unset or name in self.endless:
            raise NotExpressible(NOTHING if name in self.unset else ENDLESS, element)
        if name not in self.quantities and name not in self.reactions:
            raise Undefined(f"nothing in this file is called '{name}'", element)
        return self.start(name) if name in self.references and self.is_number(name) else self.spelled(name)

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
        if self.held_amount(name):
            return f"({self.own(name)}/{self.initial_name(self.volume(name) or '')})"
        return self.named(name, node)

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
        return total if volume is None or self.held_amount(name) else f"({total})/{self._known(volume, writer)}"

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
            return f"{value}/{self.initial_name(volume)}" if volume and value != "0" else value
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
        finite = {name: kind for name, kind in outputs.items() if name not in self.endless}
        recorded = {f"out_{name}": self.output(name, kind) for name, kind in finite.items()}
        equations = [f"{self.running.number(equation)} == 0" for equation in self.model.equations]
        flow = {self.own(name): self.flow(name, self.running) for name in states}
        self.order.find()
        transitions = [self.event(event) for event in self.model.events]
        initial = {self.own(name): self.own_start(name) for name in states}
        switches, chosen = self.switches()
        drawing = self.order.parts()
        chosen |= drawing.get("initial", {})
        parameters = {self.own(name): self.own_start(name) for name in self.ordered(fixed)}
        parameters |= drawing.get("parameters", {})
        functions = {self.spelled(name): self.function(known) for name, known in self.functions.items()}
        functions |= drawing.get("functions", {})
        solve = {"solve": {"unknowns": list(map(self.spelled, self.unknowns)), "equations": equations}}
        mode = {
            "flow": flow | dict.fromkeys(chosen, "0"),
            "transitions": [*switches, *self.order.resets(), *transitions],
        }
        used = set(_NAME.findall(str((list(let.values()), mode, equations, parameters, initial, recorded))))
        if not outputs:  # what only reports is an output
            recorded = {name: let.pop(name) for name in [*let] if name not in used}
        assumptions = list(self.assumptions())
        if re.search(r"\bfactorial\(", str((parameters, functions, let, mode, equations, initial, recorded))):
            functions["factorial"] = FACTORIAL
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

    def function(self, known: Lambda) -> Document:
        """A function, whose arguments hide no other names."""
        spelling: dict[str, str] = {}
        for name in known.arguments:
            new = name
            while new in self.visible or new in spelling.values() or (new != name and new in known.arguments):
                new += "_"
            spelling[name] = new
        return {"of": list(spelling.values()), "is": self.function_text(known, spelling)}

    @cached_property
    def visible(self) -> set[str]:
        """The names that a function may use besides its arguments."""
        return {*TAKEN, *map(self.own, filter(self.is_parameter, self.quantities)), *map(self.spelled, self.functions)}

    def ordered(self, names: list[str]) -> list[str]:
        """Parameters after those that they use."""
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
        reset = {
            self.own(name): (f"({text})*{self.named(self.volume(name) or '')}" if self.held_amount(name) else text)
            for name, text in values.items()
        }
        transition: Document = {"name": self.spelled(event.name)}
        transition["event"] = self.running.condition(self.whole(event.trigger))
        if reset or event.name in self.order.drawing:
            transition["reset"] = reset
        if event.delay is not None:
            if not event.at_trigger:
                transition["values"] = "execution"
            elif any(map(self.held_amount, values)):
                feature = "values of the time of the trigger in a volume of the time of execution"
                raise NotExpressible(feature, event.element)
            transition["delay"] = self.running.number(self.whole(event.delay))
        elif event.at_trigger and self.reads_changes(event):
            transition["delay"] = "0"  # its values are those of its trigger, before what other events do then
        reset |= self.order.reset(event, "delay" in transition and "values" not in transition)
        if not event.persistent:
            transition["persistent"] = False
        if not event.initially:
            transition["initially"] = False
        if event.priority is not None:
            text = self.order.priorities.get(event.name) or self.running.number(self.whole(event.priority))
            whole = re.fullmatch(r"\(?(-?\d{1,9})\)?", text)
            transition["priority"] = whole[1] if whole else text
        return transition

    def assumptions(self) -> Iterator[str]:
        """Sentences on what the model takes for granted."""
        lines = [str(one.line) for one in self.model.constraints]
        if lines:
            where = f"of line {', '.join(lines[:MOST_LISTED])}" + " and others" * (len(lines) > MOST_LISTED)
            yield f"the SBML constraints {where} are not checked: write them under `domain` to stop a run there"
        yield from self.order.assumption()

    def reads_changes(self, event: Event) -> bool:
        """Whether what an event assigns uses what changes at that instant: by others, or by itself, set off again."""
        used = set[str]().union(*(self.deep(self.whole(node)) for _, node in event.changes))
        used |= {self.volume(name) or "" for name in used if name in self.species}
        others = {name for other in self.model.events if other is not event for name, _ in other.changes}
        again = others & self.deep(self.whole(event.trigger))
        return bool(used & (others | {name for name, _ in event.changes if again}))

    def sorted_lets(self, let: dict[str, str]) -> dict[str, str]:
        """Definitions after those that they use."""
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
