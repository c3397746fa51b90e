# pyright: basic
"""What there is in a model of SBML: its quantities, and which of them are states, parameters or given by rules.

libSBML flattens submodels, promotes local parameters and writes out functions that are no arithmetic of their
arguments.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import libsbml
from sbml_math import Node, NotExpressible, Writer, children

FUNCTIONS = {
    *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
    *("exp", "log", "sqrt", "abs", "sign", "floor", "min", "max", "select"),
}
TAKEN = {"t", "pi", "since", "index", "and", "or", "not", "true", "false", "sum", "count", "mode", *FUNCTIONS}


def prepared(document: Any, folder: str) -> None:
    """Flatten a document, and write out its local parameters and what the language has no functions for."""
    if document.getModel() is None:
        raise NotExpressible("no model that libSBML reads")
    if document.getPlugin("comp") is not None:
        converted(document, "flatten comp", performValidation=False, basePath=folder, leavePorts=False)
    if document.getLevel() < 3:
        document.setLevelAndVersion(3, 1, False)
    converted(document, "promoteLocalParameters")
    plain = ",".join(f.getId() for f in plain_functions(document.getModel()))
    converted(document, "expandFunctionDefinitions", skipIds=plain)


def converted(document: Any, what: str, **options: Any) -> None:
    """Apply a converter of libSBML."""
    properties = libsbml.ConversionProperties()
    properties.addOption(what, True)
    for name, value in options.items():
        properties.addOption(name, value)
    if document.convert(properties) != libsbml.LIBSBML_OPERATION_SUCCESS:
        raise NotExpressible(f"libSBML cannot do: {what}")


def plain_functions(model: Any) -> list[Any]:
    """The functions that are arithmetic of their arguments."""
    return [function for function in model.getListOfFunctionDefinitions() if is_plain(function)]


def written_function(function: Any) -> dict[str, Any]:
    """A function of the language."""
    arguments = [spelled(function.getArgument(i).getName()) for i in range(function.getNumArguments())]
    return {"of": arguments, "is": function_text(function)}


def is_plain(function: Any) -> bool:
    """Whether a function is arithmetic of its arguments."""
    try:
        return function.getNumArguments() > 0 and bool(function_text(function))
    except NotExpressible:
        return False


def function_text(function: Any) -> str:
    """The body of a function."""
    arguments = {function.getArgument(i).getName() for i in range(function.getNumArguments())}

    def name(identifier: str) -> str:
        if identifier not in arguments:
            raise NotExpressible("a function of more than its arguments")
        return spelled(identifier)

    def none(*_: Any) -> str:
        raise NotExpressible("a function that chooses")

    if not function.isSetMath() or function.getBody() is None or uses_time(function.getBody()):
        raise NotExpressible("a function without a body")
    return Writer(name, none, none).number(function.getBody())


def uses_time(node: Node) -> bool:
    """Whether a formula uses the time."""
    return node.getType() == libsbml.AST_NAME_TIME or any(map(uses_time, children(node)))


def names_in(node: Node) -> set[str]:
    """The names in a formula."""
    own = {node.getName()} if node.getType() == libsbml.AST_NAME else set()
    return own.union(*map(names_in, children(node)))


def spelled(identifier: str) -> str:
    """A name of SBML where the language has none of that spelling."""
    return f"{identifier}_" if identifier in TAKEN else identifier


def raw(quantity: Any) -> float:
    """The number of a parameter, a compartment or a species reference, not-a-number where there is none."""
    if isinstance(quantity, libsbml.Parameter):
        return quantity.getValue()
    return quantity.getSize() if isinstance(quantity, libsbml.Compartment) else quantity.getStoichiometry()


def uses_rate(node: Node) -> bool:
    """Whether a formula uses a rate of change."""
    return node.getType() == libsbml.AST_FUNCTION_RATE_OF or any(map(uses_rate, children(node)))


@dataclass
class Facts:
    """A model of libSBML, and what its parts are."""

    model: Any

    @cached_property
    def species(self) -> dict[str, Any]:
        return {s.getId(): s for s in self.model.getListOfSpecies()}

    @cached_property
    def references(self) -> dict[str, Any]:
        """Species references that have a name."""
        lists = [list_ for r in self.reactions.values() for list_ in (r.getListOfReactants(), r.getListOfProducts())]
        return {reference.getId(): reference for list_ in lists for reference in list_ if reference.getId()}

    @cached_property
    def reactions(self) -> dict[str, Any]:
        return {r.getId(): r for r in self.model.getListOfReactions()}

    @cached_property
    def quantities(self) -> dict[str, Any]:
        """Everything that has a value, by name."""
        lists = (self.model.getListOfCompartments(), self.model.getListOfParameters())
        return {q.getId(): q for list_ in lists for q in list_} | self.species | self.references

    def _rules(self, kind: str) -> dict[str, Node]:
        rules = [r for r in self.model.getListOfRules() if getattr(r, f"is{kind}")() and r.isSetMath()]
        return {(rule.getVariable() or str(i)): rule.getMath() for i, rule in enumerate(rules)}

    @cached_property
    def assigned(self) -> dict[str, Node]:
        return self._rules("Assignment")

    @cached_property
    def rates(self) -> dict[str, Node]:
        return self._rules("Rate")

    @cached_property
    def equations(self) -> list[Node]:
        return list(self._rules("Algebraic").values())

    @cached_property
    def starts(self) -> dict[str, Node]:
        """Initial assignments."""
        assignments = self.model.getListOfInitialAssignments()
        return {a.getSymbol(): a.getMath() for a in assignments if a.isSetMath()}

    @cached_property
    def events(self) -> list[Any]:
        events = self.model.getListOfEvents()
        return [e for e in events if e.isSetTrigger() and e.getTrigger().isSetMath()]

    @cached_property
    def event_assigned(self) -> set[str]:
        assignments = [a for e in self.events for a in e.getListOfEventAssignments()]
        return {a.getVariable() for a in assignments if a.isSetMath()}

    @cached_property
    def reacting(self) -> dict[str, list[tuple[str, Any, str]]]:
        """For each species that reactions change: the signs, the references and the names of these reactions."""
        changes: dict[str, list[tuple[str, Any, str]]] = {}
        for name, reaction in self.reactions.items():
            if reaction.isSetFast() and reaction.getFast():
                raise NotExpressible("fast reactions")
            for sign, list_ in (("-", reaction.getListOfReactants()), ("", reaction.getListOfProducts())):
                for reference in list_:
                    of = self.species[reference.getSpecies()]
                    if not of.getBoundaryCondition() and not of.getConstant():
                        changes.setdefault(reference.getSpecies(), []).append((sign, reference, name))
        return changes

    def is_number(self, name: str) -> bool:
        """Whether a species reference is a plain number."""
        return not any(name in of for of in (self.assigned, self.rates, self.starts, self.event_assigned))

    @cached_property
    def unknowns(self) -> list[str]:
        """For each algebraic rule a name that it determines."""
        fixed = {*self.assigned, *self.rates, *self.reacting}
        free = [n for n, q in self.quantities.items() if n not in fixed and not q.getConstant()]
        free.sort(key=self.event_assigned.__contains__)
        uses = [[n for n in free if n in self.deep(equation)] for equation in self.equations]
        owner: dict[str, int] = {}

        def place(equation: int, seen: set[str]) -> bool:
            for name in uses[equation]:
                if name not in seen:
                    seen.add(name)
                    if name not in owner or place(owner[name], seen):
                        owner[name] = equation
                        return True
            return False

        if not all(place(i, set()) for i in range(len(self.equations))):
            raise NotExpressible("an algebraic rule that determines no name")
        return list(owner)

    def deep(self, node: Node) -> set[str]:
        """The names in a formula and in what it is assigned."""
        found, new = set[str](), names_in(node)
        while new:
            found |= new
            maths = [self.assigned[n] for n in new if n in self.assigned]
            maths += [self.reactions[n].getKineticLaw().getMath() for n in new if n in self.reactions]
            new = set[str]().union(*map(names_in, maths)) - found
        return found

    def varies(self, name: str) -> bool:
        """Whether a quantity changes in a run."""
        changed = (self.assigned, self.rates, self.event_assigned, self.unknowns, self.reacting)
        return any(name in of for of in changed)

    def volume(self, name: str) -> str | None:
        """The compartment that a species is a concentration in."""
        species = self.species.get(name)
        if species is None or species.getHasOnlySubstanceUnits():
            return None
        compartment = self.model.getCompartment(species.getCompartment())
        no_size = compartment.isSetSpatialDimensions() and compartment.getSpatialDimensionsAsDouble() == 0
        return None if no_size else compartment.getId()

    def held_amount(self, name: str) -> bool:
        """Whether the state of a species is its amount though its name means a concentration."""
        volume = self.volume(name)
        if volume is None or not self.varies(volume) or name in self.assigned or name in self.unknowns:
            return False
        return name not in self.rates or volume in self.event_assigned

    def is_state(self, name: str) -> bool:
        if name in self.assigned or name in self.unknowns:
            return False
        return self.varies(name) or self.starts_by_states(name)

    def starts_by_states(self, name: str) -> bool:
        """Whether the initial value of what does not change uses a name that is not a parameter."""
        others = self.deep(self.starts[name]) if name in self.starts else set[str]()
        if name in self.species and self.species[name].getCompartment():
            others |= {self.species[name].getCompartment()}
        used = any(n in self.reactions or self.varies(n) or self.starts_by_states(n) for n in others - {name})
        return used or (name in self.starts and uses_rate(self.starts[name]))

    def is_parameter(self, name: str) -> bool:
        """Whether a quantity is the same in the whole run, and a name of the model."""
        if self.is_state(name) or name in self.unset or (name in self.references and self.is_number(name)):
            return False
        return name not in self.assigned and name not in self.unknowns

    @cached_property
    def unset(self) -> set[str]:
        """What has no value in the file."""
        return {n for n, q in self.quantities.items() if self.has_no_value(n, q)}

    def has_no_value(self, name: str, quantity: Any) -> bool:
        if any(name in of for of in (self.starts, self.assigned, self.unknowns)):
            return False
        if name in self.species:
            return not (quantity.isSetInitialAmount() or quantity.isSetInitialConcentration())
        return name not in self.references and math.isnan(raw(quantity))
