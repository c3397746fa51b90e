"""``python examples/paper``."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

EXAMPLES = Path(__file__).parents[1]
MODELS = EXAMPLES.parent / "models"
sys.path[:0] = [str(EXAMPLES), str(MODELS)]

from hsdsl.base.errors import ModelError, UsageError  # noqa: E402
from hsdsl.language.diagnose import render  # noqa: E402
from paper.parts import PARTS  # noqa: E402
from paper.results import Desk, Finding, say  # noqa: E402

HEADER = ("where", "what", "here", "known")


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute the chosen parts; return the exit code, as the verbs of ``hsdsl`` do."""
    options = _parser().parse_args(arguments)
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        findings = _run(Desk(options.out, options.models, options.quick), options.only or list(PARTS))
    except OSError as error:
        say(f"paper: cannot make the folder {options.out}: {error.strerror}")
        return 2
    except ModelError as error:
        say("\n\n".join(render(diagnostic) for diagnostic in error.diagnostics))
        return 1
    except UsageError as error:
        say(f"paper: {error}" + (f"\n  hint: {error.hint}" if error.hint else ""))
        return 2
    except KeyboardInterrupt:
        say("interrupted; what was written is complete")
        return 130
    print(summary(findings))
    return 0


def _run(desk: Desk, names: Sequence[str]) -> list[Finding]:
    findings: list[Finding] = []
    for i, name in enumerate(names, 1):
        began = time.perf_counter()
        say(f"[{i}/{len(names)}] {name}: {PARTS[name].summary}")
        findings += PARTS[name].run(desk)
        say(f"  {time.perf_counter() - began:.1f} s")
    rows = [(f.figure, f.quantity, f.here, f.known) for f in findings]
    desk.table("summary", HEADER, rows)
    return findings


def summary(findings: Sequence[Finding]) -> str:
    """Set the findings as a table."""
    rows = [HEADER, *(finding.cells for finding in findings)]
    widths = [max(len(row[k]) for row in rows) for k in range(4)]
    return "\n".join("  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python examples/paper",
        description="Compute and draw all figures and tables of the paper's Section V; print what is found and known.",
    )
    parser.add_argument("--out", type=Path, default=Path("paper-figures"), help="folder for PNG, SVG and CSV files")
    parser.add_argument("--only", action="append", choices=list(PARTS), metavar="NAME", help=_choices())
    parser.add_argument("--quick", action="store_true", help="coarser grids: seconds instead of minutes")
    parser.add_argument("--models", type=Path, default=MODELS, help="folder of the paper's models")
    return parser


def _choices() -> str:
    return "one part, may be repeated: " + ", ".join(PARTS)


if __name__ == "__main__":
    sys.exit(main())
