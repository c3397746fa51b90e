"""What the quantities of a model of SBML are: states, parameters, or given by rules."""

from __future__ import annotations

import math
from functools import cached_property

from hsdsl.base.names import SINCE
from hsdsl.interface.imports.sbml.document import Quantity, Reaction, Reference, SbmlModel, Species
from hsdsl.interface.imports.sbml.formulas import Writer
from hsdsl.interface.imports.sbml.mathml import Lambda, Node, NotExpressible, written_out
from hsdsl.language.expression.scope import RESERVED

TAKEN = frozenset((*RESERVED, SINCE, "index", "sum", "count", "mode"))


class Facts:
    """A model, and what its parts are."""

    def __init__(self, model: SbmlModel) -> None:
        self.model = model
        self.reactions: dict[str, Reaction] = model.reactions
        self.quantities: dict[str, Quantity] = model.quantities
        self.functions = {name: known for name, known in model.functions.items() if self._is_plain(known)}
        self._write_out({name: known for name, known in model.functions.items() if name not in self.functions})

    def _write_out(self, functions: dict[str, Lambda]) -> None:
        """Put the bodies of functions that are no arithmetic of their arguments in place of their calls."""
        model = self.model
        for table in (model.starts, model.assigned, model.rates):
            table.update({name: written_out(node, functions) for name, node in table.items()})
        model.equations = [written_out(node, functions) for node in model.equations]
        self.laws = {
            name: written_out(reaction.law, functions)
            for name, reaction in self.reactions.items()
            if reaction.law is not None
        }
        self._functions = functions

    def whole(self, node: Node) -> Node:
        """A formula of an event with such functions written out."""
        return written_out(node, self._functions)

    @cached_property
    def spelling(self) -> dict[str, str]:
        """A name for each name of the file: another one where the language has its own of that spelling."""
        names = [*self.quantities, *self.reactions, *self.model.functions]
        names += [event.name for event in self.model.events]
        found: dict[str, str] = {}
        for name in names:
            new = name
            while new in TAKEN or (new != name and new in names):
                new += "_"
            found[name] = new
        return found

    def spelled(self, name: str) -> str:
        """What a name is called."""
        if name not in self.spelling:
            raise NotExpressible(f"a name that is nowhere: {name}", self.model.element)
        return self.spelling[name]

    def fresh(self, name: str) -> str:
        """A name that the file does not have."""
        while name in self.spelling.values():
            name += "_"
        return name

    def _is_plain(self, known: Lambda) -> bool:
        """Whether a function is arithmetic of its arguments."""
        try:
            return bool(known.arguments) and not known.body.uses("time") and bool(self.function_text(known))
        except NotExpressible:
            return False

    def function_text(self, known: Lambda) -> str:
        """The body of a function."""

        def name(node: Node) -> str:
            if node.name not in known.arguments:
                raise NotExpressible("a function of more than its arguments", node.element)
            return argument(node.name)

        def refused(*given: object) -> str:
            raise NotExpressible("a function that chooses", known.body.element)

        for node in known.body.walk():
            if node.kind == "call" and (node.name not in self.model.functions or not self._calls_plain(node.name)):
                raise NotExpressible("a function of others", node.element)
        return Writer(name, refused, refused, function=argument).number(known.body)

    def _calls_plain(self, name: str) -> bool:
        known = self.model.functions[name]
        return all(node.kind != "call" for node in known.body.walk()) and self._is_plain(known)

    @cached_property
    def species(self) -> dict[str, Species]:
        """Species by name."""
        return {name: one for name, one in self.quantities.items() if isinstance(one, Species)}

    @cached_property
    def references(self) -> dict[str, Reference]:
        """Species references that have a name."""
        return {name: one for name, one in self.quantities.items() if isinstance(one, Reference)}

    @cached_property
    def event_assigned(self) -> frozenset[str]:
        """What events change."""
        return frozenset(name for event in self.model.events for name, _ in event.changes)

    @cached_property
    def reacting(self) -> dict[str, list[tuple[str, Reference, str]]]:
        """For each species that reactions change: the signs, the references and the names of these reactions."""
        changes: dict[str, list[tuple[str, Reference, str]]] = {}
        for name, reaction in self.reactions.items():
            for sign, references in (("-", reaction.reactants), ("", reaction.products)):
                for reference in references:
                    of = self.species.get(reference.species)
                    if of is None:
                        raise NotExpressible(f"a species that is nowhere: {reference.species}", reference.element)
                    if not of.boundary and not of.constant:
                        changes.setdefault(reference.species, []).append((sign, reference, name))
        return changes

    def is_number(self, name: str) -> bool:
        """Whether a species reference is a plain number."""
        model = self.model
        return not any(name in of for of in (model.assigned, model.rates, model.starts, self.event_assigned))

    @cached_property
    def unknowns(self) -> list[str]:
        """For each algebraic rule a name that it determines."""
        fixed = {*self.model.assigned, *self.model.rates, *self.reacting}
        free = [name for name, one in self.quantities.items() if name not in fixed and not one.constant]
        free.sort(key=self.event_assigned.__contains__)
        uses = [[name for name in free if name in self.deep(equation)] for equation in self.model.equations]
        owner: dict[str, int] = {}

        def place(equation: int, seen: set[str]) -> bool:
            for name in uses[equation]:
                if name not in seen:
                    seen.add(name)
                    if name not in owner or place(owner[name], seen):
                        owner[name] = equation
                        return True
            return False

        for i, equation in enumerate(self.model.equations):
            if not place(i, set()):
                raise NotExpressible("an algebraic rule that determines no name", equation.element)
        return list(owner)

    def deep(self, node: Node) -> set[str]:
        """The names in a formula and in what it is assigned."""
        found, new = set[str](), node.names
        while new:
            found |= new
            formulas = [self.model.assigned[name] for name in new if name in self.model.assigned]
            formulas += [self.laws[name] for name in new if name in self.laws]
            new = set[str]().union(*(one.names for one in formulas)) - found
        return found

    def varies(self, name: str) -> bool:
        """Whether a quantity changes in a run."""
        changed = (self.model.assigned, self.model.rates, self.event_assigned, self.unknowns, self.reacting)
        return any(name in of for of in changed)

    def volume(self, name: str) -> str | None:
        """The compartment that a species is a concentration in."""
        species = self.species.get(name)
        if species is None or species.in_amounts:
            return None
        if species.compartment not in self.quantities:
            raise NotExpressible(f"a compartment that is nowhere: {species.compartment}", species.element)
        return None if self.model.dimensions.get(species.compartment) == 0 else species.compartment

    def held_amount(self, name: str) -> bool:
        """Whether the state of a species is its amount though its name means a concentration."""
        volume = self.volume(name)
        if volume is None or not self.varies(volume) or name in self.model.assigned or name in self.unknowns:
            return False
        return name not in self.model.rates or volume in self.event_assigned

    def is_state(self, name: str) -> bool:
        """Whether a quantity is a state."""
        if name in self.model.assigned or name in self.unknowns:
            return False
        return self.varies(name) or self.starts_by_states(name)

    def starts_by_states(self, name: str, above: tuple[str, ...] = ()) -> bool:
        """Whether the initial value of what does not change uses a name that is not a parameter."""
        if name in above:
            raise NotExpressible("initial assignments in a circle", self.quantities[name].element)
        start = self.model.starts.get(name)
        others = set[str]() if start is None else self.deep(start)
        if name in self.species:
            others |= {self.species[name].compartment}
        used = any(
            n in self.reactions or self.varies(n) or self.starts_by_states(n, (*above, name)) for n in others - {name}
        )
        return used or (start is not None and start.uses("rateOf"))

    def is_parameter(self, name: str) -> bool:
        """Whether a quantity is the same in the whole run, and a name of the model."""
        if self.is_state(name) or name in self.unset or (name in self.references and self.is_number(name)):
            return False
        return name not in self.model.assigned and name not in self.unknowns

    @cached_property
    def unset(self) -> set[str]:
        """What has no value in the file."""
        given = (self.model.starts, self.model.assigned, self.unknowns, self.references)
        known = {name for of in given for name in of}
        return {name for name, one in self.quantities.items() if name not in known and math.isnan(one.value)}


def argument(name: str) -> str:
    """What an argument of a function is called, or a function in one."""
    return f"{name}_" if name in TAKEN else name
