# pyright: reportUnknownMemberType=false
"""The scene of a run as a film: GIF by Pillow, MP4 by ffmpeg; the mode and the time are below the shapes."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hsdsl.analysis.plot.curves import curves
from hsdsl.analysis.plot.style import ALARM, INK, RUNS, check_suffixes, fills, styled
from hsdsl.analysis.report import words
from hsdsl.base.atomic import replacing
from hsdsl.base.errors import UsageError
from hsdsl.base.names import shown, visible
from hsdsl.engine.execution import Array, Execution, Samples

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


FORMATS = (".gif", ".mp4")
FPS = 25
SHORTEST, LONGEST = 4.0, 20.0  # seconds of a film whose speed nobody chose
MOST = 5000  # frames
FAR = 100  # pictures: what reaches farther, at the end of a run that failed, would take minutes to draw
INCHES, DPI = 6.4, 100
HINT = "write a .gif, which needs nothing else, or install ffmpeg"


def check(path: str | os.PathLike[str]) -> Path:
    """Refuse what cannot be written, before a run.

    Raises UsageError: the suffix is not one of a film, or ffmpeg is missing.
    """
    (target,) = check_suffixes(path, formats=FORMATS)
    if target.suffix.lower() == ".mp4" and which("ffmpeg") is None:
        raise UsageError(f"{target}: an .mp4 needs the program ffmpeg, which is not there", HINT)
    if not target.parent.is_dir():
        raise UsageError(f"{target}: there is no folder {target.parent}")
    return target


def frame_times(run: Execution, speed: float | None) -> Array:
    """Return the time of each frame; ``speed`` is time of the run by seconds of the film.

    Raises UsageError: the speed is not positive, or the film would have more than `MOST` frames.
    """
    start, end = map(float, run.time_span)
    if speed is None:
        seconds = min(LONGEST, max(SHORTEST, end - start))
    elif not speed > 0 or not math.isfinite(speed):
        raise UsageError(f"expected a positive speed, got {speed}")
    else:
        seconds = (end - start) / speed
    if seconds * FPS > MOST:
        faster = f"{(end - start) * FPS / MOST:.3g}"
        raise UsageError(f"the film would have {seconds * FPS:,.0f} frames, and {MOST:,} is the most: choose a speed of"
                         f" at least {faster}")  # fmt: skip
    return np.linspace(start, end, max(2, round(seconds * FPS) + 1)) if end > start else np.array([start])


def animate(
    run: Execution,
    shapes: Sequence[Any],
    path: str | os.PathLike[str],
    speed: float | None = None,
    unit: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write the film of a run whose outputs are the numbers of its scene.

    Parameters
    ----------
    shapes : sequence of `hsdsl.language.system.Shape`
    speed : float, optional
        Model time per second of the film; by default 1 if the film then lasts 4 to 20 s, or else a value for such a
        length.
    unit : str, optional
        The unit of time.
    progress : callable, optional
        Called after each frame with the number of finished frames and their total number.

    Raises UsageError: as :func:`check` and :func:`frame_times`.
    """
    target = check(path)
    times = frame_times(run, speed)
    samples = run.sample(times)
    with styled(), TemporaryDirectory() as folder:
        from matplotlib.figure import Figure

        figure, scene, cursor = _set_up(Figure(layout="constrained"), run, samples, shapes)
        ends = np.array([scene.get_xlim(), scene.get_ylim()])
        middle, view = ends.mean(axis=1), float(np.ptp(ends, axis=1).max())
        file = Path(folder) / f"film{target.suffix.lower()}"
        with _writer(target).saving(figure, str(file), DPI) as writer:
            for row, time in enumerate(times.tolist()):
                if row == 1:
                    figure.set_layout_engine("none")  # keeps the places of the first frame
                for artist in [*scene.patches, *scene.lines]:
                    artist.remove()
                for drawn in shapes_at(samples, shapes, row):
                    if drawn.reach(middle) <= FAR * view:
                        draw_shape(scene, drawn)
                cursor.set_xdata([time, time])
                label = f"t = {words.number(time, 4)}{f' {unit}' if unit else ''}, {shown(str(samples.mode[row]), 40)}"
                scene.set_xlabel(visible(label), loc="left", parse_math=False)
                writer.grab_frame()
                if progress is not None:
                    progress(row + 1, len(times))
        with replacing(target) as out:
            out.write(file.read_bytes())


def _writer(target: Path) -> Any:
    from matplotlib.animation import FFMpegWriter, PillowWriter

    if target.suffix.lower() == ".gif":
        return PillowWriter(fps=FPS)
    return FFMpegWriter(fps=FPS, extra_args=["-pix_fmt", "yuv420p", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2"])


def _set_up(figure: Figure, run: Execution, samples: Samples, shapes: Sequence[Any]) -> tuple[Figure, Axes, Any]:
    """Size the picture after everything that the shapes reach, and draw what no frame changes."""
    (left, right), (low, high) = _box(run, samples, shapes)
    shape = min(1.6, max(0.35, (high - low) / (right - left)))
    figure.set_size_inches(INCHES, round(INCHES * shape, 1) + 1.0)
    grid = figure.add_gridspec(2, 1, height_ratios=[INCHES * shape, 0.18])
    scene, ribbon = figure.add_subplot(grid[0]), figure.add_subplot(grid[1])
    scene.set(xlim=(left, right), ylim=(low, high), aspect="equal", xticks=[], yticks=[])
    scene.spines[:].set_visible(False)
    scene.set_title(shown(words.heading(run), 70), loc="left", fontsize=10, fontweight="bold", parse_math=False)
    data = curves(run)
    for mode, fill in fills(data.modes, light=False).items():
        spans = [(begin, end - begin) for name, begin, end in data.bands if name == mode]
        ribbon.broken_barh(spans, (0, 1), label=mode, **fill)
    start, end = data.span
    ribbon.set(xlim=(start, end if end > start else start + 1), ylim=(0, 1), yticks=[])
    ribbon.spines[:].set_visible(False)
    ribbon.tick_params(labelsize=7)
    return figure, scene, ribbon.axvline(start, color="#000000", linewidth=2.0)


def _box(run: Execution, samples: Samples, shapes: Sequence[Any]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Find the ends of both axes; what a run that stopped early does at its end is arbitrary."""
    rows = len(samples) if run.stop.complete else max(1, int(0.97 * len(samples)))
    reached = [drawn.extent for row in range(rows) for drawn in shapes_at(samples, shapes, row)]
    points = np.concatenate(reached) if reached else np.zeros((1, 2))
    low, high = points.min(axis=0), points.max(axis=0)
    size = float(max(*(high - low), 1e-9 * np.abs(points).max())) or 1.0
    room, least = 0.06 * size, 0.05 * size
    ends = [(float(a) - room - least * (b - a < least), float(b) + room + least * (b - a < least))
            for a, b in zip(low, high, strict=True)]  # fmt: skip
    return ends[0], ends[1]


COILS = 8  # of a spring


class Drawn(NamedTuple):
    """A shape at one time: its kind, its points (n, 2), and its sizes."""

    kind: str
    points: Array
    sizes: tuple[float, ...]

    @property
    def outline(self) -> Array:
        """The corners of a box, the zigzag of a spring, else the points."""
        if self.kind == "box":
            width, height, angle = self.sizes
            corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (width / 2, height / 2)
            turned = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
            return self.points[0] + corners @ turned
        return _zigzag(*self.points) if self.kind == "spring" else self.points

    def reach(self, point: Array) -> float:
        """How far its farthest coordinate is from that of a point."""
        return float(np.abs(self.extent - point).max())

    @property
    def extent(self) -> Array:
        """Points that a picture must have room for."""
        if self.kind == "circle":
            return np.concatenate([self.points - self.sizes[0], self.points + self.sizes[0]])
        return self.points if self.kind == "spring" else self.outline


def _zigzag(start: Array, end: Array) -> Array:
    along = end - start
    across = np.array([-along[1], along[0]]) * 0.06
    shares = np.linspace(0.12, 0.88, 2 * COILS + 1)
    sides = np.array([0, *([1, -1] * COILS)[: 2 * COILS - 1], 0])
    return np.concatenate([[start], start + np.outer(shares, along) + np.outer(sides, across), [end]])


def shapes_at(samples: Samples, shapes: Sequence[Any], row: int) -> Iterator[Drawn]:
    """Give the shapes at a row that have all their numbers; these are the outputs ``scene 0``, ``scene 1``, ..."""
    at = 0
    for shape in shapes:
        numbers = np.array([float(samples[f"scene {k}"][row]) for k in range(at, at + shape.numbers)])
        at += shape.numbers
        if np.isfinite(numbers).all():
            points = numbers[: 2 * shape.points].reshape(-1, 2)
            yield Drawn(shape.kind, points, tuple(numbers[2 * shape.points :].tolist()))


def draw_shape(axis: Axes, drawn: Drawn) -> None:
    """Add a shape to an axis."""
    from matplotlib.patches import Circle, Polygon

    look: dict[str, Any] = {"edgecolor": INK, "facecolor": f"{RUNS[0]}59", "linewidth": 1.6}
    if drawn.kind == "circle":
        x, y = drawn.points[0].tolist()
        axis.add_patch(Circle((x, y), abs(drawn.sizes[0]), **look))
    elif drawn.kind == "box":
        axis.add_patch(Polygon(drawn.outline, closed=True, **look))
    elif drawn.kind == "point":
        axis.plot(*drawn.points.T, "o", color=ALARM, markersize=6)
    else:
        axis.plot(*drawn.outline.T, color=INK, linewidth=1.6, solid_joinstyle="round")
