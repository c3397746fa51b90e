"""What hsdsl says when something is wrong: diagnostics with a place, and the exceptions that carry them."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, order=True)
class Span:
    """A place in a text: file, 1-based line and column, and how many characters it covers."""

    path: str
    line: int
    column: int
    length: int = 1


@dataclass(frozen=True)
class Diagnostic:
    """One error in a model.

    Attributes
    ----------
    code : str
        A stable code, a key of :data:`CODES`.
    message : str
        One sentence.
    span : Span or None
        Where; None when no single place is to blame.
    hint : str or None
        What to write instead, when that is known.
    text : str or None
        The source line that ``span`` points into, for the caret.
    """

    code: str
    message: str
    span: Span | None = None
    hint: str | None = None
    text: str | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if self.code not in CODES:
            raise ValueError(f"unregistered diagnostic code {self.code}")


class ModelError(Exception):
    """The model has errors (exit code 1). Carries every diagnostic found, in source order."""

    def __init__(self, diagnostics: list[Diagnostic] | tuple[Diagnostic, ...]) -> None:
        self.diagnostics = tuple(diagnostics)
        super().__init__("\n".join(f"{d.code}: {d.message}" for d in self.diagnostics))


class UsageError(Exception):
    """The request is wrong, or a file cannot be read (exit code 2). The message is one sentence for a person."""

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__(message)
        self.hint = hint


# One line a code: what the code is about. The codes are stable; a retired one is never used again.
CODES: dict[str, str] = {}
