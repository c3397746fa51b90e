# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""Fig. 16: the touchdown guards in pitch and height, and both strides through them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from hsdsl.analysis.plot.style import INK
from hsdsl.engine.execution import Execution
from paper.drawing.axes import shades

NAMES = {
    "G(a,l)": (-0.42, "$G_{(a,l)}$"),
    "G(l,g)": (-0.42, "$G_{(l,g)}$"),
    "G(a,r)": (0.32, "$G_{(a,r)}$"),
    "G(r,g)": (0.32, "$G_{(r,g)}$"),
}


def draw(curves: Mapping[str, Sequence[float]], runs: Mapping[str, Execution]) -> Figure:
    """Draw the four guards, the domains between them, and both strides until both feet are down."""
    figure = Figure(figsize=(6.4, 5.0), layout="constrained")
    axis = figure.subplots()
    th = np.linspace(-0.5, 0.5, len(curves["G(a,l)"]))
    palette = shades(["G(a,l)", "G(a,r)"])
    for name, curve in curves.items():
        left = name in ("G(a,l)", "G(r,g)")
        axis.plot(th, curve, color=palette["G(a,l)" if left else "G(a,r)"], linewidth=2.0)
        at, label = NAMES[name]
        k = int(np.argmin(np.abs(th - at)))
        axis.annotate(label, (th[k], curve[k]), xytext=(4, 13), textcoords="offset points", fontsize=10, ha="left",
                      color=palette["G(a,l)" if left else "G(a,r)"])  # fmt: skip
    for name, style in (("A", "-"), ("B", "--")):
        run = runs[name]
        landed = next(t for t in run.transitions if t.target == "ground")
        points = run.sample(np.linspace(0, float(landed.resumed or landed.time) + 0.03, 400))
        axis.plot(points["th"], points["z"], style, color=INK, linewidth=1.6,
                  label=rf"stride {name}, $\dot\theta_0 = {'0' if name == 'A' else '-0.4'}$")  # fmt: skip
        axis.annotate("", (points["th"][-1], points["z"][-1]), (points["th"][-12], points["z"][-12]),
                      arrowprops={"arrowstyle": "-|>", "color": INK, "shrinkA": 0, "shrinkB": 0})  # fmt: skip
        marks = [t.before for t in run.transitions[:2]]
        axis.plot([m["th"] for m in marks], [m["z"] for m in marks], "o", color=INK, markersize=4.5,
                  markerfacecolor="white", zorder=5)  # fmt: skip
    for text, x, z in (
        ("$D_a$ aerial", 0.13, 1.1),
        ("$D_l$ left stance", -0.42, 0.94),
        ("$D_r$ right stance", 0.25, 0.6),
        ("$D_g$ ground", 0.1, 0.5),
    ):
        axis.text(x, z, text, color="#555555", fontsize=9)
    axis.set(xlim=(-0.5, 0.5), ylim=(0.3, 1.25), xlabel=r"pitch $\theta$ [rad]", ylabel="height $z$ [m]")
    axis.legend(frameon=False, loc="lower left", fontsize=8.5)
    return figure
