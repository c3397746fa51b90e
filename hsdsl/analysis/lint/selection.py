"""Which rules count: by code or by the beginning of codes, from the command line or a configuration file."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from hsdsl.analysis.lint.rules import FAMILIES, RULES, family
from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean

OWN_FILE = "hsdsl.toml"
_KEYS = ("select", "ignore")


@dataclass(frozen=True)
class Selection:
    """The codes of the rules that run."""

    codes: tuple[str, ...]

    @classmethod
    def of(cls, select: Iterable[str] | None = None, ignore: Iterable[str] | None = None) -> Selection:
        """The rules that ``select`` names, all when it is None, without those that ``ignore`` names.

        Raises UsageError: for a name that no rule has, and for a selection of nothing.
        """
        chosen = set(RULES) if select is None else codes_of(select, "select")
        if not chosen:
            raise UsageError("select: no rule is named", "leave it out to use all rules")
        dropped = set[str]() if ignore is None else codes_of(ignore, "ignore")
        return cls(tuple(code for code in RULES if code in chosen - dropped))


def codes_of(names: Iterable[str], where: str) -> set[str]:
    """The codes that begin with one of some texts, or belong to the family or the rule of that name.

    Raises UsageError: for one that nothing answers to.
    """
    found: set[str] = set()
    for name in filter(None, (part.strip() for part in names)):
        answering = {code for code, rule in RULES.items() if _answers(code, rule.name, name)}
        if not answering:
            known = [*RULES, *FAMILIES, *(rule.name for rule in RULES.values())]
            hint = did_you_mean(name, known, "rules have codes such as HS401; the documentation lists them")
            raise UsageError(f"{where}: no lint rule is called '{name}'", hint)
        found |= answering
    return found


def _answers(code: str, rule: str, name: str) -> bool:
    return (len(name) > 1 and code.startswith(name)) or name in (rule, family(code))


def configured(path: str | os.PathLike[str]) -> dict[str, list[str]]:
    """The ``select`` and ``ignore`` that the configuration nearest to a model gives.

    It is the first ``hsdsl.toml`` (table ``lint``) or ``pyproject.toml`` with a table ``tool.hsdsl.lint``, from the
    model's folder upwards.

    Raises UsageError: the file cannot be read, or has something else in that table.
    """
    folder = Path(os.path.abspath(path)).parent
    for place in (folder, *folder.parents):
        for file, keys in ((place / OWN_FILE, ("lint",)), (place / "pyproject.toml", ("tool", "hsdsl", "lint"))):
            if file.is_file():
                table = _table(file, keys)
                if table is not None or file.name == OWN_FILE:
                    return _checked(file, table or {})
    return {}


def _table(file: Path, keys: tuple[str, ...]) -> Any:
    try:
        found: Any = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UsageError(f"{file}: {error}") from None
    for key in keys:
        found = cast("dict[str, Any]", found).get(key) if isinstance(found, dict) else None
    return found


def _checked(file: Path, table: Any) -> dict[str, list[str]]:
    if not isinstance(table, dict):
        raise UsageError(f"{file}: the lint configuration is a table with `select` and `ignore`")
    for key, value in cast("dict[str, Any]", table).items():
        if key not in _KEYS:
            raise UsageError(f"{file}: there is no setting '{key}' of lint", did_you_mean(key, _KEYS))
        texts = cast("list[Any]", value) if isinstance(value, list) else [None]
        if not all(isinstance(text, str) for text in texts):
            raise UsageError(f"{file}: `{key}` is a list of texts", f'such as {key} = ["HS401"]')
    return cast("dict[str, list[str]]", table)
