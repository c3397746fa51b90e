# pyright: reportUnknownMemberType=false
"""The scene of a run as a film: GIF by Pillow, MP4 by ffmpeg; the mode and the time are below the shapes.

What no frame changes is drawn once; a frame copies it, and draws what moves upon it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from shutil import which
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

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
    from matplotlib.lines import Line2D
    from PIL.Image import Image


FORMATS = (".gif", ".mp4")
FPS = 25
SHORTEST, LONGEST = 4.0, 20.0  # seconds of a film whose speed nobody chose
MOST = 5000  # frames
FAR = 1e6  # pictures: a circle that reaches farther, at the end of a run that failed, would take minutes to draw
INCHES, DPI = 6.4, 100
SEEN, COLOURS = 9, 256  # so many frames, from the first to the last, give a GIF its colours
APART = 10  # of 255: Pillow looks colours up without their last two bits, and each chosen one must be found again
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
    with styled():
        stage = Stage(run, run.sample(times), shapes, unit)
        frames = counted_off((stage.frame(row) for row in range(len(times))), len(times), progress)
        with replacing(target) as file:
            if target.suffix.lower() == ".gif":
                _write_gif(frames, _palette(stage, len(times)), file)
            else:
                _write_mp4(frames, stage.size, file)


def counted_off(frames: Iterator[Array], count: int, progress: Callable[[int, int], None] | None) -> Iterator[Array]:
    """Tell how many frames are finished."""
    for done, frame in enumerate(frames):
        if progress is not None and done:
            progress(done, count)
        yield frame
    if progress is not None:
        progress(count, count)


def _palette(stage: Stage, count: int) -> Image:
    """The most frequent colours of some frames: one table for the whole GIF, where the search for each takes longer."""
    from PIL import Image

    rows = np.unique(np.linspace(0, count - 1, SEEN).astype(int)).tolist()
    seen = Image.fromarray(np.concatenate([stage.frame(row) for row in rows]))
    chosen: list[Array] = []
    for _, colour in sorted(seen.getcolors(seen.width * seen.height) or (), reverse=True):
        if len(chosen) < COLOURS and (not chosen or np.abs(np.subtract(chosen, colour)).max(axis=1).min() >= APART):
            chosen.append(np.array(colour))
    table = Image.new("P", (1, 1))
    table.putpalette(np.concatenate(chosen).tolist())
    return table


def _write_gif(frames: Iterator[Array], palette: Image, file: BinaryIO) -> None:
    from PIL import Image

    first, *others = (Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    first.save(file, "GIF", save_all=True, append_images=others, duration=1000 / FPS, loop=0)


def _write_mp4(frames: Iterator[Array], size: tuple[int, int], file: BinaryIO) -> None:
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-framerate", str(FPS), "-i", "-"]
    form = ["-pix_fmt", "yuv420p", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2"]
    with TemporaryDirectory() as folder:
        made = Path(folder) / "film.mp4"
        command = ["ffmpeg", "-loglevel", "error", *raw, *form, str(made)]
        with Popen(command, stdin=PIPE, stderr=DEVNULL) as ffmpeg:
            assert ffmpeg.stdin is not None
            with suppress(BrokenPipeError), ffmpeg.stdin:
                for frame in frames:
                    ffmpeg.stdin.write(frame.tobytes())
        if ffmpeg.returncode:
            raise UsageError(f"ffmpeg cannot write the film: it ends with code {ffmpeg.returncode}", HINT)
        file.write(made.read_bytes())


class Stage:
    """The picture of a scene: what no frame changes is drawn once, and the rest upon it."""

    def __init__(self, run: Execution, samples: Samples, shapes: Sequence[Any], unit: str | None) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self.samples, self.shapes, self.unit = samples, shapes, f" {unit}" if unit else ""
        self.canvas = FigureCanvasAgg(Figure(dpi=DPI, layout="constrained"))
        # The lower left and the upper right corner of all shapes, and those of the first view, or the same again.
        # What a run that stopped early does at its end is arbitrary
        rows = len(samples) if run.stop.complete else max(1, int(0.97 * len(samples)))
        seen = [drawn for row in range(rows) for _, drawn in shapes_at(samples, shapes, row)]
        reached = [drawn.extent for drawn in seen if drawn.kind != "view"]
        points = np.concatenate(reached) if reached else np.zeros((1, 2))
        low, high = points.min(axis=0), points.max(axis=0)
        size = float(max(*(high - low), 1e-9 * np.abs(points).max())) or 1.0
        room = size * np.where(high - low < 0.05 * size, 0.11, 0.06)
        self.whole = np.array([low - room, high + room])
        first = next((drawn.extent for drawn in seen if drawn.kind == "view"), self.whole)
        width, height = (first[1] - first[0]).tolist()
        self.shape = height / width if width > 0 and height > 0 else 1.0
        self.scene, self.cursor = self._set_up(run)
        self.artists = [_artist(self.scene, shape.kind) for shape in shapes]
        self._label(0)
        self.canvas.draw()
        self.canvas.figure.set_layout_engine("none")  # keeps the places, of the label too
        self.scene.set_xlabel("")
        self.canvas.draw()
        self.still: Any = self.canvas.copy_from_bbox(self.canvas.figure.bbox)

    @property
    def size(self) -> tuple[int, int]:
        """The width and the height of a frame."""
        return self.canvas.get_width_height()

    def frame(self, row: int) -> Array:
        """The colours of a frame, shape (height, width, 3)."""
        self.canvas.restore_region(self.still)
        shapes = dict(shapes_at(self.samples, self.shapes, row))
        middle, view = self._look_at([drawn for drawn in shapes.values() if drawn.kind == "view"], row)
        for k, drawn in shapes.items():
            if (artist := self.artists[k]) and (drawn.kind != "circle" or drawn.reach(middle) <= FAR * view):
                if drawn.kind == "circle":
                    artist.set(center=drawn.points[0], radius=abs(drawn.sizes[0]))
                elif drawn.kind == "box":
                    artist.set_xy(drawn.outline)
                else:
                    artist.set_data(*drawn.outline.T)
                self.scene.draw_artist(artist)
        time = float(self.samples.time[row])
        self.cursor.set_xdata([time, time])
        self.scene.draw_artist(self.cursor)
        self._label(row)
        self.scene.draw_artist(self.scene.xaxis.label)
        return np.asarray(self.canvas.buffer_rgba())[:, :, :3].copy()

    def _label(self, row: int) -> None:
        mode = shown(str(self.samples.mode[row]), 40)
        label = f"t = {words.number(float(self.samples.time[row]), 4)}{self.unit}, {mode}"
        self.scene.set_xlabel(visible(label), loc="left", parse_math=False)

    def _look_at(self, views: Sequence[Drawn], row: int) -> tuple[Array, float]:
        """Show what the last of the views says, or the whole scene; return its middle and its size."""
        ends = views[-1].extent if views else self.whole
        middle, (width, height) = ends.mean(axis=0), (ends[1] - ends[0]).tolist()
        if not (width > 0 and height > 0):
            time = words.number(float(self.samples.time[row]), 4)
            raise UsageError(f"expected a view with a positive size, got {width:g} by {height:g} at t = {time}")
        half = np.array([1, self.shape]) * max(width, height / self.shape) / 2
        (left, low), (right, high) = middle - half, middle + half
        self.scene.set(xlim=(left, right), ylim=(low, high))
        return middle, 2 * float(half.max())

    def _set_up(self, run: Execution) -> tuple[Axes, Line2D]:
        """Size the picture after its first view, or after the whole scene, and draw what no frame changes."""
        figure = self.canvas.figure
        shape = min(1.6, max(0.35, self.shape))
        figure.set_size_inches(INCHES, round(INCHES * shape, 1) + 1.0)
        grid = figure.add_gridspec(2, 1, height_ratios=[INCHES * shape, 0.18])
        scene, ribbon = figure.add_subplot(grid[0]), figure.add_subplot(grid[1])
        scene.set(xlim=(0, 1), ylim=(0, self.shape), aspect="equal", xticks=[], yticks=[])
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
        return scene, ribbon.axvline(start, color="#000000", linewidth=2.0, animated=True)


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
        if self.kind in ("circle", "view"):
            half = np.array(self.sizes if self.kind == "circle" else [size / 2 for size in self.sizes])
            return np.concatenate([self.points - half, self.points + half])
        return self.points if self.kind == "spring" else self.outline


def _zigzag(start: Array, end: Array) -> Array:
    along = end - start
    across = np.array([-along[1], along[0]]) * 0.06
    shares = np.linspace(0.12, 0.88, 2 * COILS + 1)
    sides = np.array([0, *([1, -1] * COILS)[: 2 * COILS - 1], 0])
    return np.concatenate([[start], start + np.outer(shares, along) + np.outer(sides, across), [end]])


def shapes_at(samples: Samples, shapes: Sequence[Any], row: int) -> Iterator[tuple[int, Drawn]]:
    """Give the shapes at a row that have all their numbers, with their indices.

    The numbers are the outputs ``scene 0``, ``scene 1``, ...
    """
    at = 0
    for index, shape in enumerate(shapes):
        numbers = np.array([float(samples[f"scene {k}"][row]) for k in range(at, at + shape.numbers)])
        at += shape.numbers
        if np.isfinite(numbers).all():
            points = numbers[: 2 * shape.points].reshape(-1, 2)
            yield index, Drawn(shape.kind, points, tuple(numbers[2 * shape.points :].tolist()))


def _artist(axis: Axes, kind: str) -> Any:
    """The artist of a shape, which is placed for each frame; None for a view."""
    from matplotlib.patches import Circle, Polygon

    if kind == "view":
        return None
    look: dict[str, Any] = {"edgecolor": INK, "facecolor": f"{RUNS[0]}59", "linewidth": 1.6, "animated": True}
    if kind == "circle":
        return axis.add_patch(Circle((0, 0), 1, **look))
    if kind == "box":
        return axis.add_patch(Polygon(np.zeros((4, 2)), closed=True, **look))
    look = {"color": ALARM, "marker": "o", "markersize": 6} if kind == "point" else {"color": INK, "linewidth": 1.6}
    return axis.plot([], [], solid_joinstyle="round", animated=True, **look)[0]
