"""A model as a crate for Rust without its standard library: routines generated, the relaxed loop by hand.

A test in the crate compares it with the transitions that hsdsl makes with the same settings.
"""

from __future__ import annotations

from pathlib import Path

from hsdsl.export.explicit import explicit
from hsdsl.export.identifiers import identifiers
from hsdsl.export.rust.expected import expected_text
from hsdsl.export.rust.model import fixed_parameters, model_text
from hsdsl.export.source import Source
from hsdsl.integrators import ButcherTableau

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
    size = f"step {settings.step}" if settings.tolerance is None else f"tolerance {settings.tolerance}"
    fixed = fixed_parameters(source.problem.program)
    kept = f"Fixed, since times of inputs depend on them:\n\n    {', '.join(fixed)}\n\n" if fixed else ""
    return (
        f"A hybrid system in Rust\n=======================\n\n{heading}\n"
        f"It runs the scheme relaxed with {table.name}, {size}, relaxation {settings.relaxation}.\n\n"
        "    cargo test                        compare with the transitions of hsdsl\n"
        "    cargo run --example transitions   print the transitions\n\n"
        "`hybrid::simulate` runs from parameters, settings, a mode and a state; a `Sink` takes rows and transitions.\n"
        "The crate is `no_std`, allocates nothing, and calls functions such as `sin` of the C library.\n"
        f"{kept}"
    )
