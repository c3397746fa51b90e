"""Which key was meant: the names that other tools give, keys that stand in the wrong place, and what to add."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from hsdsl.names import closest
from hsdsl.schema.documents import SHAPES
from hsdsl.source import Mapping, Node, Scalar, Sequence

Location = tuple[int | str, ...]

_OF_OTHERS = {
    "when": "guard trigger event on condition",
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
    "initial": "init start initial_state initial_conditions initial_values x0",
    "until": "horizon end time stop stop_time duration t_end tend tf final_time t_final end_time tmax t_max",
    "step": "dt h stepsize step_size time_step fixed_step",
    "relaxation": "epsilon eps",
    "tolerance": "tol tolerances rtol atol reltol abstol precision",
    "method": "integrator solver algorithm",
    "experiment": "simulation settings options config run",
    "title": "name",
    "about": "description comment doc",
    "value": "default val number",
}
_BY_NAME: dict[str, list[str]] = {}
for _key, _names in _OF_OTHERS.items():
    for _name in _names.split():
        _BY_NAME.setdefault(_name, []).append(_key)
_NOT_NEEDED = {
    "states": "the states are the keys of `flow`, and `initial` gives their values",
    "variables": "the states are the keys of `flow`, and `initial` gives their values",
    "from": "leave it out: a transition stands in the mode that it leaves",
    "<<": "mappings are not merged in YAML 1.2",
    "terminal": "leave it out, and let `to` name a mode with final: true",
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
    "value": "write value: and the parameter's number or expression",
    "times": "write times: [0, 1, 2], or file: and the name of a CSV file",
    "values": "write values: and one value for each of the times",
    "file": "write file: and the name of a CSV file",
    "time": "write time: and when that is",
}
_MODE = ("modes", "*")
_MOST_PARTS = 6  # a transition has so many keys
_HOMES: tuple[tuple[tuple[str, ...], str], ...] = (
    ((), "at the beginning of a line, beside `modes`"),
    (_MODE, "in a mode"),
    ((*_MODE, "transitions", "*"), "in a transition of a mode"),
    (("experiment",), "under `experiment`"),
)


def key_meant(key: str, fields: Iterable[str], parent: Node | None) -> str | None:
    """The field that an unknown key was probably meant to be: by its name in other tools, or by how it looks."""
    fields, present = list(fields), parent.entries if isinstance(parent, Mapping) else {}
    named = [field for field in _BY_NAME.get(key, ()) if field in fields and field not in present]
    if named:
        return named[0]
    elsewhere = key in _NOT_NEEDED or home(key, ()) or is_a_mode(present[key][1] if key in present else None)
    return None if elsewhere else closest(key, fields)


def named_elsewhere(key: str, fields: Collection[str]) -> bool:
    """Whether a key is the name that another tool has for one of some fields."""
    return any(field in fields for field in _BY_NAME.get(key, ()))


def advice(key: str, meant: str | None, fields: Iterable[str], value: Node | None) -> str:
    """The hint for an unknown key."""
    if ":" in key:
        return "write a space after the colon"
    if meant is not None:
        return f"did you mean '{meant}'?"
    if key in _NOT_NEEDED:
        return _NOT_NEEDED[key]
    if is_a_mode(value):
        return f"a mode stands under `modes`: indent '{key}' like the others"
    where = dict(_HOMES).get(home(key, ()) or ("none",))
    return f"`{key}` stands {where}" if where else "keys here: " + ", ".join(fields)


def home(key: str, here: tuple[str, ...]) -> tuple[str, ...] | None:
    """The kind of place that has a key of this name, where it is not the one here."""
    for pattern, _ in _HOMES:
        fields = SHAPES[pattern].model_fields
        if pattern != here and key in {field.alias or name for name, field in fields.items()}:
            return pattern
    return None


def moves_to(root: Node, key: str, value: Node | None) -> Location | None:
    """Where a key belongs that stands in the wrong place, if there is one such place and it is free."""
    if not isinstance(root, Mapping):
        return None
    place: Location | None = ("modes", key) if is_a_mode(value) else home(key, ())
    if place not in ((), ("experiment",), ("modes", key)):
        return None
    place = place if place == ("modes", key) else (*place, key)
    above = root if len(place) == 1 else root.entries.get(str(place[0]), (None, None))[1]
    if isinstance(above, Scalar) and above.kind == "null":
        return place
    return place if isinstance(above, Mapping) and key not in above.entries else None


def is_a_mode(value: Node | None) -> bool:
    """Whether a mapping looks like a mode."""
    return isinstance(value, Mapping) and bool({"flow", "transitions"} & set(value.entries))


def to_add(root: Node, key: str, parent: Node | None) -> str:
    """What to write where a key is missing."""
    if key == "when" and isinstance(parent, Mapping) and "if" in parent.entries:
        return "write when: and the inequality at which it fires; `if` only says which part of it counts"
    if key != "mode":
        return _ADD[key]
    modes = root.entries["modes"][1] if isinstance(root, Mapping) and "modes" in root.entries else root
    names = [str(name) for name, _ in modes] if isinstance(modes, Mapping) else []
    return f"write mode: {names[0]}" if len(names) == 1 else "write mode: and the mode that a run starts in"


def torn(transitions: Node | None, index: int) -> int:
    """Which part of one transition an item of ``transitions`` is that dashes too many make several items of.

    From 0; -1 where the item is whole, or what it lacks is nowhere near.
    """
    items = transitions.items if isinstance(transitions, Sequence) else ()
    near = {n: _keys(items[n]) for n in range(max(0, index - _MOST_PARTS), min(len(items), index + _MOST_PARTS))}
    first, seen = index, near.get(index, set[str]())
    while first - 1 in near and near[first - 1] and not near[first - 1] & seen:
        first, seen = first - 1, seen | near[first - 1]
    last = index
    while last + 1 in near and near[last + 1] and not near[last + 1] & seen:
        last, seen = last + 1, seen | near[last + 1]
    needed = {"when", "to"}
    parts = first < last and needed <= seen and all(needed - near[n] for n in range(first + 1, last + 1))
    return index - first if parts and near[index] else -1


def _keys(item: Node) -> set[str]:
    return set(item.entries) if isinstance(item, Mapping) else set()
