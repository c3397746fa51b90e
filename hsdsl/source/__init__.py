"""YAML files as nodes with a line and a column, read by the core rules of YAML 1.2 and capped before anything recurses."""

from hsdsl.source.compose import compose
from hsdsl.source.nodes import Key, Mapping, Node, Place, Scalar, Sequence
from hsdsl.source.text import Text, decode, read_bytes, reason

__all__ = [
    "Key",
    "Mapping",
    "Node",
    "Place",
    "Scalar",
    "Sequence",
    "Text",
    "compose",
    "decode",
    "read_bytes",
    "reason",
]
