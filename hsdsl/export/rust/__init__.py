"""A model as a crate for Rust without its standard library: the program in C that `export.c` writes, and a safe API.

A test in the crate compares it with the transitions that hsdsl makes with the same settings.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from hsdsl.engine.runtime.compiler import NoCompiler
from hsdsl.engine.runtime.kernel import CompiledModel, runtime
from hsdsl.engine.simulate import prepare
from hsdsl.export.c.sources import EXACT_FLAGS, c_sources
from hsdsl.export.rust.model import literal, model_text, string
from hsdsl.export.source import Source, filled, identifiers, structural

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
