"""Colours that people with any colour vision tell apart (Okabe and Ito 2008)."""

from __future__ import annotations

from collections.abc import Sequence

from hsdsl.plot.curves import SEVERAL

INK = "#16324f"
FAINT = "#8a8a8a"
ALARM = "#d55e00"
PALETTE = ("#56b4e9", "#e69f00", "#009e73", "#cc79a7", "#f0e442", "#0072b2", "#d55e00")


def colours(modes: Sequence[str]) -> dict[str, str]:
    """Give each mode a colour; after seven modes they begin again, darker."""
    chosen: dict[str, str] = {}
    for i, mode in enumerate(mode for mode in modes if mode != SEVERAL):
        chosen[mode] = _mixed(PALETTE[i % len(PALETTE)], 0.55 ** (i // len(PALETTE)), "#000000")
    return chosen | {mode: "#7a7a7a" for mode in modes if mode == SEVERAL}


def band(colour: str, alone: bool = False) -> str:
    """Lighten a colour for the background, more so where it is the only one."""
    return _mixed(colour, 0.1 if alone else 0.24, "#ffffff")


def curve(colour: str) -> str:
    """Darken a colour for a line on white."""
    return _mixed(colour, 0.75, "#000000")


def _mixed(colour: str, share: float, other: str) -> str:
    parts = (int(colour[i : i + 2], 16) * share + int(other[i : i + 2], 16) * (1 - share) for i in (1, 3, 5))
    return "#" + "".join(f"{round(part):02x}" for part in parts)
