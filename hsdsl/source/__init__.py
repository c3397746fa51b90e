"""YAML files as nodes with a line and a column: the core rules of YAML 1.2, capped before anything recurses."""

from hsdsl.source.compose import compose
from hsdsl.source.nodes import ABSENT, Key, Mapping, Node, Scalar, Sequence, SourceRange, absent
from hsdsl.source.text import Text, decode

__all__ = [
    "ABSENT",
    "Key",
    "Mapping",
    "Node",
    "Scalar",
    "Sequence",
    "SourceRange",
    "Text",
    "absent",
    "compose",
    "decode",
]
