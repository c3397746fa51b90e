"""What YAML cuts apart: in ``{v: min(v, 0)}`` the comma ends the value, and ``0)`` becomes a key without a value.

The pieces are put together again, so that the rest of the model is still read, and a hint names the quotes.
"""

from __future__ import annotations

import re

from hsdsl.base.errors import Findings
from hsdsl.base.names import plain_sign, shown, told_apart
from hsdsl.language.source.nodes import Node, Scalar, SourceRange

_WORDS = re.compile(r"([^\W\d]\w*) +(-?[\w.]+)")
_MOST_PIECES = 100  # of one expression


def rejoined_items(items: list[Node], findings: Findings) -> list[Node]:
    """The items of a list in brackets, with parts that a comma inside parentheses cut apart joined."""
    joined: list[Node] = []
    at = 0
    while at < len(items):
        run = _run(items[at : at + _MOST_PIECES])
        joined.append(_one(run, findings))
        at += len(run)
    return joined


def rejoined_entries(entries: list[tuple[Node, Node]], findings: Findings) -> list[tuple[Node, Node]]:
    """The entries of a mapping in braces, with parts that a comma inside parentheses cut apart joined."""
    joined: list[tuple[Node, Node]] = []
    at = 0
    while at < len(entries):
        key, value = entries[at]
        pieces: list[Node] = [value]
        for name, rest in entries[at + 1 : at + _MOST_PIECES]:
            if not _nothing(rest):
                break
            pieces.append(name)
        if _nothing(value):  # a call in place of a name, such as `reinit(v, -c*v)`
            run = _run([key, *pieces[1:]])
            joined.append((_joined(run), value))
        else:
            run = pieces[:2] if _decimal(pieces) else _run(pieces)
            joined.append((key, _one(run, findings)))
        at += len(run)
    return joined


def _nothing(node: Node) -> bool:
    return isinstance(node, Scalar) and node.plain and node.value == ""


def _decimal(pieces: list[Node]) -> bool:
    """Whether a value and what follows its comma are ``9,81``."""
    match pieces:
        case [Scalar(value=whole), Scalar(value=part) as rest, *_]:
            return whole.isdecimal() and part.isdecimal() and _before(rest) == ","
        case _:
            return False


def _before(node: Node) -> str:
    index = node.place.start[0]
    return node.place.text.content[index - 1 : index]


def spaced_entries(entries: list[tuple[Node, Node]], findings: Findings) -> list[tuple[Node, Node]]:
    """The entries of a mapping in braces, with ``name:value`` and ``name value``, keys to YAML, apart again."""
    return [_spaced(key, value, findings) for key, value in entries]


def _spaced(key: Node, value: Node, findings: Findings) -> tuple[Node, Node]:
    if not (isinstance(key, Scalar) and key.plain and isinstance(value, Scalar) and value.plain and value.value == ""):
        return key, value
    name, colon, rest = key.value.partition(":")
    if words := _WORDS.fullmatch(key.value):
        name, rest = words.groups()
        findings.add(
            key.place.diagnostic("HS004", f"a colon is missing after `{name}`", f"write {name}: {shown(rest)}")
        )
        return Scalar(name, True, key.place), Scalar(rest, True, key.place)
    strange = next((sign for sign in key.value if plain_sign(sign) == ":"), "")
    if strange:
        name, colon, rest = key.value.partition(strange)
    if not (colon and rest and name.isidentifier()):
        return key, value
    message, plain = "a space is missing after the colon", rest.strip()
    if plain_sign(rest[0]) == " ":
        message = f"the blank after the colon is U+{ord(rest[0]):04X}, not a space"
    message = told_apart(strange) if strange else message
    findings.add(key.place.diagnostic("HS004", message, f"write {name}: {shown(plain)}"))
    return Scalar(name, True, key.place), Scalar(plain, True, key.place)


def _run(nodes: list[Node]) -> list[Scalar] | list[Node]:
    """The pieces from the first node on that close the parentheses it opens; the first alone where none do."""
    run: list[Scalar] = []
    open_now = 0
    for node in nodes:
        if not (isinstance(node, Scalar) and node.plain):
            break
        run.append(node)
        open_now += node.value.count("(") - node.value.count(")")
        if open_now <= 0:
            return run
    return nodes[:1]


def _one(run: list[Scalar] | list[Node], findings: Findings) -> Node:
    whole = _joined(run)
    if whole is run[0] or not isinstance(whole, Scalar):
        return run[0]
    message = "inside braces or brackets YAML ends a value at its comma"
    hint = f'quote this expression: "{whole.value}"'
    if _decimal(list(run)):
        whole = Scalar(whole.value.replace(",", "."), True, whole.place)
        hint = f"write {whole.value}"
    findings.add(whole.place.diagnostic("HS007", message, hint))
    return whole


def _joined(run: list[Scalar] | list[Node]) -> Node:
    """The pieces as one, with the text between them."""
    first, last = run[0], run[-1]
    if first is last:
        return first
    text = first.place.text
    place = SourceRange(text, first.place.start, last.place.end)
    return Scalar(" ".join(text.content[place.start[0] : place.end[0]].split()), True, place)
