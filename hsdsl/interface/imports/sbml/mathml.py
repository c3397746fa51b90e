"""Formulas of MathML as trees, as SBML uses it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

from hsdsl.base import limits
from hsdsl.language.source.xml import Element

_SYMBOLS = {"time": "time", "delay": "delay", "avogadro": "avogadro", "rateOf": "rateOf"}  # ends of definition URLs
CONSTANTS = ("true", "false", "pi", "exponentiale", "infinity", "notanumber")


class NotExpressible(Exception):
    """A feature of SBML that the language has no words for: its name, and the element that has it."""

    def __init__(self, feature: str, element: Element | None = None) -> None:
        super().__init__(feature)
        self.element = element


@dataclass(frozen=True)
class Node:
    """A part of a formula: what it is, its arguments, and its element.

    ``kind`` is ``number`` with a ``value``, ``name`` or ``call`` with a ``name``, or an element of MathML: ``plus``. An
    argument of `log` or `root` that is its base or degree comes first. A piece of `piecewise` is two arguments.
    """

    kind: str
    element: Element
    arguments: tuple[Node, ...] = ()
    name: str = ""
    value: str = ""

    def walk(self) -> Iterator[Node]:
        """It and all of its parts."""
        yield self
        for argument in self.arguments:
            yield from argument.walk()

    @property
    def names(self) -> set[str]:
        """The names in it."""
        return {node.name for node in self.walk() if node.kind == "name"}

    def uses(self, kind: str) -> bool:
        """Whether a part of it is of a kind."""
        return any(node.kind == kind for node in self.walk())

    def mapped(self, change: Callable[[Node], Node]) -> Node:
        """It with every part changed, from the inside out."""
        return change(replace(self, arguments=tuple(argument.mapped(change) for argument in self.arguments)))


@dataclass(frozen=True)
class Lambda:
    """A function definition: the names of its arguments, and its body."""

    arguments: tuple[str, ...]
    body: Node


def formula(holder: Element) -> Node | None:
    """The formula in an element's `math`; None where it has none."""
    content = _math(holder)
    return None if content is None else _node(content)


def function(holder: Element) -> Lambda | None:
    """The function in an element's `math`; None where it has none."""
    content = _math(holder)
    if content is None or content.tag != "lambda" or not content.children:
        return None
    *bound, body = content.children
    return Lambda(tuple(_word(one.children[0]) for one in bound if one.children), _node(body))


def written_out(node: Node, functions: Mapping[str, Lambda], parts: Iterator[int] | None = None) -> Node:
    """A formula with the bodies of functions in place of their calls.

    ``parts`` counts what is left to be written. Raises NotExpressible: the formula becomes too large.
    """
    parts = parts or iter(range(limits.current().values))

    def change(part: Node) -> Node:
        if part.kind != "call" or part.name not in functions:
            return part
        known = functions[part.name]
        if len(known.arguments) != len(part.arguments):
            raise NotExpressible(f"a call of {part.name} with another number of arguments", part.element)
        given = dict(zip(known.arguments, part.arguments, strict=True))
        body = known.body.mapped(lambda inner: given.get(inner.name, inner) if inner.kind == "name" else inner)
        if any(next(parts, None) is None for _ in body.walk()):
            raise NotExpressible(f"a formula of more than {limits.current().values:,} parts", part.element)
        return written_out(body, {name: one for name, one in functions.items() if name != part.name}, parts)

    return node.mapped(change)


def _math(holder: Element) -> Element | None:
    found = holder.all("math")
    return found[0].children[0] if found and found[0].children else None


def _word(element: Element) -> str:
    return element.passage.text.strip()


def _node(element: Element) -> Node:
    match element.tag:
        case "ci":
            return Node("name", element, name=_word(element))
        case "cn":
            return Node("number", element, value=_number(element))
        case "csymbol":
            return Node(_symbol(element), element)
        case "apply":
            return _applied(element)
        case "piecewise":
            parts = (part for piece in element.children for part in piece.children)
            return Node("piecewise", element, tuple(map(_node, parts)))
        case "semantics":
            return _node(element.children[0])
        case tag if tag in CONSTANTS:
            return Node(tag, element)
        case tag:
            raise NotExpressible(f"the formula <{tag}>", element)


def _applied(element: Element) -> Node:
    if not element.children:
        raise NotExpressible("an empty <apply>", element)
    head, *rest = element.children
    arguments = tuple(_node(part.children[0] if part.tag in ("logbase", "degree") else part) for part in rest)
    if head.tag == "ci":
        return Node("call", element, arguments, name=_word(head))
    return Node(_symbol(head) if head.tag == "csymbol" else head.tag, element, arguments)


def _symbol(element: Element) -> str:
    meant = element.attributes.get("definitionURL", "").rpartition("/")[2]
    if meant not in _SYMBOLS:
        raise NotExpressible(f"the symbol '{meant or _word(element)}'", element)
    return _SYMBOLS[meant]


def _number(element: Element) -> str:
    """The text of a number; one in two parts is joined."""
    kind = element.attributes.get("type", "real")
    if kind not in ("e-notation", "rational"):
        return _word(element)
    place = [(part.line, part.column) for part in element.all("sep")]
    before = "".join(text for text, *at in element.pieces if not place or tuple(at) < place[0]).strip()
    after = "".join(text for text, *at in element.pieces if place and tuple(at) > place[0]).strip()
    return f"{before}e{after}" if kind == "e-notation" else f"{before}/{after}"
