"""Findings that are the same in many places of a model, told once."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field, replace

from hsdsl.lint.finding import Finding


@dataclass
class Repeats:
    """Keeps the first finding of each kind, and counts the others.

    A large model repeats itself: what is said of one guard among a thousand like it is said once, with their number.
    ``alike`` says what the others share, where the whole finding is not known of them.
    """

    noun: str
    alike: str = "like it"
    _found: dict[Hashable, tuple[Finding, int]] = field(default_factory=dict[Hashable, tuple[Finding, int]])

    def again(self, kind: Hashable) -> bool:
        """Count one more of a kind that was found; False where it was not."""
        if kind not in self._found:
            return False
        finding, count = self._found[kind]
        self._found[kind] = finding, count + 1
        return True

    def add(self, kind: Hashable, finding: Finding) -> None:
        """Keep a finding, or count it where its kind is known."""
        if not self.again(kind):
            self._found[kind] = finding, 0

    def __iter__(self) -> Iterator[Finding]:
        for finding, count in self._found.values():
            more = f"; {count:,} more {self.noun}{'s' * (count > 1)} {self.alike}" if count else ""
            yield replace(finding, message=finding.message + more)
