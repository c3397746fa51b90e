"""What is wrong with a file, in its own words, and what was meant: imported when a stage of reading has failed.

Reading goes on without the faults that are found, so that one answer has them all.

=============== ===============================================================================
``tables.toml`` words of other tools, and what to write here
``documents``   `reread`: keys and values that the schema refuses; each is taken out, and the rest is read
``yaml_text``   what YAML takes for something else; what it cuts apart is joined
``values``      the hint for a value that is of another kind than its key asks for
``corrections`` what only the whole document shows: indentation, idioms of other tools, misspelt states
``expressions`` signs, words and names of other languages in expressions
=============== ===============================================================================
"""

from __future__ import annotations

import tomllib
from importlib import resources
from typing import Any

TABLES: dict[str, Any] = tomllib.loads(resources.files(__name__).joinpath("tables.toml").read_text(encoding="utf-8"))
OTHER_NAMES: dict[str, list[str]] = {}  # for each key of another tool those that it may mean here
for _key, _others in TABLES["keys"].items():
    for _other in _others.split():
        OTHER_NAMES.setdefault(_other, []).append(_key)
