"""The function that gives a model as a structure: routines of each mode, names, inputs over time, method, settings.

Routines are functions of time, the states and the parameters, each a column of values.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from hsdsl.base.names import visible
from hsdsl.base.parts import layout_of
from hsdsl.engine.backends.c.source import width
from hsdsl.engine.backends.printer import C_OPERATORS, Language, number_text
from hsdsl.engine.simulate import Problem
from hsdsl.engine.simulate.control import LARGEST_SHARE
from hsdsl.export.source import Source, data_names, identifiers, mode_definitions
from hsdsl.mathematics.program import ModeProgram, Program


def parameter_fields(program: Program) -> dict[str, str]:
    """The field of each parameter in the structure of parameters."""
    return identifiers(program.parameters, KEYWORDS)


def row_entries(program: Program) -> dict[str, str]:
    """The inputs, switches and contacts of a routine, as entries of a row."""
    names = data_names(program)[len(program.parameters) :]
    return {name: f"d({at})" for at, name in enumerate(names, start=1)}


@dataclass
class ModelText:
    """The text of ``NAME_model.m`` under way: functions, and the handles that the structure has."""

    source: Source
    gateway: str
    functions: list[str] = field(default_factory=list[str])
    handles: dict[str, list[str]] = field(default_factory=dict[str, list[str]])

    def text(self) -> str:
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
        functions = "\n".join([*self.functions, (PARTS / "last.m.in").read_text()])
        return "".join(parts) + functions + helpers(functions)

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
        names |= row_entries(program) | {"t": "t"}
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


_WIDTH = 100


def comment(lines: Iterable[str]) -> str:
    """Comments; none of them is a brace alone, which would begin a block."""
    return "".join(f"% {line}\n" for line in lines)


def string(text: str) -> str:
    """A text between single quotes, in which only the quote itself means something."""
    return "'" + visible(text).replace("'", "''") + "'"


def strings(texts: Iterable[str]) -> str:
    """A row of texts."""
    return cell(map(string, texts))


def cell(items: Iterable[str]) -> str:
    """A row of anything."""
    return "{" + ", ".join(items) + "}"


def vector(values: Iterable[float], sign: str = ", ") -> str:
    """A row of numbers, or with ``"; "`` a column; broken into lines."""
    lines, line = list[str](), ""
    for text in map(literal, values):
        if line and len(line) + len(text) > _WIDTH:
            lines.append(line + sign.rstrip())
            line = ""
        line += (sign if line else "") + text
    return "[" + " ...\n    ".join([*lines, line]) + "]"


def matrix(rows: Sequence[Sequence[float]]) -> str:
    """Rows of numbers, a line each."""
    inner = "; ...\n    ".join(", ".join(map(literal, row)) for row in rows)
    return f"[{inner}]" if rows else "zeros(0, 0)"


def run_fields(problem: Problem) -> Iterable[tuple[str, str]]:
    """Names of fields with their values.

    ``data`` has a row of numbers for each stretch of inputs. ``typical`` has a size of each state, by which the sets of
    a toolbox know round-off.
    """
    settings, segments = problem.settings, problem.timeline.segments
    yield "starts", _column(s.start for s in segments)
    rows = [s.data[len(problem.program.parameters) :] for s in segments]
    yield "data", matrix(rows) if rows[0] else f"zeros({len(rows)}, 0)"
    scale = {name: float(settings.scale.get(name, 0.0)) for name in problem.program.all_states}
    first = {name: abs(float(number)) for name, number in zip(problem.states, problem.x, strict=True)}
    yield "typical", _column(max(size, first.get(name, 0.0)) for name, size in scale.items())
    yield "settings.scheme", string(settings.scheme)
    numbers = {"step": settings.step or 0.0, "tolerance": settings.tolerance or 0.0, "relaxation": settings.relaxation}
    numbers |= {"until": settings.until, "max_transitions": settings.max_transitions}
    yield from ((f"settings.{key}", vector([number])) for key, number in numbers.items())


def _column(values: Iterable[float]) -> str:
    numbers = list(values)
    return vector(numbers, "; ") if numbers else "zeros(0, 1)"


_WORDS = """
break case catch classdef continue do else elseif end end_try_catch end_unwind_protect endfor endfunction endif
endswitch endwhile enumeration events for function global if methods otherwise parfor persistent properties return spmd
switch try until unwind_protect while arguments import
"""
KEYWORDS = frozenset(_WORDS.split())
BUILT_IN = ("sin", "cos", "tan", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "exp", "abs", "sign", "floor")
_FUNCTIONS = frozenset((*BUILT_IN, "min", "max", "zeros", "pi", "eps", "Inf", "NaN", "i", "j", "e"))
PARTS = Path(__file__).parent / "parts"
_PLAIN = re.compile(rf"\bhs_({'|'.join(BUILT_IN)})\(")
_HELPER = re.compile(r"\bhs_(\w+)\(")
_TEMPORARY = re.compile(r"\b[vw]\d+\b")

# what MATLAB answers with a complex number has no value here
HELPERS = {
    "sqrt": ("x", "x >= 0", "sqrt(x)"),
    "log": ("x", "x > 0", "log(x)"),
    "asin": ("x", "abs(x) <= 1", "asin(x)"),
    "acos": ("x", "abs(x) <= 1", "acos(x)"),
    "acosh": ("x", "x >= 1", "acosh(x)"),
    "atanh": ("x", "abs(x) < 1", "atanh(x)"),
    "pow": ("x, y", "x >= 0 || y == floor(y)", "x ^ y"),
    "heaviside": ("x", "x == x", "(1 + sign(x)) / 2"),
    "choose": ("test, x, other", "test", "x"),
}


def literal(value: float) -> str:
    """Write a number without loss."""
    return number_text(value, "NaN", "Inf", lambda number: repr(number).removesuffix(".0"))


def _results(values: Sequence[str]) -> list[str]:
    return [f"out = zeros({len(values)}, 1);", *(f"out({i}) = {value};" for i, value in enumerate(values, start=1))]


MATLAB = Language(
    literal=literal,
    assign="{name} = {value};",
    results=_results,
    divide="({left} / {right})",
    choose="hs_choose({test}, {body}, {other})",
    call="hs_{name}({arguments})",
    fold="{name}({left}, {right})",
    truths=("false", "true"),
    operators={**C_OPERATORS, ast.NotEq: "~=", ast.Not: "~"},
)


def body(definition: ast.FunctionDef, names: Mapping[str, str]) -> str:
    """The statements of a routine, indented; ``out`` has its values."""
    lines = (_PLAIN.sub(r"\1(", line) for line in MATLAB.body(definition, names))
    return "\n".join(f"  {line}" for line in lines)


def reserved(source: str) -> frozenset[str]:
    """What no variable of a function made from a text may be called."""
    own = ("t", "x", "p", "d", "s", "m", "out")
    return KEYWORDS | _FUNCTIONS | frozenset(own) | frozenset(_TEMPORARY.findall(source))


def helpers(text: str) -> str:
    """The functions that a text calls and MATLAB lacks, each after an empty line."""
    lines: list[str] = []
    for name in sorted(set(_HELPER.findall(text)) & HELPERS.keys()):
        arguments, where, value = HELPERS[name]
        lines.append(f"\nfunction value = hs_{name}({arguments})\n  if {where}\n    value = {value};\n")
        lines[-1] += f"  else\n    value = {'other' if name == 'choose' else 'NaN'};\n  end\nend\n"
    return "".join(lines)
