"""What the repository has for tests: its models, loaded once, those that are refused, and kept texts.

HSDSL_WRITE_GOLDEN=1 writes these anew.
"""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

import hsdsl

MODELS = Path(__file__).parents[1] / "models"


@lru_cache
def shipped(name: str) -> hsdsl.Model:
    """A model of the folder by its name."""
    return hsdsl.load(MODELS / f"{name}.yaml")


def bad_models() -> dict[str, bytes]:
    """The models of tests/golden/bad by their names; of some a file has what follows the lines of `head` alone."""
    folder = Path(__file__).parent / "golden" / "bad"
    whole = {path.stem: path.read_bytes() for path in folder.glob("*.yaml")}
    head = (folder / "head").read_bytes()
    return dict(sorted((whole | {path.stem: head + path.read_bytes() for path in folder.glob("*.tail")}).items()))


def assert_golden(text: str, path: Path) -> None:
    """A text must be the one that a file keeps."""
    if os.environ.get("HSDSL_WRITE_GOLDEN"):
        path.write_text(text, encoding="utf-8")
    assert text == path.read_text(encoding="utf-8")
