# pyright: reportUnknownMemberType=false
"""The strip of modes above the panels of a figure: bars by run, by part or by mode, or shares of the time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hsdsl.analysis.plot.curves import SEVERAL, Curves, Shares, merged, modes_of
from hsdsl.analysis.plot.style import INK, PLAIN, Look, fills
from hsdsl.base.names import shown
from hsdsl.base.parts import parts_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINE = 0.2  # inches of a line of text
ROW, NAMED, HIGHEST = 0.28, 0.15, 3.0  # inches of a row of bars, of one with a name at least, and of all rows at most
LONGEST_LABEL = 24  # letters of a name beside a row, or of a guard's
MOST_BANDS = 9  # modes whose colours and hatches differ
MOST_BEHIND = 60  # bands behind panels; more are a strip above them


class Strip(NamedTuple):
    """Bars of modes above the panels: bands by row, how modes are filled, and shares where the bands are too many."""

    rows: dict[str, list[tuple[str, float, float]]]
    fill: Mapping[str, Look]
    shares: Shares | None = None

    @property
    def inches(self) -> float:
        """The height."""
        return LINE + (3 * ROW if self.shares else min(ROW * len(self.rows), HIGHEST))

    @classmethod
    def of(cls, data: Sequence[Curves], labels: Sequence[str]) -> Strip | None:
        """A row for each of several runs; of one run, where it has many modes, a row for each of these or each part."""
        first, modes = data[0], modes_of(data)
        if len(data) > 1:
            rows = {f"{k} {label}": run.bands for k, (label, run) in enumerate(zip(labels, data, strict=True))}
            return cls(rows, fills(modes, light=False)) if len(modes) > 1 else None
        if first.shares is not None and len(first.shares.of) <= MOST_BANDS:
            return cls({}, fills([*first.shares.of], light=False), first.shares)
        if len(modes) <= (PLAIN if parts_in(modes) else MOST_BANDS):
            return cls({"": first.bands}, fills(modes, light=False)) if len(first.bands) > MOST_BEHIND else None
        parts = parts_in([mode for mode in first.modes if mode != SEVERAL])
        rows = (
            {mode: [band for band in first.bands if band[0] == mode] for mode in first.modes}
            if parts is None
            else {
                part: merged([(modes.get(mode, SEVERAL), begin, end) for mode, begin, end in first.bands])
                for part, modes in parts.items()
            }
        )
        named = list(dict.fromkeys(mode for bands in rows.values() for mode, _, _ in bands))
        one: Look = {"facecolor": INK, "linewidth": 0}
        return cls(rows, fills(named, light=False) if named != [*rows] else dict.fromkeys(named, one))

    def draw(self, axis: Axes, names: Sequence[str]) -> None:
        """Draw the bars, the first row on top, or the shares of the time that modes take."""
        axis.tick_params(left=False, bottom=False, labelbottom=False)
        axis.spines[["left", "bottom"]].set_visible(False)
        if self.shares is not None:
            edges, low = self.shares.edges, np.zeros(len(self.shares.edges))
            for mode, share in self.shares.of.items():
                high = low + np.append(share, share[-1])
                axis.fill_between(edges, low, high, step="post", label=mode, **self.fill[mode])
                low = high
            axis.set(ylim=(0, 1), yticks=(0, 1), yticklabels=("0", "1"), ylabel="share")
            return
        for row, bands in enumerate(self.rows.values()):
            for mode in dict.fromkeys(mode for mode, _, _ in bands):
                spans = [(begin, end - begin) for name, begin, end in bands if name == mode]
                axis.broken_barh(spans, (row - 0.4, 0.8), label=mode, **self.fill[mode])
        axis.set_ylim(len(names) - 0.5, -0.5)
        named = range(0, len(names), ceil(NAMED * len(names) / (self.inches - LINE)))
        axis.set_yticks(named, [shown(names[row], LONGEST_LABEL) for row in named], parse_math=False)
