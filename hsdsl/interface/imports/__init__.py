"""Models of other tools as model files of ours: `sbml`, `spaceex`."""

from __future__ import annotations

from hsdsl.base.errors import UsageError
from hsdsl.base.names import shown
from hsdsl.language.expression.parse import ExpressionError
from hsdsl.language.expression.plain import value


def end_of_run(text: str | None, hint: str) -> str:
    """The end of an imported run, as it is given.

    Raises UsageError: there is none, or it is no number from 0 on.
    """
    if not text:
        raise UsageError("the end of the run is not given", hint)
    try:
        if not bool(value(text) >= 0):
            raise UsageError(f"the end of the run must not be negative, got {shown(text, 40)}")
    except (ExpressionError, TypeError) as error:
        raise UsageError(f"the end of the run: expected a number, got '{shown(text, 40)}'") from error
    return text
