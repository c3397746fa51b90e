"""The shape of a model file: what may stand where.

`documents` has the keys of each mapping, `fields` the values that each may hold, and `jsonschema` is made of both.
:func:`read` makes documents of nodes.
"""

from __future__ import annotations

from pydantic import ValidationError

from hsdsl.language.schema.documents import ModelDocument, SystemDocument, plain
from hsdsl.language.source.compose import Unread
from hsdsl.language.source.nodes import Node, keys


def kind_of(root: Node) -> type[ModelDocument]:
    """The kind of document that a YAML file is."""
    return SystemDocument if {"system", "automata"} & set(map(str, keys(root))) else ModelDocument


def read(root: Node) -> ModelDocument:
    """The document of a YAML file.

    Raises Unread: at a key or a value that may not stand where it does.
    """
    try:
        return kind_of(root).model_validate(plain(root))
    except ValidationError:
        raise Unread from None
