# pyright: basic
"""The composition of parts: one mode over the states of all of them, and the numbers of their modes.

It is the product in the sense of Def. 7 without its enumeration. What differs between the modes of a part is chosen by
the number of its mode; a surface that its mode does not have is -1, inside everywhere. A transition of a part has a
surface of its own, or fires together with another one: every reset then reads the values before.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

from hsdsl.base.names import SINCE, did_you_mean, shown
from hsdsl.base.parts import numbered
from hsdsl.language.elaborate.modes import NOWHERE, edge_names, event_of, of_events, surface
from hsdsl.language.elaborate.parts.instances import Instance
from hsdsl.language.elaborate.parts.names import MEMBER, Board, Names
from hsdsl.language.expression.algebra import ONE, ZERO, either, is_mode, pick, select, total, truth_of, whole
from hsdsl.language.expression.scope import Refusal, symbol
from hsdsl.language.schema.documents import PartTransitionDocument
from hsdsl.language.source import ABSENT, Key, Scalar
from hsdsl.language.system import Altered, Edge, Mode, Surface, places_of, symbols_of
from hsdsl.language.system import Event as Rising

MODE, FINAL = "system", "final"


def composed(board: Board, outputs: tuple[Any | None, ...], scene: tuple[Any, ...]) -> tuple[Mode, ...]:
    """The mode of the whole, and a final one where a part has one; none where something is wrong."""
    instances = list(board.roster.instances.values())
    flow = [value for one in instances for value in _flow(board, one)]
    walls = [wall for one in instances for wall in _walls(board, one)]
    transitions = [t for one in instances for t in transitions_of(board, one)]
    if board.symbols.findings.diagnostics:
        return ()
    timers = [one.full(SINCE) for one in instances if one.name in board.timed]
    numbers = numbered([one.part for one in instances])
    states = (*(one.full(state) for one in instances for state in one.states), *timers, *numbers)
    broadcast = Broadcast(board, [t for t in transitions if t.listens])
    edges = [_edge(broadcast, states, t) for t in transitions if not t.listens]
    flow += [*[(ONE, "1")] * len(timers), *[(ZERO, "0")] * len(numbers)]
    exprs, texts = zip(*flow, strict=True) if flow else ((), ())
    whole = Mode(MODE, states, exprs, texts, tuple(walls), tuple(edges), outputs, scene=scene)
    if not any(final for one in instances for final in one.part.final):
        return (whole,)
    return whole, Mode(FINAL, (), (), (), (), (), (None,) * len(outputs), True, scene=(None,) * len(scene))


def _flow(board: Board, one: Instance) -> Iterator[tuple[Any, str]]:
    """The flow of each state of an instance, zero in modes that lack it, and how it is written.

    Of final modes in which nothing flows it is that of another mode.
    """
    values: dict[str, list[Any]] = {state: [] for state in one.states}
    texts: dict[str, list[str]] = {state: [] for state in one.states}
    ended = {mode for mode, document in one.modes if document.final and document.flow is None}
    for mode, document in one.modes:
        names = Names(board, one, mode, one.index)
        given = {str(key): scalar for key, scalar in (document.flow or {}).items()}
        if document.flow is None and not document.final:
            key = next(key for key in one.kind.modes if key == mode)
            hint = "write `flow: {}` for a mode without states, or `final: true`"
            board.report_once(key, "HS304", f"the mode '{mode}' has no `flow`", hint)
        for state in one.states:
            value = board.value(given[state], names) if state in given else None
            values[state] += [] if mode in ended else [ZERO if value is None else value.expr]
            texts[state] += [given[state].value] if state in given else []
    for state in one.states:
        rest = iter(values[state])
        every = [values[state][0] if name in ended else next(rest) for name, _ in one.modes]
        yield pick(symbol(one.name), every, board.constants), " or ".join(dict.fromkeys(texts[state]))


def _surface(board: Board, one: Instance, mode: int, found: Surface) -> Surface:
    """A surface of one mode of an instance; in the others it is -1."""

    def in_mode(value: Any, elsewhere: Any) -> Any:
        values = [value if k == mode else elsewhere for k in range(len(one.modes))]
        return pick(symbol(one.name), values, board.constants)

    return Surface(in_mode(found.left, ZERO), in_mode(found.right, ZERO), in_mode(found.residual, -ONE), found.text)


def _walls(board: Board, one: Instance) -> Iterator[Surface]:
    for k, (mode, document) in enumerate(one.modes):
        names = Names(board, one, mode, one.index)
        for scalar in document.domain:
            if board.is_broken(scalar, names):
                continue
            found = surface(board.symbols, scalar, names.scope, "domain")
            board.note(scalar, names, found)
            if found is not None:
                yield _surface(board, one, k, found)


def _edge(broadcast: Broadcast, states: tuple[str, ...], made: PartTransition) -> Edge:
    """The edge of a transition of a system with these states."""
    one, places = made.one, places_of(states)
    return Edge(
        name=one.full(made.name),
        source=MODE,
        target=FINAL if one.part.final[made.target] else MODE,
        surface=_surface(broadcast.board, one, made.source, made.surface) if made.surface else NOWHERE,
        condition=made.condition,
        target_states=states,
        reset=Altered(symbols_of(states), {places[name]: v for name, v in broadcast.changes(made).items()}),
        reset_texts=Altered(states, {places[name]: text for name, text in made.texts.items()}),
        priority=made.priority,
        condition_text=made.condition_text,
        event=made.rising,
        stays=made.stays,
        part=(one.name, made.source + 1) if one.part.is_numbered else None,
    )


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
        labels = edge_names(mode, document.transitions, board.report_once)
        for name, transition in zip(labels, document.transitions, strict=True):
            made = _transition(board, names, source, name, transition)
            if made is not None:
                found.append(made)
    return found


def _transition(
    board: Board, names: Names, source: int, name: str, document: PartTransitionDocument
) -> PartTransition | None:
    one, symbols = names.instance, board.symbols
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
        crossed = surface(symbols, document.when, names.scope, "when")
        board.note(document.when, names, crossed)
    elif document.on is not None:
        after = _events(board, names, document.on)
    condition = None
    if document.condition is not None and not board.is_broken(document.condition, names):
        condition = symbols.condition(document.condition, names.scope)
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
    modes = [(mode, inner.transitions) for other in senders for mode, inner in other.modes]
    known = [label for mode, made in modes for label in edge_names(mode, made, board.report_once)]
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


@dataclass
class Broadcast:
    """The transitions that listen to others, and what follows from one that fires.

    An instance makes one transition at an instant: the first in its file order whose `if` holds. What it makes can be
    listened to in its turn.
    """

    board: Board
    listeners: Sequence[PartTransition]
    _by_event: dict[Event, list[PartTransition]] = field(init=False)
    _places: dict[PartTransition, int] = field(init=False)

    def __post_init__(self) -> None:
        self._by_event = defaultdict(list)
        self._places = {listener: k for k, listener in enumerate(self.listeners)}
        for listener in self.listeners:
            if listener.one.part.final[listener.target]:
                message = f"'{listener.name}' fires together with another transition, and leads to a final mode"
                self.board.report_once(listener.place, "HS353", message, "give it a `when`")
            for event in listener.after:
                self._by_event[event].append(listener)

    def followers(self, first: PartTransition) -> Iterator[tuple[Any, PartTransition]]:
        """The transitions that may fire together with one, each with the truth that it does."""
        fired: dict[str, Any] = {first.one.name: ONE}
        settled: set[PartTransition] = set()
        news: dict[Event, Any] = {first.event: ONE}
        while news:
            later: dict[Event, list[Any]] = defaultdict(list)
            hearing = dict.fromkeys(x for event in news for x in self._by_event[event] if x.one is not first.one)
            for listener in sorted(hearing, key=lambda x: (-x.priority, self._places[x])):
                if listener in settled:
                    continue
                heard = either([truth for event, truth in news.items() if event in listener.after])
                if heard == 1:
                    settled.add(listener)
                one = listener.one
                here = is_mode(symbol(one.name), listener.source + 1) if one.part.is_numbered else ONE
                truth = heard * here * (ONE if listener.condition is None else truth_of(listener.condition))
                before = fired.get(listener.one.name)
                truth = truth if before is None else truth * (1 - before)
                if truth != 0:
                    fired[listener.one.name] = truth if before is None else before + truth
                    later[listener.event].append(truth)
                    yield truth, listener
            news = {event: sum(truths[1:], truths[0]) for event, truths in later.items()}

    def changes(self, first: PartTransition) -> dict[str, Any]:
        """The states that change where a transition fires, with their values, expressions of the values before."""
        values = dict(first.resets)
        setters = dict.fromkeys(first.resets, first)
        if first.one.part.is_numbered and first.target != first.source:
            values[first.one.name] = whole(first.target + 1)
        values |= self._timer(first)
        for truth, follower in self.followers(first):
            given = follower.resets | self._timer(follower)
            if follower.one.part.is_numbered and follower.target != follower.source:
                given[follower.one.name] = whole(follower.target + 1)
            for state, value in given.items():
                setter = setters.setdefault(state, follower)
                if setter.one is not follower.one:
                    names = " and ".join(f"'{made.one.name}.{made.name}'" for made in (setter, follower))
                    message = f"{names} fire together and both set '{state}'"
                    self.board.report_once(follower.keys[state], "HS353", message, "let one of them set it")
                safe = total(value, lambda a, b, truth=truth: select(truth, a, b), frozenset())
                values[state] = select(truth, safe, values.get(state, symbol(state)))
        return values

    def _timer(self, made: PartTransition) -> dict[str, Any]:
        """The timer of an instance, which each of its transitions that does not stay sets to 0."""
        return {made.one.full(SINCE): ZERO} if made.one.name in self.board.timed and not made.stays else {}
