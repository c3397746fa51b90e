"""The page of typical mistakes, from the records that the tests compare with."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from writing.markdown import code, escaped, table

GOLDEN = Path(__file__).parents[2] / "tests" / "golden"

MISTAKES = """# Typical mistakes

What people write who come from other tools or are new to YAML, and the messages. Each row is a test: the model at
the end with one passage written as in the row, a file of its own, or a command. The codes are explained on
[their page](errors.md); `hsdsl explain HS106` prints the same.

"""


def mistakes() -> str:
    """Tabulate what is answered to typical mistakes, from the records that the tests compare with."""
    data = yaml.safe_load((GOLDEN / "mistakes.yaml").read_text(encoding="utf-8"))
    records = (GOLDEN / "mistakes.txt").read_text(encoding="utf-8").split("### ")[1:]
    printed = {record.split("\n", 1)[0]: record.split("\n", 1)[1] for record in records}
    parts = [MISTAKES]
    for group, cases in data["groups"].items():
        rows = [(case["title"], written_as(case), answers(printed[f"{group}: {case['title']}"])) for case in cases]
        parts.append(f"## {group}\n\n" + table(("mistake", "written", "answer"), rows))
    return "".join(parts) + f"## The model\n\n```yaml\n{data['base']}```\n"


def written_as(case: Mapping[str, Any]) -> str:
    """Show the lines of a mistake that differ from what they should be."""
    if "command" in case:
        return code("hsdsl " + " ".join(case["command"]))
    lines = str(case.get("write", case.get("file"))).splitlines()
    right = str(case.get("for", "")).splitlines()
    wrong = [line for line in lines if line not in right] or lines
    return "<br>".join(code(line.replace("\t", "→")) for line in wrong[:6] if line.strip()) or "nothing"


def answers(printed: str) -> str:
    """Set the messages of a record, each with its hint."""
    found: list[str] = []
    for line in printed.splitlines():
        message = re.match(r"[^ ]+:(\d+):(\d+): error (HS\d+): (.*)|(?:hsdsl|Error): (.*)", line)
        if message and message[3]:
            found.append(f"[{message[3]}](errors.md#{message[3].lower()}) {escaped(message[4])}")
        elif message:
            found.append(escaped(message[5]))
        elif line.startswith("  hint: ") and found:
            found[-1] += f"; *{escaped(line[8:])}*"
    return "<br>".join(found)
