"""Rebuild the stored references: ``python models/references/build.py [NAME-BLOCK]...``, all of them when none is named.

Each is solved by Taylor series of order 40 in eighty digits, with steps and with half steps (`hsdsl.exact.by_series`),
from equations written by hand. It is written down only if the relaxed scheme, which shares nothing with that solution,
refined by `hsdsl.exact.precise` from the model's file, agrees to nine digits.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import hsdsl
from hsdsl.exact.references import STORED, file_name, references_of
from hsdsl.exact.refined import difference
from hsdsl.execution import Execution

HERE = Path(__file__).parent
DIGITS = 9  # that the two must agree to


def solved(name: str, block: int) -> Execution:
    """Solve a reference anew, and hold it against the relaxed scheme."""
    model = hsdsl.load(HERE.parent / f"{name}.yaml")
    found = STORED[name][block]()
    initial = {key.removeprefix("initial."): text for key, text in references_of(model)[block].items()}
    other = hsdsl.exact.precise(model, DIGITS + 2, initial=initial)
    apart = difference(found, other)
    if not apart <= 10.0**-DIGITS:
        raise SystemExit(f"{name}, block {block}: the relaxed scheme's refined run is {apart:.2g} away")
    agreed = f"; the relaxed scheme, refined from the model's file, agrees to {apart:.1g}"
    return replace(found, settings=found.settings | {"source": found.settings["source"] + agreed})


def main(wanted: list[str]) -> None:
    """Write the named references, or all."""
    for name, solutions in STORED.items():
        for block in range(len(solutions)):
            if not wanted or f"{name}-{block}" in wanted:
                run = solved(name, block)
                run.save(HERE / file_name(name, block))
                print(
                    f"{file_name(name, block)}: error {run.settings['error']:.2g}, {run.settings['source']}", flush=True
                )


if __name__ == "__main__":
    main(sys.argv[1:])
