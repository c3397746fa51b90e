"""Models of SpaceEx as models of this language: networks flattened, transitions made where invariants end.

An initial box is kept, or a point of it is chosen. What cannot be kept is refused with its place: nondeterminism, free
inputs, other sets of initial states.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hsdsl.base.errors import Findings
from hsdsl.base.names import did_you_mean, shown
from hsdsl.interface.imports import end_of_run
from hsdsl.interface.imports.spaceex.document import Component, Configuration, components, configuration
from hsdsl.interface.imports.spaceex.modes import Judge, TransitionDraft, lone_draft, mode_drafts
from hsdsl.interface.imports.spaceex.network import Key, Network, automaton, flattened
from hsdsl.interface.imports.spaceex.start import (
    Start,
    admits,
    candidates,
    choice,
    no_location,
    refuse_outside,
    start,
    with_inputs,
)
from hsdsl.interface.imports.spaceex.writing import assumptions, written
from hsdsl.language.files import read_bytes

__all__ = ["imported"]


def imported(
    path: Path, cfg: Path | None = None, until: str | None = None, urgent: bool = False, at: Sequence[str] = ()
) -> str:
    """The text of a model for a SpaceEx model.

    Its configuration ``cfg``, left out, is the file of the same name that ends in ``.cfg``, where there is one; the end
    of the run is the configuration's ``time-horizon``. With ``urgent`` a transition whose guard holds off the end of
    the invariant is made as soon as it does, not refused. ``at`` is the point of an initial set: ``centre``, ``lower``
    or ``upper``, and values as ``NAME=VALUE``. Without a word for it, an initial box is kept.

    Raises ModelError: a file that is none of SpaceEx, or what a model cannot keep.
    Raises UsageError: a file that cannot be read, no end of the run, or a point that is none.
    """
    corner, values = choice(at)
    cfg = cfg or (path.with_suffix(".cfg") if path.with_suffix(".cfg").is_file() else None)
    known = components(str(path), read_bytes(path))
    configured = configuration(str(cfg), read_bytes(cfg)) if cfg else Configuration()
    system = _system(known, configured)
    network = with_inputs(flattened(known, system), configured, system.name, corner, values)
    begin = start(network, configured, system.name, corner)
    constants = {s: v for s, v in begin.numbers.items() if s.name in network.constants}
    first, others = _first(network, configured, system, begin, constants)
    places, arrows = automaton(network, first)
    drafts = mode_drafts(network, places, arrows, constants)
    refuse_outside(drafts[first], begin, configured, system.element)
    findings = Findings(str(path))
    judge = Judge(findings, urgent)
    transitions: dict[Key, list[TransitionDraft]] = {key: [] for key in drafts}
    for arrow in arrows:
        transitions[arrow.source] += judge.transitions(arrow, drafts[arrow.source], drafts[arrow.target])
    for key, leaving in transitions.items():
        judge.choices(leaving, drafts[key])
    findings.raise_if_any()
    horizon = configured.horizon and configured.horizon.text.strip()
    given = until or (None if horizon and horizon.startswith("-") else horizon)  # a negative one: without end
    end = end_of_run(given, "give --until, or time-horizon in the configuration")
    names = ", ".join(filter(None, (path.name, f"component {system.name}", cfg and f"with {cfg.name}")))
    notes = [
        *filter(None, [system.note]),
        *(f"{key} = {text}" for key, text in configured.others.items() if key == "forbidden"),
    ]
    assumed = list(assumptions(network, begin, places[first].name if others else None))
    return written(f"SpaceEx model {names}", system.name, notes, assumed, drafts, transitions, begin, first, end)


def _first(
    network: Network, configured: Configuration, system: Component, begin: Start, constants: Mapping[Any, Any]
) -> tuple[Key, bool]:
    """The first location that admits the initial point, and whether others do.

    Raises ModelError: none does, or its flow cannot be kept.
    """
    keys = list(candidates(network, configured, system.name))
    if len(keys) == 1:
        return keys[0], False
    fit = [key for key in keys if admits(lone_draft(network, key, constants), begin)]
    if not fit:
        raise no_location(configured, system.element)
    return fit[0], len(fit) > 1


def _system(known: Mapping[str, Component], configured: Configuration) -> Component:
    """The component that the configuration names, or the only one that is in no other."""
    if configured.system is not None:
        name = configured.system.text.strip()
        if name in known:
            return known[name]
        message = f"the model has no component '{shown(name)}'"
        raise configured.system.refusal("HS333", message, did_you_mean(name, known))
    inner = {bind.component for component in known.values() for bind in component.binds}
    outer = [component for name, component in known.items() if name not in inner]
    if len(outer) == 1:
        return outer[0]
    element = next(iter(known.values())).element
    hint = "name it in the configuration: system = " + (outer[0].name if outer else element.attributes["id"])
    raise element.refusal("HS333", "which component is the system is not given", hint)
