# pyright: basic, reportAttributeAccessIssue=false, reportOperatorIssue=false
"""Where a run starts: the location of each instance, and a point or a box; values of constants that no map binds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice, product
from typing import Any

from hsdsl.base import limits
from hsdsl.base.errors import ModelError, UsageError
from hsdsl.base.functions import replaced
from hsdsl.base.names import closest, did_you_mean, shown
from hsdsl.interface.imports.spaceex.document import (
    DOT,
    MIRRORED,
    Configuration,
    Relation,
    names_in,
    renamed,
    value,
    within,
)
from hsdsl.interface.imports.spaceex.modes import STRICT, ModeDraft
from hsdsl.interface.imports.spaceex.network import Key, Network
from hsdsl.interface.imports.spaceex.points import decide
from hsdsl.language.expression.parse import ExpressionError
from hsdsl.language.expression.scope import symbol
from hsdsl.language.source.xml import Element
from hsdsl.mathematics.decisions.search import at_most_zero, negative, positive

CORNERS = {"centre": "({0} + {1})/2", "lower": "{0}", "upper": "{1}"}


def choice(given: Sequence[str]) -> tuple[str | None, dict[str, str]]:
    """What the texts of --at choose of an initial set: a corner or the centre, and values by name.

    Raises UsageError: one that is neither a word for a point nor NAME=VALUE.
    """
    corner, values = None, dict[str, str]()
    for text in (part.strip() for each in given for part in each.split(",")):
        name, equals, number = (part.strip() for part in text.partition("="))
        try:
            constant = bool(equals) and not names_in(number)
            constant = constant and value(number) is not None
        except ExpressionError as error:
            raise UsageError(f"--at {name}: expected a number, got '{shown(number, 40)}': {error.message}") from None
        if not constant and text not in CORNERS:
            raise UsageError(f"--at: expected {', '.join(CORNERS)} or NAME=VALUE, got '{shown(text, 40)}'")
        corner = corner if constant else text
        values |= {name: number} if constant else {}
    return corner, values


@dataclass(frozen=True)
class Start:
    """Texts of values of constants and variables, ranges of some, and the numbers of a point, by symbol.

    ``chosen`` are the names whose values --at chose.
    """

    constants: dict[str, str]
    variables: dict[str, str]
    ranges: dict[str, tuple[str, str]]
    numbers: dict[Any, Any]
    chosen: tuple[str, ...]


def candidates(network: Network, configured: Configuration, system: str) -> Iterator[Key]:
    """The locations in which the instances may start, by id: those that are given, else all, in the file's order.

    Raises ModelError: a location or an instance that does not exist, or two locations.
    """
    chosen: dict[str, str] = {}
    paths = {i.path: i for i in network.instances}
    for name, location, span in configured.locations:
        assert configured.initially is not None
        path = name.removeprefix(f"{system}.")
        path = next(iter(paths)) if len(paths) == 1 and path in ("", system) else path
        refusal = configured.initially.refusal
        if path not in paths:
            message = f"there is no instance '{shown(name)}' in '{shown(system)}'"
            raise refusal("HS333", message, did_you_mean(path, paths), *span)
        ids = {known.name: key for key, known in paths[path].component.locations.items()}
        if location not in ids:
            message = f"'{shown(path)}' has no location '{shown(location)}'"
            raise refusal("HS333", message, did_you_mean(location, ids), *span)
        if chosen.setdefault(path, ids[location]) != ids[location]:
            raise refusal("HS333", f"'{shown(path)}' starts in two locations", None, *span)
    ways = [[chosen[p]] if p in chosen else list(i.component.locations) for p, i in paths.items()]
    return islice(product(*ways), limits.current().modes)


def _refusal(configured: Configuration, element: Element, message: str, hint: str) -> ModelError:
    return (configured.initially or element).refusal("HS333", message, hint)


def with_inputs(
    network: Network, configured: Configuration, system: str, corner: str | None, values: Mapping[str, str]
) -> Network:
    """The network in which variables that nothing moves are constants, where --at chooses their values.

    Raises UsageError: --at names nothing of the model.
    """
    given: dict[str, str | None] = {}
    for name, text in values.items():
        known = network.qualified.get(name.removeprefix(f"{system}."), name)
        if known not in network.params or network.params[known].kind == "label":
            near = did_you_mean(name, [*network.constants, *network.variables])
            raise UsageError(f"--at: the model has no variable or constant '{shown(name)}'", near)
        given[known] = text
    if corner:
        named = {name for relation in configured.values for name in _named_place(relation, network, system).names}
        given = dict.fromkeys(sorted(named & {*network.variables} - given.keys())) | given
    moved = network.moved
    constants = {n: text for n, text in given.items() if n in network.constants or n not in moved}
    return replace(
        network,
        constants={**network.constants, **constants},
        variables=tuple(name for name in network.variables if name not in constants),
        given={n: text for n, text in given.items() if n in moved and text is not None},
        held=tuple(n for n in constants if n in network.variables),
    )


def start(network: Network, configured: Configuration, system: str, corner: str | None) -> Start:
    """The values that `initially`, maps and --at give.

    Raises ModelError: a name that does not exist, a set that is neither a point nor a box, a constant without a value.
    """
    relations = [_named_place(relation, network, system) for relation in configured.values]
    work = _Solving(network, relations, corner).solved()
    for name in network.constants:
        if name not in work.texts:
            message = f"the constant '{name}' has no value"
            hint = f"write {name} == and its value under `initially`, or give --at {name}=NUMBER"
            raise network.params[name].element.refusal("HS333", message, hint)
    for relation in relations:
        work.hold(relation)
    constants = {name: text for name, text in work.texts.items() if name in network.constants}
    variables = {name: text for name, text in work.texts.items() if name not in network.constants}
    numbers = {here: replaced(expr, work.centres, {}) for here, expr in work.values.items()} | work.centres
    return Start(constants, variables, work.ranges, numbers, (*network.given, *work.chosen))


def _named_place(relation: Relation, network: Network, system: str) -> Relation:
    """A relation of `initially` with the names of the whole."""
    names: dict[str, str] = {}
    for name in relation.names:
        dotted = name.replace(DOT, ".").removeprefix(f"{system}.")
        if dotted not in network.qualified:
            near = closest(dotted, network.qualified)
            hint = f"did you mean '{near}'?" if near else None
            raise relation.refusal(f"nothing is called '{shown(dotted)}'", hint, "HS333")
        names[name] = network.qualified[dotted]
    if relation.operator == ":=" or relation.primed:
        raise relation.refusal("an initial set has relations such as x == 1", None, "HS333")
    return relation.renamed(names)


def _turned(relation: Relation) -> tuple[str, str, str]:
    return relation.right, MIRRORED[relation.operator], relation.left


@dataclass
class _Solving:
    """The relations of an initial set, and what is found from them.

    ``values`` are over the symbols of ``ranges``, whose ``centres`` and ``sides`` are kept apart.
    """

    network: Network
    relations: list[Relation]
    corner: str | None
    texts: dict[str, str] = field(default_factory=dict[str, str])
    values: dict[Any, Any] = field(default_factory=dict[Any, Any])
    ranges: dict[str, tuple[str, str]] = field(default_factory=dict[str, tuple[str, str]])
    centres: dict[Any, Any] = field(default_factory=dict[Any, Any])
    sides: list[Any] = field(default_factory=list[Any])
    chosen: list[str] = field(default_factory=list[str])

    def give(self, name: str, text: str) -> None:
        """A name has a value."""
        inner = {
            n: within(self.texts[n]) for n in names_in(text) if n in self.network.variables and n not in self.ranges
        }
        self.texts[name] = renamed(text, inner)
        self.values[symbol(name)] = replaced(value(text), self.values, {})

    def __post_init__(self) -> None:
        both = [side for r in self.relations for side in ((r.left, r.operator, r.right), _turned(r))]
        named = [side for side in both if side[0] in self.network.params]
        self.named = [(*side, frozenset(names_in(side[2]))) for side in named]

    def solved(self) -> _Solving:
        """Give all names the values that they have by themselves, then by relations."""
        for name, text in [*self.network.constants.items(), *self.network.given.items()]:
            if text is not None:
                self.give(name, text)
        while self.equation() or self.bounds():
            pass
        return self

    def alone(self) -> Iterator[tuple[str, str, str]]:
        """Relations of a name that has no value with an expression that has: name, sign and expression."""
        for name, sign, text, names in self.named:
            if name not in self.texts and names <= self.texts.keys():
                yield name, sign, text

    def equation(self) -> bool:
        """Give the values that equations have; whether there are some."""
        found = False
        for name, sign, text in self.alone():
            if sign == "==":
                self.give(name, text)
                found = True
        return found

    def bounds(self) -> bool:
        """Give a value to a name with bounds on both sides: the corner, or the centre of a range that is kept."""
        found: dict[str, tuple[list[str], list[str]]] = {}
        for name, sign, text in self.alone():
            found.setdefault(name, ([], []))[sign.startswith("<")].append(text)
        for name, bounds in found.items():
            equal = [low for low in bounds[0] if self.number(low) in map(self.number, bounds[1])]
            lows, highs = ([text for text in side if not self.number(text).free_symbols] for side in bounds)
            if equal:
                self.give(name, equal[0])
                return True
            if lows and highs:
                self.choose(name, max(lows, key=self.number), min(highs, key=self.number))
                return True
        return False

    def number(self, text: str) -> Any:
        """The value of an expression, over the symbols of ranges."""
        return replaced(value(text), self.values, {})

    def choose(self, name: str, low: str, high: str) -> None:
        """Take a point between two bounds, or keep them as a range."""
        self.give(name, CORNERS[self.corner or "centre"].format(within(low), within(high)))
        if self.corner is not None:
            self.chosen.append(name)
            return
        here = symbol(name)
        known = {n: within(self.texts[n]) for n in self.network.variables if n in self.texts}
        self.ranges[name] = renamed(low, known), renamed(high, known)
        self.sides += [at_most_zero(self.number(low) - here), at_most_zero(here - self.number(high))]
        self.centres[here] = self.values.pop(here)

    def hold(self, relation: Relation) -> None:
        """Refuse a relation that does not hold, at the point or in all of the box.

        Raises ModelError: so it is, or a name in it has no value.
        """
        excess = replaced(relation.excess, self.values, {})
        free = sorted((s for s in excess.free_symbols if s not in self.centres), key=lambda s: s.name)
        if free:
            names = ", ".join(f"'{s.name}'" for s in free)
            hint = f"choose a point of it: --at {free[0].name}=NUMBER"
            raise relation.refusal(f"a run starts at one point, and this leaves {names} open", hint, "HS333")
        if excess.free_symbols:
            outside = [positive(excess), *([negative(excess)] if relation.operator == "==" else [])]
            sides = [side for side in self.sides if side.expr.free_symbols & excess.free_symbols]
            if not all(decide([*sides, beyond]).never for beyond in outside):
                message = "the initial set is no box: this holds in a part of it alone"
                raise relation.refusal(message, f"choose a point of it: {self.inside()}", "HS333")
            return
        beyond = excess >= 0 if relation.operator in STRICT else excess > 0
        if (excess != 0) if relation.operator == "==" else bool(beyond):
            message = "the initial set is empty: this does not hold at its only point"
            hint = None
            if self.chosen or self.network.given:
                message, hint = "this does not hold at the point that --at chose", "choose another one"
            raise relation.refusal(message, hint, "HS333")

    def inside(self) -> str:
        """The --at that chooses a point of a set that is no box."""
        for corner in CORNERS:
            with suppress(ModelError):
                work = _Solving(self.network, self.relations, corner).solved()
                for relation in self.relations:
                    work.hold(relation)
                return f"--at {corner}"
        return " ".join(f"--at {name}=NUMBER" for name in self.ranges)


def admits(draft: ModeDraft, begin: Start) -> bool:
    """Whether an invariant holds at the point, as far as its values are given."""
    inside = (replaced(draft.placed(facet), begin.numbers, {}) for facet in draft.facets)
    equal = (replaced(equality, begin.numbers, {}) for equality in draft.equalities)
    return not any(e.free_symbols == set() and bool(e > 0) for e in inside) and not any(
        e.free_symbols == set() and e != 0 for e in equal
    )


def refuse_outside(draft: ModeDraft, begin: Start, configured: Configuration, element: Element) -> None:
    """Refuse a start without a value for each state, or outside the invariant.

    Raises ModelError: so it is.
    """
    for name in draft.states:
        if name not in begin.variables:
            message = f"where '{name}' starts is not given"
            hint = f"write {name} == and a number under `initially`, or give --at {name}=NUMBER"
            raise _refusal(configured, element, message, hint)
    for facet, relation in draft.facets.items():
        if bool(replaced(draft.placed(facet), begin.numbers, {}) > 0):
            raise relation.refusal("the run starts where this invariant does not hold")
    for equality in draft.equalities:
        if replaced(equality, begin.numbers, {}) != 0:
            message = "the run starts where an equation of the invariant does not hold"
            raise _refusal(configured, element, message, "change `initially`")


def no_location(configured: Configuration, element: Element) -> ModelError:
    """The error that the initial point is in no invariant."""
    message, hint = "no location admits the initial point", "change `initially`, or give another point by --at"
    return _refusal(configured, element, message, hint)
