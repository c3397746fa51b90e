# pyright: basic
"""Conjunctions of SpaceEx cut into relations, with names of a model put in place of the file's own."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from hsdsl.base.errors import Diagnostic, ModelError
from hsdsl.base.names import shown
from hsdsl.language.expression.parse import ExpressionError, Name, parse, walk
from hsdsl.language.expression.plain import names_in, value
from hsdsl.language.source.xml import Passage

_AND = re.compile(r"&&?|\band\b")
_RELATION = re.compile(r":=|==|<=|>=|!=|<|>|=")
_EITHER = re.compile(r"\|\|?|\bor\b|!(?!=)|\bnot\b")
MIRRORED = {"<=": ">=", ">=": "<=", "<": ">", ">": "<", "==": "=="}


@dataclass(frozen=True)
class Relation:
    """``left operator right`` with its place: ``start`` to ``end`` of a passage; ``primed`` where left had a prime."""

    left: str
    operator: str
    right: str
    passage: Passage
    start: int
    end: int
    primed: bool = False

    def fault(self, message: str, hint: str | None = None, code: str = "HS332") -> Diagnostic:
        """A diagnostic about it."""
        return self.passage.fault(code, message, hint, self.start, self.end)

    def refusal(self, message: str, hint: str | None = None) -> ModelError:
        """The error that it cannot be kept."""
        return ModelError([self.fault(message, hint)])

    @property
    def text(self) -> str:
        """The relation as a model writes it."""
        return f"{self.left} {self.operator} {self.right}"

    @property
    def names(self) -> set[str]:
        """The names in it."""
        return {name for side in (self.left, self.right) for name in names_in(side)}

    def renamed(self, names: Mapping[str, str]) -> Relation:
        """The same with other names."""
        return replace(self, left=renamed(self.left, names), right=renamed(self.right, names))

    def mirrored(self) -> Relation:
        """The relation whose boundary is the same and which holds on its other side."""
        return replace(self, operator=MIRRORED[self.operator])

    @property
    def excess(self) -> Any:
        """The expression that is at most zero where it holds (for ``==``: zero), over plain symbols."""
        left, right = value(self.left), value(self.right)
        return right - left if self.operator in (">=", ">") else left - right


def relations(passage: Passage | None) -> list[Relation]:
    """The relations of a conjunction; none where it is empty or `true`.

    Raises ModelError: an alternative, a negation, or something that is no relation.
    """
    if passage is None or passage.text.strip() in ("", "true"):
        return []
    if either := _EITHER.search(passage.text):
        message = "alternatives and negations cannot be kept: a set here is a conjunction of inequalities"
        hint = "write a transition or a location for each alternative"
        raise ModelError([passage.fault("HS332", message, hint, either.start(), either.end())])
    found: list[Relation] = []
    start = 0
    for end, following in [*((m.start(), m.end()) for m in _AND.finditer(passage.text)), (len(passage.text), 0)]:
        found += _chain(passage, start, end)
        start = following
    return found


def _chain(passage: Passage, start: int, end: int) -> list[Relation]:
    """The relations of ``a <= b <= c``."""
    part = passage.text[start:end]
    start, end = start + len(part) - len(part.lstrip()), end - len(part) + len(part.rstrip())
    operators = list(_RELATION.finditer(passage.text, start, end))
    if passage.text[start:end] == "true":
        return []
    if not operators:
        message = f"expected a relation such as `x >= 1`, got `{shown(passage.text[start:end], 40)}`"
        raise ModelError([passage.fault("HS332", message, None, start, end)])
    cuts = [start, *(m.end() for m in operators)], [*(m.start() for m in operators), end]
    sides = [_side(passage, a, b) for a, b in zip(*cuts, strict=True)]
    found: list[Relation] = []
    for operator, (left, primed), (right, wrong) in zip(operators, sides, sides[1:], strict=False):
        sign = "==" if operator.group() == "=" else operator.group()
        if sign == "!=" or wrong:
            sentence = "a derivative belongs on the left-hand side" if wrong else "`!=` is no closed set"
            raise ModelError([passage.fault("HS332", sentence, None, start, end)])
        found.append(Relation(left, sign, right, passage, start, end, primed))
    return found


def _side(passage: Passage, start: int, end: int) -> tuple[str, bool]:
    """An expression as a model writes it, and whether it is a name with a prime."""
    raw = passage.text[start:end]
    primed = raw.rstrip().endswith("'")
    text = " ".join(raw.rstrip().removesuffix("'").split()).replace("^", "**")
    text = re.sub(r"^- +", "-", text)
    try:
        parse(text)
    except ExpressionError as error:
        at = start + len(raw) - len(raw.lstrip()) + error.start  # off by what blanks and `^` have changed
        raise ModelError([passage.fault(error.code, error.message, error.hint, at, end)]) from None
    return text, primed


def renamed(text: str, names: Mapping[str, str]) -> str:
    """An expression with other names, and nothing else changed."""
    for node in reversed([node for node in walk(parse(text)) if isinstance(node, Name)]):
        if node.name in names:
            text = text[: node.start] + names[node.name] + text[node.end :]
    return text


def within(text: str) -> str:
    """An expression to put in place of a name."""
    return text if isinstance(parse(text), Name) else f"({text})"


def checked(relation: Relation) -> Relation:
    """The relation, whose sides have values.

    Raises ModelError: they do not.
    """
    try:
        for side in (relation.left, relation.right):
            value(side)
    except ExpressionError as error:
        raise ModelError([relation.fault(error.message, error.hint, error.code)]) from None
    return relation
