# pyright: basic
"""What is known of a model while it is elaborated: its document, and what each of its names means."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from hsdsl.elaborate.resolver import ExpressionResolver
from hsdsl.expression.scope import Refusal, Scope, Value, state
from hsdsl.files import folder_of, read_data
from hsdsl.names import closest
from hsdsl.schema import ModeDocument, ModelDocument
from hsdsl.source import ABSENT, Key, Scalar
from hsdsl.system import TIME

KINDS = {"parameters": "a parameter", "inputs": "an input", "states": "a state", "let": "a `let` name"}
Values = dict[str, Value | Refusal | None]


@dataclass
class SymbolTable:
    """A document with its names.

    Attributes
    ----------
    names : dict of str to str
        Every name that is not of one mode alone, and which of :data:`KINDS` it is.
    values : dict
        What each of those names that is defined so far means; ``t`` is there from the start.
    states : dict
        The states of each mode in file order; empty for a final mode without a flow.
    undeclared : frozenset of str
        The names that only `initial` knows: states of its mode that lack a flow. They are reported there alone.
    scopes : dict
        What names mean in each mode, once it is elaborated.
    given : mapping or None
        The content of all data files by name, where they are not to be read.
    files : dict
        The data files that were used: their content by name, relative to the model.
    """

    document: ModelDocument
    resolver: ExpressionResolver
    folder: Path
    path: str
    given: Mapping[str, bytes] | None = None
    names: dict[str, str] = field(default_factory=dict)
    values: Values = field(default_factory=dict)
    states: dict[str, tuple[str, ...]] = field(default_factory=dict)
    undeclared: frozenset[str] = frozenset()
    scopes: dict[str, Scope] = field(default_factory=dict)
    files: dict[str, bytes] = field(default_factory=dict)

    @classmethod
    def of(
        cls, document: ModelDocument, resolver: ExpressionResolver, path: str, given: Mapping[str, bytes] | None = None
    ) -> SymbolTable:
        """A document with its names gathered and their clashes reported."""
        symbols = cls(document, resolver, folder_of(path), path, given)
        for key in document.parameters:
            symbols._claim(key, "parameters")
        for key in document.inputs:
            symbols._claim(key, "inputs")
        for name, mode in document.modes.items():
            symbols.states[name] = tuple(map(str, mode.flow or ()))
            for key in mode.flow or ():
                symbols._claim(key, "states")
        for key in document.let:
            symbols._claim(key, "let")
        symbols.values["t"] = Value(TIME)
        for name, kind in symbols.names.items():
            if kind == "states":
                symbols.values[name] = state(name)
        symbols.undeclared = frozenset(symbols._undeclared())
        symbols.values.update(dict.fromkeys(symbols.undeclared))
        return symbols

    def _undeclared(self) -> list[str]:
        start = self.document.initial
        mode = self.document.modes.get(start.mode.value)  # pyright: ignore[reportArgumentType]
        if mode is None or mode.flow is None:
            return []
        given = [str(key) for key in start.__pydantic_extra__ if key not in self.names]
        return [key for key in given if closest(key, map(str, mode.flow)) is None]

    def _claim(self, key: Key, kind: str) -> None:
        taken = self.names.setdefault(key, kind)
        if taken != kind:
            message = f"'{key}' is {KINDS[kind]} here, and also {KINDS[taken]}"
            self.resolver.add(key.place, "HS301", message, "give one of them another name")

    def scope(
        self, usable: tuple[str, ...], sentence: str, values: Values | None = None, hint: str | None = None
    ) -> Scope:
        """A scope with names of some kinds; the others are refused with a sentence and a hint."""
        found: Values = {"t": self.values["t"] if "time" in usable else _refused("t", "the time", sentence, hint)}
        for name, kind in self.names.items():
            if kind in usable:
                if name in self.values:
                    found[name] = self.values[name]
            else:
                found[name] = _refused(name, KINDS[kind], sentence, hint)
        return Scope({**dict.fromkeys(self.undeclared), **found, **(values or {})})

    def data(self, name: str) -> bytes:
        """The content of a data file, which is read once.

        Raises
        ------
        DataRefused
            It cannot be used.
        """
        if name not in self.files:
            self.files[name] = read_data(self.folder, name) if self.given is None else self.given[name]
        return self.files[name]

    def text(self, scalar: Scalar | None) -> str | None:
        """The text of a scalar that may be missing."""
        return None if scalar is None or scalar.value == ABSENT else scalar.value

    def all_states(self) -> tuple[str, ...]:
        """Every state of every mode, once."""
        return tuple(name for name, kind in self.names.items() if kind == "states")

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
    def elsewhere(self) -> Values:
        """Refusals of those names for modes that do not define them."""
        hint = "give it to this mode too, or define it once in the `let` of the whole model"
        return {name: Refusal("HS111", f"'{name}' is a `let` name of other modes", hint) for name in self.inner_lets}

    def without_states(self, mode: ModeDocument) -> bool:
        """Whether a mode has the states it is entered with, and none of its own."""
        return mode.final and mode.flow is None


def _refused(name: str, kind: str, sentence: str, hint: str | None) -> Refusal:
    return Refusal("HS117", f"'{name}' is {kind}; {sentence}", hint)


def definition_order(keys: Iterable[Key], kind: str, refused: Values) -> Iterator[Key]:
    """The names of definitions that may use earlier ones only.

    ``refused`` holds, while a name's turn lasts, refusals of it and of those below, and in the end nothing.
    """
    keys = list(keys)
    for key in keys:
        refused[key] = Refusal("HS302", f"'{key}' is defined below; {kind} use earlier ones only", "move it up")
    for key in keys:
        refused[key] = Refusal("HS302", f"'{key}' is defined by itself", "give one of the two another name")
        yield key
        del refused[key]
