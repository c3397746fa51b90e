"""Models of SBML, Levels 2 and 3: lists as data and formulas as trees, each with its element in the file."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from hsdsl.base import limits
from hsdsl.base.names import shown
from hsdsl.language.source.xml import Element

_NOTES = ("notes", "annotation")
_SYMBOLS = {"time": "time", "delay": "delay", "avogadro": "avogadro", "rateOf": "rateOf"}  # ends of definition URLs
CONSTANTS = ("true", "false", "pi", "exponentiale", "infinity", "notanumber")


class NotExpressible(Exception):
    """A feature of SBML that the language has no words for: its name, and the element that has it."""

    def __init__(self, feature: str, element: Element | None = None) -> None:
        super().__init__(feature)
        self.element = element

    @property
    def message(self) -> str:
        """The sentence of the refusal."""
        return f"a model cannot have {self}"


class Undefined(NotExpressible):
    """A name that the file uses and nothing in it has: what is called so."""

    @property
    def message(self) -> str:
        """The sentence of the refusal."""
        return str(self)


@dataclass(frozen=True)
class Node:
    """A part of a formula: what it is, its arguments, and its element.

    ``kind`` is ``number`` with a ``value``, ``name`` or ``call`` with a ``name``, or an element of MathML: ``plus``. An
    argument of `log` or `root` that is its base or degree comes first. A piece of `piecewise` is two arguments.
    """

    kind: str
    element: Element
    arguments: tuple[Node, ...] = ()
    name: str = ""
    value: str = ""

    def walk(self) -> Iterator[Node]:
        """It and all of its parts."""
        yield self
        for argument in self.arguments:
            yield from argument.walk()

    @property
    def names(self) -> set[str]:
        """The names in it."""
        return {node.name for node in self.walk() if node.kind == "name"}

    def uses(self, kind: str) -> bool:
        """Whether a part of it is of a kind."""
        return any(node.kind == kind for node in self.walk())

    def mapped(self, change: Callable[[Node], Node]) -> Node:
        """It with every part changed, from the inside out."""
        return change(replace(self, arguments=tuple(argument.mapped(change) for argument in self.arguments)))


@dataclass(frozen=True)
class Lambda:
    """A function definition: the names of its arguments, and its body."""

    arguments: tuple[str, ...]
    body: Node


def formula(holder: Element) -> Node | None:
    """The formula in an element's `math`; None where it has none."""
    content = _math(holder)
    return None if content is None else _node(content)


def function(holder: Element) -> Lambda | None:
    """The function in an element's `math`; None where it has none."""
    content = _math(holder)
    if content is None or content.tag != "lambda" or not content.children:
        return None
    *bound, body = content.children
    return Lambda(tuple(_word(one.children[0]) for one in bound if one.children), _node(body))


def written_out(node: Node, functions: Mapping[str, Lambda], parts: Iterator[int] | None = None) -> Node:
    """A formula with the bodies of functions in place of their calls.

    ``parts`` counts what is left to be written. Raises NotExpressible: the formula becomes too large.
    """
    parts = parts or iter(range(limits.current().values))

    def change(part: Node) -> Node:
        if part.kind != "call" or part.name not in functions:
            return part
        known = functions[part.name]
        if len(known.arguments) != len(part.arguments):
            raise NotExpressible(f"a call of {part.name} with another number of arguments", part.element)
        given = dict(zip(known.arguments, part.arguments, strict=True))
        body = known.body.mapped(lambda inner: given.get(inner.name, inner) if inner.kind == "name" else inner)
        if any(next(parts, None) is None for _ in body.walk()):
            raise NotExpressible(f"a formula of more than {limits.current().values:,} parts", part.element)
        return written_out(body, {name: one for name, one in functions.items() if name != part.name}, parts)

    return node.mapped(change)


def _math(holder: Element) -> Element | None:
    found = holder.all("math")
    return found[0].children[0] if found and found[0].children else None


def _word(element: Element) -> str:
    return element.passage.text.strip()


def _node(element: Element) -> Node:
    match element.tag:
        case "ci":
            return Node("name", element, name=_word(element))
        case "cn":
            return Node("number", element, value=_number(element))
        case "csymbol":
            return Node(_symbol(element), element)
        case "apply":
            if not element.children:
                raise NotExpressible("an empty <apply>", element)
            head, *rest = element.children
            arguments = tuple(_node(part.children[0] if part.tag in ("logbase", "degree") else part) for part in rest)
            if head.tag == "ci":
                return Node("call", element, arguments, name=_word(head))
            return Node(_symbol(head) if head.tag == "csymbol" else head.tag, element, arguments)
        case "piecewise":
            parts = (part for piece in element.children for part in piece.children)
            return Node("piecewise", element, tuple(map(_node, parts)))
        case "semantics":
            return _node(element.children[0])
        case tag if tag in CONSTANTS:
            return Node(tag, element)
        case tag:
            raise NotExpressible(f"the formula <{tag}>", element)


def _symbol(element: Element) -> str:
    meant = element.attributes.get("definitionURL", "").rpartition("/")[2]
    if meant not in _SYMBOLS:
        raise NotExpressible(f"the symbol '{meant or _word(element)}'", element)
    return _SYMBOLS[meant]


def _number(element: Element) -> str:
    """The text of a number; one in two parts is joined."""
    kind = element.attributes.get("type", "real")
    if kind not in ("e-notation", "rational"):
        return _word(element)
    place = [(part.line, part.column) for part in element.all("sep")]
    before = "".join(text for text, *at in element.pieces if not place or tuple(at) < place[0]).strip()
    after = "".join(text for text, *at in element.pieces if place and tuple(at) > place[0]).strip()
    return f"{before}e{after}" if kind == "e-notation" else f"{before}/{after}"


@dataclass(frozen=True)
class Quantity:
    """A compartment, a parameter, a species or a reference to one: what has a value, not-a-number where none is given.

    ``math`` is what a reference of Level 2 has in place of a number.
    """

    name: str
    kind: str  # compartment, parameter, species or reference
    value: float
    constant: bool
    element: Element
    unit: str = ""
    math: Node | None = None


@dataclass(frozen=True)
class Species(Quantity):
    """A species; ``value`` is the initial concentration where ``by_concentration``, else the initial amount."""

    by_concentration: bool = False
    compartment: str = ""
    in_amounts: bool = False  # its name means its amount
    boundary: bool = False
    factor: str = ""


@dataclass(frozen=True)
class Reference(Quantity):
    """How much of a species a reaction takes or makes."""

    species: str = ""


@dataclass(frozen=True)
class Reaction:
    """A reaction: its references, and its rate."""

    name: str
    reactants: tuple[Reference, ...]
    products: tuple[Reference, ...]
    law: Node | None
    element: Element


@dataclass(frozen=True)
class Event:
    """An event: its formulas, and how it is made."""

    name: str
    trigger: Node
    initially: bool
    persistent: bool
    delay: Node | None
    priority: Node | None
    at_trigger: bool
    changes: tuple[tuple[str, Node], ...]
    element: Element


@dataclass
class SbmlModel:
    """A model; rules, starts and functions by the name they define."""

    element: Element
    name: str
    level: int
    factor: str = ""
    quantities: dict[str, Quantity] = field(default_factory=dict[str, Quantity])
    dimensions: dict[str, float] = field(default_factory=dict[str, float])  # of compartments
    functions: dict[str, Lambda] = field(default_factory=dict[str, Lambda])
    starts: dict[str, Node] = field(default_factory=dict[str, Node])
    assigned: dict[str, Node] = field(default_factory=dict[str, Node])
    rates: dict[str, Node] = field(default_factory=dict[str, Node])
    equations: list[Node] = field(default_factory=list[Node])
    reactions: dict[str, Reaction] = field(default_factory=dict[str, Reaction])
    events: list[Event] = field(default_factory=list[Event])
    constraints: list[Element] = field(default_factory=list[Element])
    units: dict[str, Element] = field(default_factory=dict[str, Element])


def is_sbml(root: Element) -> bool:
    """Whether a file is one of SBML."""
    return root.tag.rpartition(":")[2] == "sbml"


def model_of(root: Element) -> SbmlModel:
    """The model in a file.

    Raises ModelError: it is of Level 1, or has no model.
    Raises NotExpressible: a package or a part of SBML that a model cannot keep.
    """
    _without_prefixes(root)
    level = root.attributes.get("level", "")
    if level not in ("2", "3"):
        hint = "save it as Level 3, with COPASI or libSBML"
        raise root.refusal("HS331", f"SBML of Level {level or '1'} is not read", hint)
    for name, value in root.attributes.items():
        if name.endswith(":required") and value == "true":
            raise NotExpressible(f"the package '{name.partition(':')[0]}'", root)
    found = root.all("model")
    if not found:
        raise root.refusal("HS331", "the file has no <model>")
    return _Reader(found[0], int(level)).model


def _without_prefixes(root: Element) -> None:
    """Leave out of tags what a file calls the spaces of names; elements of packages keep theirs."""
    prefix, math = root.tag.rpartition(":")[0], set[str]()
    for element in root.within():
        before, _, tag = element.tag.rpartition(":")
        math |= {key.partition(":")[2] for key, value in element.attributes.items() if value.endswith("Math/MathML")}
        if before in (prefix, *math):
            element.tag = tag


class _Reader:
    """Reads the lists of a model; defaults are those of its level."""

    def __init__(self, element: Element, level: int) -> None:
        self.level = level
        name = element.attributes.get("name") or element.attributes.get("id") or "SBML model"
        self.model = SbmlModel(element, name, level, element.attributes.get("conversionFactor", ""))
        for one in self.listed(element, "UnitDefinitions"):
            self.model.units[one.attribute("id")] = one
        for one in self.listed(element, "FunctionDefinitions"):
            known = function(one)
            if known is not None:
                self.model.functions[one.attribute("id")] = known
        self.quantities(element)
        for one in self.listed(element, "Reactions"):
            reaction = self.reaction(one)
            self.model.reactions[reaction.name] = reaction
        self.rules(element)
        self.model.constraints = self.listed(element, "Constraints")
        events = enumerate(self.listed(element, "Events"))
        self.model.events = [event for i, one in events if (event := self.event(i, one)) is not None]

    def listed(self, element: Element, name: str) -> list[Element]:
        return [one for list_ in element.all(f"listOf{name}") for one in list_.children if one.tag not in _NOTES]

    def number(self, element: Element, key: str) -> float:
        text = element.attributes.get(key, "")
        words = {"INF": math.inf, "-INF": -math.inf, "": math.nan, "NaN": math.nan}
        try:
            return words[text.strip()] if text.strip() in words else float(text)
        except ValueError:
            raise element.refusal("HS331", f"'{key}' is no number here") from None

    def flag(self, element: Element, key: str, default: bool = False) -> bool:
        text = element.attributes.get(key)
        if text is None:
            return default
        if text.strip() not in ("true", "1", "false", "0"):
            raise element.refusal("HS331", f"'{key}': expected true or false, got '{shown(text)}'")
        return text.strip() in ("true", "1")

    def quantities(self, element: Element) -> None:
        """Compartments, parameters and species, in the order in which others may use them."""
        quantities, old = self.model.quantities, self.level < 3
        for one in self.listed(element, "Compartments"):
            name = one.attribute("id")
            self.model.dimensions[name] = (
                self.number(one, "spatialDimensions") if "spatialDimensions" in one.attributes else 3.0
            )
            constant, unit = self.flag(one, "constant", old), one.attributes.get("units", "")
            quantities[name] = Quantity(name, "compartment", self.number(one, "size"), constant, one, unit)
        for one in self.listed(element, "Parameters"):
            name, constant = one.attribute("id"), self.flag(one, "constant", old)
            quantities[name] = Quantity(
                name, "parameter", self.number(one, "value"), constant, one, one.attributes.get("units", "")
            )
        for one in self.listed(element, "Species"):
            amount, concentration = self.number(one, "initialAmount"), self.number(one, "initialConcentration")
            name, by_concentration = one.attribute("id"), math.isnan(amount)
            quantities[name] = Species(
                name,
                "species",
                concentration if by_concentration else amount,
                self.flag(one, "constant"),
                one,
                one.attributes.get("substanceUnits", ""),
                by_concentration=by_concentration,
                compartment=one.attribute("compartment"),
                in_amounts=self.flag(one, "hasOnlySubstanceUnits"),
                boundary=self.flag(one, "boundaryCondition"),
                factor=one.attributes.get("conversionFactor", ""),
            )

    def reaction(self, element: Element) -> Reaction:
        """A reaction; its local parameters become parameters of the model."""
        if self.flag(element, "fast"):
            raise NotExpressible("fast reactions", element)
        name = element.attribute("id")
        laws = element.all("kineticLaw")
        law = formula(laws[0]) if laws else None
        if laws and law is not None:
            own = [*self.listed(laws[0], "Parameters"), *self.listed(laws[0], "LocalParameters")]
            law = _renamed(law, {one.attribute("id"): self.local(name, one) for one in own})
        return Reaction(name, self.references(element, "Reactants"), self.references(element, "Products"), law, element)

    def local(self, reaction: str, element: Element) -> str:
        name = f"{reaction}_{element.attribute('id')}"
        while name in self.model.quantities:
            name += "_"
        value, unit = self.number(element, "value"), element.attributes.get("units", "")
        self.model.quantities[name] = Quantity(name, "parameter", value, True, element, unit)
        return name

    def references(self, element: Element, kind: str) -> tuple[Reference, ...]:
        found: list[Reference] = []
        for one in self.listed(element, kind):
            written = one.all("stoichiometryMath")
            given = formula(written[0]) if written else None
            value = self.number(one, "stoichiometry")
            if math.isnan(value) and self.level < 3 and given is None:
                value = 1.0
            constant = self.flag(one, "constant", self.level < 3)
            name = one.attributes.get("id", "")
            reference = Reference(name, "reference", value, constant, one, "", given, one.attribute("species"))
            if name:
                self.model.quantities[name] = reference
            found.append(reference)
        return tuple(found)

    def rules(self, element: Element) -> None:
        """Rules and initial assignments."""
        for one in self.listed(element, "InitialAssignments"):
            node = formula(one)
            if node is not None:
                self.model.starts[one.attribute("symbol")] = node
        tables = {"assignmentRule": self.model.assigned, "rateRule": self.model.rates}
        for one in self.listed(element, "Rules"):
            node = formula(one)
            if node is None:
                continue
            if one.tag == "algebraicRule":
                self.model.equations.append(node)
            elif one.tag in tables:
                tables[one.tag][one.attribute("variable")] = node

    def event(self, index: int, element: Element) -> Event | None:
        """An event; None where nothing triggers it."""
        triggers = element.all("trigger")
        condition = formula(triggers[0]) if triggers else None
        if condition is None:
            return None
        delay, priority = (next(iter(element.all(tag)), None) for tag in ("delay", "priority"))
        changes = [(one.attribute("variable"), formula(one)) for one in self.listed(element, "EventAssignments")]
        return Event(
            element.attributes.get("id") or f"event_{index + 1}",
            condition,
            self.flag(triggers[0], "initialValue", True),
            self.flag(triggers[0], "persistent", True),
            None if delay is None else formula(delay),
            None if priority is None else formula(priority),
            self.flag(element, "useValuesFromTriggerTime", True),
            tuple((name, node) for name, node in changes if node is not None),
            element,
        )


def _renamed(node: Node, names: Mapping[str, str]) -> Node:
    def change(part: Node) -> Node:
        if part.kind != "name" or part.name not in names:
            return part
        return Node("name", part.element, name=names[part.name])

    return node.mapped(change)
