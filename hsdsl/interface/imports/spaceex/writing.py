"""The text of a model: what an import has found, as YAML for people."""

from __future__ import annotations

import json
import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from hsdsl import __version__
from hsdsl.base.names import counted, visible
from hsdsl.interface.imports.spaceex.document import renamed, within
from hsdsl.interface.imports.spaceex.modes import ALWAYS, FIRST, INWARD, LATER, ModeDraft, TransitionDraft
from hsdsl.interface.imports.spaceex.network import Key, Network
from hsdsl.interface.imports.spaceex.start import Start

_WIDTH = 116
NEVER = "0 >= 1"  # a wall that every point is beyond


def written(
    source: str,
    title: str,
    notes: Sequence[str],
    assumed: Sequence[str],
    drafts: Mapping[Key, ModeDraft],
    transitions: Mapping[Key, Sequence[TransitionDraft]],
    begin: Start,
    first: Key,
    until: str,
) -> str:
    """The model's text."""
    lines = ["hsdsl: 1", f"title: {_quoted(title)}", f"source: {_quoted(source)}"]
    assumed = [*assumed, *_assumed([t for leaving in transitions.values() for t in leaving])]
    lines += [*(["assumptions:", *(f"  - {_quoted(text)}" for text in assumed)] if assumed else []), ""]
    lines += _comment([f"Imported by hsdsl {__version__}: each transition is made where its guard is reached.", *notes])
    lines += _section("parameters", _with_ranges(begin.constants, begin, "value: {0}, "))
    lines += ["", "modes:"]
    for key, draft in drafts.items():
        lines += _indented(_mode(draft, transitions[key], drafts))
    states = _with_ranges({name: begin.variables[name] for name in drafts[first].states}, begin, "")
    lines += ["", "initial:", f"  mode: {_plain(drafts[first].place.name)}", *_indented(_entries(states))]
    lines += ["", "experiment:", f"  until: {_plain(until)}"]
    return "\n".join(lines) + "\n"


def _with_ranges(values: Mapping[str, str], begin: Start, form: str) -> dict[str, str]:
    """Values, or mappings where a range is kept."""
    ranges = {name: begin.ranges[name] for name in values if name in begin.ranges}
    written = {n: f"{{{form.format(values[n])}min: {low}, max: {high}}}" for n, (low, high) in ranges.items()}
    return {**values, **written}


def assumptions(network: Network, begin: Start, first: str | None) -> Iterator[str]:
    """Sentences on where a run starts, and SpaceEx elsewhere too; ``first`` is one of several locations."""
    if kept := [name for name in begin.ranges if name in network.constants]:
        yield f"in SpaceEx {', '.join(kept)} may have any value from `min` to `max`, here the centre"
    if begin.chosen:
        yield f"SpaceEx starts in a set: --at chose the value of {', '.join(begin.chosen)}"
    if network.held:
        yield f"{', '.join(network.held)} may change in any way in SpaceEx, and does not change here"
    if first is not None:
        yield f"SpaceEx may start in other locations than {first}, the first one that admits the initial point"


def _assumed(transitions: Sequence[TransitionDraft]) -> Iterator[str]:
    """Sentences on the choices that every run makes, where SpaceEx has others too."""
    inward, later = (sum(text in t.comments for t in transitions) for text in (INWARD, LATER))
    if inward:
        yield f"{counted(inward, 'transition')} may also be made in SpaceEx where the flow leads back inside, not here"
    if first := sum(FIRST in t.comments for t in transitions):
        yield f"of {counted(first, 'transition')} and others at the same time SpaceEx may make either, here the first"
    if later:
        yield f"{counted(later, 'transition')} may be made later in SpaceEx, here as soon as the guard holds"


def _mode(draft: ModeDraft, transitions: Sequence[TransitionDraft], drafts: Mapping[Key, ModeDraft]) -> list[str]:
    place, inner = draft.place, _substituted(draft, drafts)
    notes = [location.note for location in place.locations if location.note]
    lines = [*_comment(notes), f"{_plain(place.name)}:", *_indented(_comment(draft.comments))]
    lines += _indented(_section("let", {name: text for name, text in draft.lets.items() if name not in inner}))
    flow = {name: renamed(place.flow[name].right, inner) for name in draft.states}
    lines += _indented(_section("flow", flow)) if flow else ["  flow: {}"]
    covered = [t.facet for t in transitions if t.facet is not None and not t.condition]
    walls = [
        relation.renamed(inner).text
        for facet, relation in draft.facets.items()
        if facet not in covered and not draft.kept(facet)
    ]
    if not place.passing and not any(ALWAYS in t.event for t in transitions):
        walls.append(NEVER)
        lines.append("  # time does not pass here: a run ends where no transition can be made")
    if walls:
        lines += _indented(["domain:", *_indented([f"- {_plain(wall)}" for wall in walls])])
    if transitions:
        labels = Counter(t.arrow.label for t in transitions)
        lines.append("  transitions:")
        for t in transitions:
            lines += _indented(_transition(t, drafts, labels), 4)
    return lines


def _transition(t: TransitionDraft, drafts: Mapping[Key, ModeDraft], labels: Counter[str]) -> list[str]:
    arrow, inner = t.arrow, _substituted(drafts[t.arrow.source], drafts)
    source, target = drafts[arrow.source], drafts[arrow.target]
    entries = {"name": arrow.label} if arrow.label and labels[arrow.label] == 1 else {}
    when = t.when.renamed(inner).text if t.when else None
    entries |= {"when": when} if when else {"event": _joined(t.event, inner), "initially": "false"}
    entries |= {"if": _joined(t.condition, inner), "to": target.place.name}
    reset = {name: relation.right for name, relation in arrow.reset.items() if name in target.states}
    reset |= {name: name for name in target.states if name not in reset and name in source.lets}
    reset = {name: renamed(text, inner) for name, text in reset.items()}
    body = _entries({key: text for key, text in entries.items() if text}) + _section("reset", reset)
    return [*_comment([*arrow.notes, *t.comments]), f"- {body[0]}", *_indented(body[1:])]


def _joined(parts: Iterable[str], names: Mapping[str, str]) -> str:
    return " and ".join(dict.fromkeys(renamed(part, names) for part in parts))


def _substituted(draft: ModeDraft, drafts: Mapping[Key, ModeDraft]) -> dict[str, str]:
    """The texts that replace names which equations give here, and which are states of other modes."""
    states = {name for other in drafts.values() for name in other.states}
    inner: dict[str, str] = {}
    for name, text in draft.lets.items():
        if name in states:
            inner[name] = within(renamed(text, inner))
    return inner


def _section(key: str, entries: Mapping[str, str]) -> list[str]:
    return [f"{key}:", *_indented(_entries(entries))] if entries else []


def _entries(entries: Mapping[str, str]) -> list[str]:
    return [f"{_plain(name)}: {_plain(text)}" for name, text in entries.items()]


def _indented(lines: Sequence[str], by: int = 2) -> list[str]:
    return [f"{' ' * by}{line}" for line in lines]


def _comment(texts: Sequence[str]) -> list[str]:
    """Comments, cut into lines of a readable width."""
    return [f"# {line}" for text in texts for line in textwrap.wrap(visible(text), _WIDTH)]


def _plain(text: str) -> str:
    """An expression or a name as YAML, in which only one word means something else."""
    return _quoted(text) if text.lower() == "null" else text


def _quoted(text: str) -> str:
    return json.dumps(visible(text), ensure_ascii=False)
