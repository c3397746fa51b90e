# pyright: basic
"""Transitions of parts: those with a surface of their own, and those that fire together with another."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from hsdsl.base.names import did_you_mean, shown
from hsdsl.language.elaborate.edges import event_of, of_events, surface, unnamed
from hsdsl.language.elaborate.parts.instances import Instance
from hsdsl.language.elaborate.parts.names import MEMBER, Board, Names
from hsdsl.language.expression.scope import Refusal
from hsdsl.language.schema.documents import PartModeDocument, PartTransitionDocument
from hsdsl.language.source import ABSENT, Key, Scalar
from hsdsl.language.system import Event as Rising
from hsdsl.language.system import Surface

Event = tuple[str, str]  # an instance and the name of its transition


@dataclass(frozen=True, eq=False)
class PartTransition:
    """A transition of an instance out of its mode ``source``, an index.

    It has a ``surface``, or fires where a condition is ``rising``, or ``after`` has what it fires together with. One
    that ``stays`` does not enter its mode again. ``resets`` maps states of the whole to their values, and ``keys`` to
    where they are set; ``place`` is where a fault of it is reported.
    """

    one: Instance
    source: int
    target: int
    name: str
    surface: Surface | None
    rising: Rising | None
    stays: bool
    after: tuple[Event, ...]
    condition: Any | None
    condition_text: str | None
    resets: dict[str, Any]
    texts: dict[str, str]
    keys: dict[str, Key]
    priority: int
    place: Scalar | Key

    @property
    def listens(self) -> bool:
        """Whether it fires together with others alone."""
        return self.surface is None and self.rising is None

    @property
    def event(self) -> Event:
        """What others may fire together with."""
        return self.one.name, self.name


def transitions_of(board: Board, one: Instance) -> list[PartTransition]:
    """The transitions of an instance without faults, in the order of its modes."""
    found: list[PartTransition] = []
    for source, (mode, document) in enumerate(one.modes):
        names = Names(board, one, mode, one.index)
        for name, transition in zip(_labels(board, mode, document), document.transitions, strict=True):
            made = _transition(board, names, source, name, transition)
            if made is not None:
                found.append(made)
    return found


def _labels(board: Board, mode: str, document: PartModeDocument) -> list[str]:
    """The name of each transition of a mode; a name given twice is reported, once."""
    given: set[str] = set()
    for label in (transition.name for transition in document.transitions):
        if label is not None and label.value in given:
            board.report_once(label, "HS307", f"the mode '{mode}' has a transition '{shown(label.value)}' already",
                              "give it another name")  # fmt: skip
        given |= {label.value} if label is not None else set()
    counts: dict[str, int] = {}
    return [
        t.name.value if t.name else unnamed(f"{mode}->{t.target or mode}", counts, given) for t in document.transitions
    ]


def _transition(
    board: Board, names: Names, source: int, name: str, document: PartTransitionDocument
) -> PartTransition | None:
    one, resolver = names.instance, board.symbols.resolver
    assert one is not None
    if not _of_one_kind(board, one, name, document):
        return None
    target = _target(board, one, source, document)
    crossed, rising, after = None, None, ()
    if document.event is not None:
        if not board.is_broken(document.event, names):
            rising = event_of(board.symbols, document, names.scope)
            board.note(document.event, names, rising)
    elif document.when is not None and not board.is_broken(document.when, names):
        crossed = surface(resolver, document.when, names.scope, "when")
        board.note(document.when, names, crossed)
    elif document.on is not None:
        after = _events(board, names, document.on)
    condition = None
    if document.condition is not None and not board.is_broken(document.condition, names):
        condition = resolver.condition(document.condition, names.scope)
        board.note(document.condition, names, condition)
    resets, keys, texts, whole = _resets(board, names, document)
    if target is None or not whole or (crossed is None and rising is None and not document.on) or after is None:
        return None
    if document.condition is not None and condition is None:
        return None
    _check_entered(board, one, source, target, document, resets)
    text = None if document.condition is None else document.condition.value
    rising = None if rising is None else replace(rising, given=tuple(resets))
    stays = rising is not None and document.target is None
    priority = document.priority if isinstance(document.priority, int) else 0
    return PartTransition(one, source, target, name, crossed, rising, stays, after, condition, text, resets, texts,
                          keys, priority, document.to or document.on or one.key)  # fmt: skip


def _of_one_kind(board: Board, one: Instance, name: str, document: PartTransitionDocument) -> bool:
    """Whether a transition has one of `when`, `event` and `on`, and only keys of its kind; else that is reported."""
    given = {key: getattr(document, key) for key in ("when", "event", "on")}
    known = [key for key, scalar in given.items() if scalar is not None and scalar.value != ABSENT]
    if len(known) != 1:
        found = " and ".join(f"`{key}`" for key in known) or "none"
        message = f"the transition '{name}' of '{one.automaton}': expected one of `when`, `event` and `on`, got {found}"
        board.report_once(given[known[0]] if known else document.to or document.name or one.key, "HS353", message, None)
        return False
    if known != ["event"]:
        for key in of_events(document):
            message = f"only a transition with `event` has `{key}`"
            board.report_once(given[known[0]], "HS323", message, "use `since` in `when`")
    return True


def _target(board: Board, one: Instance, source: int, document: PartTransitionDocument) -> int | None:
    label, names = document.to, one.part.modes
    if label is None or label.value == ABSENT:
        return source if label is None or document.event is not None else None
    if label.value in names:
        return names.index(label.value)
    message = f"the automaton '{one.automaton}' has no mode '{shown(label.value)}'"
    board.report_once(label, "HS303", message, did_you_mean(label.value, names))
    return None


def _events(board: Board, names: Names, label: Scalar, beyond: bool = False) -> tuple[Event, ...] | None:
    """The events that `on` names, or `at_ends` where that names one ``beyond`` the ends; none further out."""
    found = MEMBER.fullmatch(label.value)
    if found is None:
        board.report_once(label, "HS353", f"expected an instance and its transition, got '{shown(label.value)}'",
                          "write on: INSTANCE.TRANSITION")  # fmt: skip
        return None
    base, index, name = found.groups()
    one, several = names.instance, board.roster.group(base) if index is None else None
    if one is not None and base == one.name and len(board.roster.automata[one.automaton]) == 1:
        several = None  # no other instance could listen
    try:
        sender = None if several else board.instance(base, index, names)
    except KeyError:
        known = (*board.roster.instances, *board.roster.automata)
        message = f"there is no instance '{shown(base)}'"
        board.report_once(label, "HS350", message, did_you_mean(base, known))
        return None
    if isinstance(sender, Refusal):
        board.report_once(label, sender.code, sender.message, sender.hint)
        return None
    if isinstance(sender, int):
        given = board.at_end(base, sender, name)
        if beyond or isinstance(given, Refusal):
            return ()
        return _events(board, replace(names, index=sender), given, beyond=True)
    senders = [other for other in several or [] if other is not names.instance] or ([sender] if sender else [])
    known = [label for other in senders for mode, inner in other.modes for label in _labels(board, mode, inner)]
    if senders and name not in known:
        message = f"the automaton '{senders[0].automaton}' has no transition '{shown(name)}'"
        board.report_once(label, "HS353", message, did_you_mean(name, known))
        return None
    if sender is names.instance and sender is not None:
        message = f"'{label.value}' is a transition of '{sender.name}' itself"
        board.report_once(label, "HS353", message, "a transition fires together with one of another instance")
        return None
    return tuple((other.name, name) for other in senders)


def _resets(board: Board, names: Names, document: PartTransitionDocument):
    """The states that a transition sets, with their values, places and texts; and whether all of them are whole."""
    one = names.instance
    assert one is not None
    resets, keys, texts, whole = {}, {}, {}, True
    for key, scalar in document.reset.items():
        value = board.value(scalar, names)
        full = one.full(key) if key in one.states else _foreign(board, names, key)
        whole = whole and value is not None and full is not None
        if full and full in resets:
            message = f"'{one.name}' sets '{full}' twice in one transition"
            board.report_once(key, "HS353", message, "keep one of the two")
        if full and value is not None:
            resets[full], keys[full], texts[full] = value.expr, key, scalar.value
    return {k: v for k, v in resets.items() if k}, keys, texts, whole


def _foreign(board: Board, names: Names, key: Key) -> str | None:
    """The full name of a state of another instance that a reset sets; empty where that is beyond the ends."""
    one, found = names.instance, MEMBER.fullmatch(key)
    assert one is not None
    other: Any = None
    with suppress(KeyError):
        other = board.instance(found[1], found[2], names) if found else None
    if isinstance(other, int):
        return ""
    if found is not None and board.roster.is_broken(found[1]):
        return None  # reported with the instance
    if isinstance(other, Refusal):
        board.report_once(key, other.code, other.message, other.hint)
    elif other is None:
        message = f"the automaton '{one.automaton}' has no state '{shown(key)}' to reset"
        board.report_once(key, "HS306", message, did_you_mean(key, one.states))
    elif found is not None and all(other.full(found[3]) in states for states in other.part.states):
        return other.full(found[3])
    elif found is not None:
        message = f"'{found[3]}' is not a state of every mode of '{other.automaton}'"
        board.report_once(key, "HS306", message, did_you_mean(found[3], other.states))
    return None


def _check_entered(
    board: Board, one: Instance, source: int, target: int, document: PartTransitionDocument, resets: dict[str, Any]
) -> None:
    before, after = one.part.states[source], one.part.states[target]
    for state in after:
        if state not in before and state not in resets:
            own = state.removeprefix(f"{one.name}.")
            message = f"the transition to '{one.part.modes[target]}' gives its state '{own}' no value, and "
            message += f"'{one.part.modes[source]}' has no such state"
            board.report_once(document.to or one.key, "HS305", message, f"write reset: {{{own}: ...}}")
    for state in resets:
        if state.startswith(f"{one.name}.") and state in {s for states in one.part.states for s in states} - {*after}:
            own = state.removeprefix(f"{one.name}.")
            message = f"the mode '{one.part.modes[target]}' has no state '{own}' to reset"
            board.report_once(document.to or one.key, "HS306", message, None)
