# pyright: basic
"""A model as SBML, Level 3 Version 2: flows as rate rules, transitions as events, several modes as a parameter.

A guard becomes an event whose trigger holds where the state is on it or beyond and the flow points out. Its `if`
decides what the event assigns, so that a surface that is passed while it is false stays passed. Events lose the race
of an instant as transitions do: one goes at a time, by priority and then by their order in the file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import sympy as sp

from hsdsl.base import functions
from hsdsl.base.errors import UsageError
from hsdsl.base.names import visible
from hsdsl.export.source import Source, identifiers
from hsdsl.language.elaborate import elaborate_files
from hsdsl.language.expression.conditions import Joined, Reached, Trigger
from hsdsl.language.system import TIME, Edge, HybridSystem, Mode, symbol

SPACE = "http://www.sbml.org/sbml/level3/version2/core"


def files(source: Source) -> dict[str, bytes]:
    """One file of SBML.

    Raises UsageError: what SBML does not have.
    """
    return {f"{source.name}.xml": document(source).encode()}


def document(source: Source) -> str:
    """The text of the file."""
    system = _system(source)
    root = Element("sbml", xmlns=SPACE, level="3", version="2")
    root.append(_Writer(source, system).model())
    indent(root)
    heading = "".join(f"<!-- {line.replace('--', '- -')} -->\n" for line in source.heading)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{heading}{tostring(root, encoding="unicode")}\n'


def _system(source: Source) -> HybridSystem:
    """The system, with events as conditions; refused where SBML cannot keep it."""
    system = source.system
    if system.inputs:
        name = system.inputs[0].name
        hint = f"write it as an expression of time, for example `let: {{{name}: sin(t)}}` without the input"
        raise UsageError(f"SBML has no sampled inputs, and `{name}` is one", hint)
    if not any(edge.of_event for edge in system.edges):
        return system
    if len(system.modes) > 1:
        hint = "write one mode, or guards (`when`)"
        raise UsageError("SBML has no events of a mode, and this model has several modes and an `event`", hint)
    source_files = source.model.pipeline.files
    assert source_files is not None
    return elaborate_files(source_files).before_events


class _Writer:
    """The parts of a model in SBML."""

    def __init__(self, source: Source, system: HybridSystem) -> None:
        self.source, self.system = source, system
        self.ids = identifiers([*system.states, *(p.name for p in system.parameters), *system.outputs])
        self.mode = next(iter(identifiers(["mode"], self.ids.values()).values()))
        self.numbers = {mode.name: sp.Integer(i) for i, mode in enumerate(system.modes)}
        self.on = self._switches()
        self.mathml = MathML({**self.ids, self.mode: self.mode, **{name: name for name in self.on.values()}})

    def _switches(self) -> dict[str, str]:
        """For each of three or more modes a parameter that is 1 in it and 0 elsewhere, to multiply flows with.

        An event that changes two conditions of a ``piecewise`` in flows stops COPASI 4.48. A product needs factors
        that are finite in every mode: without it, other flows have a ``piecewise``.
        """
        modes, wave = self.system.modes, sp.Dummy()
        values = [
            value for mode in modes for value in (*mode.vector_field.values(), *mode.outputs) if value is not None
        ]
        plain: list[Any] = [
            value.replace(sp.sin, lambda x: wave * x).replace(sp.cos, lambda x: wave * x) for value in values
        ]
        moving = [*map(symbol, self.system.states), TIME]
        if len(modes) < 3 or not all(value.is_polynomial(*moving) for value in plain):
            return {}
        names = identifiers([f"in {mode.name}" for mode in modes], [*self.ids.values(), self.mode])
        return dict(zip(self.numbers, names.values(), strict=True))

    def model(self) -> Element:
        """The element of the model, with what it has of each kind in SBML's order."""
        whole = Element("model", id=self.source.name, name=visible(self.system.title or self.source.name))
        kinds = {"Parameters": self.parameters, "Rules": self.rules}
        kinds |= {"Constraints": self.constraints, "Events": self.events}
        for kind, make in kinds.items():
            if parts := list(make()):
                SubElement(whole, f"listOf{kind}").extend(parts)
        return whole

    def parameters(self) -> Iterator[Element]:
        """Parameters, states with their initial values, outputs, and the number of the mode."""
        problem = self.source.problem
        for given, value in zip(self.system.parameters, problem.timeline.segments[0].data, strict=False):
            yield self._parameter(given.name, float(value), given.about)
        starts = dict(zip(problem.states, map(float, problem.x), strict=True))
        for name in self.system.states:
            yield self._parameter(name, starts.get(name, 0.0), constant=False)
        for name in self.system.outputs:
            yield self._parameter(name, None, constant=False)
        if len(self.numbers) > 1:
            listed = ", ".join(f"{number} is {name}" for name, number in self.numbers.items())
            start = problem.program.modes[problem.mode].name
            yield self._parameter(self.mode, float(self.numbers[start]), f"the mode: {listed}", constant=False)
            for name, switch in self.on.items():
                yield self._parameter(switch, float(name == start), f"1 in the mode {name}", constant=False)

    def _parameter(self, name: str, value: float | None, about: str | None = None, constant: bool = True) -> Element:
        identifier = self.ids.get(name, name)
        given = {"id": identifier} | ({"name": visible(about or name)} if about or name != identifier else {})
        given |= {} if value is None else {"value": repr(value)}
        return Element("parameter", given | {"constant": str(constant).lower()})

    def rules(self) -> Iterator[Element]:
        """The flow of each state that is not at rest in every mode, and the outputs.

        An event on a state with the rate 0 that is on the event's threshold fires again and again in COPASI 4.48.
        """
        for name in self.system.states:
            flows = [mode.vector_field.get(symbol(name), sp.S.Zero) for mode in self.system.modes]
            if any(flows):
                yield self._rule("rateRule", name, self.by_mode(flows))
        for i, name in enumerate(self.system.outputs):
            if lacking := [mode.name for mode in self.system.modes if mode.outputs[i] is None]:
                raise UsageError(f"SBML needs output `{name}` in every mode, and {lacking[0]} has none")
            yield self._rule("assignmentRule", name, self.by_mode([mode.outputs[i] for mode in self.system.modes]))

    def _rule(self, tag: str, name: str, value: Any) -> Element:
        rule = Element(tag, variable=self.ids[name])
        rule.append(self.mathml.math(value))
        return rule

    def by_mode(self, given: list[Any]) -> Any:
        """The expression that is given for the mode that is on."""
        values: dict[Any, list[Any]] = {}
        for mode, value in zip(self.system.modes, given, strict=True):
            values.setdefault(value, []).append(symbol(self.on[mode.name]) if self.on else self.inside(mode))
        *others, last = values
        if others and self.on:
            return sp.Add(*(value * sp.Add(*switches) for value, switches in values.items()))
        pieces = [(value, sp.Or(*values[value])) for value in others]
        return sp.Piecewise(*pieces, (last, True), evaluate=False) if pieces else last

    def inside(self, mode: Mode) -> Any:
        """The condition that a mode is on."""
        return sp.true if len(self.numbers) == 1 else sp.Eq(symbol(self.mode), self.numbers[mode.name])

    def constraints(self) -> Iterator[Element]:
        """The walls of each mode."""
        for mode in self.system.modes:
            for wall in mode.walls:
                constraint = Element("constraint")
                constraint.append(self.mathml.math(sp.Or(sp.Not(self.inside(mode)), sp.Le(wall.residual, 0))))
                yield constraint

    def events(self) -> Iterator[Element]:
        """The transitions, each as an event."""
        edges = [(mode, edge) for mode in self.system.modes for edge in mode.edges]
        taken = [*self.ids.values(), self.mode, *self.on.values()]
        names = identifiers([f"{mode.name} {edge.name} {k}" for k, (mode, edge) in enumerate(edges)], taken)
        for k, ((mode, edge), name) in enumerate(zip(edges, names.values(), strict=True)):
            yield self._event(mode, edge, name, len(edges) - k)

    def _event(self, mode: Mode, edge: Edge, identifier: str, rank: int) -> Element:
        event = edge.event
        delay = event.delay if event else None
        at_trigger = event is not None and delay is not None and not event.at_execution
        given = {"id": identifier, "name": visible(edge.name), "useValuesFromTriggerTime": str(at_trigger).lower()}
        whole = Element("event", given)
        initially, persistent = (event.initially, event.persistent) if event else (False, False)
        attributes = {"initialValue": str(initially).lower(), "persistent": str(persistent).lower()}
        trigger = self.guard(mode, edge) if event is None else condition(event.trigger)
        SubElement(whole, "trigger", attributes).append(self.mathml.math(trigger))
        SubElement(whole, "priority").append(self.mathml.math(self.priority(edge, rank)))
        if delay is not None and delay != 0:
            SubElement(whole, "delay").append(self.mathml.math(delay))
        assigned = {str(name): value for name, value in edge.changes.items()}
        if edge.target != mode.name:
            assigned[self.mode] = self.numbers[edge.target]
            assigned |= {self.on[mode.name]: sp.S.Zero, self.on[edge.target]: sp.S.One} if self.on else {}
        makes = SubElement(whole, "listOfEventAssignments") if assigned else whole
        for name, value in assigned.items():
            if edge.condition is not None:
                value = sp.Piecewise((value, edge.condition), (symbol(name), True), evaluate=False)
            one = SubElement(makes, "eventAssignment", variable=self.ids.get(name, name))
            one.append(self.mathml.math(value))
        return whole

    def priority(self, edge: Edge, rank: int) -> Any:
        """What decides between events of one instant: the priority, and of whole ones then the order in the file."""
        given = [each.event.priority for each in self.system.edges if each.event and each.event.priority is not None]
        if not given:
            return sp.Integer(edge.priority * (len(self.system.edges) + 1) + rank)
        return edge.event.priority if edge.event and edge.event.priority is not None else sp.Integer(edge.priority)

    def guard(self, mode: Mode, edge: Edge) -> Any:
        """The condition that a state is on a guard or beyond it, and that the flow points out."""
        residual = edge.surface.residual
        slopes = [residual.diff(name) * flow for name, flow in mode.vector_field.items()]
        rate = sum(slopes, residual.diff(TIME))
        return sp.And(self.inside(mode), sp.Ge(residual, 0), sp.Gt(rate, 0))


MATH_SPACE = "http://www.w3.org/1998/Math/MathML"
TIME_URL = "http://www.sbml.org/sbml/symbols/time"
MOST_DIGITS = 15  # of a numerator or a denominator: a float has no more
_WORDS = {
    **{sp.Add: "plus", sp.Mul: "times", sp.Pow: "power", sp.And: "and", sp.Or: "or", sp.Not: "not", sp.Xor: "xor"},
    **{sp.Gt: "gt", sp.Ge: "geq", sp.Lt: "lt", sp.Le: "leq", sp.Eq: "eq", sp.Ne: "neq"},
    **{sp.sin: "sin", sp.cos: "cos", sp.tan: "tan", sp.exp: "exp", sp.log: "ln"},
    **{sp.asin: "arcsin", sp.acos: "arccos", sp.atan: "arctan"},
    **{sp.asinh: "arcsinh", sp.acosh: "arccosh", sp.atanh: "arctanh"},
    **{functions.sinh: "sinh", functions.cosh: "cosh", functions.tanh: "tanh"},
    **{functions.absolute: "abs", functions.floor: "floor", functions.maximum: "max", functions.minimum: "min"},
}
_CONSTANTS = {sp.pi: "pi", sp.E: "exponentiale", sp.true: "true", sp.false: "false"}


class MathML:
    """Writes expressions whose symbols have identifiers."""

    def __init__(self, identifiers: Mapping[str, str]) -> None:
        self.identifiers = identifiers

    def math(self, expression: Any) -> Element:
        """The element `math` of an expression, a condition or a trigger."""
        whole = Element("math", xmlns=MATH_SPACE)
        whole.append(self.node(expression))
        return whole

    def node(self, expression: Any) -> Element:
        """The element of an expression.

        Raises UsageError: a function that SBML does not have.
        """
        if expression in _CONSTANTS:
            return Element(_CONSTANTS[expression])
        if expression == TIME:
            return _leaf("csymbol", "time", encoding="text", definitionURL=TIME_URL)
        if expression.is_Symbol:
            return _leaf("ci", self.identifiers[expression.name])
        if expression.is_Number:
            if expression.is_Integer and len(str(expression)) <= MOST_DIGITS:
                return _leaf("cn", str(expression), type="integer")
            if expression.is_Rational and max(len(str(expression.p)), len(str(expression.q))) <= MOST_DIGITS:
                node = _leaf("cn", str(expression.p), type="rational")
                SubElement(node, "sep").tail = str(expression.q)
                return node
            return _leaf("cn", repr(float(expression)))
        if isinstance(expression, functions.sign):
            return self.node(sp.Piecewise(*_signs(expression.args[0])))
        if isinstance(expression, functions.below):
            number, bound, one, other = expression.args
            return self.cases([(one, sp.Lt(number, bound))], other)
        if isinstance(expression, sp.Piecewise):
            pieces: list[Any] = [tuple(piece.args) for piece in expression.args]
            return self.cases(pieces[:-1], pieces[-1][0]) if pieces[-1][1] == sp.true else self.cases(pieces, None)
        if (word := _WORDS.get(type(expression))) is None:
            raise UsageError(f"SBML has no `{expression.func.__name__}`", "write it with the functions of SBML")
        return _apply(word, *map(self.node, expression.args))

    def cases(self, pieces: Any, other: Any) -> Element:
        """A value for each condition, and another one."""
        whole = Element("piecewise")
        for value, condition in pieces:
            SubElement(whole, "piece").extend([self.node(value), self.node(condition)])
        if other is not None:
            SubElement(whole, "otherwise").append(self.node(other))
        return whole


def condition(trigger: Trigger) -> Any:
    """The Boolean of the condition of an event."""
    if isinstance(trigger, Joined):
        return (sp.And if trigger.word == "and" else sp.Or)(*map(condition, trigger.parts))
    if isinstance(trigger, Reached):
        return (sp.Gt if trigger.strict else sp.Ge)(trigger.residual, 0)
    return sp.true if trigger else sp.false


def _signs(number: Any) -> list[tuple[Any, Any]]:
    return [(sp.S.One, sp.Gt(number, 0)), (sp.S.NegativeOne, sp.Lt(number, 0)), (sp.S.Zero, sp.true)]


def _apply(word: str, *arguments: Element) -> Element:
    node = Element("apply")
    node.append(Element(word))
    node.extend(arguments)
    return node


def _leaf(tag: str, text: str, **attributes: str) -> Element:
    node = Element(tag, attributes)
    node.text = text
    return node
