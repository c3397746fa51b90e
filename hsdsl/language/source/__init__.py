"""YAML files as nodes with a line and a column: the core rules of YAML 1.2, capped before anything recurses."""

from hsdsl.language.source.compose import Composer, Unread, compose, decode
from hsdsl.language.source.nodes import (
    ABSENT,
    Key,
    Mapping,
    Node,
    NodePath,
    Scalar,
    Sequence,
    SourceRange,
    Text,
    absent,
    child,
    children,
    descend,
    is_empty,
    keys,
)

__all__ = [
    "ABSENT", "Composer", "Key", "Mapping", "Node", "NodePath", "Scalar", "Sequence", "SourceRange", "Text", "Unread",
    "absent", "child", "children", "compose", "decode", "descend", "is_empty", "keys",
]  # fmt: skip
