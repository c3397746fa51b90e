"""A model for MATLAB and GNU Octave: flow set and map, jump set and map, and a driver that needs no toolbox."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable
from textwrap import wrap

from hsdsl.base.names import visible
from hsdsl.export.c import EXACT_FLAGS, c_sources
from hsdsl.export.matlab.model import PARTS, ModelText, body, comment, helpers, literal, parameter_fields, string
from hsdsl.export.source import Source, definitions, derived, followed, structural


def files(source: Source) -> dict[str, bytes]:
    """Functions, each in a file of its name.

    Raises UsageError: the C runtime has no such scheme.
    """
    name = source.name
    c = c_sources(source, True, "given.h") | {"gateway.c": (PARTS / "gateway.c").read_bytes()}
    digest = hashlib.sha256(b"\0".join(c.values())).hexdigest()[:8]  # what was compiled before is not taken for this
    gateway = f"{name}_{digest}"
    texts = {
        f"{name}_model.m": ModelText(source, gateway).text(),
        f"{name}_parameters.m": _parameters(source),
        f"{name}_initial.m": _initial(source),
        **{f"{name}_{part}.m": _part(f"{part}.m", source, gateway) for part in ("run", "f", "C", "g", "D")},
        **{part: _part(part, source, gateway) for part in ("hsdsl_simulate.m", "README.md")},
    }
    return {path: text.encode() for path, text in texts.items()} | {f"c/{path}": text for path, text in c.items()}


def _part(path: str, source: Source, gateway: str) -> str:
    """A file that is the same for every model but for names; no text of the model is markup in it."""
    text = (PARTS / path).read_text(encoding="utf-8")
    settings = source.problem.settings
    assert settings.method is not None
    heading = comment(source.heading) if path.endswith(".m") else "".join(f"    {line}\n" for line in source.heading)
    begin = (PARTS / "begin.m").read_text(encoding="utf-8")
    texts = {"BEGIN\n": begin, "HEADING\n": heading, "NAME": source.name, "METHOD": settings.method.name}
    exact, wrapped = " ".join(EXACT_FLAGS), wrap(" ".join(EXACT_FLAGS), 110, break_on_hyphens=False)
    texts |= {"EXACT": exact if path.endswith(".m") else " \\\n      ".join(wrapped), "GATEWAY": gateway}
    for key, value in texts.items():
        text = text.replace(f"@{key}", value)
    return text


def _parameters(source: Source) -> str:
    """The function of the parameters; one that others decide follows them unless it is given."""
    problem = source.problem
    program, own, fixed = problem.program, derived(problem), structural(problem)
    fields = parameter_fields(program)
    bodies = definitions(program.constants)
    about = {p.name: p for p in source.system.parameters}
    lines: list[str] = []
    functions: list[str] = []
    for i, (name, field) in enumerate(fields.items()):
        value = literal(problem.timeline.segments[0].data[i])
        if name in own:
            text = _given(bodies[f"parameter_{i}"], fields.values(), f"derived_{field}")
            functions.append(text)
            value = f"derived_{field}(p)"
        notes = [visible(part) for part in (about[name].unit, about[name].about) if part]
        notes += ["inputs keep the times that it had here"] if name in fixed else []
        note = f"  % {', '.join(notes)}" if notes else ""
        lines.append(f"  p.{field} = given(chosen, {string(field)}, {value});{note}\n")
    head = (
        f"function p = {source.name}_parameters(varargin)\n"
        + comment([f"p = {source.name}_parameters('name', value, ...)  Parameters, some of them changed."])
        + comment(source.heading)
        + "  chosen = struct(varargin{:});\n  p = struct();\n"
    )
    known = "  unknown = setdiff(fieldnames(chosen), fieldnames(p));\n  if ~isempty(unknown)\n"
    known += "    error('hsdsl:parameter', 'there is no parameter %s', unknown{1});\n  end\n"
    given = "\nfunction value = given(chosen, name, value)\n  if isfield(chosen, name)\n"
    given += "    value = chosen.(name);\n  end\nend\n"
    rest = "".join(f"\n{text}" for text in functions)
    return head + "".join(lines) + known + "end\n" + given + rest + helpers(rest)


def _initial(source: Source) -> str:
    """The function of the initial state: the mode's number, and the states."""
    problem = source.problem
    program = problem.program
    inner = _given(definitions(program.constants)["initial"], parameter_fields(program).values(), "given_values")
    lines = [f"function x0 = {source.name}_initial(p)\n"]
    lines.append(comment([f"x0 = {source.name}_initial(p)  Where a run starts: [mode; states].", *source.heading]))
    lines.append("  values = given_values(p);\n" if program.initial_states else "")
    width = max(len(mode.states) for mode in program.modes)
    lines.append(f"  x0 = zeros({1 + max(width, len(problem.states))}, 1);\n  x0(1) = {problem.mode + 1};\n")
    for i, (name, number, place) in enumerate(zip(problem.states, problem.x, followed(problem), strict=True)):
        value = literal(number) if place is None else f"values({place + 1})"
        lines.append(f"  x0({i + 2}) = {value};  % {visible(name)}\n")
    text = "".join(lines) + "end\n" + (f"\n{inner}" if program.initial_states else "")
    return text + helpers(text)


def _given(definition: ast.FunctionDef, fields: Iterable[str], name: str) -> str:
    """A routine of parameters alone."""
    names = {f"p{i}": f"p.{field}" for i, field in enumerate(fields)}
    return f"function out = {name}(p)\n{body(definition, names)}\nend\n"
