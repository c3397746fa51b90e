"""What only the whole document shows, changed in the nodes and reported once: the rest is read as it was meant.

Keys indented too little are moved into their section, idioms of other tools are translated, and a state that is
misspelt in a flow gets the name that the mode's other expressions have for it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator

from hsdsl.base.errors import Findings
from hsdsl.base.names import closest, is_identifier, shown
from hsdsl.language.diagnosis import OTHER_NAMES
from hsdsl.language.expression.scope import RESERVED
from hsdsl.language.schema.documents import keys_of
from hsdsl.language.source.nodes import (
    Key,
    Mapping,
    Node,
    Scalar,
    Sequence,
    SourceRange,
    absent,
    child,
    children,
    is_empty,
    keys,
)

_OF_MAPPINGS = ("parameters", "inputs", "experiment")
_REQUIRED = frozenset(("modes", "initial", "experiment", "when", "to"))
_SECTIONS = ("parameters", "functions", "inputs", "let", "outputs", "units", "initial", "experiment", "flow", "reset")
_MODEL, _MODE = frozenset(keys_of()), frozenset(keys_of("modes", "*"))
_TRANSITION = frozenset(keys_of("modes", "*", "transitions", "*"))


def correct(root: Node, findings: Findings) -> None:
    """Change the nodes that have such faults, which go to ``findings``."""
    if isinstance(root, Mapping):
        _correct_indentation(root, findings)
        _time_span(root, findings)
        _start(root, findings)
        _functions(root, findings)
    initial, modes = (child(root, name) for name in ("initial", "modes"))
    for transition in _transitions(modes):
        if isinstance(transition, Mapping) and "direction" in transition.entries:
            _direction(transition, findings)
    if isinstance(initial, Mapping) and isinstance(modes, Mapping):
        start = child(initial, "mode")
        flow = child(child(modes, start.value), "flow") if isinstance(start, Scalar) else None
        _nested_values(initial, [str(key) for key in keys(flow)], findings)
    rename_states(root, findings)


def rename_states(root: Node, findings: Findings) -> bool:
    """Rename states that a flow gives the name of their derivative, or that occur in one flow alone, misspelt.

    False where there are none.
    """
    before = len(findings.diagnostics)
    initial, modes = (child(root, name) for name in ("initial", "modes"))
    if not isinstance(root, Mapping) or not isinstance(modes, Mapping):
        return False
    if isinstance(initial, Mapping):
        known = set(map(str, keys(initial)))
        reset = {str(key) for transition in _transitions(modes) for key in keys(child(transition, "reset"))}
        for mode in children(modes):
            states = child(mode, "flow")
            if isinstance(states, Mapping):
                _dotted_names(states, known, reset, findings)
    _correct_spelling(root, modes, findings)
    return len(findings.diagnostics) > before


def _transitions(modes: Node | None) -> list[Node]:
    return [edge for mode in children(modes) for edge in children(child(mode, "transitions"))]


def _correct_indentation(root: Mapping, findings: Findings) -> None:
    _below_empty(root, _MODEL, findings)
    modes = child(root, "modes")
    if not isinstance(modes, Mapping):
        return
    _among_modes(modes, findings)
    if modes.entries:
        key, last = list(modes)[-1]
        _after(root, "modes", last, _MODE - _MODEL, f"in the mode '{shown(key)}'", findings)
    for _, mode in modes:
        if isinstance(mode, Mapping):
            _in_mode(mode, findings)


def _in_mode(mode: Mapping, findings: Findings) -> None:
    _below_empty(mode, _MODE, findings)
    transitions = child(mode, "transitions")
    items = transitions.items if isinstance(transitions, Sequence) else ()
    if items:
        _after(mode, "transitions", items[-1], _TRANSITION - _MODE, "in the transition above", findings)
    for item in items:
        if isinstance(item, Mapping):
            _below_empty(item, _TRANSITION, findings)


def _below_empty(parent: Mapping, fields: frozenset[str], findings: Findings) -> None:
    """Take unknown keys after an empty section for those of the section."""
    section, below = "", dict[str, list[Key]]()
    for key, value in parent:
        if key in fields:
            section = str(key) if key in _SECTIONS and is_empty(value) else ""
        elif section and (isinstance(value, Scalar) or section in _OF_MAPPINGS):
            lacking = _REQUIRED & fields - set(parent.entries)  # it may rather be a field by another name
            if fields.isdisjoint(OTHER_NAMES.get(key, ())) and closest(key, lacking) is None:
                below.setdefault(section, []).append(key)
    for section, strays in below.items():
        inner = Mapping({}, parent.entries[section][0].place)
        parent.entries[section] = (parent.entries[section][0], inner)
        message = f"`{shown(strays[0])}` is at the level of `{section}`, which is empty"
        _move(parent, strays, inner, message, f"under `{section}`", findings)


def _among_modes(modes: Mapping, findings: Findings) -> None:
    """Take ``transitions`` among the modes for that of the mode above."""
    above: Key | None = None
    strays: dict[str, list[Key]] = {}
    for key, value in modes:
        if above is not None and key in _MODE and not _may_be_mode(value):
            strays.setdefault(str(above), []).append(key)
        else:
            above = key
    for name, moved in strays.items():
        key, mode = modes.entries[name]
        if is_empty(mode):
            mode = Mapping({}, key.place)
            modes.entries[name] = (key, mode)
        if isinstance(mode, Mapping) and not any(key in mode.entries for key in moved):
            message = f"`{moved[0]}` is among the modes, as if it were one"
            _move(modes, moved, mode, message, f"in the mode '{shown(name)}'", findings)


def _after(parent: Mapping, section: str, last: Node, fields: frozenset[str], where: str, findings: Findings) -> None:
    """Take the keys right after a section that its last part can have for those of that part."""
    after = keys(parent)[list(parent.entries).index(section) + 1 :]
    strays = [key for key in after if key in fields]
    if not strays or strays != after[: len(strays)] or not isinstance(last, Mapping):
        return
    if not any(key in last.entries for key in strays):
        _move(parent, strays, last, f"`{strays[0]}` is at the level of `{section}`", where, findings)


def _move(
    parent: Mapping, strays: Iterable[Key], target: Mapping, message: str, where: str, findings: Findings
) -> None:
    first, *more = strays
    hint = f"indent {'it' if not more else 'these lines'}, so that {'they are' if more else 'it is'} {where}"
    findings.add(first.place.diagnostic("HS201", message, hint))
    for key in (first, *more):
        target.entries[str(key)] = parent.entries.pop(str(key))


def _may_be_mode(value: Node) -> bool:
    """Whether a value could be that of a mode: empty, or with a key that modes have."""
    if isinstance(value, Mapping):
        return not value.entries or not _MODE.isdisjoint(value.entries)
    return is_empty(value)


_NESTED = ("state", "states", "values", "x0", "variables", "continuous")
_CALL = re.compile(r"\s*([^\W\d]\w*)\s*\(([^()]*)\)\s*")
_LONGEST = 100  # names that are looked at
_SPANS = ("until", "tspan", "t_span", "timespan", "time_span", "t_eval")
_STARTS = ("initial", "x0", "y0", "u0", "z0", "ic", "ics", "init", "start", "initial_state", "initial_conditions")
_DEFINING = ("parameters", "inputs", "let", "outputs")
_SURFACES = ("when", "guard", "event", "trigger", "on", "condition")  # `when` and its names in other tools
_COMPARED = re.compile("[<>=]")
_DIRECTIONS = {
    "<=": ("-1", "-1.0", "falling", "fall", "down", "negative", "decreasing"),
    ">=": ("1", "+1", "1.0", "rising", "rise", "up", "positive", "increasing"),
}
_NAMED_AFTER = re.compile(r"d_?(\w+?)(?:_?dt)?|(\w+?)_?dot|(\w+)_(?:prime|p|d)")


def _nested_values(initial: Mapping, states: list[str], findings: Findings) -> None:
    """Take ``initial: {mode: A, state: {x: 1}}`` for ``initial: {mode: A, x: 1}``."""
    for name in _NESTED:
        value = child(initial, name)
        if name in states or not isinstance(value, (Mapping, Sequence)):
            continue
        key, _ = initial.entries.pop(name)
        entries, text = _paired(states, value)
        hint = f"write the values at the level of `mode`: {shown(text)}"
        findings.add(key.place.diagnostic("HS201", f"unknown key '{name}' in `initial`", hint))
        for state, part in entries:
            initial.entries.setdefault(str(state), (state, part))


def _paired(states: list[str], value: Mapping | Sequence) -> tuple[list[tuple[Key, Node]], str]:
    """States with values that are given for them, by name or in order, and how that is written."""
    entries: list[tuple[Key, Node]] = []
    if isinstance(value, Mapping):
        entries = list(value)
    elif len(states) == len(value.items):
        entries = [(Key.at(state, each.place), each) for state, each in zip(states, value.items, strict=True)]
    texts = (f"{name}: {each.value if isinstance(each, Scalar) else '...'}" for name, each in entries)
    return entries, ", ".join(texts) or "x: 0"


def _dotted_names(flow: Mapping, known: set[str], reset: set[str], findings: Findings) -> None:
    """Take the keys ``xdot``, ``dx`` and ``dxdt`` of a flow for ``x``, where the start is given as ``x``."""
    for key in keys(flow):
        match = _NAMED_AFTER.fullmatch(key) if len(key) < _LONGEST else None
        name = next(filter(None, match.groups()), "") if match else ""
        if not name or key in known or key in reset:
            continue
        if name in known and name not in flow.entries and name != "mode" and is_identifier(name):
            message = f"the flow says '{shown(key)}', and `initial` says '{shown(name)}'"
            hint = f"write {shown(name)}: its value is the derivative of the state"
            findings.add(key.place.diagnostic("HS205", message, hint))
            flow.rename(str(key), name)


def _time_span(root: Mapping, findings: Findings) -> None:
    """Take ``tspan: [0, 3]`` for ``experiment: {until: 3}``."""
    for parent in (root, child(root, "experiment")):
        for key in [key for key in keys(parent) if key in _SPANS]:
            match child(parent, key):
                case Sequence(items=(Scalar(), Scalar() as end)) if isinstance(parent, Mapping):
                    place, text = parent.entries.pop(key)[0].place, f"until: {shown(end.value)}"
                case _:
                    continue
            inside = parent is not root
            message = f"unknown key '{key}' in {'`experiment`' if inside else 'a model'}"
            if key == "until":
                message = "a run starts at 0, so `until` is one time, not a list"
            hint = f"write {text if inside else f'experiment: {{{text}}}'}; every run starts at t = 0"
            findings.add(place.diagnostic("HS203" if key == "until" else "HS201", message, hint))
            experiment = _section(root, "experiment", place)
            if experiment is not None:
                experiment.entries.setdefault("until", (Key.at("until", place), end))


def _start(root: Mapping, findings: Findings) -> None:
    """Take ``x0: [2, 0]`` for ``initial: {mode: A, y: 2, v: 0}``."""
    modes = child(root, "modes")
    for key in keys(root):
        value, taken = child(root, key), "initial" in root.entries and key != "initial"
        if key not in _STARTS or taken or not isinstance(value, (Mapping, Sequence)) or "mode" in keys(value):
            continue
        if key == "initial" and isinstance(value, Mapping):
            continue  # it lacks a mode, which has a finding of its own
        first = keys(modes)[0] if len(keys(modes)) == 1 else None
        states = [str(name) for name in keys(child(child(modes, first or ""), "flow"))]
        entries, text = _paired(states, value)
        mode = absent(key.place) if first is None else Scalar(str(first), True, key.place)
        hint = f"write initial: {{mode: {shown(first or '...')}, {shown(text)}}}"
        code, message = "HS201", f"unknown key '{key}' in a model"
        if key == "initial":
            code, message = "HS203", "expected a mapping (name: value), got a list"
        findings.add(key.place.diagnostic(code, message, hint))
        given: dict[str, tuple[Key, Node]] = {"mode": (Key.at("mode", key.place), mode)}
        given |= {str(name): (name, v) for name, v in entries}
        root.rename(str(key), "initial", Mapping(given, value.place))


def _section(root: Mapping, name: str, place: SourceRange) -> Mapping | None:
    """A section of the model, made where there is none; None where it is something else."""
    key, section = root.entries.setdefault(name, (Key.at(name, place), Mapping({}, place)))
    if is_empty(section):
        section = Mapping({}, section.place)
        root.entries[name] = (key, section)
    return section if isinstance(section, Mapping) else None


def _functions(root: Mapping, findings: Findings) -> None:
    """Take ``rpm(w): EXPRESSION``, wherever names are defined, for a function of the model."""
    sections = [root, *(child(root, name) for name in _DEFINING)]
    sections += [child(mode, name) for mode in children(child(root, "modes")) for name in ("let", "outputs")]
    moved = set[str]()
    for section in sections:
        called = [(key, child(section, key)) for key in keys(section) if _CALL.fullmatch(key[:_LONGEST])]
        for key, value in called:
            match = _CALL.fullmatch(key)
            if not isinstance(section, Mapping) or not isinstance(value, Scalar) or not match:
                continue
            name = match[1]
            if match[2].strip() == "t" and section is not root:
                hint = f"write {name}: its value may use the time t"
                findings.add(key.place.diagnostic("HS205", f"'{shown(key)}' cannot be a name", hint))
                section.rename(str(key), name)
                continue
            functions = _section(root, "functions", key.place)
            if functions is not None and name not in functions.entries:
                del section.entries[key]
                functions.entries[str(key)] = (key, value)
                moved.add(str(key))
    functions = child(root, "functions")
    if isinstance(functions, Mapping):
        _called(functions, moved, findings)


def _called(functions: Mapping, moved: set[str], findings: Findings) -> None:
    """Take the function ``clip(z, lo): EXPRESSION`` for ``clip: {of: [z, lo], is: EXPRESSION}``."""
    for key, value in list(functions):
        match = _CALL.fullmatch(key) if len(key) < _LONGEST else None
        name, *arguments = (part.strip() for part in (match[1], *match[2].split(","))) if match else ("",)
        body = value if isinstance(value, Scalar) else child(value, "is")
        if not name or not all(map(is_identifier, arguments)):
            continue
        text = shown(body.value) if isinstance(body, Scalar) else "..."
        entry = f"{name}: {{of: [{', '.join(arguments)}], is: {text}}}"
        hint = f"write functions: {{{entry}}}" if key in moved else f"write {entry}"
        findings.add(key.place.diagnostic("HS205", f"'{shown(key)}' cannot be a name", hint))
        names = Sequence(tuple(Scalar(each, True, key.place) for each in arguments), key.place)
        entries: dict[str, tuple[Key, Node]] = {"of": (Key.at("of", key.place), names)}
        if body is not None:
            entries["is"] = (Key.at("is", key.place), body)
        functions.rename(str(key), name, Mapping(entries, value.place))


def _direction(transition: Mapping, findings: Findings) -> None:
    """Take ``direction: -1`` for the sign of the inequality; a bare expression becomes that inequality."""
    key, value = transition.entries.pop("direction")
    word = value.value.strip().lower() if isinstance(value, Scalar) else ""
    sign = next((sign for sign, words in _DIRECTIONS.items() if word in words), None)
    name = next((k for k in _SURFACES if isinstance(child(transition, k), Scalar)), "")
    surface = child(transition, name)
    hint = "leave it out: `x <= 0` fires where x falls through 0, `x >= 0` where it rises"
    if isinstance(surface, Scalar) and not _COMPARED.search(surface.value):
        text, operator = surface.value.strip(), sign or "<="
        both = "and a second transition with >= for where it rises"
        more = f"which fires where {shown(text, 30)} {'falls' if sign == '<=' else 'rises'}" if sign else both
        hint = f"leave it out, and write when: {shown(text, 30)} {operator} 0, {more}"
        inequality = Scalar(f"{text} {operator} 0", surface.plain, surface.place)
        transition.entries[name] = (transition.entries[name][0], inequality)
    findings.add(key.place.diagnostic("HS201", "unknown key 'direction' in a transition", hint))


_WORD = re.compile(r"[^\W\d]\w*")
_FOR_PEOPLE = ("title", "source", "units", "assumptions")
_OF_STATES = (
    *("modes", "initial", "experiment", "outputs", "scene", "units", "reference"),
    *("flow", "transitions", "reset"),
)


def _correct_spelling(root: Mapping, modes: Mapping, findings: Findings) -> None:
    counts = Counter(word for key, part in root if key not in _FOR_PEOPLE for word in _words(part))
    known = {*RESERVED, *_defined(root)}
    given = _given(root, modes)
    for name, mode in modes:
        flow = child(mode, "flow")
        alone = [key for key in keys(flow) if counts[str(key)] == 1 and is_identifier(key)]
        if not alone or not isinstance(flow, Mapping):
            continue
        words = (word for part in _expressions(mode) for word in _words(part))
        used = dict.fromkeys((*given.get(str(name), ()), *words))
        here = known.union(map(str, keys(flow)), _defined(mode))
        unknown = [word for word in used if counts[word] > 1 and word not in here]
        for key in alone:
            meant = closest(key, unknown)
            if meant is not None:
                unknown.remove(meant)
                message = f"the flow of '{shown(name)}' says '{shown(key)}', and the rest of the model '{shown(meant)}'"
                findings.add(key.place.diagnostic("HS111", message, f"did you mean '{shown(meant)}'?"))
                flow.rename(str(key), meant)


def _defined(node: Node) -> Iterator[str]:
    """The names that the sections of a model or a mode define, other than states."""
    for section, part in node if isinstance(node, Mapping) else ():
        if section not in _OF_STATES:
            yield from map(str, keys(part))


def _given(root: Mapping, modes: Mapping) -> dict[str, list[str]]:
    """The states of each mode that `initial` and resets give a value to."""
    initial = child(root, "initial")
    start = child(initial, "mode")
    states: dict[str, list[str]] = {}
    if isinstance(start, Scalar):
        states[start.value] = [str(key) for key in keys(initial) if key != "mode"]
    for mode in children(modes):
        for transition in children(child(mode, "transitions")):
            target = child(transition, "to")
            if isinstance(target, Scalar):
                states.setdefault(target.value, []).extend(map(str, keys(child(transition, "reset"))))
    return states


def _expressions(mode: Node) -> Iterator[Node]:
    """The expressions of a mode: names of transitions and targets are none of them."""
    for section in ("flow", "domain", "let", "outputs"):
        yield from children(child(mode, section))
    for transition in children(child(mode, "transitions")):
        parts = (child(transition, "when"), child(transition, "if"), *children(child(transition, "reset")))
        yield from (part for part in parts if part is not None)


def _words(node: Node) -> Iterator[str]:
    """The words of every key and value."""
    waiting = [node]
    while waiting:
        part = waiting.pop()
        if isinstance(part, Scalar):
            yield from _WORD.findall(part.value)
        yield from map(str, keys(part))
        waiting.extend(children(part))
