"""What YAML takes for something else, explained to a person who writes mathematics.

`Faults` takes the faults of a second reading. What YAML cuts apart in braces and brackets is put together again, so
that the rest of the model is still read: in ``{v: min(v, 0)}`` the comma ends the value, and ``0)`` becomes a key.
"""

from __future__ import annotations

import re
from typing import Any

from hsdsl.base.errors import Diagnostic, Findings
from hsdsl.base.names import plain_sign, shown, told_apart
from hsdsl.language.diagnosis.expressions import CASES
from hsdsl.language.source.nodes import TOO_DEEP, Node, Scalar, SourceRange, Text, is_bare

_VALUE = re.compile(r"^\s*(?:- +)*(?:[^\s:{\[,'\"][^:{\[,]*:\s+)?(?P<value>\S.*)$")
_KEY_AND_VALUE = re.compile(r"^\s*(?:- +)*[^:]+:\s+\S")
_MEANINGS = {  # what a value is in YAML, by its first sign
    "an alias": "*",
    "an anchor": "&",
    "a tag": "!",
    "a text of several lines": "|>",
    "a directive": "%",
    "a reserved sign": "@`",
    "a mapping": "{",
    "a list": "[",
    "the end of a mapping": "}",
    "the end of a list": "]",
    "the end of a value": ",",
    "a quoted text": "'\"",
    "a key": "?",
    "an item of a list": "-",
}
_MEANS = {sign: meaning for meaning, signs in _MEANINGS.items() for sign in signs}
_QUOTE = "quote this expression"
_NO_SPACE = re.compile(r"\s*(?:- +)?([^\W\d]\w*):(\S.*)")
_EQUATION = re.compile(r"\s*(?:- +)?([^\W\d]\w*)(?:'|\(t\))?\s*=\s*([^=].*)|\s*(?:der|diff)\((\w+)\)\s*=\s*([^=].*)")
_TWO_WORDS = re.compile(r"\s*(?:- +)?([^\W\d]\w*) +([\w.'\"+-]\S*)\s*")
_DASH = re.compile(r"(\s*)-([^\W\d].*:.*)")
_LAST_WORD = re.compile(r"([^\W\d]\w*)\s*$")
_WHOLE_LINE = 9999  # characters, cut at the line's end
_FAR = 100  # characters before a fault that are looked at
_COMMENT = re.compile(r"//|/\*|%")
_NOT_YAML = re.compile("\"[^\"]*\"|'[^']*'|(?<!\\S)#.*")
_OF_YAML = ":{}[],#-\"' "  # signs and blanks that give a file its shape
_UNCOLONED = re.compile(r"\s*(?:- +)?([^\W\d]\w*)(?: +(?=\[)| *(?={))(.*)")
_KEY_BEFORE = re.compile(r"[{,]\s*([^\W\d]\w*) *$")
_TEXTS = ("title", "source", "about")
_NEITHER = "this line is neither a key nor part of a value"
_NOT_VALID = "this is not valid YAML from here on", "remove it, or quote the value it belongs to"
_KEY_AND_WORD = re.compile(r"([^\W\d]\w*) +(-?[\w.]+)")
_MOST_PIECES = 100  # of one expression


class Faults:
    """What takes the faults of a second reading, which goes on where it can."""

    def __init__(self, findings: Findings) -> None:
        self.findings, self.report = findings, findings.add

    def stop(self, diagnostic: Diagnostic) -> None:
        """Report all faults."""
        self.findings.add(diagnostic)
        self.findings.raise_if_any()

    def unparsed(self, text: Text, error: Any) -> None:
        """Explain what stops the parser, a `yaml.MarkedYAMLError`."""
        self.stop(_explained(text, error))

    def no_anchor(self, name: str, place: SourceRange) -> None:
        """Explain an alias of nothing: it is a factor."""
        message = f"`*{name}` is an alias in YAML, and there is no anchor `&{name}` before it"
        _, line, column = place.start
        self.stop(place.diagnostic("HS007", message, _quote(place.text.lines[line], column)))

    def strange_key(self, key: Scalar) -> None:
        """Refuse a key that begins with a blank that is no space, or has a brace: ``initial {mode: A}``."""
        text, line = key.place.text, key.place.span.line
        blank = _strange_blank(text, line) if key.value[:1].isspace() else None
        if fault := blank or (_colon_missing(text, line) if "{" in key.value else None):
            self.stop(fault)

    def rejoined_items(self, items: list[Node]) -> list[Node]:
        """The items of a list in brackets, with parts that a comma inside parentheses cut apart joined."""
        joined: list[Node] = []
        at = 0
        while at < len(items):
            run = _run(items[at : at + _MOST_PIECES])
            joined.append(_one(run, self.findings))
            at += len(run)
        return joined

    def rejoined_entries(self, entries: list[tuple[Node, Node]]) -> list[tuple[Node, Node]]:
        """The entries of a mapping in braces, with parts that a comma inside parentheses cut apart joined.

        Before that ``name:value`` and ``name value``, keys to YAML, become entries again.
        """
        entries = [_spaced(key, value, self.findings) for key, value in entries]
        joined: list[tuple[Node, Node]] = []
        at = 0
        while at < len(entries):
            key, value = entries[at]
            pieces: list[Node] = [value]
            for name, rest in entries[at + 1 : at + _MOST_PIECES]:
                if not is_bare(rest):
                    break
                pieces.append(name)
            if is_bare(value):  # a call in place of a name, such as `reinit(v, -c*v)`
                run = _run([key, *pieces[1:]])
                joined.append((_joined(run), value))
            else:
                run = pieces[:2] if _decimal(pieces) else _run(pieces)
                joined.append((key, _one(run, self.findings)))
            at += len(run)
        return joined


def _explained(text: Text, error: Any) -> Diagnostic:
    """The diagnostic for a fault that stops the YAML parser, a `yaml.MarkedYAMLError`."""
    problem, context = error.problem or "", error.context or ""
    marks: list[Any] = [mark for mark in (error.problem_mark, error.context_mark) if mark]
    places: list[tuple[int, int]] = [(mark.line + 1, mark.column + 1) for mark in marks] or [(1, 1)]
    here, opened = places[0], places[-1]
    if "nesting depth" in problem:  # of libyaml, which reads ahead
        return text.fault("HS014", TOO_DEEP, *here)
    for suspect in dict.fromkeys((here[0], opened[0], _above(text, here[0]))):
        if wrong := _strange_blank(text, suspect) or _lookalike(text, suspect):
            return wrong
    if "document start" in problem:
        return text.fault("HS010", "a second document begins here", *here, "a file holds one model")
    if "quoted scalar" in context:
        if "escape" in problem or "hexdecimal" in problem or "hexadecimal" in problem:
            message = "the backslash here begins an escape that YAML does not know"
            return text.fault("HS004", message, *here, "use single quotes, where a backslash is itself")
        hint = f"close it with `{_character(text, *opened)}`"
        return text.fault("HS004", "the quote that opens here is never closed", *opened, hint)
    if "block scalar" in context:
        return _misread(text, *opened)
    if "could not find expected ':'" in problem:
        return text.fault("HS004", _NEITHER, *opened, _with_colon(text.lines[opened[0] - 1]), _WHOLE_LINE)
    return _in_brackets(text, here, opened) if "flow" in context else _in_block(text, problem, *here)


def _strange_blank(text: Text, line: int) -> Diagnostic | None:
    """A tab, or another blank that is no space, in the indentation of a line."""
    content = text.lines[min(line, len(text.lines)) - 1]
    strange = next((sign for sign in content[: _indent(content)] if sign != " "), None)
    if strange is None:
        return None
    name = "a tab" if strange == "\t" else f"the blank U+{ord(strange):04X}"
    return text.fault("HS005", f"expected spaces, got {name}", line, content.index(strange) + 1, "indent with spaces")


def _lookalike(text: Text, line: int) -> Diagnostic | None:
    """A character of a line that looks like one of YAML's own signs, outside of quotes, comments and texts."""
    content = text.lines[min(line, len(text.lines)) - 1]
    if content.partition(":")[0].strip(" -") in _TEXTS:
        return None
    plain = _NOT_YAML.sub(lambda match: " " * len(match.group()), content)
    for at, sign in enumerate(plain):
        if (meant := plain_sign(sign)) and meant in _OF_YAML:
            hint = "write a space" if meant == " " else f"write `{meant}`" + " and a space" * (meant in ":,")
            return text.fault("HS004", told_apart(sign), line, at + 1, hint)
    return None


def _above(text: Text, line: int) -> int:
    """The last line above another that is not empty."""
    above = min(line, len(text.lines)) - 1
    while above > 1 and not text.lines[above - 1].strip():
        above -= 1
    return max(above, 1)


def _in_brackets(text: Text, here: tuple[int, int], opened: tuple[int, int]) -> Diagnostic:
    bracket, (line, column) = _character(text, *opened), here
    closing = {"{": "}", "[": "]"}.get(bracket)
    if closing is None:
        message, hint = _NOT_VALID
        return text.fault("HS004", message, line, column, hint)
    content = _line(text, line)
    sign, below = _character(text, line, column), line != opened[0]
    outdented = not content[: column - 1].strip() and column <= _indent(text.lines[opened[0] - 1]) + 1
    if column > len(content) or (below and (sign == ":" or outdented)):
        message = f"the `{bracket}` that opens here is never closed"
        return text.fault("HS004", message, *opened, f"close it with `{closing}`")
    key = _KEY_BEFORE.search(content, max(0, column - _FAR), column - 1)
    if sign in "{[" and key:
        return _without_its_colon(text, line, key.start(1) + 1, key.group(1), f"{sign}...")
    message = f"YAML cannot read on at `{sign}` inside `{bracket}` and `{closing}`"
    hint = f"{_QUOTE} if `{sign}` belongs to one"
    name = _LAST_WORD.search(content, max(0, column - _FAR), column - 1)
    if sign == ":" and name:
        hint = f"write a comma before `{name.group(1)}`, or quote the expression that `:` belongs to"
    return text.fault("HS007", message, line, column, hint)


def _in_block(text: Text, problem: str, line: int, column: int) -> Diagnostic:
    content = _line(text, line)
    before = content[: column - 1]
    if before.strip(" -") == "" and _character(text, line, column) not in "%@`*&!":
        return _indentation(text, line, column)
    if "mapping values" not in problem:
        return _misread(text, line, column)
    if missing := _colon_missing(text, line):
        return missing
    if _KEY_AND_VALUE.match(before):
        message = "a value cannot contain a colon followed by a space"
        return text.fault("HS007", message, line, column, _two_colons(content, column))
    above = _above(text, line)  # taken for the beginning of a text where no colon follows its key
    content_above = text.lines[above - 1] if above < line else ""
    if content_above.strip() and ":" not in content_above and content_above.lstrip()[0] not in "-#":
        hint = _with_colon(content_above)
        return text.fault("HS004", _NEITHER, above, _indent(content_above) + 1, hint, _WHOLE_LINE)
    return _indentation(text, line, _indent(content) + 1)


def _with_colon(content: str) -> str:
    """The hint for a line that should have been a key with its value."""
    if match := _NO_SPACE.fullmatch(content):
        return f"write a space after the colon: {shown(': '.join(match.groups()))}"
    if match := _EQUATION.fullmatch(content) or _TWO_WORDS.fullmatch(content):
        return f"write {shown(': '.join(part for part in match.groups() if part))}"
    return "a key is followed by a colon and a space"


def _colon_missing(text: Text, line: int) -> Diagnostic | None:
    match = _UNCOLONED.fullmatch(text.lines[line - 1])
    return _without_its_colon(text, line, match.start(1) + 1, *match.groups()) if match else None


def _without_its_colon(text: Text, line: int, column: int, key: str, value: str) -> Diagnostic:
    message = f"a colon is missing after `{shown(key)}`"
    return text.fault("HS004", message, line, column, f"write {shown(key)}: {shown(value)}", len(key))


def _two_colons(content: str, column: int) -> str:
    """The hint for ``reset: v: -c*v``, and for a text or an expression with a colon in it."""
    key, _, value = content.partition(": ")
    if key.strip(" -") in _TEXTS:
        return f'quote the text: {key.strip(" -")}: "{shown(value)}"'
    if "?" in content[: column - 1]:
        return CASES
    if value[: column - len(key) - 3].isidentifier():
        inner = f"{key.strip(' -')}: {{{value}}}"
        return f"write {shown(inner)}, or quote it if it is a text"
    return f"{_QUOTE} or begin a new line"


def _indentation(text: Text, line: int, column: int) -> Diagnostic:
    dash = _DASH.fullmatch(text.lines[line - 2]) if 2 <= line <= len(text.lines) else None
    if dash:
        message, hint = "a space is missing after the dash of a list item", f"write - {shown(dash.group(2))}"
        return text.fault("HS004", message, line - 1, len(dash.group(1)) + 1, hint, _WHOLE_LINE)
    item = _line(text, line).lstrip().startswith("- ")
    message = "a list item is not possible here" if item else "the indentation of this line fits no line above it"
    hint = "entries of one mapping or list begin in the same column; a key that has a value has no lines under it"
    return text.fault("HS006", message, line, column, hint, _WHOLE_LINE)


def _misread(text: Text, line: int, column: int) -> Diagnostic:
    content = _line(text, line)
    remark = _COMMENT.match(content, column - 1) or _COMMENT.match(content, _indent(content))
    if remark and content[: remark.start()].rstrip()[-1:] in ("", "}", "]"):
        message, length = f"`{remark.group()}` does not begin a comment", len(remark.group())
        return text.fault("HS004", message, line, remark.start() + 1, "write `#` before it", length)
    match = _VALUE.match(content)
    start = match.start("value") if match else column - 1
    first = content[start : start + 1]
    if start >= column or first not in _MEANS:
        start, first = column - 1, content[column - 1 : column]
    if first not in _MEANS:
        message, hint = _NOT_VALID
        return text.fault("HS004", message, line, column, hint)
    message = f"a value that begins with `{first}` is {_MEANS[first]} in YAML"
    hint = "quote the whole expression, or none of it" if first in "'\"" else _quote(content, start)
    return text.fault("HS007", message, line, start + 1, hint, _WHOLE_LINE)


def _quote(content: str, start: int) -> str:
    """The hint to quote what begins somewhere in a line, with the form where its end is known."""
    value = content[start:].strip()
    if set(content[:start]) & set("{[") or set(value) & set('"\\#'):
        return _QUOTE
    return f'{_QUOTE}: "{shown(value)}"'


def _indent(content: str) -> int:
    return len(content) - len(content.lstrip())


def _line(text: Text, line: int) -> str:
    return text.lines[line - 1] if line <= len(text.lines) else ""


def _character(text: Text, line: int, column: int) -> str:
    return _line(text, line)[column - 1 : column]


def _decimal(pieces: list[Node]) -> bool:
    """Whether a value and what follows its comma are ``9,81``."""
    match pieces:
        case [Scalar(value=whole), Scalar(value=part) as rest, *_]:
            index = rest.place.start[0]
            return whole.isdecimal() and part.isdecimal() and rest.place.text.content[index - 1 : index] == ","
        case _:
            return False


def _spaced(key: Node, value: Node, findings: Findings) -> tuple[Node, Node]:
    if not (isinstance(key, Scalar) and key.plain and is_bare(value)):
        return key, value
    name, colon, rest = key.value.partition(":")
    message = "a space is missing after the colon"
    if words := _KEY_AND_WORD.fullmatch(key.value):
        name, rest = words.groups()
        message, colon = f"a colon is missing after `{name}`", " "
    elif strange := next((sign for sign in key.value if plain_sign(sign) == ":"), ""):
        name, colon, rest = key.value.partition(strange)
        message = told_apart(strange)
    if not words and not (colon and rest and name.isidentifier()):
        return key, value
    if plain_sign(rest[0]) == " " and colon == ":":
        message = f"the blank after the colon is U+{ord(rest[0]):04X}, not a space"
    plain = rest.strip()
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
    message = "YAML ends a value at a comma inside braces or brackets"
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
