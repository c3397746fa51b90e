# pyright: basic
"""The symbol table of a model under elaboration: its document, the meaning of its names, and its expressions.

A scalar is parsed, looked up and translated, with every fault at its place in the file; the answer is then None.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

from hsdsl.base.errors import Findings
from hsdsl.base.names import SINCE, closest, shown
from hsdsl.base.parts import Part
from hsdsl.language.expression import Expected, ExpressionError, numeric, parse, symbolic
from hsdsl.language.expression.conditions import Trigger, equation, inequality, the_comparison, trigger_of
from hsdsl.language.expression.parse import Call, Name, Tree, walk
from hsdsl.language.expression.scope import Meaning, Refusal, Scope, Value, state
from hsdsl.language.expression.timebox import Box
from hsdsl.language.files import ModelFiles
from hsdsl.language.schema.documents import ModeDocument, ModelDocument
from hsdsl.language.source import ABSENT, Key, Scalar, SourceRange
from hsdsl.language.system import TIME

T = TypeVar("T")

_NOT_FINITE = (".inf", "+.inf", "-.inf", ".nan", "inf", "+inf", "-inf", "infinity", "-infinity", "nan")


def resolved_expression(text: str, scope: Scope) -> Value:
    """The value of an expression that is in no file.

    Raises ExpressionError: at its first fault.
    """
    tree = _tree(text, "number", scope)
    faults = scope.faults(tree)
    if faults:
        raise faults[0]
    return symbolic.number(tree, scope, text)


def all_of(parts: Iterable[T | None]) -> list[T] | None:
    """The parts, or None where one of them is broken and reported."""
    every = list(parts)
    whole = [part for part in every if part is not None]
    return whole if len(whole) == len(every) else None


class Seen(Mapping[str, Meaning]):
    """The names of a scope while one expression is built: of parts each is worked out at every look."""

    def __init__(self, values: Mapping[str, Meaning]) -> None:
        self._values = values
        self._known: dict[str, Meaning] = {}

    def __getitem__(self, name: str) -> Meaning:
        if name not in self._known:
            self._known[name] = self._values[name]
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def items(self) -> Any:
        """The names with their meanings, for hints."""
        return self._values.items()


def _tree(text: str, expected: Expected, scope: Scope) -> Tree:
    word = text.strip()
    if word.lower() in _NOT_FINITE and word.lstrip("+-") not in scope.values:
        message, hint = f"`{word}` is not a finite number", "every number is finite here"
        raise ExpressionError("HS118", message, 0, len(text), hint)
    return parse(text, expected)


KINDS = {
    "functions": "a function", "parameters": "a parameter", "inputs": "an input", "states": "a state",
    "let": "a `let` name", "unknowns": "an unknown of `solve`",
}  # fmt: skip
Meanings = dict[str, Meaning]


@dataclass
class SymbolTable:
    """A document with its names.

    ``names`` has the kind, of :data:`KINDS`, of every name that is not of one mode alone; ``values`` the meaning of
    those that are defined so far, ``t`` from the start. ``states`` has the states of each mode in file order, none for
    a final mode without a flow. ``undeclared`` names are in `initial` alone: states of its mode that lack a flow,
    reported there. ``scopes`` has the scope of each mode that is elaborated, ``data`` the content of the data files
    that were used. ``drivable`` says that inputs of time stay inputs. ``of_functions`` has the names that functions of
    the file may use, with the parameters that are defined so far. ``parts`` are those of a system.

    ``box`` bounds the time that each expression takes, and ``at`` is the one that was begun last. ``made`` has the
    values of expressions by their text and the meanings of their names.
    """

    document: ModelDocument
    findings: Findings
    files: ModelFiles
    names: dict[str, str] = field(default_factory=dict)
    values: Meanings = field(default_factory=dict)
    states: dict[str, tuple[str, ...]] = field(default_factory=dict)
    undeclared: frozenset[str] = frozenset()
    scopes: dict[str, Scope] = field(default_factory=dict)
    data: dict[str, bytes] = field(default_factory=dict)
    drivable: bool = False
    of_functions: Meanings = field(default_factory=dict)
    parts: tuple[Part, ...] = ()
    box: Box | None = None
    at: Scalar | None = None
    made: dict[tuple[Any, ...], Value] = field(default_factory=dict)

    def __post_init__(self) -> None:
        document = self.document
        self.states = {name: tuple(map(str, mode.flow or ())) for name, mode in document.modes.items()}
        keys = [(kind, getattr(document, kind)) for kind in ("functions", "parameters", "inputs")]
        keys += [("states", mode.flow or ()) for mode in document.modes.values()] + [("let", document.let)]
        keys += [("unknowns", document.solve.unknowns)] if document.solve is not None else []
        for kind, names in keys:
            for key in names:
                taken = self.names.setdefault(key, kind)
                if taken != kind:
                    message = f"'{key}' is {KINDS[kind]} here, and also {KINDS[taken]}"
                    self.report(key.place, "HS301", message, "give one of them another name")
        self.values["t"] = Value(TIME)
        self.values |= {name: state(name) for name in self.all_states()}
        if self.timed:
            self.values[SINCE] = state(SINCE)
        self.undeclared = frozenset(self._undeclared())
        self.values.update(dict.fromkeys(self.undeclared))

    def _undeclared(self) -> list[str]:
        if not self.document.modes:
            return []
        start = self.document.initial
        if start is None:  # reported with the system, which has no `modes`
            return []
        mode = self.document.modes.get(start.mode.value)  # pyright: ignore[reportArgumentType]
        if mode is None or mode.flow is None:
            return []
        given = [str(key) for key in start.__pydantic_extra__ if key not in self.names and key != SINCE]
        return [key for key in given if closest(key, map(str, mode.flow)) is None]

    def report(self, place: SourceRange, code: str, message: str, hint: str | None = None) -> None:
        """Report a fault at a place."""
        self.findings.add(place.diagnostic(code, message, hint))

    def number(self, scalar: Scalar, scope: Scope, finite_now: bool = False) -> Value | None:
        """The value of an expression; with ``finite_now`` it must have one with the file's own parameters."""
        value = self._built(scalar, scope, "number", lambda tree, scope: self._number(tree, scope, scalar.value))
        if value and finite_now and value.number is not None and not numeric.finite(value.number):
            message = f"`{shown(scalar.value, 40)}` has no finite real value with the parameters of this file"
            self.report(scalar.place, "HS118", message)
            return None
        return value

    def _number(self, tree: Tree, scope: Scope, text: str) -> Value:
        """The value of a tree: made once where its names mean the same, as those of many parts and of their modes."""
        named = (
            (node.name if isinstance(node, Name) else node.function)
            for node in walk(tree)
            if isinstance(node, (Name, Call))
        )
        key = text, *map(scope.values.get, named)
        if key not in self.made:
            self.made[key] = symbolic.number(tree, scope, text)
        return self.made[key]

    def tree(self, scalar: Scalar) -> Tree | None:
        """The tree of an expression whose names are looked up later."""
        try:
            return None if scalar.value == ABSENT else parse("" if scalar.kind == "null" else scalar.value)
        except ExpressionError as error:
            self._report(scalar, error)
            return None

    def names_known(self, scalar: Scalar, tree: Tree, scope: Scope) -> bool:
        """Whether all names of an expression can be used; those that cannot are reported."""
        faults = scope.faults(tree)
        for fault in faults:
            self._report(scalar, fault)
        return not faults and not scope.broken(tree)

    def condition(self, scalar: Scalar, scope: Scope) -> Any | None:
        """The SymPy Boolean of a condition."""
        return self._built(
            scalar, scope, "condition", lambda tree, scope: symbolic.condition(tree, scope, scalar.value)
        )

    def equation(self, scalar: Scalar, scope: Scope) -> tuple[Value, Value] | None:
        """Both sides of an equation."""
        return self._built(scalar, scope, "condition", lambda tree, scope: equation(tree, scope, scalar.value))

    def trigger(self, scalar: Scalar, scope: Scope) -> Trigger | None:
        """The condition of an event."""
        return self._built(scalar, scope, "condition", lambda tree, scope: trigger_of(tree, scope, scalar.value))

    def inequality(self, scalar: Scalar, scope: Scope, key: str) -> tuple[Value, str, Value] | None:
        """The two sides of one inequality, and its sign between them."""
        build = lambda tree, scope: inequality(tree, scope, scalar.value, key)  # noqa: E731
        return self._built(scalar, scope, "inequality", build, key)

    def _built(
        self, scalar: Scalar, scope: Scope, expected: Expected, build: Callable[[Tree, Scope], T], key: str = ""
    ) -> T | None:
        """An object built of an expression; None where it has faults, which are reported, or uses what is broken."""
        if scalar.value == ABSENT:
            return None
        self.at = scalar
        if self.box:
            self.box.restart()
        text = "" if scalar.kind == "null" else scalar.value.lower() if scalar.kind == "boolean" else scalar.value
        scope = replace(scope, values=Seen(scope.values))
        try:
            tree = _tree(text, expected, scope)
            tree = tree if scope.expanded is None else scope.expanded(tree)
            known = self.names_known(scalar, tree, scope)
            if expected == "inequality" and not (isinstance(tree, Call) and scope.faults(tree)):
                the_comparison(tree, key, text)
            return build(tree, scope) if known else None
        except ExpressionError as error:
            self._report(scalar, error)
            return None

    def _report(self, scalar: Scalar, error: ExpressionError) -> None:
        hint, text, (_, line, column) = error.hint, scalar.place.text, scalar.place.end
        cut = scalar.plain and scalar.value.count("(") > scalar.value.count(")")
        if cut and text.lines[line][column:].lstrip().startswith("#"):
            hint = "YAML begins a comment at ` #`: quote this expression"
        self.findings.add(text.diagnostic(error.code, error.message, scalar.span(error.start, error.end), hint))

    def scope(
        self, usable: tuple[str, ...], sentence: str, values: Meanings | None = None, hint: str | None = None
    ) -> Scope:
        """A scope with names of some kinds; the others are refused with a sentence and a hint."""

        def refusal(name: str, kind: str) -> Refusal:
            return Refusal("HS117", f"'{name}' is {kind}; {sentence}", hint)

        known: Meanings = {"t": self.values["t"] if "time" in usable else refusal("t", "the time")}
        if self.timed:
            since = "the time since the mode was entered"
            known[SINCE] = self.values[SINCE] if "states" in usable else refusal(SINCE, since)
        for name, kind in self.names.items():
            if kind not in (*usable, "functions"):
                known[name] = refusal(name, KINDS[kind])
            elif name in self.values:
                known[name] = self.values[name]
        return Scope({**dict.fromkeys(self.undeclared), **known, **(values or {})})

    def parameter_scope(self, sentence: str, hint: str | None = None) -> Scope:
        """A scope with the parameters alone."""
        return self.scope(("parameters",), sentence, hint=hint)

    def numbers(self, scalars: Iterable[Scalar], scope: Scope, finite_now: bool = False) -> list[Value] | None:
        """The values of expressions; None where one of them is broken."""
        return all_of([self.number(scalar, scope, finite_now) for scalar in scalars])

    def content(self, name: str) -> bytes:
        """The content of a data file, which is read once; raises DataRefused."""
        if name not in self.data:
            self.data[name] = self.files.content(name)
        return self.data[name]

    def text(self, scalar: Scalar | None) -> str | None:
        """The text of a scalar that may be missing."""
        return None if scalar is None or scalar.value == ABSENT else scalar.value

    def all_states(self) -> tuple[str, ...]:
        """Every state of every mode, once."""
        return tuple(name for name, kind in self.names.items() if kind == "states")

    @cached_property
    def timed(self) -> bool:
        """Whether `since` is the time since the mode was entered: the file defines no such name."""
        return SINCE not in self.names and SINCE not in self.inner_lets

    @cached_property
    def all_outputs(self) -> tuple[str, ...]:
        """Every output of the model, then every further one of a mode, once."""
        inner = (key for mode in self.document.modes.values() for key in mode.outputs)
        return tuple(dict.fromkeys(map(str, (*self.document.outputs, *inner))))

    @cached_property
    def inner_lets(self) -> frozenset[str]:
        """Every `let` name that some mode defines for itself."""
        return frozenset(str(key) for mode in self.document.modes.values() for key in mode.let)

    @cached_property
    def recorded(self) -> Meanings:
        """Refusals of outputs, which no expression has."""
        hint = "define it under `let`, and write outputs: {{{0}: {0}}}"
        message = "'{}' is an output, and expressions have none"
        own = (name for name in self.all_outputs if name not in self.names)
        return {name: Refusal("HS117", message.format(name), hint.format(name)) for name in own}

    @cached_property
    def elsewhere(self) -> Meanings:
        """Refusals of outputs, and of those names for modes that do not define them."""
        hint = "give it to this mode too, or define it once in the `let` of the whole model"
        return self.recorded | self._of_modes("'{}' is a `let` name of other modes", hint)

    @cached_property
    def above(self) -> Meanings:
        """Refusals of outputs, and of those names for what all modes share."""
        message = "'{}' is a `let` name of modes, and what all modes share cannot use it"
        return self.recorded | self._of_modes(message, "write this in those modes")

    def _of_modes(self, message: str, hint: str) -> Meanings:
        return {name: Refusal("HS111", message.format(name), hint) for name in self.inner_lets}

    def without_states(self, mode: ModeDocument) -> bool:
        """Whether a mode has the states it is entered with, and none of its own."""
        return mode.final and mode.flow is None


def definition_order(keys: Iterable[Key], kind: str, refused: Meanings) -> Iterator[Key]:
    """The names of definitions that may use earlier ones only.

    ``refused`` holds, at a name's turn, refusals of it and of those below, and in the end nothing.
    """
    keys = list(keys)
    for key in keys:
        refused[key] = Refusal("HS302", f"'{key}' is defined below; {kind} use earlier ones only", "move it up")
    for key in keys:
        refused[key] = Refusal("HS302", f"'{key}' is defined by itself", "give one of the two another name")
        yield key
        del refused[key]
