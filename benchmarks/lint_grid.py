"""How long linting takes, by the number of modes: `python benchmarks/lint_grid.py`.

The models are squares of cells (`tests/lint/grid.py`). Processor time of this process, reading included.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from lint.grid import grid

from hsdsl.analysis.lint import lint
from hsdsl.language.elaborate import elaborate


def seconds(work, *arguments, **named) -> float:
    """The processor time that a call takes."""
    began = time.process_time()
    work(*arguments, **named)
    return time.process_time() - began


def main() -> None:
    """Print a table."""
    print("modes  reading  with lint  per mode")
    for side in (5, 10, 15, 20, 25):
        text = grid(side).encode()
        reading = seconds(elaborate, "grid.yaml", text=text)
        linting = seconds(lint, "grid.yaml", text=text)
        print(f"{side**2:5}  {reading:5.2f} s  {linting:7.2f} s  {linting / side**2 * 1e3:5.2f} ms")


if __name__ == "__main__":
    main()
