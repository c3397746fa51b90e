"""Golden bits: what runs of all models and cases give, frozen to the last bit, for changes that may change no number.

``bits.txt`` has a line for each model: a digest of each of its runs, in the order of :data:`RUNS`. Both engines must
give it. A digest is of all numbers as hexadecimal: times, values, depths, coefficients, transitions. Where a change
means to change numbers, write them anew and look at what differs:

    python tests/golden/test_bits.py write
    python tests/golden/test_bits.py show MODEL RUN [ENGINE] > one    # and in another checkout; then `diff`

Functions such as `sin` are the platform's: where they give other bits, the first line of the file tells, and nothing
can be compared.
"""

from __future__ import annotations

import hashlib
import math
import sys
from collections.abc import Iterator
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

import pytest
from engines import ENGINES

import hsdsl
from hsdsl.base.errors import ModelError, UsageError

GOLDEN, TESTS = Path(__file__).with_name("bits.txt"), Path(__file__).parents[1]
FOLDERS = [TESTS.parent / "models", *(TESTS.parent / "models" / name for name in ("gallery", "parts"))]
FOLDERS += [TESTS / "conformance" / name for name in ("cases", "parts", "events")]
MODELS = {
    f"{folder.name}/{path.stem}": path
    for folder in FOLDERS
    for path in sorted(folder.glob("*.yaml"))
    if not path.stem.endswith(".expect")
}
ADAPTIVE: dict[str, Any] = {"tolerance": 1e-7, "relaxation": 1e-6}
RUNS: dict[str, dict[str, Any]] = {
    "relaxed-heun": {"scheme": "relaxed", "method": "heun", "step": Fraction(1, 12), "relaxation": 3e-4},
    "relaxed-dopri5": {"scheme": "relaxed", "method": "dopri5", **ADAPTIVE},
    "relaxed-radau": {"scheme": "relaxed", "method": "radau", **ADAPTIVE},
    "located-rk4": {"scheme": "located", "method": "rk4", "step": Fraction(1, 7), "relaxation": 1e-5},
    "located-dop853": {"scheme": "located", "method": "dop853", **ADAPTIVE},
    "located-radau": {"scheme": "located", "method": "radau", **ADAPTIVE},
    "located-taylor": {"scheme": "located", "method": "taylor", **ADAPTIVE},
    "digits": {"scheme": "located", "method": "dopri5", "precision": 30, **ADAPTIVE},
}
MOST = {"relaxed": 6, "located": 12, "digits": 2}  # transitions
FEW = 150  # lines of a run that is short enough for the Python loop
SHORT = {"models/stiff-switch": {"until": "1e-4"}}  # explicit steps on it are a ten-millionth long


def hexadecimal(value: Any) -> str:
    """A number, or what holds numbers, without loss."""
    if isinstance(value, dict):
        return " ".join(f"{name}={hexadecimal(each)}" for name, each in value.items())
    if isinstance(value, (int, str, type(None))):
        return str(value)
    if hasattr(value, "_mpf_"):
        return str(value._mpf_)
    if isinstance(value, float) or not hasattr(value, "__iter__"):
        return float(value).hex()
    return " ".join(map(hexadecimal, value))


@lru_cache(1)
def loaded(name: str) -> Any:
    """A model."""
    return hsdsl.load(MODELS[name])


def lines(name: str, run: str, engine: str = ENGINES[-1]) -> Iterator[str]:
    """All numbers of a run, a row, an arc or a transition a line; or that it is refused."""
    arguments = {"max_transitions": MOST.get(run, MOST[RUNS[run]["scheme"]]), **RUNS[run], **SHORT.get(name, {})}
    try:
        found = loaded(name).simulate(engine=engine, **arguments)
    except (ModelError, UsageError) as error:
        yield f"refused: {type(error).__name__}"
        return
    rows = zip(found.times, found.values, found.depth, strict=True)
    yield from (f"row {k}: {hexadecimal(row)}" for k, row in enumerate(rows))
    yield from (f"piece {k}: {hexadecimal(piece)}" for k, piece in enumerate(found.coefficients))
    for arc in found.arcs:
        yield f"arc {arc.jump}: {arc.mode} {arc.states} {arc.kind} from {arc.first} to {arc.last}"
    for made in found.transitions:
        states = hexadecimal(made.before), hexadecimal(made.after)
        instants = hexadecimal([made.time, made.resumed])
        yield f"{made.edge} {instants}: {states} {made.alternatives} {made.entry}"
    yield f"stop: {found.stop.reason} {hexadecimal(found.stop.time)}"


def digest(text: list[str]) -> str:
    """A few characters that stand for many lines."""
    return hashlib.sha256("\n".join(text).encode()).hexdigest()[:8]


@lru_cache(1)
def platform() -> str:
    """A digest of what the platform's functions give.

    glibc gives other bits on processors without FMA, in one of a thousand arguments: findings/bits-of-functions.sh.
    """
    arguments = [0.1 + k / 7000 for k in range(6000)]
    ones, twos = (math.sin, math.cos, math.tan, math.exp, math.log, math.tanh), (math.pow, math.atan2)
    values = [function(a) for function in ones for a in arguments]
    values += [function(a, 1.3) for function in twos for a in arguments]
    return digest([value.hex() for value in values])


def digests(name: str) -> str:
    """The digests of all runs of a model; by both engines, where a run has few rows."""
    found: list[str] = []
    for run in RUNS:
        if run == "digits":
            text = list(lines(name, run, "python"))
        else:
            text = list(lines(name, run))
            if len(text) <= FEW and ENGINES[-1] != "python":
                assert list(lines(name, run, "python")) == text, f"engines differ in {run}"
        found.append(digest(text))
    return " ".join(found)


def golden() -> dict[str, str]:
    """The digests of the models that the file knows."""
    return dict(line.split(": ", 1) for line in GOLDEN.read_text().splitlines()[1:])


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (k % 5 > 0)) for k, n in enumerate(golden())]
)
def test_no_bit_has_changed(name: str) -> None:
    if GOLDEN.read_text().splitlines()[0] != f"platform: {platform()}":
        pytest.skip("the functions of this platform give other bits")
    found, told = digests(name), golden()[name].split()
    changed = [run for run, one, two in zip(RUNS, found.split(), told, strict=True) if one != two]
    assert not changed, f"numbers of {name} have changed; see the docstring of {Path(__file__).name}"


def main() -> None:
    """Write the file, or show a run."""
    match sys.argv[1:]:
        case ["write"]:
            table = {"platform": platform()} | {name: digests(name) for name in MODELS}
            GOLDEN.write_text("".join(f"{name}: {text}\n" for name, text in table.items()))
        case ["show", name, run, *engine]:
            print("\n".join(lines(name, run, *engine)))
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
