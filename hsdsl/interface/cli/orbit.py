"""``hsdsl orbit``: a periodic orbit by shooting on a section, and its Floquet multipliers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from hsdsl.base.errors import UsageError
from hsdsl.base.progress import counted_runs
from hsdsl.interface.cli.console import draw, progress
from hsdsl.interface.cli.options import AS_RUN, Answer, Located, Model, option, overriding
from hsdsl.interface.cli.texts import check_target

SECTION = "The transition that the orbit is cut at, by its name."
LAPS = "How many transitions of the section close the orbit."
FOLLOW = "Follow the orbit in a parameter from A to B, and mark folds, flips and grazing."
PERIOD = "The period of the forcing, an expression of parameters; left out, that of sines and cosines of t."


def orbit(
    model: Model,
    *,
    section: Annotated[str, option("EDGE", SECTION)],
    laps: Annotated[int, option("N", LAPS)] = 1,
    period: Annotated[str | None, option("T", PERIOD)] = None,
    follow: Annotated[str | None, option("PARAM=A:B", FOLLOW, "--continue")] = None,
    overrides: Annotated[list[str] | None, overriding(AS_RUN)] = None,
    until: Annotated[str | None, option("T", "End of the run that the first guess is from.")] = None,
    located: Located,
    plot: Annotated[Path | None, option("FILE", "Draw it: .png or .svg.")] = None,
    answer: Answer,
) -> None:
    """Find a periodic orbit near the model's run, with its Floquet multipliers."""
    with answer.reporting():
        check_target(plot, "--plot")
        from hsdsl.interface.model import load

        call = located.settings(overrides, until=until, laps=laps, period=period)
        loaded = load(model)
        with progress(answer.hidden) as show:
            if follow is None:
                found = loaded.orbit(section, progress=counted_runs(show), **call)
            else:
                name, *ends = _range(follow)
                found = loaded.continuation(section, name, *ends, progress=counted_runs(show, name), **call)
        draw(found, plot)
        answer.give(found.as_json, lambda: found.summary)


def _range(text: str) -> tuple[str, str, str]:
    """Read PARAM=A:B."""
    name, equals, rest = text.partition("=")
    start, colon, end = rest.partition(":")
    if not (name.strip() and equals and start.strip() and colon and end.strip()):
        raise UsageError(f"--continue: expected PARAM=A:B, got '{text}'", "for example --continue c=0.5:0.9")
    return name.strip(), start.strip(), end.strip()
