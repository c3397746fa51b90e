"""Findings of rules, the first of each kind of alike ones, and edits that remedy them; comments and layout stay."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from hsdsl.base.errors import Decided, Edit, Severity, Span
from hsdsl.language.source import Mapping, Node, SourceRange


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


def without_entry(mapping: Node | None, name: str) -> tuple[Edit, ...]:
    """The edit that removes an entry of a mapping; none where that cannot be done safely."""
    if not isinstance(mapping, Mapping) or name not in mapping.entries:
        return ()
    ranges = [(key.place.start[0], _end(value, key.place)) for key, value in mapping]
    index, content = list(mapping.entries).index(name), mapping.place.text.content
    if content[mapping.place.start[0]] != "{":
        return _from_block(content, ranges, index)
    start, end = ranges[index]
    if index + 1 < len(ranges):
        return (Edit(start, ranges[index + 1][0]),)
    return (Edit(ranges[index - 1][1] if index else start, end),)


def _end(value: Node, key: SourceRange) -> int:
    """After the value; a value that is left out ends with the colon of its key."""
    if value.place.end[0] > value.place.start[0]:
        return _trimmed(value.place.text.content, value.place.end[0])
    return key.text.content.index(":", key.end[0]) + 1


def _trimmed(content: str, end: int) -> int:
    """YAML ends a block where the next thing begins, after blanks and comments: go back to its last line of content."""
    while True:
        end = len(content[:end].rstrip())
        line = content.rfind("\n", 0, end) + 1
        if not content[line:end].lstrip().startswith("#"):
            return end
        end = line


def _from_block(content: str, ranges: Sequence[tuple[int, int]], index: int) -> tuple[Edit, ...]:
    start, end = ranges[index]
    if "#" in content[start:end]:
        return ()  # a comment within would go too
    line = content.rfind("\n", 0, start) + 1
    after = content.find("\n", end)
    rest = content[end : after if after >= 0 else len(content)]
    if content[line:start].strip():  # the first key of a list item, after its dash
        follows = index + 1 < len(ranges) and not rest.strip()
        return (
            (Edit(start, ranges[index + 1][0]),) if follows and "#" not in content[end : ranges[index + 1][0]] else ()
        )
    if rest.strip():  # a comment stays, in a line of its own
        return (Edit(start, end + len(rest) - len(rest.lstrip())),)
    return (Edit(line, after + 1 if after >= 0 else len(content)),)
