# pyright: basic
"""Systems of parts: instances of automata and their connections, to one hybrid system.

`instances` lists the parts, with automata of other files in place, and `names` has what their names and initial values
mean. `composition` reads the transitions of each part, joins those that fire together, and makes the one mode of all.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from hsdsl.base.names import SINCE
from hsdsl.base.parts import Part, numbered
from hsdsl.language.elaborate.definitions import define_parameter, placeholders, solutions, units_of, with_solutions
from hsdsl.language.elaborate.modes import elaborate_scene
from hsdsl.language.elaborate.parts.composition import FINAL, MODE, composed
from hsdsl.language.elaborate.parts.instances import Instance, roster_of
from hsdsl.language.elaborate.parts.names import Board, Names, Starts, unknowns_of
from hsdsl.language.elaborate.symbols import Meanings, SymbolTable, definition_order
from hsdsl.language.expression.algebra import NO_VALUE, ZERO, whole
from hsdsl.language.expression.scope import Refusal, Scope, Value, state
from hsdsl.language.schema.documents import PartModeDocument, SystemDocument
from hsdsl.language.source import Key
from hsdsl.language.system import Initial, Mode, Parameter, started

__all__ = ["FINAL", "MODE", "Parts"]


class Parts:
    """The parts of a document with a `system`, parameters and inputs of the file being known.

    ``parameters`` are those of the instances, by their full names. There are no ``modes`` where something is wrong,
    which is reported. ``units`` are those of names of instances that their automata give.
    """

    def __init__(self, symbols: SymbolTable, document: SystemDocument) -> None:
        self.symbols = symbols
        for key in ("modes", "initial"):
            if key in document.model_fields_set and getattr(document, key):
                place = next(iter(document.modes)).place if key == "modes" else document.initial.mode.place
                message = f"a model has either `modes` or a `system`; here is `{key}` besides `system`"
                symbols.report(place, "HS353", message, "give the parts their modes and initial values")
        self.roster = roster_of(symbols, document)
        self.board = Board(symbols, self.roster, {str(key): scalar for key, scalar in document.let.items()})
        instances = self.roster.instances.values()
        if not document.system:
            place = next(iter(document.automata)).place
            symbols.report(place, "HS350", "the model has automata and no `system`", "name its parts under `system`")
        self.parts: tuple[Part, ...] = tuple(one.part for one in instances)
        symbols.parts = self.parts
        self.parameters: tuple[Parameter, ...] = tuple(p for one in instances for p in self._parameters_of(one))
        names = [one.full(name) for one in instances for name in one.states]
        symbols.names |= dict.fromkeys(names, "states") | {p.name: "parameters" for p in self.parameters}
        symbols.values |= {name: state(name) for name in names}
        self._solve(document)
        self.outputs, values = self._outputs(document)
        symbols.all_outputs = self.outputs
        self.scene, numbers = elaborate_scene(symbols, Names(self.board, lenient=True).scope)
        scene = tuple(0 if scalar is None else value and value.expr for scalar, value in numbers)
        self._check_lets(document)
        self.modes: tuple[Mode, ...] = composed(self.board, values, scene)
        for k, part in enumerate(self.parts):
            if part.name in self.board.timed:  # all of its modes have the state `since`
                timed = replace(part, states=tuple((*states, f"{part.name}.{SINCE}") for states in part.states))
                self.parts = (*self.parts[:k], timed, *self.parts[k + 1 :])
        self.initial = self._initial()
        self.units = dict(self._units())
        if not symbols.findings.diagnostics:  # else what reads them may not have been examined
            self.board.check_ends()

    def _units(self) -> Iterator[tuple[str, str]]:
        given = self.symbols.document.units.get("t")  # pyright: ignore[reportArgumentType]
        time = None if given is None else self.symbols.text(given)
        if time is not None:
            timed = (one for one in self.roster.instances.values() if one.name in self.board.timed)
            yield from ((one.full(SINCE), time) for one in timed)
        for group in self.roster.automata.values():
            kind = group[0].kind if group else None
            if kind is not None:
                outputs = (name for table in (kind, *kind.modes.values()) for name in table.outputs)
                own = [*group[0].states, *map(str, (*kind.parameters, *kind.inputs, *outputs))]
                units = units_of(self.symbols, kind, own)
                yield from ((one.full(name), unit) for one in group for name, unit in units.items())

    def _solve(self, document: SystemDocument) -> None:
        """Solve the file's equations, in which definitions of parts have the unknowns as symbols of their own."""
        solve, values = document.solve, self.symbols.values
        if solve is None:
            return
        values |= placeholders(solve)
        found = solutions(self.symbols, solve, Names(self.board).scope)
        self.board.forget()
        unknowns = dict.fromkeys(map(str, solve.unknowns))
        values |= unknowns if found is None else with_solutions(placeholders(solve), found)

    def _parameters_of(self, one: Instance) -> list[Parameter]:
        """The parameters of an instance: those that are given to it, else those of its automaton."""
        refused: Meanings = {}
        earlier: Meanings = {} if one.index is None else {"index": Names(self.board, index=one.index)["index"]}
        outer = self.symbols.parameter_scope("a parameter is an expression of earlier parameters").values
        own = Scope(ChainMap(refused, earlier, outer))  # pyright: ignore[reportArgumentType]
        given = {str(key): scalar for key, scalar in one.given.parameters.items()}
        found: list[Parameter] = []
        for name in definition_order(one.kind.parameters, "parameters", refused):
            full, entry = one.full(name), one.kind.parameters[name]
            override = given.get(str(name))
            outside = ChainMap({"index": earlier["index"]} if one.index else {}, outer)  # pyright: ignore[reportArgumentType]
            value, parameter = define_parameter(self.symbols, full, entry, own, override, Scope(outside))
            earlier[name] = self.board.parameters[full] = value
            found += [] if parameter is None else [parameter]
        return found

    def _outputs(self, document: SystemDocument):
        """The outputs of the file and of the instances, and their values."""
        file = Names(self.board, lenient=True)
        values: dict[str, Any] = {str(n): self.symbols.number(s, file.scope) for n, s in document.outputs.items()}
        for name in document.outputs:
            if self.symbols.names.get(name) == "states":
                self.symbols.report(name.place, "HS301", f"the output '{name}' has the name of a state", None)
        for one in self.roster.instances.values():
            for name in dict.fromkeys((*one.kind.outputs, *(key for _, mode in one.modes for key in mode.outputs))):
                values[one.full(name)] = self._output_of(one, name)
        return tuple(values), tuple(None if value is None else value.expr for value in values.values())

    def _output_of(self, one: Instance, name: Key) -> Value | None:
        """An output of an instance, that of the mode first; without a value in modes that lack one of its names."""
        values: list[Value] = []
        for mode, document in one.modes:
            names = Names(self.board, one, mode, one.index)
            own = document.outputs.get(name)
            scalar = own or one.kind.outputs.get(name)
            lacks = own is None and (scalar is None or self.board.lacks(scalar, names))
            value = Value(NO_VALUE) if lacks or scalar is None else self.board.value(scalar, names)
            if value is None:
                return None
            values.append(value)
        return self.board.picked(one, values)

    def _check_lets(self, document: SystemDocument) -> None:
        """Work out every `let`, also those that nothing uses."""
        for name in document.let:
            Names(self.board)[name]
        for one in self.roster.instances.values():
            for mode, inner in one.modes:
                self._check_unknowns(one, mode, inner)
                for name in (*one.kind.inputs, *inner.let, *unknowns_of(inner)):
                    Names(self.board, one, mode, one.index)[str(name)]
            for name, scalar in one.kind.let.items():
                places = [Names(self.board, one, mode, one.index) for mode, _ in one.modes]
                found = [names[name] for names in places]
                if found and all(isinstance(meaning, Refusal) for meaning in found):
                    self.board.value(scalar, places[0])

    def _check_unknowns(self, one: Instance, mode: str, document: PartModeDocument) -> None:
        """Report unknowns whose names mean something else."""
        if document.solve is None:
            return
        taken = dict.fromkeys(map(str, (*one.kind.let, *document.let)), "a `let` name")
        taken |= dict.fromkeys(one.states, "a state") | dict.fromkeys(map(str, one.kind.inputs), "an input")
        taken |= dict.fromkeys(map(str, one.kind.parameters), "a parameter")
        for name in document.solve.unknowns:
            if str(name) in taken:
                message = f"'{name}' is an unknown of `solve` in the mode '{mode}', and also {taken[str(name)]}"
                self.board.report_once(name, "HS301", message, "give one of them another name")

    def _initial(self) -> Initial:
        """The initial state of the whole; states that the initial mode of a part lacks are 0."""
        written = Starts(self.board).written
        values = [
            (n, written.get(n, ZERO)) for one in self.roster.instances.values() for n in map(one.full, one.states)
        ]
        starts = {
            part.name: whole((one.start or 0) + 1)
            for part, one in zip(self.parts, self.roster.instances.values(), strict=True)
        }
        ends = any(one.part.final[one.start or 0] for one in self.roster.instances.values())
        values += [(one.full(SINCE), ZERO) for one in self.roster.instances.values() if one.name in self.board.timed]
        values += [(name, starts[name]) for name in numbered(self.parts)]
        order = {name: value for name, value in values if name not in written} | written
        return started(FINAL if ends else MODE, [name for name, _ in values], tuple(order.items()))
