"""What hsdsl makes of an exported run: its first transitions, for the test in the crate."""

from __future__ import annotations

from dataclasses import replace

from hsdsl.backends.c.source import width
from hsdsl.export.rust.language import array, literal, string
from hsdsl.export.source import Source
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
    modes = [mode.name for mode in program.modes]
    rows: list[str] = []
    for made in run.transitions:
        mode = modes.index(made.source)
        edges = program.modes[mode].edges
        edge = next(k for k, e in enumerate(edges) if e.name == made.edge)
        after = [0.0] * width(program)
        for i, value in enumerate((made.after or {}).values()):
            after[i] = float(value)
        resumed = float("nan") if made.resumed is None else float(made.resumed)
        entry = "true" if made.entry else "false"
        states = array(map(literal, after))
        rows.append(f"    ({literal(float(made.time))}, {literal(resumed)}, {mode}, {edge}, {entry}, {states}),\n")
    reason = "".join(word.title() for word in run.stop.reason.split("_"))
    comments = "".join(f"// {line}\n" for line in source.heading)
    return (
        f"{comments}use hybrid::model::W;\n\n/// Time, when flow went on, mode, edge, on entry, state behind it.\n"
        "pub type Expected = (f64, f64, usize, usize, bool, [f64; W]);\n\n"
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
