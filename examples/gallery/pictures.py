# pyright: reportUnknownMemberType=false
"""A picture of each scene: the exact execution, ours, and SciPy's where it is another."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gallery.scenes import Entry
from hsdsl.analysis.plot.style import ALARM, FAINT, INK, save
from hsdsl.interface.chart.peers import prepare
from hsdsl.interface.chart.scene import sampled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DRAWN: dict[str, tuple[str, ...]] = {
    "three-spheres": ("x1", "x2", "x3"),
    "cascade": ("x1", "x2", "x3", "x4"),
    "equal-balls": ("h1", "h2"),
    "rolling-ball": ("h", "x"),
    "relay": ("x", "y"),
    "two-ways": ("x", "y"),
    "lorenz-section": ("z",),
    "fast-clock": ("x", "u"),
    "narrow-hole": ("h",),
    "two-crossings": ("y",),
}
"""The states in a picture; elsewhere the first one."""
WINDOWS: dict[str, tuple[float, float]] = {
    "restart-on-guard": (1.0, 1.01),
    "narrow-pulse": (4.99, 5.01),
    "stiff-contact": (0.995, 1.01),
    "fast-clock": (0.0, 0.01),
    "stiff-switch": (0.0, 5.0),
    "oscillator-with-stop-1": (0.0, 20.0),
    "blow-up": (0.0, 1.05),
}
"""The times in a picture; elsewhere all."""
POINTS = 500
DRAWN_AT = 1e-6  # the tolerance of SciPy's run
Curve = tuple[Any, Any]


def draw(entry: Entry, path: Path, others: bool) -> None:
    """Write the picture of a scene, with SciPy's execution if ``others``."""
    save(lambda: _figure(entry, others), path)


def _figure(entry: Entry, others: bool) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2, 2.1), layout="constrained")
    axes = figure.subplots()
    states = DRAWN.get(entry.name, entry.scene.states[:1])
    low, high = WINDOWS.get(entry.name, (0.0, entry.until))
    curves: list[tuple[str, Curve, dict[str, Any]]] = []
    curves.append(("exact", _curve(entry.exact, states, low, high), {"color": FAINT, "linewidth": 4, "alpha": 0.6}))
    curves.append(("hsdsl", _ours(entry, states, low, high), {"color": INK, "linewidth": 1.2}))
    if others:
        curves.append(("scipy", _theirs(entry, states), {"color": ALARM, "linewidth": 1.2, "linestyle": "--"}))
    for name, (times, values), style in curves:
        for column in values.T:
            axes.plot(times, column, label=name, **style)
            name = "_"
    exact = curves[0][1][1]
    margin = 0.15 * (float(np.nanmax(exact) - np.nanmin(exact)) or 1.0)
    axes.set_ylim(float(np.nanmin(exact)) - margin, float(np.nanmax(exact)) + margin)
    axes.set_xlim(low, high)
    axes.set_xlabel("t")
    axes.set_ylabel(", ".join(states))
    figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return figure


def _curve(execution: Any, states: Sequence[str], low: float, high: float) -> Curve:
    """Samples, and both sides of every jump."""
    high = min(high, float(execution.stop.time), float(execution.times[-1]))
    jumps = [float(t.time) for t in execution.transitions if low <= float(t.time) <= high]
    evenly = np.linspace(low, high, POINTS)
    times = np.sort(np.concatenate([evenly, np.repeat(jumps[:POINTS], 2)]))
    second = np.concatenate([[False], times[1:] == times[:-1]])
    right, _ = sampled(execution, times, states)
    left = np.array([execution.sample(times, columns=list(states), side="left").state_columns]).reshape(right.shape)
    return times, np.where(second[:, None], right, left)


def _ours(entry: Entry, states: Sequence[str], low: float, high: float) -> Curve:
    method = "radau" if entry.name.startswith("stiff") else "taylor"
    run = entry.model.simulate(scheme="located", method=_smooth(entry, method), tolerance=1e-9)
    return _curve(run, states, low, high)


def _smooth(entry: Entry, method: str) -> str:
    return method if all(mode.tape is not None for mode in entry.model.program.modes if not mode.final) else "dopri5"


def _theirs(entry: Entry, states: Sequence[str]) -> Curve:
    """SciPy's samples."""
    result = prepare("scipy", entry.scene)(DRAWN_AT)
    columns = [entry.scene.states.index(name) for name in states]
    return entry.scene.grid, result.values[:, columns]
