"""What a part finds, and where it puts it."""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from hsdsl.analysis.exact import reference
from hsdsl.base.atomic import replacing
from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Execution
from hsdsl.interface.model import Model, load


@dataclass(frozen=True)
class Finding:
    """One line of the summary.

    Attributes
    ----------
    figure : str
        Where in the paper, as ``Fig. 14d``.
    quantity : str
        What it is, unambiguously.
    here : float, int or str
        What was found.
    known : str
        What the paper prints, its authors recorded or a closed form gives; empty where nothing is known.
    """

    figure: str
    quantity: str
    here: float | int | str
    known: str = ""

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """The line as text, numbers to the digits that a reader can use."""
        here = f"{self.here:.4g}" if isinstance(self.here, float) else str(self.here)
        return self.figure, self.quantity, here, self.known


@dataclass(frozen=True)
class Desk:
    """Where models come from and results go.

    Attributes
    ----------
    out : Path
        Folder of pictures and tables; it exists.
    models : Path
        Folder of the paper's models.
    quick : bool
        Coarser grids.
    """

    out: Path
    models: Path
    quick: bool

    @cached_property
    def oscillators(self) -> dict[int, Model]:
        """Examples 1 and 2 of Table I."""
        return {example: self.model(f"oscillator-with-stop-{example}.yaml") for example in (1, 2)}

    @cached_property
    def truths(self) -> dict[int, Execution]:
        """Their exact executions."""
        return {example: reference(model) for example, model in self.oscillators.items()}

    def model(self, name: str) -> Model:
        """Load one of the paper's models.

        Raises UsageError: it is not there.
        """
        path = self.models / name
        if not path.is_file():
            raise UsageError(f"there is no {path}", "name the folder of the paper's models with --models")
        return load(path)

    def table(self, name: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """Write ``NAME.csv``; numbers so that reading them gives the same ones."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([[repr(v) if isinstance(v, float) else v for v in row] for row in rows])
        with replacing(self.out / f"{name}.csv") as file:
            file.write(text.getvalue().encode())
        say(f"  wrote {self.out / name}.csv")

    def picture(self, name: str, draw: Callable[[], Any]) -> None:
        """Write the figure that ``draw`` makes as ``NAME.png`` and ``NAME.svg``."""
        from hsdsl.analysis.plot import save

        save(draw, self.out / f"{name}.png", self.out / f"{name}.svg")
        say(f"  wrote {self.out / name}.png and .svg")


def say(text: str) -> None:
    """Write progress to standard error."""
    print(text, file=sys.stderr, flush=True)
