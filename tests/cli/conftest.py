"""The command line as a user meets it: arguments in, exit code and both streams out."""

from __future__ import annotations

import json as json_module
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from hsdsl.interface.cli import main


@dataclass(frozen=True)
class Answer:
    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """Standard output as the one JSON object it must be."""
        return json_module.loads(self.out, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


@pytest.fixture
def command(capsys, monkeypatch):
    def run(*arguments: object) -> Answer:
        monkeypatch.setattr(sys, "argv", ["hsdsl", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            main()
        streams = capsys.readouterr()
        assert "Traceback" not in streams.err
        return Answer(stop.value.code or 0, streams.out, streams.err)

    return run


@pytest.fixture
def model(tmp_path):
    """Write a model file and return its path."""

    def write(text: str, name: str = "model.yaml") -> Path:
        path = tmp_path / name
        path.write_text(text)
        return path

    return write
