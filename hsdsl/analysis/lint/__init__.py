"""Findings in legal models: probable mistakes (warnings), and remarks (notes).

`lint` reads a model, applies every rule of `rules` in the `selection` to it as a `subject`, and leaves out what
comments in the file ask to ignore. A rule gives a `finding`, which `fix` corrects in the file.

Rules decide by `hsdsl.mathematics.decisions` for all states and by `Subject.numbers` at one. They read
`source_expressions` as they are written, and `units`. In a system of parts `parts` applies them to each automaton.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from typing import NamedTuple

from hsdsl.analysis.lint.finding import Finding
from hsdsl.analysis.lint.parts import OF_UNITS, automata_of, findings_of_parts
from hsdsl.analysis.lint.rules import RULES
from hsdsl.analysis.lint.selection import Ignored, configured, selected, sift
from hsdsl.analysis.lint.subject import Subject
from hsdsl.base import limits
from hsdsl.base.errors import Diagnostic
from hsdsl.language.elaborate import elaborate_files
from hsdsl.language.expression.timebox import PARTS, OutOfTime, deep_stack, timebox
from hsdsl.language.files import ModelFiles
from hsdsl.language.system import HybridSystem

UNDECIDED = "HS492"
_LEAST_SECONDS = 0.01  # for a rule, also where the others have used up the time of all

__all__ = ["RULES", "Finding", "Ignored", "Report", "Subject", "configured", "lint", "selected"]


class Report(NamedTuple):
    """What was found in one model, in source order, and what its comments ask to ignore."""

    system: HybridSystem
    findings: tuple[Diagnostic, ...]
    ignored: tuple[Ignored, ...]


def lint(path: str | os.PathLike[str], selection: Sequence[str] | None = None, *, text: bytes | None = None) -> Report:
    """Let rules look at a model.

    Parameters
    ----------
    path : path
        The model file.
    selection : codes, optional
        Those of the rules to use, see `selected`; all unless given.
    text : bytes, optional
        The file's content, where it is not to be read from ``path``.

    Raises ModelError: the model has errors; rules look only at models without.
    Raises UsageError: the file cannot be read.
    """
    subject = Subject(elaborate_files(ModelFiles.read(path, text=text)))
    codes = selected() if selection is None else selection
    seconds = limits.current().seconds
    end = time.process_time() + seconds / 2
    found: list[Diagnostic] = []
    if subject.system.parts:
        found += [_diagnostic(subject, code, finding) for code, finding in findings_of_parts(subject, codes)]
        looks = [(subject, code) for code in codes if code in OF_UNITS]
        looks += [(part, code) for part in automata_of(subject) for code in codes if code in part.codes]
    else:
        looks = [(subject, code) for code in codes]
    places = set[tuple[object, ...]]()
    with deep_stack():
        for looked_at, code in looks:
            made = _findings(looked_at, code, min(seconds / PARTS, end - time.process_time()))
            found += [one for one in made if _place(one) not in places]
            places |= set(map(_place, made))  # what several instances of an automaton have is one finding
    findings, ignored = sift(subject, found, codes)
    return Report(subject.system, findings, ignored)


def _place(found: Diagnostic) -> tuple[object, ...]:
    return found.code, found.span, found.message if found.code == UNDECIDED else ""


def _findings(subject: Subject, code: str, seconds: float) -> list[Diagnostic]:
    """What one rule finds in some processor time, and a note where it does not finish."""
    check = RULES[code].check
    found: dict[Finding, None] = {}
    problem = None
    try:
        with timebox(max(seconds, _LEAST_SECONDS)):
            for finding in check(subject) if check else ():
                found[finding] = None
    except OutOfTime:
        problem = "takes too long"
    except Exception as error:  # SymPy may raise anything on a rare expression: the other rules go on
        problem = f"raised {type(error).__name__}"
    diagnostics = [_diagnostic(subject, code, finding) for finding in found]
    if problem:
        message = f"{code} ({RULES[code].name}) is undecided for this model: the rule {problem}"
        diagnostics.append(_diagnostic(subject, UNDECIDED, Finding(subject.root.place.span, message)))
    return diagnostics


def _diagnostic(subject: Subject, code: str, f: Finding) -> Diagnostic:
    line = subject.reading.text.lines[f.span.line - 1] if f.span.path == subject.system.path else None
    return Diagnostic(code, f.message, f.span, f.hint, line, f.severity or RULES[code].severity, f.decided, f.fix)
