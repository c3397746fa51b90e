"""The function that gives a model as a structure: routines of each mode, names, inputs over time, method, settings."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from hsdsl.export import routines
from hsdsl.export.identifiers import identifiers
from hsdsl.export.matlab.language import KEYWORDS, body, helpers, reserved
from hsdsl.export.matlab.method import method_text
from hsdsl.export.matlab.settings import run_fields
from hsdsl.export.matlab.text import cell, comment, string, strings, vector
from hsdsl.export.routines import definitions, mode_definitions
from hsdsl.export.source import Source
from hsdsl.names import visible
from hsdsl.program import ModeProgram, Program

_LAST = """
function k = enabled(m, x, t, p)
% The number of the edge that is made at x = [mode; states], 0 where there is none.
  k = 0;
  q = x(1);
  y = reshape(x(2:m.dim(q) + 1), [], 1);
  edges = numel(m.edge_target{q});
  if m.final(q) || edges == 0
    return
  end
  d = m.data(max(1, find(m.starts <= t, 1, 'last')), :);
  values = m.surfaces{q}(t, y, p, d);
  best = -Inf;
  for i = 1:edges
    noise = m.roundoff(m, q, i, t, y, p, d, m.typical(m.state_index{q}));
    made = values(i) >= -noise && m.rate{q}{i}(t, y, p, d) >= 0;
    parts = m.condition{q}{i};
    for part = 1:numel(parts)
      made = made && parts{part}(t, y, p, d);
    end
    if made && m.edge_priority{q}(i) > best
      k = i;
      best = m.edge_priority{q}(i);
    end
  end
end

function bound = roundoff(m, q, k, t, x, p, d, scale)
% Below this a value of surface k counts as zero: round-off of the numbers that it is computed from.
  sides = m.magnitudes{q}(t, x, p, d);
  slopes = m.gradient{q}{k}(t, x, p, d);
  if ~all(isfinite(slopes))
    bound = 16 * eps * sides(k);
    return
  end
  bound = 16 * eps * (sides(k) + abs(slopes(1)) * abs(t) + sum(abs(slopes(2:end)) .* max(abs(x), scale)));
end
"""


def parameter_fields(program: Program) -> dict[str, str]:
    """The field of each parameter in the structure of parameters."""
    return identifiers(program.parameters, KEYWORDS)


def data_names(program: Program) -> dict[str, str]:
    """The inputs, switches and contacts of a routine, as entries of a row."""
    names = routines.data_names(program)[len(program.parameters) :]
    return {name: f"d({at})" for at, name in enumerate(names, start=1)}


@dataclass
class ModelText:
    """The text of ``NAME_model.m`` under way: functions, and the handles that the structure has."""

    source: Source
    functions: list[str] = field(default_factory=list[str])
    handles: dict[str, list[str]] = field(default_factory=dict[str, list[str]])

    def text(self) -> str:
        """All of it."""
        source, problem = self.source, self.source.problem
        program = problem.program
        for number, mode in enumerate(self.flows, start=1):
            self.mode(number, mode)
        parts = [
            f"function m = {source.name}_model()\n",
            comment([f"m = {source.name}_model()  The model as a structure, for hsdsl_simulate.", *source.heading]),
            *(f"  m.{key} = {value};\n" for key, value in self.facts(program)),
            *(f"  m.{key} = {cell(handles)};\n" for key, handles in self.handles.items()),
            "  m.roundoff = @roundoff;\n  m.enabled = @enabled;\n",
            *(f"  m.{key} = {value};\n" for key, value in run_fields(problem)),
            *(f"  m.method.{key} = {value};\n" for key, value in method_text(problem.settings)),
            "end\n\n",
        ]
        functions = "\n".join(self.functions) + _LAST
        calls = helpers(functions)
        return "".join(parts) + functions + (f"\n{calls}" if calls else "")

    @property
    def flows(self) -> tuple[ModeProgram, ...]:
        """The modes, then those with motion along guards, where a run has them."""
        problem = self.source.problem
        return problem.program.modes if problem.settings.completion == "none" else problem.program.flows

    def facts(self, program: Program) -> Iterable[tuple[str, str]]:
        """Names and sizes."""
        modes, states, none = self.flows, program.all_states, self.source.problem.settings.completion == "none"
        yield "name", string(self.source.name)
        yield "mode_names", strings(program.mode_names)
        yield "state_names", cell(strings(mode.states) for mode in modes)
        yield "dim", vector(len(mode.states) for mode in modes)
        yield "final", vector(int(mode.final) for mode in modes)
        yield "state_index", cell(vector(1 + states.index(name) for name in mode.states) for mode in modes)
        yield "walls", cell(strings(mode.walls) for mode in modes)
        yield "edge_names", cell(strings(edge.name for edge in mode.edges) for mode in modes)
        yield "edge_target", cell(vector(1 + edge.target for edge in mode.edges) for mode in modes)
        yield "edge_priority", cell(vector(edge.priority for edge in mode.edges) for mode in modes)
        yield "edge_changes", cell(cell(vector(1 + i for i in edge.changes) for edge in mode.edges) for mode in modes)
        yield "edge_counts", cell(cell(vector(1 + i for i in edge.counts) for edge in mode.edges) for mode in modes)
        yield "queues", cell(vector(1 + queue.waiting for queue in mode.queues) for mode in modes)
        held = [0 if none or mode.held is None else 1 + mode.held for mode in modes]
        yield "held", vector(held)
        yield "contacts", str(program.contact_count)
        places = [[(e.contact, e.releases, e.push_order) for e in mode.edges] for mode in modes]
        numbers = [[tuple(0 if k is None or none else k + 1 for k in both) for *both, _ in edges] for edges in places]
        yield "edge_contact", cell(vector(contact for contact, _ in edges) for edges in numbers)
        yield "edge_releases", cell(vector(ends for _, ends in edges) for edges in numbers)
        yield "edge_order", cell(vector(order for *_, order in edges) for edges in places)
        yield "edge_conditional", cell(f"{vector(int(e.conditional) for e in mode.edges)} == 1" for mode in modes)

    def mode(self, number: int, mode: ModeProgram) -> None:
        """The functions of a mode."""
        found = mode_definitions(mode)
        edges = range(len(mode.edges))
        for name in ("flow", "surfaces", "magnitudes", "outputs"):
            self.add(name, self.function(f"{name}_{number}", found[name], mode))
        for name in ("gradient", "rate"):
            self.add(
                name, cell(self.function(f"{name}_{number}_{k + 1}", found[f"{name}_{k}"], mode) for k in mode.surfaces)
            )
        for name in ("reset", "spread"):
            self.add(name, cell(self.function(f"{name}_{number}_{k + 1}", found[f"{name}_{k}"], mode) for k in edges))
        self.add("slow", cell(self.slow(number, k, mode) for k in edges))
        self.add("condition", cell(self.condition(number, k, found, mode) for k in edges))
        method = self.source.problem.settings.method
        needed = (method is not None and method.implicit) or mode.held is not None
        self.add("jacobian", self.jacobian(number, mode) if needed else "[]")

    def add(self, key: str, handle: str) -> None:
        """One more mode's entry of a table."""
        self.handles.setdefault(key, []).append(handle)

    def slow(self, number: int, k: int, mode: ModeProgram) -> str:
        """The reset of an edge that leads back to its mode, or the branch of it that slow impacts take."""
        if not mode.edges[k].branched:
            return f"@reset_{number}_{k + 1}"
        assert mode.held is not None
        definition = mode_definitions(self.source.problem.program.flows[mode.held])[f"reset_{k}"]
        return self.function(f"slow_{number}_{k + 1}", definition, mode)

    def condition(self, number: int, k: int, found: Mapping[str, ast.FunctionDef], mode: ModeProgram) -> str:
        """The parts of a condition; an edge without one has none."""
        if not mode.edges[k].conditional:
            return "{}"
        parts = enumerate(mode.conditions[k], 1)
        return cell(self.function(f"condition_{number}_{k + 1}_{i}", found[name], mode) for i, name in parts)

    def jacobian(self, number: int, mode: ModeProgram) -> str:
        """The derivatives of a mode's flow as a matrix."""
        (definition,) = definitions(mode.jacobian.routines).values()
        values = self.function(f"derivatives_{number}", definition, mode).removeprefix("@")
        n = len(mode.states)
        places = vector((place // n + 1 + n * (place % n) for place in mode.jacobian.places), "; ")  # by columns
        body = f"  J = zeros({n}, {n});\n  J({places}) = {values}(t, x, p, d);\n"
        self.functions.append(f"function J = jacobian_{number}(t, x, p, d)\n{body}end\n")
        return f"@jacobian_{number}"

    def function(self, name: str, definition: ast.FunctionDef, mode: ModeProgram) -> str:
        """Print one routine; return its handle."""
        program = self.source.problem.program
        taken = reserved(mode.routines.source + mode.jacobian.routines.source)
        own = identifiers(mode.states, taken | set(parameter_fields(program).values()))
        names = {f"x{i}": own[state] for i, state in enumerate(mode.states)}
        names |= {f"p{i}": f"p.{f}" for i, f in enumerate(parameter_fields(program).values())}
        names |= {f"s{i}": f"s({i + 1})" for i in range(len(mode.states))} | data_names(program) | {"t": "t"}
        text = body(definition, names)
        arguments = "t, x, p, d, s" if name.startswith("spread") else "t, x, p, d"
        used = {node.id for node in ast.walk(definition) if isinstance(node, ast.Name)}
        unpack = [f"  {own[s]} = x({i + 1});\n" for i, s in enumerate(mode.states) if f"x{i}" in used]
        lines = "".join(unpack) + text
        self.functions.append(f"function out = {name}({arguments})\n{comment([_about(name, mode)])}{lines}\nend\n")
        return f"@{name}"


def _about(name: str, mode: ModeProgram) -> str:
    """What a function is of, for a comment."""
    kind, _, rest = name.partition("_")
    numbers = rest.split("_")
    texts = [*(edge.text for edge in mode.edges), *mode.walls]
    if kind in ("gradient", "rate") and len(numbers) > 1:
        return visible(f"mode {mode.name}, {kind} of {texts[int(numbers[1]) - 1]}")
    if kind in ("reset", "slow", "spread", "condition") and len(numbers) > 1:
        return visible(f"mode {mode.name}, {kind} of {mode.edges[int(numbers[1]) - 1].name}")
    return visible(f"mode {mode.name}: {kind}")
