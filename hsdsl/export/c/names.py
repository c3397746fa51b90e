"""The names of a model as C strings, for people: of modes, states, edges, parameters and outputs."""

from __future__ import annotations

from collections.abc import Iterable

from hsdsl.base.parts import layout_of
from hsdsl.engine.simulate import Problem
from hsdsl.export.c.text import array, string
from hsdsl.mathematics.program import ModeProgram, Program

STRINGS = "const char *const"


def names_text(problem: Problem, title: str) -> str:
    """The definitions of ``problem_name``, ``problem_state`` and the others."""
    program, settings = problem.program, problem.settings
    assert settings.method is not None
    modes = range(len(program.modes))
    parts = [_mode(k, mode) for k, mode in enumerate(program.modes)]
    for kind, pointer in (("state", STRINGS), ("edge", STRINGS), ("edge_state", f"{STRINGS} *const")):
        parts.append(array(f"{pointer} *const", f"problem_{kind}", (f"{kind}s_{k}" for k in modes)))
    for kind, text in (("name", title), ("scheme", settings.scheme), ("method_name", settings.method.name)):
        parts.append(f"const char problem_{kind}[] = {string(text)};\n")
    parts.append(_strings("problem_mode_name", program.mode_names))
    parts.append(_strings("problem_start_state", problem.states))
    parts.append(_strings("problem_parameter", program.parameters))
    parts.append(_strings("problem_output", program.outputs))
    return "".join([*parts, *_parts(program)])


def _parts(program: Program) -> Iterable[str]:
    """The parts of a system, and what their modes have."""
    parts = program.parts
    layout = layout_of(parts, program.modes[0].states)
    yield array("const int", "problem_part_number", map(str, layout.numbers))
    yield array("const int", "problem_owner", map(str, layout.owners))
    yield _strings("problem_part", (part.name for part in parts))
    kinds = {part.modes: f"part_modes_{k}" for k, part in enumerate(parts)}
    for modes, name in kinds.items():
        yield _strings(name, modes, "static ")
    yield array(f"{STRINGS} *const", "problem_part_mode", (kinds[part.modes] for part in parts))
    yield _strings("problem_owned", layout.owned)


def _mode(k: int, mode: ModeProgram) -> str:
    """The names of a mode's states and edges, and of the states that each edge leads to."""
    targets = [_strings(f"target_{k}_{i}", e.target_states, "static ") for i, e in enumerate(mode.edges)]
    return "".join(
        [
            _strings(f"states_{k}", mode.states, "static "),
            _strings(f"edges_{k}", (edge.name for edge in mode.edges), "static "),
            *targets,
            array(f"static {STRINGS} *const", f"edge_states_{k}", (f"target_{k}_{i}" for i in range(len(targets)))),
        ]
    )


def _strings(name: str, texts: Iterable[str], static: str = "") -> str:
    return array(f"{static}{STRINGS}", name, map(string, texts))
