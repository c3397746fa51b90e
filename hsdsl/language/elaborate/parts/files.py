"""Automata that are in files of their own, put in their places in the model's tree.

Every node knows its own text, so faults in such a file have its path and line.
"""

from __future__ import annotations

from hsdsl.base.errors import Findings
from hsdsl.language.files import DataRefused, ModelFiles
from hsdsl.language.source import Mapping, Node, Scalar, child, compose, decode

_ABOUT = ("hsdsl", "title", "source")  # keys that a file may have and that say nothing about the automaton


def read_automata(root: Node, files: ModelFiles, findings: Findings) -> dict[str, bytes]:
    """Put automata of files in their places; the content of the files, by name."""
    automata = child(root, "automata")
    found: dict[str, bytes] = {}
    for key, entry in list(automata) if isinstance(automata, Mapping) else ():
        name = child(entry, "file")
        if not isinstance(name, Scalar) or not isinstance(entry, Mapping) or len(entry.entries) > 1:
            continue
        try:
            content = found.setdefault(name.value, files.content(name.value))
        except DataRefused as refusal:
            findings.add(name.place.diagnostic(refusal.code, refusal.message, refusal.hint))
            continue
        inner = compose(decode(str(files.folder / name.value), content), findings)
        if isinstance(inner, Mapping):
            for about in _ABOUT:
                inner.entries.pop(about, None)
        assert isinstance(automata, Mapping)
        automata.entries[str(key)] = (key, inner)
    return found
