"""The lint rules: one file each, whose docstring is the rule's page, in one dictionary."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import ModuleType
from typing import Literal

from hsdsl.lint.finding import Finding
from hsdsl.lint.rules import identity_reset, unknown_ignore, unreachable_mode, unused_ignore, unused_parameter
from hsdsl.lint.subject import Subject

FAMILIES = {
    "names": ("HS400", "HS419"),
    "shape": ("HS420", "HS439"),
    "scene": ("HS440", "HS459"),
    "experiment": ("HS460", "HS479"),
    "comments": ("HS490", "HS499"),
    "mathematics": ("HS500", "HS599"),
    "units": ("HS600", "HS699"),
}


@dataclass(frozen=True)
class Rule:
    """A rule: its module, and how much its findings weigh.

    A warning says that something is probably not what was meant; a note, that something is worth knowing. Both count.
    """

    module: ModuleType
    severity: Literal["warning", "note"] = "warning"

    @property
    def name(self) -> str:
        """What people call it."""
        return self.module.__name__.rpartition(".")[2].replace("_", "-")

    @property
    def page(self) -> str:
        """The rule's page, in Markdown; its first line is the title."""
        return (self.module.__doc__ or "").strip()

    @property
    def title(self) -> str:
        """What the rule finds, in one line."""
        return self.page.partition("\n")[0].rstrip(".")

    @property
    def check(self) -> Callable[[Subject], Iterable[Finding]] | None:
        """The rule itself; None for the rules about comments, which see what the others have found."""
        return getattr(self.module, "check", None)


def family(code: str) -> str:
    """The family that a code belongs to."""
    return next(name for name, (first, last) in FAMILIES.items() if first <= code <= last)


RULES: dict[str, Rule] = {
    # names
    "HS401": Rule(unused_parameter),
    "HS406": Rule(unreachable_mode),
    # shape
    "HS421": Rule(identity_reset),
    # comments
    "HS490": Rule(unused_ignore),
    "HS491": Rule(unknown_ignore),
}
