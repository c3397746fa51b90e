"""A model as a crate for Rust without its standard library: routines generated, the relaxed loop by hand.

A test in the crate compares it with the transitions that hsdsl makes with the same settings.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from hsdsl.backends.c.source import width
from hsdsl.export.explicit import explicit
from hsdsl.export.identifiers import identifiers
from hsdsl.export.parameters import structural
from hsdsl.export.rust.language import array, literal, string
from hsdsl.export.rust.model import model_text
from hsdsl.export.source import Source
from hsdsl.integrators import ButcherTableau
from hsdsl.runtime.compiler import NoCompiler
from hsdsl.runtime.kernel import CompiledModel, runtime
from hsdsl.simulate import prepare

MOST = 100  # transitions; of longer runs these are enough


def expected_text(source: Source) -> str:
    """The text of ``tests/expected/mod.rs``."""
    problem, settings = source.problem, source.problem.settings
    program = problem.program
    most = min(MOST, settings.max_transitions)
    limited = problem.with_settings(replace(settings, max_transitions=most))
    run = prepare(limited, _compiled(source)).simulate()
    modes = program.mode_names
    rows: list[str] = []
    for made in run.transitions:
        mode = modes.index(made.source)
        after = [0.0] * width(program)
        for i, value in enumerate((made.after or {}).values()):
            after[i] = float(value)
        resumed = float("nan") if made.resumed is None else float(made.resumed)
        entry = "true" if made.entry else "false"
        states = array(map(literal, after))
        edge = string(made.edge)  # an event is several edges of its name
        rows.append(f"    ({literal(float(made.time))}, {literal(resumed)}, {mode}, {edge}, {entry}, {states}),\n")
    reason = "".join(word.title() for word in run.stop.reason.split("_"))
    comments = "".join(f"// {line}\n" for line in source.heading)
    return (
        f"{comments}use hybrid::model::W;\n\n/// Time, when flow went on, mode, edge, on entry, state behind it.\n"
        "pub type Expected = (f64, f64, usize, &'static str, bool, [f64; W]);\n\n"
        f"pub const MOST: usize = {most};\npub const REASON: &str = {string(reason)};\n"
        f"pub const END: f64 = {literal(float(run.stop.time))};\n"
        f"pub static TRANSITIONS: &[Expected] = &[\n{''.join(rows)}];\n"
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

    Raises UsageError: a method that it cannot keep.
    """
    source, table = explicit(source, "rust", "relaxed")
    name = identifiers([source.name.lower()], RESERVED)[source.name.lower()]
    parts = sorted(path for path in CRATE.rglob("*.rs"))
    texts = {path.relative_to(CRATE).as_posix(): path.read_text(encoding="utf-8") for path in parts}
    texts["Cargo.toml"] = _manifest(source, name)
    texts["README.md"] = _readme(source, table)
    texts["src/model.rs"] = model_text(source, table)
    texts["tests/expected/mod.rs"] = expected_text(source)
    return {name: texts[name].encode() for name in sorted(texts)}


def _manifest(source: Source, name: str) -> str:
    comments = "".join(f"# {line}\n" for line in source.heading)
    return (
        f'{comments}\n[package]\nname = "{name}"\nversion = "0.1.0"\nedition = "2018"\nrust-version = "1.56"\n'
        'publish = false\n\n[lib]\nname = "hybrid"\n\n[workspace]\n'
    )


def _readme(source: Source, table: ButcherTableau) -> str:
    settings = source.problem.settings
    heading = "".join(f"    {line}\n" for line in source.heading)
    decide = structural(source.problem)
    fixed = ", ".join(name for name in source.problem.program.parameters if name in decide)
    kept = f"Fixed, since times of inputs depend on them:\n\n    {fixed}\n\n" if fixed else ""
    return (
        f"A hybrid system in Rust\n=======================\n\n{heading}\n"
        f"It runs the scheme relaxed with {table.name}, {source.size}, relaxation {settings.relaxation}.\n\n"
        "    cargo test                        compare with the transitions of hsdsl\n"
        "    cargo run --example transitions   print the transitions\n\n"
        "`hybrid::simulate` runs from parameters, settings, a mode and a state; a `Sink` takes rows and transitions.\n"
        "The crate is `no_std`, allocates nothing, and calls functions such as `sin` of the C library.\n"
        f"{kept}"
    )
