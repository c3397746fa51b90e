"""The shared parts of pages that draw runs: styles, elements and scripts as files, and how a page is put together."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

SCRIPTS = ("text.js", "axes.js", "plots.js", "player.js")
_PLACE = re.compile(r"\{\{(\w+)\}\}")


def shared(name: str) -> str:
    """Read a file of this folder."""
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


def scripts() -> str:
    """Return the scripts that every page needs, in their order."""
    return "\n".join(map(shared, SCRIPTS))


def filled(page: str, parts: Mapping[str, str]) -> str:
    """Put parts into the places ``{{name}}`` of a page; what looks like a place in a part stays."""
    return _PLACE.sub(lambda place: parts[place[1]], page)


def inert(data: Any) -> str:
    """Write JSON that is no markup, and in one line: the signs that could end an element are escapes."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
