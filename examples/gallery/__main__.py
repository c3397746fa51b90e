"""``python examples/gallery``: run every scene with every tool, and write the page."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

EXAMPLES = Path(__file__).parents[1]
sys.path[:0] = [str(EXAMPLES), str(EXAMPLES.parent / "models")]

from gallery.outcomes import outcomes  # noqa: E402
from gallery.page import page  # noqa: E402
from gallery.pictures import DRAWN_AT, draw  # noqa: E402
from gallery.records import Record, Records, joined, read, save, versions  # noqa: E402
from gallery.scenes import Entry, entries  # noqa: E402
from gallery.settings import Setting, own_settings, peer_settings  # noqa: E402
from hsdsl.interface.chart import PEERS  # noqa: E402

DOCS = EXAMPLES.parent / "docs"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is chosen; return the exit code."""
    known = entries()
    given = _parser().parse_args(arguments)
    if unknown := sorted({*given.only} - set(known)):
        print(f"gallery: there is no scene '{unknown[0]}'; the scenes are {', '.join(known)}", file=sys.stderr)
        return 2
    chosen = [known[name] for name in given.only or known]
    file = given.out / "gallery.json"
    if not given.page:
        _run(file, chosen, _settings(given.tools), given.processes)
    if given.pictures if given.pictures is not None else not given.page:
        (given.out / "images" / "gallery").mkdir(parents=True, exist_ok=True)
        for entry in chosen:
            _say(f"{entry.name}: picture")
            scipy = [r for r in read(file).of(entry.name, "scipy") if r.setting.tolerance == DRAWN_AT]
            wrong = any(r.outcome.word == "wrong" for r in scipy)
            draw(entry, given.out / "images" / "gallery" / f"{entry.name}.svg", wrong)
    (given.out / "gallery.md").write_text(page(read(file), list(known.values())), encoding="utf-8")
    return 0


def _settings(tools: Sequence[str]) -> list[Setting]:
    every = [*own_settings(), *peer_settings()]
    return [setting for setting in every if not tools or setting.name in tools]


def _run(file: Path, chosen: Sequence[Entry], settings: Sequence[Setting], processes: int) -> None:
    """Run scene by scene; what is done is written at once."""
    numbers = versions()
    present = [s for s in settings if s.name not in PEERS or numbers[s.name]]
    for entry in chosen:
        found: list[Record] = []
        for tool in dict.fromkeys(setting.name for setting in present):
            group = [setting for setting in present if setting.name == tool]
            _say(f"{entry.name}: {tool}")
            found += [Record(entry.name, setting, each) for setting, each in outcomes(entry, group, processes)]
        old = read(file).rows if file.is_file() else ()
        save(file, Records(numbers, joined(old, found)))


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="gallery", description="Run hard scenes with every tool; write the page.")
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="SCENE", help="these scenes; others keep their results"
    )
    parser.add_argument("--tools", nargs="+", default=[], metavar="TOOL", help="these tools: 'hsdsl c', scipy, ...")
    parser.add_argument("--page", action="store_true", help="write the page from gallery.json, and run nothing")
    drawn = "draw the pictures; else with everything but --page"
    parser.add_argument("--pictures", action=argparse.BooleanOptionalAction, help=drawn)
    parser.add_argument("--processes", type=int, default=1, metavar="N", help="how many runs at a time (1)")
    parser.add_argument("--out", type=Path, default=DOCS, metavar="DIR", help="where the files go (docs)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
