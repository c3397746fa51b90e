"""Every field that `--json` prints is in the tables of docs/reference/files.md."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from docs.test_documents import run_hsdsl

from hsdsl.interface.cli.verbs import VERBS, command

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "reference" / "files.md").read_text(encoding="utf-8")
ROOM = str(ROOT / "models" / "thermostat.yaml")
BALL = str(ROOT / "models" / "bouncing-ball.yaml")
SPACEEX = str(ROOT / "tests" / "import" / "heater.xml")
CALLS = [
    ["run", ROOM, "--estimate"],
    ["run", ROOM, "--out", "rows.csv", "--every", "9"],
    ["sweep", ROOM, "--vary", "rate=0.1,0.2", "--out", "sweep", "--processes", "1"],
    ["validate", ROOM],
    ["lint", ROOM],
    ["explain", "HS401"],
    ["distance", ROOM, "--from", "heating T=20", "--to", "idle T=20"],
    ["distance", ROOM, ROOM],
    ["sensitivity", ROOM, "--wrt", "rate"],
    ["orbit", ROOM, "--section", "switch_on"],
    ["fit", ROOM, "data.csv", "--wrt", "rate"],
    ["chart", ROOM, "--methods", "rk4", "--engines", "python", "--schemes", "located", "--steps", "0.1"],
    ["stability", ROOM, "--map", "rate=0.1:0.2:2,tolerance=1e-6:1e-5:2", "--processes", "1", "--no-rho"],
    ["plot", ROOM, "--out", "room.svg"],
    ["complete", BALL, "--out", "complete.yaml"],
    ["complete", BALL],
    ["export", ROOM, "--to", "mermaid", "--out", "graph"],
    ["export", ROOM, "--to", "mermaid"],
    ["import", SPACEEX, "--out", "heater.yaml"],
    ["doctor"],
]


def documented(verb: str) -> dict[str, str]:
    """The fields of a verb's table, each with its meaning."""
    found: dict[str, str] = {}
    part = re.search(rf"^### hsdsl {verb}\n(.*?)(?=^###|\Z)", PAGE, re.MULTILINE | re.DOTALL)
    assert part, f"docs/reference/files.md has no section for hsdsl {verb}"
    for names, meaning in re.findall(r"^\| (`[^|]*`) \| (.*) \|$", part[1], re.MULTILINE):
        found |= dict.fromkeys(re.findall(r"`([^`]+)`", names), meaning)
    return found


def fields(value: Any, path: str = "") -> Iterator[str]:
    """The paths of all fields of an object, `[]` for any item of a list."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield f"{path}.{key}".lstrip(".")
            yield from fields(item, f"{path}.{key}".lstrip("."))
    elif isinstance(value, list):
        for item in value:
            yield from fields(item, f"{path}[]")


def known(field: str, table: dict[str, str]) -> bool:
    """Whether a field is in a table, holds one that is, or is in a map or list that is."""
    if any(name == field or name.startswith((f"{field}.", f"{field}[")) for name in table):
        return True
    above = [name for name in table if field.startswith((f"{name}.", f"{name}["))]
    return any(re.match(r"map|list", table[name]) for name in above)


def test_every_verb_with_json_is_called():
    verbs = {name for name in VERBS if any("--json" in parameter.opts for parameter in command(name).params)}
    assert verbs - {"schema"} == {call[0] for call in CALLS}  # its fields are those of JSON Schema


@pytest.mark.parametrize("call", CALLS, ids=lambda call: " ".join(Path(word).name for word in call[:3]))
def test_every_field_is_documented(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("data.csv").write_text("t,T\n1,20.5\n2,21.4\n3,21\n")
    code, output = run_hsdsl([*call, "--json"])
    assert code == 0, output
    table = documented(call[0])
    unknown = [field for field in dict.fromkeys(fields(json.loads(output))) if not known(field, table)]
    assert not unknown
