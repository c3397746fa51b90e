"""Suggestions for keys: those of other tools, keys in the wrong place, and missing ones."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from hsdsl.base.names import closest
from hsdsl.language.schema.documents import NAMES_OF_FILES, keys_of
from hsdsl.language.source import Key, Mapping, Node, NodePath, Sequence, child, is_empty, keys

_OF_OTHERS = {
    "when": "guard on condition",
    "event": "trigger",
    "if": "condition guard only_if provided",
    "to": "target goto next into destination dest",
    "reset": "jump assign update action actions effect set jumps",
    "domain": "invariant invariants inv walls constraints",
    "flow": "ode odes dynamics equations equation derivatives derivative rhs vector_field field",
    "transitions": "edges jumps events switches",
    "modes": "locations location discrete_states",
    "let": "where definitions define algebraic",
    "parameters": "constants params consts",
    "inputs": "controls signals",
    "initial": "init start initial_state initial_conditions initial_values x0 y0 u0 z0 ic ics",
    "until": "horizon end time stop stop_time duration t_end tend tf final_time t_final end_time tmax t_max"
    " tspan t_span timespan time_span",
    "step": "dt h stepsize step_size time_step fixed_step",
    "relaxation": "epsilon eps",
    "tolerance": "tol tolerances rtol atol reltol abstol precision",
    "method": "integrator solver algorithm",
    "scale": "scales nominal nominals",
    "experiment": "simulation settings options config run",
    "file": " ".join(NAMES_OF_FILES),
    "column": "col field header column_name variable series",
    "of": "args arguments params parameters inputs variables vars",
    "is": "expr expression body formula value returns return",
    "title": "name model",
    "samples": "points n_points num_points n_samples num_samples",
    "about": "description comment doc",
    "value": "default val number",
}
_BY_NAME: dict[str, list[str]] = {}
for _key, _others in _OF_OTHERS.items():
    for _other in _others.split():
        _BY_NAME.setdefault(_other, []).append(_key)
_NOT_NEEDED = {
    "states": "the states are the keys of `flow`, and `initial` gives their values",
    "variables": "the states are the keys of `flow`, and `initial` gives their values",
    "from": "leave it out: a transition is in the mode that it leaves",
    "<<": "mappings are not merged in YAML 1.2",
    "terminal": "leave it out, and let `to` name a mode with final: true",
}
_OF_MODELS = {  # keys of the whole file in other tools
    "species": "a species is a state, a key of `flow`; `initial` gives its value",
    "compartments": "give the size of a compartment under `parameters`",
    "reactions": "write the rate of each reaction under `let` of a mode, and what it changes in `flow`",
    "doses": "a dose is an event that adds to a state: {event: since >= 8, reset: {gut: gut + dose}}",
    "events": "an event is a transition of a mode: {event: A < 1, reset: {A: 2}}",
    "rules": "write assignment rules under `let`, and rate rules in `flow`",
    "assignmentRules": "write them under `let`",
    "rateRules": "write them in `flow` of a mode",
    "algebraicRules": "write them under `solve`, where they are linear",
    "functionDefinitions": "write them under `functions`: {f: {of: [x], is: x**2}}",
    "initialAssignments": "write them under `initial`: they may be expressions",
    "equations": "write differential equations in `flow` of a mode, and linear ones under `solve`",
    "guards": "a guard is `when` of a transition",
    "resets": "a reset is `reset` of a transition",
}
_ADD = {
    "hsdsl": "begin the file with hsdsl: 1",
    "modes": "write modes: and under it each mode's name with its flow",
    "flow": "write flow: and under it each state with its derivative",
    "initial": "write initial: {mode: ..., x: ...}, a value for each state of that mode",
    "experiment": "write experiment: {until: 10}, the time at which a run ends",
    "until": "write until: and the time at which a run ends",
    "when": "write when: and the inequality at which the transition fires, such as x >= 1",
    "to": "write to: and the mode that is entered",
    "of": "write of: [x], the names of the function's arguments",
    "unknowns": "write unknowns: [a, b], the names of what is solved for",
    "equations": "write equations: and as many texts such as m*a + b == f",
    "is": "write is: and an expression of the function's arguments",
    "value": "write value: and the parameter's number or expression",
    "times": "write times: [0, 1, 2], or file: and the name of a CSV file",
    "values": "write values: and one value for each of the times",
    "file": "write file: and the name of a CSV file",
    "automaton": "write automaton: and a key of `automata`",
    "time": "write time: and when that is",
    "every": "write every: and the time between two samples",
    **{size: f"write {size}: and a number or an expression" for size in ("radius", "width", "height")},
}
_MODE = ("modes", "*")
_MOST_PARTS = 6  # a transition has so many keys
_HOMES: tuple[tuple[tuple[str, ...], str], ...] = (
    (_MODE, "in a mode"),
    ((*_MODE, "transitions", "*"), "in a transition of a mode"),
    (("experiment",), "under `experiment`"),
)


def key_meant(key: str, fields: Iterable[str], parent: Node | None) -> str | None:
    """The field that an unknown key was probably meant to be: by its name in other tools, or by its spelling."""
    fields, present = list(fields), keys(parent)
    named = [field for field in _BY_NAME.get(key, ()) if field in fields and field not in present]
    if named:
        return named[0]
    elsewhere = _not_needed(key, fields) if key not in fields else None
    elsewhere = elsewhere or _home(key) or _is_a_mode(child(parent, key))
    return None if elsewhere else closest(key, fields)


def named_elsewhere(key: str, fields: Collection[str]) -> bool:
    """Whether a key is the name that another tool has for one of some fields."""
    return any(field in fields for field in _BY_NAME.get(key, ()))


def _not_needed(key: str, fields: Iterable[str]) -> str | None:
    """What to write in the place of a key that no mapping has, or not the one of these fields."""
    return _NOT_NEEDED.get(key) or (_OF_MODELS.get(key) if "hsdsl" in fields else None)


def unknown_key_hint(key: str, meant: str | None, fields: Iterable[str], value: Node | None) -> str:
    """The hint for an unknown key."""
    if ":" in key:
        return "write a space after the colon"
    if meant is not None:
        return f"did you mean '{meant}'?"
    if instead := _not_needed(key, fields):
        return instead
    if _is_a_mode(value):
        return f"a mode belongs under `modes`: indent '{key}' like the others"
    where = dict(_HOMES).get(_home(key) or ("none",))
    return f"`{key}` belongs {where}" if where else "keys here: " + ", ".join(fields)


def _home(key: str) -> tuple[str, ...] | None:
    """The kind of mapping that has a key of this name; of the model's own keys none."""
    return next((pattern for pattern, _ in _HOMES if key in keys_of(*pattern)), None)


def path_meant(root: Node, key: str, value: Node | None) -> NodePath:
    """The path that a key in the wrong place belongs to, if there is one and it is free; else an empty one."""
    pattern = ("modes",) if _is_a_mode(value) else _home(key)
    if not isinstance(root, Mapping) or pattern not in (("modes",), ("experiment",)):
        return ()
    above = child(root, pattern[0])
    if above is not None and is_empty(above):
        return (*pattern, key)
    return (*pattern, key) if isinstance(above, Mapping) and key not in above.entries else ()


def _is_a_mode(value: Node | None) -> bool:
    """Whether a mapping looks like a mode."""
    return not {"flow", "transitions"}.isdisjoint(keys(value))


def missing_key_hint(root: Node, key: str, parent: Node | None) -> str:
    """The hint for a missing key."""
    if key == "when" and "if" in keys(parent):
        return "write when: and the inequality at which it fires; `if` only says which part of it counts"
    if key != "mode":
        return _ADD[key]
    modes = child(root, "modes")
    names = keys(root if modes is None else modes)
    return f"write mode: {names[0]}" if len(names) == 1 else "write mode: and the mode that a run starts in"


def part_of_transition(transitions: Node | None, index: int) -> int:
    """Which part, from 0, of a transition that dashes too many make several items of an item of ``transitions`` is.

    It is -1 where the item is whole, or where its missing keys are nowhere near.
    """
    items = transitions.items if isinstance(transitions, Sequence) else ()
    near = {n: set(keys(items[n])) for n in range(max(0, index - _MOST_PARTS), min(len(items), index + _MOST_PARTS))}
    present = near.get(index, set[Key]())
    ends = [index, index]
    for side, step in ((0, -1), (1, 1)):
        while near.get(ends[side] + step) and not near[ends[side] + step] & present:
            ends[side] += step
            present = present | near[ends[side]]
    first, last = ends
    needed = {"when", "to"}
    parts = first < last and needed <= present and all(needed - near[n] for n in range(first + 1, last + 1))
    return index - first if parts and near[index] else -1
