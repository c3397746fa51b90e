"""Diagnostics with a place, and the exceptions that carry them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Severity = Literal["error", "warning", "note"]
Decided = Literal["symbolic", "interval", "sampled"]


@dataclass(frozen=True, order=True)
class Span:
    """A place in a text.

    Attributes
    ----------
    path : str
        The file.
    line, column : int
        From 1.
    length : int
        The number of characters.
    """

    path: str
    line: int
    column: int
    length: int = 1


@dataclass(frozen=True, order=True)
class Edit:
    """A change of a text: ``replacement`` replaces the characters from ``start`` to ``end``."""

    start: int
    end: int
    replacement: str = ""


@dataclass(frozen=True)
class Diagnostic:
    """One error in a model, or one finding about it.

    Attributes
    ----------
    code : str
        The code of an error (:data:`CODES`) or of a lint rule; `hsdsl explain CODE` prints its page.
    message : str
        One sentence.
    span : Span or None
        Its place; None if no single place is at fault.
    hint : str or None
        The right form, if it is known.
    text : str or None
        The line of the file.
    severity : {"error", "warning", "note"}
        An error makes the model unusable; warnings and notes come from lint rules.
    decided : {"symbolic", "interval", "sampled"} or None
        The kind of proof of a finding.
    fix : tuple of Edit
        Edits that remedy the finding and keep the model's meaning.
    """

    code: str
    message: str
    span: Span | None = None
    hint: str | None = None
    text: str | None = field(default=None, compare=False)
    severity: Severity = "error"
    decided: Decided | None = None
    fix: tuple[Edit, ...] = ()

    def __post_init__(self) -> None:
        if self.severity == "error" and self.code not in CODES:
            raise ValueError(f"unregistered diagnostic code {self.code}")

    def __str__(self) -> str:
        """``path:line:column: error HS012: sentence``."""
        where = f"{self.span.path}:{self.span.line}:{self.span.column}: " if self.span else ""
        return f"{where}{self.severity} {self.code}: {self.message}"


class ModelError(Exception):
    """The model has errors (exit code 1).

    Attributes
    ----------
    diagnostics : tuple of Diagnostic
        All of them, in source order.
    """

    def __init__(self, diagnostics: list[Diagnostic] | tuple[Diagnostic, ...]) -> None:
        self.diagnostics = tuple(diagnostics)
        super().__init__(self.diagnostics)  # its arguments when it is unpickled in another process

    def __str__(self) -> str:
        return "\n".join(f"{d}" + (f" ({d.hint})" if d.hint else "") for d in self.diagnostics)


class UsageError(Exception):
    """The request is wrong, or a file cannot be read (exit code 2). The message is a sentence for a person.

    Attributes
    ----------
    hint : str or None
        What to write instead, if it is known.
    """

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__(message)
        self.hint = hint
        if hint is not None:
            self.add_note(f"hint: {hint}")


MOST_DIAGNOSTICS = 500


@dataclass
class Findings:
    """The diagnostics of one file, gathered so that all are reported, not only the first."""

    path: str = ""
    diagnostics: dict[Diagnostic, None] = field(default_factory=dict[Diagnostic, None])

    def add(self, diagnostic: Diagnostic) -> None:
        """Keep a diagnostic, once.

        Raises ModelError: when there are :data:`MOST_DIAGNOSTICS`: nobody reads on.
        """
        self.diagnostics[diagnostic] = None
        if len(self.diagnostics) >= MOST_DIAGNOSTICS:
            self.raise_if_any()

    def raise_if_any(self) -> None:
        """Raise all diagnostics so far, in source order, other files last.

        Raises ModelError: when there is at least one diagnostic.
        """
        if self.diagnostics:
            raise ModelError(sorted(self.diagnostics, key=self._source_order))

    def _source_order(self, diagnostic: Diagnostic) -> tuple[bool, str, int, int]:
        span = diagnostic.span
        return (span.path != self.path, span.path, span.line, span.column) if span else (False, "", 0, 0)


# One line a code: what the code is about. The codes are stable; a retired one is never used again.
# Each has a page in hsdsl/analysis/lint/errors.md: a text, and most often a wrong and a right example.
CODES: dict[str, str] = {
    # the file and its YAML
    "HS001": "the file is not UTF-8 text",
    "HS002": "a character that does not belong in a model",
    "HS003": "the file is too large",
    "HS004": "the file is not valid YAML",
    "HS005": "a tab where YAML wants spaces",
    "HS006": "the indentation fits no line above",
    "HS007": "YAML reads this expression as something else: it needs quotes",
    "HS008": "the same key twice in one mapping",
    "HS009": "a tag, which models do not use",
    "HS010": "more than one document in the file",
    "HS011": "the file is empty",
    "HS012": "an alias inside its own anchor",
    "HS013": "a key that is not a plain word",
    "HS014": "mappings and lists nested too deep",
    "HS015": "too many values, once aliases are expanded",
    "HS016": "too many entries in one mapping",
    # expressions
    "HS101": "a character that expressions do not have",
    "HS102": "an expression that ends or goes on where it should not",
    "HS103": "parentheses that do not match",
    "HS104": "an operator is missing between two operands",
    "HS105": "a number that cannot be read",
    "HS106": "`^` where `**` is meant",
    "HS107": "an equality in place of an inequality",
    "HS108": "a logical operator of another language",
    "HS109": "a construct of another language",
    "HS110": "an expression that is too long",
    "HS111": "a name that nothing defines",
    "HS112": "a function that does not exist, or a function without its parentheses",
    "HS113": "a function with the wrong number of arguments",
    "HS114": "a condition in place of a number",
    "HS115": "a number in place of a condition",
    "HS116": "not exactly one inequality",
    "HS117": "a name that cannot be used here",
    "HS118": "a constant without a finite real value",
    "HS119": "a numeric exponent above 1,000",
    "HS120": "an expression that grows too large once names are replaced",
    "HS121": "a missing expression",
    "HS122": "symbolic work that takes too long",
    "HS123": "parentheses that are nested too deep",
    "HS124": "a whole number that is too large, or a number with too many digits",
    # the shape of the document
    "HS201": "a key that does not exist here",
    "HS202": "a key that is missing",
    "HS203": "a mapping, a list or a single value in place of another",
    "HS204": "a value that is not one of those possible",
    "HS205": "a name that cannot be a name",
    "HS206": "a version of the language that is not known",
    # the meaning
    "HS301": "two things with one name",
    "HS302": "a definition that uses itself or a later one",
    "HS303": "a mode that does not exist",
    "HS304": "a mode without a flow",
    "HS305": "a transition that leaves a state of its target without a value",
    "HS306": "a reset of a state that the target does not have",
    "HS307": "two transitions of one mode with one name",
    "HS308": "initial values that are not those of the initial mode's states",
    "HS309": "a parameter outside its own bounds",
    "HS310": "samples that do not make an input",
    "HS311": "a data file that cannot be read",
    "HS312": "a data file with wrong content",
    "HS313": "a unit for something that does not exist",
    "HS314": "a reference to something that does not exist",
    "HS315": "a transition, a domain or an output in a mode that has no states of its own",
    "HS316": "two units for one name",
    "HS317": "a data file outside the model's folder",
    "HS320": "both a step and a tolerance",
    "HS321": "a setting outside its range",
    "HS322": "a scale of a name that is not a state",
    "HS323": "an event that cannot be one",
    "HS325": "equations that do not give the unknowns of `solve`",
    # systems of parts
    "HS350": "an instance or an automaton that does not exist",
    "HS351": "an input or a parameter of an instance that does not fit its automaton",
    "HS352": "definitions of parts that need each other in a circle",
    "HS353": "a part whose transitions cannot be what is written",
    "HS354": "a name that a mode of a part does not define",
    # what is imported
    "HS331": "a file to import that is no model of SpaceEx or SBML",
    "HS332": "a part of a SpaceEx model that no model of this language can keep",
    "HS333": "a configuration of SpaceEx that does not say where a run starts",
    "HS334": "a part of an SBML model that no model of this language can keep",
    # what is exported
    "HS341": "a model that needs a rule which the target of an export lacks",
}

# One line a code of the warnings of runs, as for errors. Their pages are in hsdsl/analysis/lint/warnings.md.
WARNINGS: dict[str, str] = {
    "HS701": "a surface that was passed while the `if` of its transition was false",
    "HS702": "a wall that the run did not check",
    "HS703": "motion along a guard, or rest on it, that goes on where transitions accumulate",
    "HS704": "transitions that accumulate, replaced by their limit",
    "HS705": "sliding on the surface between two modes",
    "HS706": "transitions that crowd together, and wait in strips",
    "HS707": "an assumption of the model, such as one that an import made",
}

TOO_LONG = "HS122"
STEP_AND_TOLERANCE = "HS320"  # wrong usage rather than a wrong model: the command line exits with 2
