"""Errors of the YAML parser, as diagnostics for a person who writes mathematics."""

from __future__ import annotations

import re

import yaml

from hsdsl.base.errors import Diagnostic
from hsdsl.base.names import plain_sign, shown, told_apart
from hsdsl.language.source.text import Text

_VALUE = re.compile(r"^\s*(?:- +)*(?:[^\s:{\[,'\"][^:{\[,]*:\s+)?(?P<value>\S.*)$")
_KEY_AND_VALUE = re.compile(r"^\s*(?:- +)*[^:]+:\s+\S")
_MEANS = {
    "*": "an alias",
    "&": "an anchor",
    "!": "a tag",
    "|": "a text of several lines",
    ">": "a text of several lines",
    "%": "a directive",
    "@": "a reserved sign",
    "`": "a reserved sign",
    "{": "a mapping",
    "[": "a list",
    "}": "the end of a mapping",
    "]": "the end of a list",
    ",": "the end of a value",
    "'": "a quoted text",
    '"': "a quoted text",
    "?": "a key",
    "-": "an item of a list",
}
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
DEEPEST = 64
TOO_DEEP = f"mappings and lists are nested more than {DEEPEST} deep here"
_COLON = "a key is followed by a colon and a space"


def explain(text: Text, error: yaml.MarkedYAMLError) -> Diagnostic:
    """The diagnostic for a fault that stops the YAML parser."""
    problem = error.problem or ""
    line, column = _mark(error.problem_mark or error.context_mark)
    opened = _mark(error.context_mark) if error.context_mark else (line, column)
    if "nesting depth" in problem:  # of libyaml, which reads ahead
        return text.fault("HS014", TOO_DEEP, line, column)
    for suspect in dict.fromkeys((line, opened[0], _above(text, line))):
        if wrong := strange_blank(text, suspect) or _lookalike(text, suspect):
            return wrong
    if "document start" in problem:
        return text.fault("HS010", "a second document begins here", line, column, "a file holds one model")
    if "quoted scalar" in (error.context or ""):
        return _quoted(text, problem, (line, column), opened)
    if "block scalar" in (error.context or ""):
        return _misread(text, *opened)
    if "could not find expected ':'" in problem:
        message = "this line is neither a key nor part of a value"
        return text.fault("HS004", message, *opened, _with_colon(text.lines[opened[0] - 1]), _WHOLE_LINE)
    if "flow" in (error.context or ""):
        return _in_brackets(text, (line, column), opened)
    return _in_block(text, problem, line, column)


def _mark(mark: yaml.Mark | None) -> tuple[int, int]:
    return (mark.line + 1, mark.column + 1) if mark else (1, 1)


def strange_blank(text: Text, line: int) -> Diagnostic | None:
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


def _quoted(text: Text, problem: str, here: tuple[int, int], opened: tuple[int, int]) -> Diagnostic:
    if "escape" in problem or "hexdecimal" in problem or "hexadecimal" in problem:
        message = "the backslash here begins an escape that YAML does not know"
        return text.fault("HS004", message, *here, "use single quotes, where a backslash is itself")
    hint = f"close it with `{_character(text, *opened)}`"
    return text.fault("HS004", "the quote that opens here is never closed", *opened, hint)


def _in_brackets(text: Text, here: tuple[int, int], opened: tuple[int, int]) -> Diagnostic:
    bracket = _character(text, *opened)
    line, column = here
    closing = {"{": "}", "[": "]"}.get(bracket)
    if closing is None:
        hint = "remove it, or quote the value it belongs to"
        return text.fault("HS004", "this is not valid YAML from here on", line, column, hint)
    content = text.lines[line - 1] if line <= len(text.lines) else ""
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


def _indent(content: str) -> int:
    return len(content) - len(content.lstrip())


def _in_block(text: Text, problem: str, line: int, column: int) -> Diagnostic:
    content = text.lines[line - 1] if line <= len(text.lines) else ""
    before = content[: column - 1]
    if before.strip(" -") == "" and _character(text, line, column) not in "%@`*&!":
        return _indentation(text, line, column)
    if "mapping values" in problem:
        if missing := colon_missing(text, line):
            return missing
        if _KEY_AND_VALUE.match(before):
            message = "a value cannot contain a colon followed by a space"
            return text.fault("HS007", message, line, column, _two_colons(content, column))
        return _without_colon(text, line) or _indentation(text, line, _indent(content) + 1)
    return _misread(text, line, column)


def _without_colon(text: Text, line: int) -> Diagnostic | None:
    """The line above, where it was taken for the beginning of a text because no colon follows its key."""
    above = _above(text, line)
    content = text.lines[above - 1] if above < line else ""
    if not content.strip() or ":" in content or content.lstrip()[0] in "-#":
        return None
    message = "this line is neither a key nor part of a value"
    return text.fault("HS004", message, above, _indent(content) + 1, _with_colon(content), _WHOLE_LINE)


def _with_colon(content: str) -> str:
    """The hint for a line that should have been a key with its value."""
    match = _NO_SPACE.fullmatch(content)
    if match:
        return f"write a space after the colon: {shown(': '.join(match.groups()))}"
    match = _EQUATION.fullmatch(content) or _TWO_WORDS.fullmatch(content)
    if match:
        return f"write {shown(': '.join(part for part in match.groups() if part))}"
    return _COLON


def colon_missing(text: Text, line: int) -> Diagnostic | None:
    """The diagnostic for the line ``initial {mode: A}``."""
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
        return "write a mode for each case, or select(c, a, b): a where c > 0, else b; select(t - 1, 1, 0) is a step"
    if value[: column - len(key) - 3].isidentifier():
        inner = f"{key.strip(' -')}: {{{value}}}"
        return f"write {shown(inner)}, or quote it if it is a text"
    return f"{_QUOTE} or begin a new line"


def _indentation(text: Text, line: int, column: int) -> Diagnostic:
    content = text.lines[line - 1] if line <= len(text.lines) else ""
    dash = _DASH.fullmatch(text.lines[line - 2]) if 2 <= line <= len(text.lines) else None
    if dash:
        message = "after the dash of a list item a space is missing"
        hint = f"write - {shown(dash.group(2))}"
        return text.fault("HS004", message, line - 1, len(dash.group(1)) + 1, hint, _WHOLE_LINE)
    item = content.lstrip().startswith("- ")
    message = "a list item is not possible here" if item else "the indentation of this line fits no line above it"
    hint = "entries of one mapping or list begin in the same column; a key that has a value has no lines under it"
    return text.fault("HS006", message, line, column, hint, _WHOLE_LINE)


def _misread(text: Text, line: int, column: int) -> Diagnostic:
    content = text.lines[line - 1] if line <= len(text.lines) else ""
    remark = _COMMENT.match(content, column - 1) or _COMMENT.match(content, _indent(content))
    if remark and content[: remark.start()].rstrip()[-1:] in ("", "}", "]"):
        message, length = f"`{remark.group()}` begins no comment", len(remark.group())
        return text.fault("HS004", message, line, remark.start() + 1, "write `#` before it", length)
    match = _VALUE.match(content)
    start = match.start("value") if match else column - 1
    first = content[start : start + 1]
    if start >= column or first not in _MEANS:
        start, first = column - 1, content[column - 1 : column]
    if first not in _MEANS:
        hint = "remove it, or quote the value it belongs to"
        return text.fault("HS004", "this is not valid YAML from here on", line, column, hint)
    message = f"a value that begins with `{first}` is {_MEANS[first]} in YAML"
    hint = "quote the whole expression, or none of it" if first in "'\"" else quote(content, start)
    return text.fault("HS007", message, line, start + 1, hint, _WHOLE_LINE)


def quote(content: str, start: int) -> str:
    """The hint to quote what begins somewhere in a line, with the form where its end is known."""
    value = content[start:].strip()
    if set(content[:start]) & set("{[") or set(value) & set('"\\#'):
        return _QUOTE
    return f'{_QUOTE}: "{shown(value)}"'


def _character(text: Text, line: int, column: int) -> str:
    return text.lines[line - 1][column - 1 : column] if line <= len(text.lines) else ""
