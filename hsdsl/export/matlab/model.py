"""The function that gives a model as a structure: routines of each mode, names, inputs over time, method, settings."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from hsdsl.base.names import visible
from hsdsl.base.parts import layout_of
from hsdsl.engine.backends.c import width
from hsdsl.engine.simulate.control import LARGEST_SHARE
from hsdsl.export import routines
from hsdsl.export.identifiers import identifiers
from hsdsl.export.matlab.language import KEYWORDS, body, helpers, reserved
from hsdsl.export.matlab.settings import run_fields
from hsdsl.export.matlab.text import cell, comment, string, strings, vector
from hsdsl.export.routines import mode_definitions
from hsdsl.export.source import Source
from hsdsl.mathematics.program import ModeProgram, Program

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
  bound = 16 * eps * (sides(k) + abs(slopes(1)) * abs(t) + sum(abs(slopes(2:end)) .* max(abs(x), abs(scale))));
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
    gateway: str
    functions: list[str] = field(default_factory=list[str])
    handles: dict[str, list[str]] = field(default_factory=dict[str, list[str]])

    def text(self) -> str:
        """All of it."""
        source, problem = self.source, self.source.problem
        program = problem.program
        for number, mode in enumerate(program.modes, start=1):
            self.mode(number, mode)
        parts = [
            f"function m = {source.name}_model()\n",
            comment([f"m = {source.name}_model()  The model as a structure, for hsdsl_simulate.", *source.heading]),
            *(f"  m.{key} = {value};\n" for key, value in self.facts(program)),
            *(f"  m.{key} = {cell(handles)};\n" for key, handles in self.handles.items()),
            "  m.roundoff = @roundoff;\n  m.enabled = @enabled;\n",
            *(f"  m.{key} = {value};\n" for key, value in run_fields(problem)),
            "end\n\n",
        ]
        functions = "\n".join(self.functions) + _LAST
        calls = helpers(functions)
        return "".join(parts) + functions + (f"\n{calls}" if calls else "")

    def facts(self, program: Program) -> Iterable[tuple[str, str]]:
        """Names and sizes."""
        problem, modes, states = self.source.problem, program.modes, program.all_states
        layout = layout_of(program.parts, modes[0].states)
        assert problem.settings.method is not None
        yield "name", string(self.source.name)
        yield "gateway", string(self.gateway)
        yield "mode_names", strings(program.mode_names)
        yield "state_names", cell(strings(mode.states) for mode in modes)
        yield "parameters", strings(parameter_fields(program).values())
        yield "dim", vector(len(mode.states) for mode in modes)
        yield "width", str(width(program))
        yield "final", vector(int(mode.final) for mode in modes)
        yield "state_index", cell(vector(1 + states.index(name) for name in mode.states) for mode in modes)
        yield "walls", cell(strings(mode.walls) for mode in modes)
        yield "edge_names", cell(strings(edge.name for edge in mode.edges) for mode in modes)
        yield "edge_target", cell(vector(1 + edge.target for edge in mode.edges) for mode in modes)
        yield "edge_states", cell(vector(len(edge.target_states) for edge in mode.edges) for mode in modes)
        yield "edge_priority", cell(vector(edge.priority for edge in mode.edges) for mode in modes)
        yield "edge_conditional", cell(f"{vector(int(e.conditional) for e in mode.edges)} == 1" for mode in modes)
        yield "part_names", strings(part.name for part in program.parts)
        yield "part_modes", cell(strings(part.modes) for part in program.parts)
        yield "part_number", vector(1 + number for number in layout.numbers)
        yield "adaptive", _truth(problem.settings.method.adaptive)
        yield "largest_share", vector([LARGEST_SHARE])
        yield "fixed_until", _truth(bool(program.inputs or program.switches))

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
        self.add("reset", cell(self.function(f"reset_{number}_{k + 1}", found[f"reset_{k}"], mode) for k in edges))
        self.add("condition", cell(self.condition(number, k, found, mode) for k in edges))

    def add(self, key: str, handle: str) -> None:
        """One more mode's entry of a table."""
        self.handles.setdefault(key, []).append(handle)

    def condition(self, number: int, k: int, found: Mapping[str, ast.FunctionDef], mode: ModeProgram) -> str:
        """The parts of a condition; an edge without one has none."""
        if not mode.edges[k].conditional:
            return "{}"
        parts = enumerate(mode.conditions[k], 1)
        return cell(self.function(f"condition_{number}_{k + 1}_{i}", found[name], mode) for i, name in parts)

    def function(self, name: str, definition: ast.FunctionDef, mode: ModeProgram) -> str:
        """Print one routine; return its handle."""
        program = self.source.problem.program
        taken = reserved(mode.routines.source)
        own = identifiers(mode.states, taken | set(parameter_fields(program).values()))
        names = {f"x{i}": own[state] for i, state in enumerate(mode.states)}
        names |= {f"p{i}": f"p.{f}" for i, f in enumerate(parameter_fields(program).values())}
        names |= data_names(program) | {"t": "t"}
        text = body(definition, names)
        used = {node.id for node in ast.walk(definition) if isinstance(node, ast.Name)}
        unpack = [f"  {own[s]} = x({i + 1});\n" for i, s in enumerate(mode.states) if f"x{i}" in used]
        lines = "".join(unpack) + text
        self.functions.append(f"function out = {name}(t, x, p, d)\n{comment([_about(name, mode)])}{lines}\nend\n")
        return f"@{name}"


def _truth(value: bool) -> str:
    return "true" if value else "false"


def _about(name: str, mode: ModeProgram) -> str:
    """What a function is of, for a comment."""
    kind, _, rest = name.partition("_")
    numbers = rest.split("_")
    texts = [*(edge.text for edge in mode.edges), *mode.walls]
    if kind in ("gradient", "rate") and len(numbers) > 1:
        return visible(f"mode {mode.name}, {kind} of {texts[int(numbers[1]) - 1]}")
    if kind in ("reset", "condition") and len(numbers) > 1:
        return visible(f"mode {mode.name}, {kind} of {mode.edges[int(numbers[1]) - 1].name}")
    return visible(f"mode {mode.name}: {kind}")
