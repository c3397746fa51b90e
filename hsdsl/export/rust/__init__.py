"""A model as a crate for Rust without its standard library: the program in C that `export.c` writes, and a safe API.

The generated module `model.rs` has sizes, names and settings. A test in the crate compares it with the transitions that
hsdsl makes with the same settings.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.base.parts import layout_of
from hsdsl.engine.backends.c.source import width
from hsdsl.engine.backends.printer import number_text
from hsdsl.engine.runtime.compiler import NoCompiler
from hsdsl.engine.runtime.kernel import CompiledModel, runtime
from hsdsl.engine.runtime.structures import method_table
from hsdsl.engine.simulate import Problem, prepare
from hsdsl.engine.simulate.control import make_control
from hsdsl.export.c import EXACT_FLAGS, c_sources
from hsdsl.export.source import Source, filled, identifiers, structural
from hsdsl.mathematics.program import ModeProgram, Program

MOST = 100  # transitions; of longer runs these are enough


def expected_text(source: Source) -> str:
    """The text of ``tests/expected/mod.rs``."""
    problem, settings = source.problem, source.problem.settings
    most = min(MOST, settings.max_transitions)
    run = prepare(problem.with_settings(replace(settings, max_transitions=most)), _compiled(source)).simulate()
    rows = "".join(
        f"    ({literal(float(made.time))}, {literal(float('nan' if made.resumed is None else made.resumed))}, "
        f"{string(made.edge)}, {'true' if made.entry else 'false'}),\n"
        for made in run.transitions
    )
    return (
        f"{_comment('//', source)}\n/// Time, when flow went on, edge, on entry.\n"
        "pub type Expected = (f64, f64, &'static str, bool);\n\n"
        f"pub const MOST: u64 = {most};\npub const REASON: &str = {string(run.stop.reason)};\n"
        f"pub const END: f64 = {literal(float(run.stop.time))};\n"
        f"pub static TRANSITIONS: &[Expected] = &[\n{rows}];\n"
    )


def _compiled(source: Source) -> CompiledModel | None:
    """The compiled model, where there is a compiler: the loop in Python makes the same numbers, and takes longer."""
    try:
        compiled = CompiledModel(source.problem.program)
        runtime()
    except NoCompiler:
        return None
    return compiled


CRATE = Path(__file__).parent / "crate"
RESERVED = frozenset(
    """
    as async await box break const continue crate do dyn else enum extern false final fn for gen if impl in let loop
    macro match mod move mut override priv pub ref return self static struct super trait true try type typeof union
    unsafe unsized use virtual where while yield abstract become alloc core std proc_macro test hybrid
    """.split()  # noqa: SIM905
)


def files(source: Source) -> dict[str, bytes]:
    """All files of the crate.

    Raises UsageError: the C runtime has no such scheme.
    """
    name = identifiers([source.name.lower()], RESERVED)[source.name.lower()]
    parts = {path.relative_to(CRATE).as_posix(): path.read_text(encoding="utf-8") for path in CRATE.rglob("*.*")}
    c = {f"c/{path}": content.decode() for path, content in c_sources(source, True, "given.h").items()}
    own = f"{name}_{_digest(c)}"
    fixed = ", ".join(name for name in source.problem.program.parameters if name in structural(source.problem))
    settings = source.problem.settings
    assert settings.method is not None
    names = {
        "prefix": own,
        "exact": ",\n    ".join(f'"{flag}"' for flag in EXACT_FLAGS),
        "name": name,
        "comment": _comment("#", source),
        "heading": "".join(f"    {line}\n" for line in source.heading),
        "scheme": settings.scheme,
        "method": settings.method.name,
        "size": source.size,
        "kept": f"\nFixed, since times of inputs depend on them:\n\n    {fixed}\n" if fixed else "",
    }
    texts = {path: filled(text, **names) for path, text in parts.items()} | c
    runtime = {path: text for path, text in texts.items() if path.startswith("c/runtime/")}
    loop = _functions("HS_EXPORT [^;{]*?", (text for path, text in runtime.items() if path.endswith(".h")))
    instance = _functions("", [texts["c/instance.h"]])
    shim = _functions("", [texts["c/shim.c"]], "hybrid")
    problem = {"hs_the_model", "hybrid_words", *re.findall(r"\bproblem_\w+", texts["c/problem.h"])}
    named = {**dict.fromkeys(loop, f"hs_{_digest(runtime)}"), **dict.fromkeys(instance | shim | problem, own)}
    texts["c/prefix.h"] = "".join(f"#define {name} {prefix}_{name}\n" for name, prefix in sorted(named.items()))
    texts["src/model.rs"] = model_text(source)
    texts["tests/expected/mod.rs"] = expected_text(source)
    return {name: texts[name].encode() for name in sorted(texts)}


def _digest(texts: Mapping[str, str]) -> str:
    return hashlib.sha256("\0".join(texts.values()).encode()).hexdigest()[:16]


def _functions(before: str, texts: Iterable[str], family: str = "hs") -> set[str]:
    """The functions that begin lines of C, ``before`` between the type and the name."""
    pattern = re.compile(rf"^(?!static|typedef){before or '[a-z][^;(#=]*?'}[ *]({family}_\w+)\(", re.MULTILINE)
    return {name for text in texts for name in pattern.findall(text)}


def _comment(mark: str, source: Source) -> str:
    return "".join(f"{mark} {line}\n" for line in source.heading)


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
