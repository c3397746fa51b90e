# pyright: basic, reportOperatorIssue=false
"""The text of a model with the modes of its completions: the file as it is, with further modes and transitions.

These are inserted after the last one of a mapping or list, in its style.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import sympy as sp

from hsdsl.base.defaults import DEFAULTS, least_relaxation
from hsdsl.base.errors import UsageError
from hsdsl.language.expression.plain import text_of
from hsdsl.language.expression.scope import symbol
from hsdsl.language.source import Mapping, Node, Text, child
from hsdsl.language.system import TIME, Edge, HybridSystem, Mode, Surface
from hsdsl.mathematics.completion.constrained import MOST_SETS, depends_on, neighbours
from hsdsl.mathematics.completion.contact import Contact, contact
from hsdsl.mathematics.completion.nearby import LONG, Slopes, cancelled, slopes_of_inputs
from hsdsl.mathematics.completion.sliding import Sliding, slidings, with_entries

WIDTH, INDENT = 120, 6  # of a line, and of the transitions in a mode that is written


def completed_text(text: Text, root: Node, system: HybridSystem) -> str | None:
    """The text of a model with a mode for each motion along a guard, and for each sliding.

    A transition to the same mode enters the motion along its guard where the flight that follows it would last less
    than the parameter ``contact_time``, at first the default relaxation. None where nothing can be completed.
    """
    surfaces, moving = slidings(system), slopes_of_inputs(system)
    further = [_leaving_on_surface(sliding) for sliding in surfaces]
    modes = {mode.name: mode for mode in (*with_entries(system, surfaces), *further)}
    writer = _Writer(text, root, system, modes.values())
    entries = [entry for sliding in surfaces for entry in sliding.entries]
    for mode in modes.values():
        into, motions = writer.motions(mode, moving)
        entries += into
        further += motions
    if not further:
        return None
    for given, slope in moving.items():
        if any(slope in e.free_symbols for mode in further for e in (*mode.flow, *(s.residual for s in mode.surfaces))):
            raise UsageError(
                f"motion on a guard moves with the sampled input {given}, whose slope no expression has",
                "write the input as an expression of time, or run the model itself with --completion auto",
            )
    written = {mode.name for mode in system.modes}
    for entry in entries:
        if entry.source in written:
            writer.add_transition(entry)
    fixed = set(system.parameter_symbols)
    for mode in further:
        own = tuple(entry for entry in entries if entry.source == mode.name)
        edges = (edge for edge in (*mode.edges, *own) if edge.surface.residual.free_symbols - fixed)
        writer.add_mode(replace(mode, edges=tuple(edges)))  # what parameters alone decide does not fire, nor later
    return writer.insertions.result()


def _held_together(mode: Mode, contacts: Sequence[Contact]) -> list[frozenset[int]]:
    """The sets of guards of a mode that may hold together, by their edges; the empty one is the first.

    Raises UsageError: guards that hold together press on each other, or they are too many.
    """
    near, found = neighbours(contacts), [frozenset[int]()]
    for k, one in enumerate(contacts):
        apart = {other.edge for other in contacts[:k] if {*one.near.own} & {*other.near.own}}
        for j in (j for j in near[k] if j < k and not _exclusive(one, contacts[j])):
            names = " and ".join(mode.edges[each.edge].name for each in (contacts[j], one))
            raise UsageError(
                f"mode {mode.name}: the guards of {names} may hold together and press on each other, and a text has "
                "no rule for that",
                "run the model itself, or export it: both follow such motion",
            )
        apart |= {contacts[j].edge for j in near[k]}
        found += [few | {one.edge} for few in found if not few & apart]
        if len(found) > MOST_SETS:
            message = f"mode {mode.name}: more than {MOST_SETS} sets of guards may hold together, each a mode of a text"
            raise UsageError(message, "run the model itself, or export it: both follow such motion")
    return found


def _exclusive(one: Contact, other: Contact) -> bool:
    """Whether two guards are nowhere zero together: their functions add up to, or differ by, what no state moves."""
    free = {TIME, *map(symbol, one.base.states)}
    ends = (sp.expand(one.near.guard + way * other.near.guard) for way in (1, -1))
    return any(end != 0 and not end.free_symbols & free for end in ends)


def _leaving_on_surface(found: Sliding) -> Mode:
    """The mode of a sliding, left on the surface also where that is affine: a reader of the text can rely on it."""
    mode, r = found.mode, found.entries[0].surface.residual
    states = tuple(map(symbol, mode.states))
    slopes = [sp.diff(r, x) for x in states]
    size = sum(slope**2 for slope in slopes)
    if size == 0 or size.free_symbols & {TIME, *states}:
        return mode
    onto = tuple(cancelled(x - r * slope / size) for x, slope in zip(states, slopes, strict=True))
    leave = [replace(edge, reset=onto) if edge.reset == states else edge for edge in mode.edges[:2]]
    return replace(mode, edges=(*leave, *mode.edges[2:]))


class _Writer:
    """The modes and transitions that are inserted into the text of a model, with names that are free."""

    def __init__(self, text: Text, root: Node, system: HybridSystem, modes: Iterable[Mode]) -> None:
        assert isinstance(root, Mapping)
        self._root, self._system, self.insertions = root, system, Insertions(text)
        self._names = {mode.name for mode in modes} | {p.name for p in system.parameters}
        self._time: str | None = None

    def motions(self, base: Mode, moving: Slopes) -> tuple[list[Edge], list[Mode]]:
        """The modes of motions along guards of a mode, one for each set that may hold together, and what leads there.

        Raises UsageError: guards that hold together press on each other, or they are too many.
        """
        contacts = [found for k in range(len(base.edges)) if (found := contact(base, k, moving=moving))]
        names = {few: self._name(base, few) for few in _held_together(base, contacts)}
        entries = [
            self._entry(found, name, names[few | {found.edge}])
            for few, name in names.items()
            for found in contacts
            if found.edge not in few and few | {found.edge} in names
        ]
        return entries, [self._motion(base, contacts, few, names) for few in names if few]

    def _name(self, base: Mode, few: frozenset[int]) -> str:
        """The name of the mode of a set of guards."""
        if not few:
            return base.name
        label = "_".join([base.name, *(base.edges[k].name for k in sorted(few) if "->" not in base.edges[k].name)])
        return self._free(re.sub(r"\W", "_", f"contact_{label}"))

    def _entry(self, found: Contact, source: str, target: str) -> Edge:
        """The transition by which a guard begins to hold."""
        mode, edge = found.base, found.base.edges[found.edge]
        reset = list(zip(map(symbol, mode.states), edge.reset, strict=True))

        def after(value: sp.Expr) -> sp.Expr:
            return value.subs(reset, simultaneous=True)

        if found.order == 1:
            soon = sp.Gt(found.push, 0)
        else:
            soon = sp.Le(cancelled(-2 * after(found.rate)), symbol(self._contact_time()) * found.push)
        condition = soon if edge.condition is None else sp.And(edge.condition, soon)
        landing = edge.reset if found.order == 1 else tuple(cancelled(after(value)) for value in found.landing)
        to = {"name": f"{source}->{target}", "source": source, "target": target, "priority": edge.priority + 1}
        return replace(edge, condition=condition, reset=landing, **to)

    def _motion(
        self, base: Mode, contacts: Sequence[Contact], few: frozenset[int], names: dict[frozenset[int], str]
    ) -> Mode:
        """The mode of the motion along a set of guards; what changes nothing that it depends on leads back to it."""
        name, held = names[few], [found for found in contacts if found.edge in few]
        seen = set[sp.Symbol]().union(*map(depends_on, held))
        edges = list(base.edges)
        for j, edge in enumerate(edges):
            changed = {symbol(state.name) for state in edge.changes}
            lasts = edge.target == base.name and edge.target_states == base.states and not changed & seen
            edges[j] = replace(edge, source=name, target=name if lasts else edge.target)
        flow, texts = list(base.flow), list(base.flow_texts)
        for found in held:
            to = names[few - {found.edge}]
            left = {"name": f"{name}->{to}", "source": name, "target": to}
            edges[found.edge] = replace(found.release, reset=_onto_guard(base, found), **left)
            for further, end in found.further:
                time = symbol(self._contact_time())
                depth = time * found.push if found.order == 1 else time**2 * found.push / 2
                edges.append(replace(further, condition=end, reset=_onto_guard(base, found, depth), **left))
            for i, row in found.rows.items():
                flow[i], texts[i] = row, text_of(row)
        return replace(base, name=name, flow=tuple(flow), flow_texts=tuple(texts), edges=tuple(edges))

    def _free(self, name: str) -> str:
        while name in self._names:
            name += "_"
        self._names.add(name)
        return name

    def _contact_time(self) -> str:
        if self._time is None:
            self._time = self._free("contact_time")
            parameters = child(self._root, "parameters")
            values = self._system.parameter_values(sp.Expr.xreplace)
            until = float(sp.N(self._system.experiment.until.xreplace(values)))
            entry = f"{self._time}: {float(least_relaxation(DEFAULTS['relaxation'], until)):g}"
            if parameters is None or not isinstance(parameters, Mapping) or not parameters.entries:
                (key, _) = self._root.entries["modes"]
                self.insertions.insert(key.place.start[0], f"parameters: {{{entry}}}\n")
            else:
                self.insertions.append(parameters, entry, entry)
        return self._time

    def add_transition(self, edge: Edge) -> None:
        """Add a transition after those of its mode."""
        node = child(child(child(self._root, "modes"), edge.source), "transitions")
        assert node is not None
        fields = _transition(edge)
        self.insertions.append(node, flow_style(fields), "\n".join(_transition_lines(fields, node.place.start[2])))

    def add_mode(self, mode: Mode) -> None:
        """Add a mode after the others."""
        node = child(self._root, "modes")
        assert node is not None
        end = "" if mode.edges else "  # hsdsl: ignore[HS425] no transition leads out of this motion"
        block = f"{mode.name}:{end}\n" + "".join(f"  {line}\n" for line in _mode_lines(mode, self._system))
        edges = ", ".join(flow_style(_transition(edge)) for edge in mode.edges)
        parts = [f"flow: {flow_style(_flow(mode))}", *_rest(mode, self._system)]
        parts += [f"transitions: [{edges}]"] if mode.edges else []
        self.insertions.append(node, f"{mode.name}: {{{', '.join(parts)}}}", block.rstrip("\n"))


def _onto_guard(mode: Mode, found: Contact, depth: sp.Expr = sp.S.Zero) -> tuple[sp.Expr, ...]:
    """The point near a state, that errors of steps have moved off a guard, from where the mode itself can go on.

    It is on the guard, or beyond it by a depth: where the `if` ends, the guard is one that the state has passed.
    """
    r = mode.edges[found.edge].surface.residual
    off = (r if found.order == 2 else sp.S.Zero) - depth
    slopes = [sp.diff(r, symbol(name)) for name in mode.states]
    size = sum(slope**2 for slope in slopes)
    return tuple(cancelled(x - off * slope / size) for x, slope in zip(found.landing, slopes, strict=True))


def inequality(surface: Surface) -> str:
    """The text of a guard."""
    return _between(surface, ">=", "<=")


def wall(surface: Surface) -> str:
    """The text of a wall, whose surface is negative where the inequality holds."""
    return _between(surface, "<=", ">=")


def _between(surface: Surface, of_difference: str, otherwise: str) -> str:
    """The sides of a surface, with the sign for a residual that is their difference or with the other one."""
    sign = of_difference if surface.residual == surface.left - surface.right else otherwise
    return f"{text_of(surface.left)} {sign} {text_of(surface.right)}"


def _transition(edge: Edge) -> dict[str, str]:
    """The fields of a transition; one with the name that it would have anyway gets none."""
    fields = {} if "->" in edge.name else {"name": edge.name}
    fields["when"] = inequality(edge.surface)
    if edge.condition not in (None, sp.true):
        fields["if"] = text_of(edge.condition)
    fields["to"] = edge.target
    changes = {state.name: text_of(r) for state, r in edge.changes.items()}
    if changes:
        fields["reset"] = flow_style(changes)
    if edge.priority:
        fields["priority"] = str(edge.priority)
    return fields


def _flow(mode: Mode) -> dict[str, str]:
    """The flow as text, with common factors cancelled where that is cheap and makes it shorter."""
    pairs = [(f, f if f.count_ops() > LONG else sp.cancel(f)) for f in mode.flow]
    return {name: text_of(min(pair, key=sp.count_ops)) for name, pair in zip(mode.states, pairs, strict=True)}


def _rest(mode: Mode, system: HybridSystem) -> Iterator[str]:
    """Walls and outputs."""
    if mode.walls:
        yield f"domain: [{', '.join(map(wall, mode.walls))}]"
    outputs = {n: text_of(o) for n, o in zip(system.outputs, mode.outputs, strict=True) if o is not None}
    if outputs:
        yield f"outputs: {flow_style(outputs)}"


def _mode_lines(mode: Mode, system: HybridSystem) -> Iterator[str]:
    yield "flow:"
    yield from (f"  {state}: {text}" for state, text in _flow(mode).items())
    yield from _rest(mode, system)
    if mode.edges:
        yield "transitions:"
    yield from (f"  {line}" for edge in mode.edges for line in _transition_lines(_transition(edge), INDENT))


def _transition_lines(fields: dict[str, str], column: int) -> list[str]:
    """A transition as an entry of a list at a column: on one line where it fits there."""
    if column + len(line := f"- {flow_style(fields)}") <= WIDTH:
        return [line]
    return [f"{' ' if i else '-'} {key}: {value}" for i, (key, value) in enumerate(fields.items())]


class Insertions:
    """What is inserted into a text, by its places."""

    def __init__(self, text: Text) -> None:
        self._text = text
        self._insertions: dict[int, list[str]] = {}

    def result(self) -> str:
        """The text with all insertions, which are made from its end to its start."""
        content = self._text.content
        for index in sorted(self._insertions, reverse=True):
            content = content[:index] + "".join(self._insertions[index]) + content[index:]
        return content

    def append(self, node: Node, inline: str, block: str) -> None:
        """Add an entry after the last one of a mapping or a list, in its style."""
        start, end = node.place.start[0], node.place.end[0]
        content = self._text.content
        if content[start] in "[{":
            before = "" if content[start + 1 : end - 1].strip() == "" else ", "
            self.insert(end - 1, before + inline)
            return
        column = node.place.start[2]
        lines = content[:end].rstrip().split("\n")
        while (line := lines[-1].lstrip()) == "" or (line[0] == "#" and len(lines[-1]) - len(line) < column):
            lines.pop()  # comments that begin further left belong to what follows
        last = len("\n".join(lines).rstrip())
        line_end = content.find("\n", last)
        at = len(content) if line_end < 0 else line_end
        self.insert(at, "".join(f"\n{' ' * column}{line}" for line in block.splitlines()))

    def insert(self, index: int, text: str) -> None:
        self._insertions.setdefault(index, []).append(text)


def flow_style(fields: dict[str, str]) -> str:
    """A mapping inside braces."""
    return "{" + ", ".join(f"{key}: {_quoted(value)}" for key, value in fields.items()) + "}"


def _quoted(text: str) -> str:
    """A value inside brackets: in quotes where a comma or a bracket of its own would end it."""
    return f"'{text}'" if "," in text and text[0] not in "{[" else text
