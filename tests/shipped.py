"""What the repository has for tests: its models, loaded once, and kept texts, written anew by HSDSL_WRITE_GOLDEN=1."""

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


def assert_golden(text: str, path: Path) -> None:
    """A text must be the one that a file keeps."""
    if os.environ.get("HSDSL_WRITE_GOLDEN"):
        path.write_text(text, encoding="utf-8")
    assert text == path.read_text(encoding="utf-8")
