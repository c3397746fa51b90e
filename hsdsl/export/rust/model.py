"""The generated module of a crate: sizes, names, settings. Routines and numbers are in C."""

from __future__ import annotations

from collections.abc import Iterable

from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.base.parts import layout_of
from hsdsl.engine.backends.c.source import width
from hsdsl.engine.backends.printer import number_text
from hsdsl.engine.runtime.structures import method_table
from hsdsl.engine.simulate import Problem
from hsdsl.engine.simulate.control import make_control
from hsdsl.export.source import Source
from hsdsl.mathematics.program import ModeProgram, Program

_HEAD = "use crate::names::*;\nuse crate::Settings;\npub use crate::{follow, initial, parameters};\n"


def model_text(source: Source) -> str:
    """The text of ``model.rs``."""
    heading = "".join(f"// {line}\n" for line in source.heading)
    parts = (heading + _HEAD, _sizes(source.problem), _names(source.problem), _settings(source.problem))
    return "\n".join(parts)


def literal(value: float) -> str:
    """Write a number without loss: the shortest decimals that are read as it."""
    return number_text(value, "f64::NAN", "f64::INFINITY")


def string(text: str) -> str:
    """A string literal: signs that are not plain ASCII, quotes and backslashes as escapes."""
    return '"' + "".join(s if s.isascii() and s.isprintable() and s not in '"\\' else _escape(s) for s in text) + '"'


def _escape(sign: str) -> str:
    return f"\\u{{{ord(sign):x}}}" if not 0xD800 <= ord(sign) < 0xE000 else "?"


def array(items: Iterable[str]) -> str:
    return f"[{', '.join(items)}]"


def _strings(texts: Iterable[str]) -> str:
    return f"&{array(map(string, texts))}"


def _sizes(problem: Problem) -> str:
    program, settings = problem.program, problem.settings
    assert settings.method is not None
    sizes = {
        "W": (width(program), "states of the largest mode"),
        "E": (max(len(mode.edges) for mode in program.flows), "edges of the mode with most"),
        "P": (len(program.parameters), "parameters"),
        "STATES": (len(program.all_states), "states of all modes"),
        "OUTPUTS": (len(program.outputs), "outputs"),
        "DEGREE": (method_table(settings.method).degree, "of the interpolants of steps, 0 for lines"),
        "START": (problem.mode, "the number of the initial mode"),
    }
    return "".join(f"/// {why}\npub const {name}: usize = {size};\n" for name, (size, why) in sizes.items())


def _names(problem: Problem) -> str:
    program = problem.program
    lists = {"PARAMETERS": program.parameters, "STATE_NAMES": program.all_states, "OUTPUT_NAMES": program.outputs,
             "INITIAL_STATES": problem.states}  # fmt: skip
    texts = "".join(f"pub static {name}: &[&str] = {_strings(texts)};\n" for name, texts in lists.items())
    return f"pub static MODES: &[Mode] = &[\n{''.join(map(_mode, program.modes))}];\n{texts}{_parts(program)}"


def _mode(mode: ModeProgram) -> str:
    edges = "".join(
        f"            Edge {{ name: {string(edge.name)}, target: {edge.target}, "
        f"states: {_strings(edge.target_states)} }},\n"
        for edge in mode.edges
    )
    return (
        f"    Mode {{\n        name: {string(mode.name)},\n        states: {_strings(mode.states)},\n"
        f"        edges: &[\n{edges}        ],\n    }},\n"
    )


def _parts(program: Program) -> str:
    """The parts of a system; of each state the part that it is of, and whether each of that's modes has it."""
    layout = layout_of(program.parts, program.modes[0].states)
    rows = "".join(
        f"    Part {{ name: {string(part.name)}, modes: {_strings(part.modes)}, number: {_option(number)} }},\n"
        for part, number in zip(program.parts, layout.numbers, strict=True)
    )
    owners = "".join(
        f"    ({_option(owner)}, &{array('true' if one == '1' else 'false' for one in owned)}),\n"
        for owner, owned in zip(layout.owners, layout.owned, strict=True)
    )
    return (
        f"pub static PARTS: &[Part] = &[\n{rows}];\n"
        f"/// Of each state of a system of parts the part, and whether its modes have the state.\n"
        f"pub static OWNERS: &[(Option<usize>, &[bool])] = &[\n{owners}];\n"
    )


def _option(number: int) -> str:
    return "None" if number < 0 else f"Some({number})"


def _settings(problem: Problem) -> str:
    settings, program = problem.settings, problem.program
    control = make_control(settings, FLOAT64)
    fields = {
        "step": control.h, "tolerance": control.tolerance or 0.0, "largest": control.largest,
        "relaxation": settings.relaxation, "until": settings.until,
    }  # fmt: skip
    lines = "".join(f"    {name}: {literal(float(value))},\n" for name, value in fields.items())
    known = (settings.scale or {}).get
    scales = array(literal(float(known(name, 0.0))) for name in program.all_states)
    fixed = "true" if program.inputs or program.switches else "false"
    return (
        f"pub const SETTINGS: Settings = Settings {{\n{lines}"
        f"    max_transitions: {min(settings.max_transitions, 2**62)},\n}};\n"
        "/// Whether a run lasts as long as the exported one at most, since inputs and switches are known until then.\n"
        f"pub const FIXED_UNTIL: bool = {fixed};\n"
        f"/// Sizes of states, 0 where none is known.\npub const SCALES: [f64; STATES] = {scales};\n"
    )
