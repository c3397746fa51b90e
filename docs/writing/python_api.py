"""The reference of the Python interface, from signatures and docstrings."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pkgutil import resolve_name
from typing import Any

from writing.markdown import code, table

HEAD = """# Python

`import hsdsl` provides the functions and classes on this page, or its functions return them. Two lines run a model
file: see the [tutorial](../tutorial.md#from-python). [Many runs](../how-to/many-and-long.md),
[derivatives](../how-to/sensitivities.md), [orbits](../how-to/orbits.md) and [fits](../how-to/fitting.md) have their own
pages.

Times and states are in the units of the model, and hsdsl converts nothing. You can write a number as an expression of
the model's parameters, such as `"40*pi"`. A model with errors raises [`ModelError`](#hsdslmodelerror), and a wrong
request raises [`UsageError`](#hsdslusageerror). Their messages are those of the command line.

"""
RUN = "hsdsl.engine.execution.records."
# heading: names, each with its members where it is a class
SECTIONS: dict[str, tuple[tuple[str, str], ...]] = {
    "Load a model": (("hsdsl.load", ""), ("hsdsl.loads", ""), ("hsdsl.Limits", "")),
    "Model": (
        (
            "hsdsl.Model",
            "simulate with_outputs ensemble sweep stream sensitivity fit orbit continuation orbital_stability distance "
            "estimate plot animate only completed sliding columns system program resolve",
        ),
    ),
    "Execution": (
        (
            "hsdsl.Execution",
            "__call__ sample rows to_pandas plot save sensitivity estimated finer made shown time_span states"
            " sample_times",
        ),
        *((RUN + name, "") for name in ("Transition", "Stop", "Verdict", "Point", "Arc")),
        ("hsdsl.engine.execution.records.Samples", "only columns to_pandas names labels"),
        ("hsdsl.interface.model.estimate.Estimate", "*"),
        ("hsdsl.interface.model.stream.Streamed", ""),
        ("hsdsl.store.load", ""),
        ("hsdsl.store.read_sidecar", ""),
    ),
    "Ensemble": (
        ("hsdsl.engine.execution.ensemble.Ensemble", "reasons failed failures run plot to_pandas"),
        ("hsdsl.engine.execution.ensemble.TransitionTable", ""),
        ("hsdsl.engine.execution.ensemble.Failure", ""),
    ),
    "Sweep": (
        ("hsdsl.sweep.load", ""),
        ("hsdsl.sweep.Sweep", "rows done complete columns reasons batches table to_pandas plot summary"),
    ),
    "Derivatives, orbits, fits": (
        ("hsdsl.analysis.sensitivity.result.Sensitivity", "*"),
        *(
            (f"hsdsl.analysis.sensitivity.result.{name}", "")
            for name in ("TransitionSlopes", "EndSlopes", "SampleSlopes")
        ),
        ("hsdsl.analysis.sensitivity.ties.Tie", ""),
        ("hsdsl.analysis.fitting.fit.Fit", "*"),
        ("hsdsl.analysis.orbits.orbit.Orbit", "*"),
        ("hsdsl.analysis.orbits.continuation.Branch", "*"),
        ("hsdsl.analysis.orbits.continuation.Bifurcation", ""),
        ("hsdsl.analysis.orbits.sampling.OrbitalStability", "*"),
    ),
    "Distances": (
        ("hsdsl.distance", ""),
        ("hsdsl.interface.model.distances.distance_of_runs", ""),
        ("hsdsl.analysis.metrics.interval.Interval", "width middle"),
        ("hsdsl.analysis.metrics.points.PointDistance", "status sentence"),
        ("hsdsl.analysis.metrics.points.PathPiece", ""),
        ("hsdsl.analysis.metrics.points.SpacePoint", ""),
        ("hsdsl.exact.reference", ""),
    ),
    "Plug-ins": (("hsdsl.register", ""),),
    "Errors": (
        ("hsdsl.ModelError", ""),
        ("hsdsl.base.errors.Diagnostic", ""),
        ("hsdsl.base.errors.Span", ""),
        ("hsdsl.UsageError", ""),
    ),
}
MADE = ("hsdsl.Limits", "hsdsl.analysis.metrics.points.SpacePoint")  # classes that readers make themselves
_ROLE = re.compile(r":(?:attr|class|data|func|meth|mod):`~?\.?([^`]+)`")
_ERROR = re.compile(r"^Raises (\w+): ", re.MULTILINE)
_ERRORS = re.compile(r"^Raises \w+: .+?(?=\n\n|\Z)", re.MULTILINE | re.DOTALL)
_SECTION = re.compile(r"^([A-Z][a-z]+)\n-+\n", re.MULTILINE)
_WIDE = 100


def python_api() -> str:
    """Document every public name."""
    parts = [HEAD]
    for heading, names in SECTIONS.items():
        parts.append(f"## {heading}\n\n")
        for name, members in names:
            parts += _entry(name, resolve_name(name), members)
    return "".join(parts)


def _entry(name: str, thing: Any, members: str) -> Iterator[str]:
    """One function, or a class with its members."""
    yield f"### {name}\n\n"
    if not inspect.isclass(thing):
        yield _signature(name.rpartition(".")[2], thing)
        yield _described(thing)
        return
    if name in MADE:
        yield _signature(thing.__name__, thing)
    yield _described(thing)
    own = [key for key, value in vars(thing).items() if not key.startswith("_") and _is_member(value)]
    for member in own if members == "*" else members.split():
        value = inspect.getattr_static(thing, member)
        value = getattr(value, "__func__", value)
        yield f"#### {thing.__name__}.{member}\n\n"
        getter = getattr(value, "fget", None) or getattr(value, "func", None)
        if getter is None:
            yield _signature("run" if member == "__call__" else member, value)
        else:
            yield f"Property: {code(str(inspect.signature(getter).return_annotation))}.\n\n"
        yield _described(getter or value)


def _is_member(value: Any) -> bool:
    return bool(inspect.getdoc(value)) and (
        inspect.isfunction(value) or isinstance(value, (property, classmethod, staticmethod)) or hasattr(value, "func")
    )


def _signature(name: str, function: Any) -> str:
    """A call with its arguments, their types and defaults."""
    signature = inspect.signature(function)
    parts, starred = list[str](), False
    for parameter in signature.parameters.values():
        if parameter.name in ("self", "cls"):
            continue
        star = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "")
        if parameter.kind is parameter.KEYWORD_ONLY and not starred:
            parts.append("*")
        starred = starred or star == "*" or parameter.kind is parameter.KEYWORD_ONLY
        kind = "" if parameter.annotation is parameter.empty else f": {_annotation(parameter.annotation)}"
        default = "" if parameter.default is parameter.empty else f" = {parameter.default!r}"
        parts.append(f"{star}{parameter.name}{kind}{default if kind else default.replace(' ', '')}")
    back = "" if signature.return_annotation is signature.empty else f" -> {_annotation(signature.return_annotation)}"
    line = f"{name}({', '.join(parts)}){back}"
    if len(line) > _WIDE:
        line = f"{name}(\n" + "".join(f"    {part},\n" for part in parts) + f"){back}"
    return f"```py\n{line}\n```\n\n"


def _annotation(kind: Any) -> str:
    return kind if isinstance(kind, str) else getattr(kind, "__name__", str(kind))


def _described(thing: Any) -> str:
    """A docstring: its text, and a table for each of its sections."""
    text = _ERRORS.sub(_raises, _ROLE.sub(r"`\1`", inspect.getdoc(thing) or ""))
    body, *sections = _SECTION.split(text)
    parts = [_prose(body)]
    for heading, content in zip(sections[::2], sections[1::2], strict=True):
        parts.append(_section(heading, content))
    if is_dataclass(thing) and "Attributes" not in sections:
        rows = [(code(f.name), code(_annotation(f.type))) for f in fields(thing) if not f.name.startswith("_")]
        parts.append(table(("attribute", "type"), rows))
    return "".join(parts)


def _raises(found: re.Match[str]) -> str:
    """The sentences of errors as a section of them."""
    _, *parts = _ERROR.split(found[0])
    entries = (f"{name}\n    {' '.join(when.split())}\n" for name, when in zip(parts[::2], parts[1::2], strict=True))
    return "Raises\n------\n" + "".join(entries)


def _section(heading: str, content: str) -> str:
    if heading in ("Notes", "Examples", "See"):
        return f"**{heading}.** {_prose(content)}"
    rows, rest = list[list[str]](), ""
    lines = content.splitlines()
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if line.startswith(" ") and rows and not rest:
            rows[-1][2] += f" {line.strip()}"
        elif line and (" : " in line or below.startswith(" ")):
            name, _, kind = line.partition(" : ")
            rows.append([name, kind, ""])
        elif line or rest:  # a paragraph after the entries
            rest += f"{line}\n"
    head = {"Parameters": "parameter", "Attributes": "attribute"}.get(heading)
    if head is None:
        kinds = False
        columns = ("error", "when") if heading == "Raises" else (heading.lower(), "")
    else:
        kinds = any(kind for _, kind, _ in rows)
        columns = (head, "type", "meaning") if kinds else (head, "meaning")
    cells = [
        (code(name), *((code(kind) if kind else "",) if kinds else ()), about.strip()[:1].upper() + about.strip()[1:])
        for name, kind, about in rows
    ]
    return table(columns, cells) + (_prose(rest) if rest.strip() else "")


def _prose(text: str) -> str:
    """Paragraphs, literal blocks being code."""
    parts, code_next = list[str](), False
    for paragraph in re.split(r"\n\s*\n", inspect.cleandoc(text)):
        if code_next and paragraph.startswith(" "):
            parts.append(f"```text\n{inspect.cleandoc(paragraph)}\n```")
            continue
        code_next = paragraph.rstrip().endswith("::")
        parts.append(paragraph.rstrip().removesuffix("::") + (":" if code_next else "") if code_next else paragraph)
    return "\n\n".join(parts).strip() + "\n\n"
