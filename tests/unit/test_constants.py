"""Constants that stand in Python and again in C: their values are equal."""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RUNTIME = ROOT / "hsdsl" / "engine" / "runtime" / "c"
FLOAT32 = re.compile(r"#if defined\(HS_FLOAT32\).*?#else", re.DOTALL)
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
DEFINED = re.compile(r"#define (\w+) (.+)")
LISTED = re.compile(r"\b([A-Z][A-Z_]+) = (\d+)\b")  # of `enum { NODES = 4, POWERS = 6 }`
NUMBER = re.compile(r"\(?[-+*/. \deE]*\)?|0x1p[-+]?\d+")
FOLDERS = ("simulate", "simulate/verdict", "integrators", "scheme")
PROGRAM = ("hsdsl.base.numbers.arithmetic", "hsdsl.base.numbers.enclosures", "hsdsl.mathematics.program")
IN_C_ALONE = {
    "BITS", "UNIT", "TIME_UNIT", "INTEGER_POWERS", "AT_START", "AT_END",  # of the number type, and of places
    "PAUSED", "LANDED", "AT_BOUNDARY", "WITHOUT_VALUE", "NO_VALUE", "NO_CONVERGENCE", "TESTS",  # answers of functions
    "CAME_BEYOND", "CAME_ONTO",  # marks
    "LEAST_MOST_DEGREE", "BLOCK", "STEPS_BEFORE_SEARCH", "SMALL", "FEWEST_WAITS",  # of memory
    "LEVELS", "END_LEVELS", "MOST_PARTS_TRIED", "COARSE_PARTS_TRIED", "CLOSE_SHARE",  # of the screen
    "MOST_LANES", "WIDTH", "FAR", "LOST", "MOST_LOST", "KEPT", "KEPT_OF_PLACE", "MOST_ASIDE",  # of lanes
    "OFF", "OWN", "MOST_TURNED", "LEAST_TURNED",  # and of their sines
    "MOST_NEWTON", "MOST_SETTLINGS",  # and how these find roots
    "TINIEST", "LIBRARY",  # of ranges: Python takes the next number instead
}  # fmt: skip


def in_c() -> Iterator[tuple[str, str, float]]:
    """The file, name and value of each constant of float64 that is a number."""
    for path in sorted(RUNTIME.glob("*.[ch]")):
        text = COMMENT.sub("", FLOAT32.sub("", path.read_text()))
        for name, value in (*DEFINED.findall(text), *LISTED.findall(text)):
            if NUMBER.fullmatch(value.strip()):
                number = float.fromhex(value) if "0x" in value else float(eval(value))
                yield path.stem.removeprefix("screen_"), name.removeprefix("HS_"), number


def in_python() -> dict[str, dict[str, float]]:
    """The values of the constants of modules, by their names."""
    files = (path for folder in FOLDERS for path in (ROOT / "hsdsl" / "engine" / folder).glob("[a-z]*.py"))
    modules = (*PROGRAM, *(".".join(path.relative_to(ROOT).with_suffix("").parts) for path in files))
    found: dict[str, dict[str, float]] = {}
    for module in modules:
        for name, value in vars(import_module(module)).items():
            if name.isupper() and isinstance(value, int | float):
                found.setdefault(name, {})[module.split(".")[-1]] = value
    return found


PYTHON = in_python()
CONSTANTS = [each for each in in_c() if each[1] not in IN_C_ALONE]


@pytest.mark.parametrize(("file", "name", "value"), CONSTANTS, ids=[f"{file}-{name}" for file, name, _ in CONSTANTS])
def test_it_has_the_value_that_python_has(file: str, name: str, value: float) -> None:
    values = PYTHON[name]
    assert ({values[file]} if file in values else {*values.values()}) == {value}


def test_there_are_many() -> None:
    assert len(CONSTANTS) > 20


def test_exported_programs_have_them_too() -> None:
    """Those for JAX, by name."""
    shipped = dict[str, str]()
    for path in (ROOT / "hsdsl" / "export" / "jax" / "template").glob("*.py"):
        for names, values in re.findall(r"^([A-Z_, ]+) = ([-\de.e*, ]+)\b", path.read_text(), re.MULTILINE):
            if names.count(", ") == values.count(", "):  # else it is one tuple
                shipped |= dict(zip(names.split(", "), values.split(", "), strict=True))
    common = {name: eval(value) for name, value in shipped.items() if name in PYTHON}
    assert len(common) > 20
    assert {name: value for name, value in common.items() if value not in PYTHON[name].values()} == {}
