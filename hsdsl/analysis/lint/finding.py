"""Findings of rules, and the first of each kind of alike ones."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field, replace

from hsdsl.base.errors import Decided, Edit, Severity, Span


@dataclass(frozen=True)
class Finding:
    """One finding of a rule: the smallest part of the file that has to change, one sentence, and what to write.

    It is decided for all values (``symbolic``), by bounds over boxes (``interval``) or at points (``sampled``). The
    ``fix`` remedies it and keeps the meaning of the model. A ``severity`` takes the place of the rule's.
    """

    span: Span
    message: str
    hint: str | None = None
    decided: Decided = "symbolic"
    fix: tuple[Edit, ...] = ()
    severity: Severity | None = None


@dataclass
class Alike:
    """The first finding of each kind, with the number of others: a large model repeats itself.

    ``shared`` names what the others have in common, where the whole finding is not known of them.
    """

    noun: str
    shared: str = "like it"
    _kinds: dict[Hashable, tuple[Finding, int]] = field(default_factory=dict[Hashable, tuple[Finding, int]])

    def again(self, kind: Hashable) -> bool:
        """Count one more of a known kind; False where the kind is new."""
        if kind not in self._kinds:
            return False
        finding, count = self._kinds[kind]
        self._kinds[kind] = finding, count + 1
        return True

    def add(self, kind: Hashable, finding: Finding) -> None:
        """Keep a finding of a new kind, or count it."""
        if not self.again(kind):
            self._kinds[kind] = finding, 0

    def __iter__(self) -> Iterator[Finding]:
        for finding, count in self._kinds.values():
            more = f"; {count:,} more {self.noun}{'s' * (count > 1)} {self.shared}" if count else ""
            yield replace(finding, message=finding.message + more)
