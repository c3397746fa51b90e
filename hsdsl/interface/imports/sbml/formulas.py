"""Formulas of SBML as text of the language, with all their parentheses; what is a state, a parameter, or a rule's."""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise

from hsdsl.base.names import SINCE
from hsdsl.interface.imports.sbml.document import (
    Lambda,
    Node,
    NotExpressible,
    Quantity,
    Reaction,
    Reference,
    SbmlModel,
    Species,
    Undefined,
    written_out,
)
from hsdsl.language.expression.scope import RESERVED

_LANCZOS = (676.5203681218851, -1259.1392167224028, 771.3234287776531, -176.6150291621406)
_FURTHER = (12.507343278686905, -0.13857109526572012, 9.984369578019572e-06, 1.5056327351493116e-07)
FACTORIAL = {  # of any number from 0 on (Lanczos 1964, doi:10.1137/0701008, with g = 7), to 14 digits
    "of": ["n"],
    "is": "sqrt(2*pi)*(n + 7.5)**(n + 0.5)*exp(-n - 7.5)*(0.9999999999998099 + "
    + " + ".join(f"({c})/(n + {k})" for k, c in enumerate((*_LANCZOS, *_FURTHER), 1))
    + ")",
}
AVOGADRO = "6.02214179e23"  # the value that SBML Level 3 gives it
_SAME = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "abs", "exp", "floor")
_ARCS = ("sin", "cos", "tan", "sinh", "cosh", "tanh")
_INVERSES = {"sec": "cos", "csc": "sin", "cot": "tan"}
_FUNCTIONS = {
    **{name: f"{name}({{}})" for name in _SAME},
    **{f"arc{name}": f"a{name}({{}})" for name in _ARCS},
    "ln": "log({})",
    "ceiling": "(-floor(-{}))",
    **{f"{name}{kind}": f"(1/{other}{kind}({{}}))" for name, other in _INVERSES.items() for kind in ("", "h")},
    **{f"arc{name}{kind}": f"a{other}{kind}(1/{{}})" for name, other in _INVERSES.items() for kind in ("", "h")},
}
_MEANT = {
    **{"gt": operator.gt, "geq": operator.ge, "lt": operator.lt, "leq": operator.le, "eq": operator.eq},
    "neq": operator.ne,
}
_COMPARISONS = {"gt": ">", "geq": ">=", "lt": "<", "leq": "<=", "eq": "==", "neq": "!="}
_LOGICAL = ("and", "or", "not", "xor", "implies")
_CONDITIONS = (*_COMPARISONS, *_LOGICAL, "true", "false")
_OPPOSITE = {">": "<=", ">=": "<", "<": ">=", "<=": ">", "==": "!=", "!=": "=="}
_INDICATOR = {  # 1 where the sign of left - right says that the comparison holds
    ">": "max(0, sign({0} - {1}))",
    ">=": "min(1, 1 + sign({0} - {1}))",
    "<": "max(0, sign({1} - {0}))",
    "<=": "min(1, 1 + sign({1} - {0}))",
    "==": "(1 - abs(sign({0} - {1})))",
    "!=": "abs(sign({0} - {1}))",
}


@dataclass(frozen=True)
class Writer:
    """How formulas are written: the text of names, of rates of change, and the number (0 or 1) of a condition."""

    name: Callable[[Node], str]
    rate: Callable[[Node], str]
    chooses: Callable[[Writer, Node], str] = lambda writer, node: writer.indicator(node)  # where evaluated once
    time: str = "t"
    function: Callable[[str], str] = str

    def number(self, node: Node) -> str:
        """The text of a number; that of a condition is 0 or 1."""
        if node.kind in _CONDITIONS:
            return self.chooses(self, node)
        if node.kind in _FUNCTIONS:
            return _FUNCTIONS[node.kind].format(self.number(_one(node)))
        if node.kind in _OF_NUMBERS:
            numbers, write = _OF_NUMBERS[node.kind]
            if len(node.arguments) not in numbers:
                raise NotExpressible(f"<{node.kind}> of {len(node.arguments)} arguments", node.element)
            return write(*map(self.number, node.arguments))
        if node.kind not in _SPECIAL:
            raise NotExpressible(_UNKNOWN.get(node.kind, f"the formula <{node.kind}>"), node.element)
        return _SPECIAL[node.kind](self, node)

    def condition(self, node: Node, positive: bool = True) -> str:
        """The text of a condition, or of its opposite."""
        kind, parts = node.kind, node.arguments
        if kind in ("true", "false"):
            return "true" if (kind == "true") == positive else "false"
        if kind in _COMPARISONS:
            sign = _COMPARISONS[kind] if positive else _OPPOSITE[_COMPARISONS[kind]]
            texts = [self._comparison(sign, *pair) for pair in pairwise(parts)]
            return _joined("and" if positive else "or", texts)
        if kind == "not":
            return self.condition(_one(node), not positive)
        if kind in ("and", "or"):
            word = "and" if (kind == "and") == positive else "or"
            empty = "true" if word == "and" else "false"
            return _joined(word, [self.condition(part, positive) for part in parts]) if parts else empty
        if kind == "implies":
            texts = [self.condition(parts[0], not positive), self.condition(parts[1], positive)]
            return _joined("or" if positive else "and", texts)
        if kind == "xor":
            return self._odd(parts, positive)
        number = self.number(node)  # a number is true where it is not 0
        return f"({number} > 0 or {number} < 0)" if positive else f"({number} >= 0 and {number} <= 0)"

    def _comparison(self, sign: str, left: Node, right: Node) -> str:
        a, b = self.number(left), self.number(right)
        if sign == "==":
            return f"({a} >= {b} and {a} <= {b})"
        return f"({a} > {b} or {a} < {b})" if sign == "!=" else f"{a} {sign} {b}"

    def _odd(self, parts: tuple[Node, ...], positive: bool) -> str:
        """That an odd number of conditions holds."""
        if not parts:
            return "false" if positive else "true"
        if len(parts) == 1:
            return self.condition(parts[0], positive)
        first, rest = parts[0], parts[1:]
        one = _joined("and", [self.condition(first), self._odd(rest, not positive)])
        other = _joined("and", [self.condition(first, False), self._odd(rest, positive)])
        return _joined("or", [one, other])

    def indicator(self, node: Node) -> str:
        """The number of a condition by signs: right wherever it is evaluated, and it jumps."""
        kind, parts = node.kind, node.arguments
        if kind in ("true", "false"):
            return "1" if kind == "true" else "0"
        if kind in _COMPARISONS:
            values = list(map(self.number, parts))
            factors = [_INDICATOR[_COMPARISONS[kind]].format(*pair) for pair in pairwise(values)]
            return f"({'*'.join(factors) or '1'})"
        texts = [self.indicator(part) for part in parts] if kind in _LOGICAL else []
        match kind:
            case "not":
                return f"(1 - {texts[0]})"
            case "and":
                return f"({'*'.join(texts) or '1'})"
            case "or":
                return f"max(0, {', '.join(texts) or '0'})"
            case "implies":
                return f"max(1 - {texts[0]}, {texts[1]})"
            case "xor":
                odd = "0"
                for text in texts:
                    odd = f"abs({odd} - {text})"
                return odd
            case _:
                return f"abs(sign({self.number(node)}))"


def _joined(word: str, texts: list[str]) -> str:
    neutral, decides = ("true", "false") if word == "and" else ("false", "true")
    texts = [text for text in texts if text != neutral]
    if not texts or decides in texts:
        return decides if texts else neutral
    return texts[0] if len(texts) == 1 else f"({f' {word} '.join(texts)})"


def literal(value: float) -> str:
    """The text of a number."""
    if not math.isfinite(value):
        raise NotExpressible("infinity or not-a-number as a value")
    return f"({value!r})" if value < 0 else repr(int(value) if value.is_integer() and value < 1e15 else value)


def _one(node: Node) -> Node:
    if len(node.arguments) != 1:
        raise NotExpressible(f"<{node.kind}> of {len(node.arguments)} arguments", node.element)
    return node.arguments[0]


def _constant(writer: Writer, node: Node) -> str:
    text = node.value
    try:
        if "/" in text:
            over, under = text.split("/")
            return f"({int(over)}/{int(under)})"
        return literal(float(text))
    except ValueError:
        raise NotExpressible(f"the number '{text}'", node.element) from None


def _listed(sign: str, empty: str) -> Callable[[Writer, Node], str]:
    return lambda writer, node: f"({sign.join(map(writer.number, node.arguments)) or empty})"


def _piecewise(writer: Writer, node: Node) -> str:
    """Each value where its condition holds and none before it."""
    arguments = node.arguments
    text = writer.number(arguments[-1]) if len(arguments) % 2 else "0"
    for i in reversed(range(0, len(arguments) - 1, 2)):
        holds = writer.chooses(writer, arguments[i + 1])
        value = writer.number(arguments[i])
        text = value if holds == "1" else text if holds == "0" else f"select({holds}, {value}, {text})"
    return text


def _quotient(a: str, b: str) -> str:
    """The quotient rounded towards zero."""
    return f"(sign({a}/{b})*floor(abs({a}/{b})))"


def _remainder(a: str, b: str) -> str:
    return f"({a} - {b}*{_quotient(a, b)})"


def _factorial(writer: Writer, node: Node) -> str:
    given = _one(node)
    if given.kind == "number" and given.value.isdigit() and int(given.value) <= 18:
        return str(math.factorial(int(given.value)))
    return f"factorial({writer.number(given)})"


def _extreme(name: str, *texts: str) -> str:
    return texts[0] if len(texts) == 1 else f"{name}({', '.join(texts)})"


_UNKNOWN = {
    "delay": "delay equations",
    "infinity": "infinity or not-a-number as a value",
    "notanumber": "infinity or not-a-number as a value",
}
_OF_NUMBERS: dict[str, tuple[range, Callable[..., str]]] = {  # how many arguments; a base or degree comes first
    "minus": (range(1, 3), lambda *given: f"({' - '.join(given)})" if given[1:] else f"(-{given[0]})"),
    "root": (range(1, 3), lambda *of: f"sqrt({of[-1]})" if of[:-1] in ((), ("2",)) else f"({of[-1]}**(1/{of[0]}))"),
    "log": (range(1, 3), lambda *given: f"(log({given[-1]})/log({given[0] if given[1:] else 10}))"),
    "quotient": (range(2, 3), _quotient),
    "rem": (range(2, 3), _remainder),
    **{name: (range(1, sys.maxsize), partial(_extreme, name)) for name in ("min", "max")},
}
_SPECIAL: dict[str, Callable[[Writer, Node], str]] = {
    "number": _constant,
    "name": lambda writer, node: writer.name(node),
    "call": lambda writer, node: f"{writer.function(node.name)}({', '.join(map(writer.number, node.arguments))})",
    "plus": _listed(" + ", "0"),
    "times": _listed("*", "1"),
    "divide": _listed("/", "1"),
    "power": _listed("**", "1"),
    "piecewise": _piecewise,
    "factorial": _factorial,
    "rateOf": lambda writer, node: writer.rate(_one(node)),
    "time": lambda writer, node: writer.time,
    "avogadro": lambda writer, node: AVOGADRO,
    "exponentiale": lambda writer, node: "exp(1)",
    "pi": lambda writer, node: "pi",
}


TAKEN = frozenset(  # other spellings of `true` stand for it in YAML; `factorial` is defined where it is used
    (*RESERVED, SINCE, "index", "sum", "count", "mode", "True", "TRUE", "False", "FALSE", "factorial")
)


class Facts:
    """A model, and what its parts are."""

    def __init__(self, model: SbmlModel) -> None:
        self.model = model
        self.reactions: dict[str, Reaction] = model.reactions
        self.quantities: dict[str, Quantity] = model.quantities
        self.endless = self._endless()
        self.functions = {name: known for name, known in model.functions.items() if self._is_plain(known)}
        self._functions = {name: known for name, known in model.functions.items() if name not in self.functions}
        self._write_out()

    def _write_out(self) -> None:
        """Put the bodies of functions that are no arithmetic of their arguments in place of their calls."""
        model = self.model
        for table in (model.starts, model.assigned, model.rates):
            table.update({name: self.whole(node) for name, node in table.items()})
        model.equations = list(map(self.whole, model.equations))
        laws = {name: reaction.law for name, reaction in self.reactions.items()}
        self.laws = {name: self.whole(law) for name, law in laws.items() if law is not None}

    def whole(self, node: Node) -> Node:
        """A formula with such functions written out, and comparisons with what is infinite decided."""
        return written_out(node, self._functions).mapped(self._decided)

    def _endless(self) -> dict[str, float]:
        """Constants whose value the file gives as infinity or not-a-number."""
        model, found = self.model, dict[str, float]()
        for name, one in self.quantities.items():
            start = model.starts.get(name)
            value = one.value if start is None else self._extent(start)
            given = start is not None or not math.isnan(one.value) or "NaN" in one.element.attributes.values()
            changes = name in model.assigned or name in model.rates or name in self.event_assigned
            if value is not None and not math.isfinite(value) and given and not changes:
                found[name] = value
                model.starts.pop(name, None)
        return found

    def _extent(self, node: Node) -> float | None:
        """The value of a formula that is infinite or not-a-number by itself."""
        if node.kind == "minus" and len(node.arguments) == 1:
            inner = self._extent(node.arguments[0])
            return None if inner is None else -inner
        return {"infinity": math.inf, "notanumber": math.nan}.get(node.kind)

    def _decided(self, node: Node) -> Node:
        if node.kind not in _COMPARISONS or len(node.arguments) != 2:
            return node
        a, b = (self.endless.get(part.name) if part.kind == "name" else self._extent(part) for part in node.arguments)
        if a is None and b is None:
            return node
        holds = _MEANT[node.kind](a or 0.0, b or 0.0)  # any number is between the infinities as 0 is
        return Node("true" if holds else "false", node.element)

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
            raise Undefined(f"nothing in this file is called '{name}'", self.model.element)
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

    def function_text(self, known: Lambda, spelling: Mapping[str, str] | None = None) -> str:
        """The body of a function, whose arguments may have other names."""

        def name(node: Node) -> str:
            if node.name not in known.arguments:
                raise NotExpressible("a function of more than its arguments", node.element)
            return node.name if spelling is None else spelling[node.name]

        def refused(*given: object) -> str:
            raise NotExpressible("a function that chooses", known.body.element)

        for node in known.body.walk():
            if node.kind == "call" and (node.name not in self.model.functions or not self._calls_plain(node.name)):
                raise NotExpressible("a function of others", node.element)
        return Writer(name, refused, refused, function=self.spelled).number(known.body)

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
                        raise Undefined(f"no species in this file is called '{reference.species}'", reference.element)
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
            raise Undefined(f"no compartment in this file is called '{species.compartment}'", species.element)
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
        if self.is_state(name) or name in self.unset or name in self.endless:
            return False
        if name in self.references and self.is_number(name):
            return False
        return name not in self.model.assigned and name not in self.unknowns

    @cached_property
    def unset(self) -> set[str]:
        """What has no value in the file."""
        given = (self.model.starts, self.model.assigned, self.unknowns, self.references)
        known = {name for of in given for name in of}
        return {name for name, one in self.quantities.items() if name not in known and math.isnan(one.value)}
