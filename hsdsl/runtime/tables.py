"""The structures of ``hs.h``, ``hs_simulate.h``, ``hs_sample.h`` and ``hs_ensemble.h`` as ctypes sees them."""

from __future__ import annotations

import ctypes
from ctypes import POINTER, c_char, c_double, c_int, c_int32, c_int64, c_void_p
from typing import Any

import numpy as np

from hsdsl.execution import Array

ARC = np.dtype([("first", "i8"), ("jump", "i8"), ("mode", "i4"), ("kind", "i4")])
TRANSITION = np.dtype(
    [("time", "f8"), ("resumed", "f8"), ("mode", "i4"), ("edge", "i4"), ("entry", "i4"), ("alternatives", "i4")]
)
METHOD_KINDS = ("table", "taylor", "radau")
INTERPOLANTS = ("secant", "hermite", "dense")
KINDS = ("flow", "strip")
SCHEMES = ("relaxed", "located")
NOTICES = ("crowded", "at rest", "replaced", "accumulates", "unsettled", "slides")
NOTE = np.dtype([("kind", "i4"), ("mode", "i4"), ("surface", "i8"), ("number", "i8"), ("time", "f8"), ("other", "f8")])
REASONS = (
    "until", "until in strip", "until on guard", "final", "zeno", "limit", "reset not finite", "here not finite",
    "entered outside", "stuck", "interrupted", "left", "step not finite", "accumulated",
)  # fmt: skip
FAILURES = ("error", "wall", "deep", "flat", "inward", "not finite", "error", "creeping", "unsolved", "jump")


class Edge(ctypes.Structure):
    """``hs_edge``."""

    target_dimension: int
    parts: int
    condition: Any
    reset: int | None
    spread: int | None

    _fields_ = (
        *((name, c_int) for name in ("target", "target_dimension", "conditional", "priority", "parts")),
        ("condition", POINTER(c_void_p)),
        ("reset", c_void_p),
        ("spread", c_void_p),
    )


class Mode(ctypes.Structure):
    """``hs_mode``."""

    dimension: int
    edges: int
    surfaces: int
    flow: int | None
    values: int | None
    magnitudes: int | None
    outputs: int | None
    gradients: Any
    rates: Any
    edge: Any
    series: int | None
    surface_series: int | None
    surface_line: Any
    jacobian: int | None

    _fields_ = (
        *((name, c_int) for name in ("dimension", "edges", "surfaces", "final")),
        *((name, c_void_p) for name in ("flow", "values", "magnitudes", "outputs")),
        ("gradients", POINTER(c_void_p)),
        ("rates", POINTER(c_void_p)),
        ("edge", POINTER(Edge)),
        ("series", c_void_p),
        ("surface_series", c_void_p),
        ("surface_line", POINTER(c_int)),
        ("jacobian", c_void_p),
        ("affine", c_int),
        ("jumps", c_int),
        ("state", POINTER(c_int)),
    )


class Model(ctypes.Structure):
    """``hs_model``."""

    width: int
    surfaces: int
    edges: int
    outputs: int
    lines: int
    mode: Any

    _fields_ = (
        *((name, c_int) for name in ("modes", "width", "surfaces", "edges", "outputs", "data", "lines", "states")),
        ("mode", POINTER(Mode)),
    )


class Row(ctypes.Structure):
    """``hs_row``."""

    _fields_ = (("terms", c_int), ("stage", POINTER(c_int)), ("weight", POINTER(c_double)))


class Collocation(ctypes.Structure):
    """``hs_collocation``."""

    _fields_ = (
        ("node", c_double * 3),
        ("power", c_double * 3 * 3),
        *((name, c_double) for name in ("gamma", "alpha", "beta")),
        ("mix", c_double * 3 * 3),
        ("unmix", c_double * 3 * 3),
        ("estimate", c_double * 3),
        ("share", c_double),
        ("value", c_double * 3),
        ("slope", c_double * 3),
    )


class Method(ctypes.Structure):
    """``hs_method``."""

    _fields_ = (
        *((name, c_int) for name in ("kind", "stages", "extra", "order", "interpolant", "degree")),
        ("c", POINTER(c_double)),
        ("a", POINTER(Row)),
        ("b", Row),
        ("error", Row),
        ("coarse", Row),
        ("dense", POINTER(Row)),
        ("gain", c_double),
        ("collocation", POINTER(Collocation)),
    )


class Timeline(ctypes.Structure):
    """``hs_timeline``."""

    _fields_ = (("segments", c_int64), *((name, c_void_p) for name in ("start", "end", "jump", "data")))


class Interpolation(ctypes.Structure):
    """``hs_interpolation``."""

    _fields_ = (
        ("degree", c_int),
        *((name, POINTER(c_double)) for name in ("nodes", "tests", "matrix")),
        ("share", c_double),
    )


class Settings(ctypes.Structure):
    """``hs_settings``."""

    _fields_ = (
        *((name, c_double) for name in ("step", "tolerance", "largest", "relaxation", "until")),
        ("max_transitions", c_int64),
        ("scheme", c_int64),
        ("scale", POINTER(c_double)),
    )


CHUNK_COLUMNS = (
    "times", "values", "outputs", "depth", "pieces", "arc", "transition", "before", "after", "alternatives",
)  # fmt: skip
ROOMS = ("row_room", "rows", "arc_room", "arcs", "transition_room", "transitions", "note_room", "notes")


class Chunk(ctypes.Structure):
    """``hs_chunk``."""

    row_room: int
    rows: int
    arc_room: int
    arcs: int
    transition_room: int
    transitions: int
    note_room: int
    notes: int
    alternatives_used: int

    _fields_ = (
        *((name, c_int64) for name in ROOMS),
        *((name, c_void_p) for name in CHUNK_COLUMNS),
        ("alternatives_used", c_int64),
        ("note", c_void_p),
    )


class Visited(ctypes.Structure):
    """``hs_visited``."""

    room: int
    count: int
    mode: Any
    state: Any
    slot: Any

    _fields_ = (("room", c_int64), ("count", c_int64), *((name, c_void_p) for name in ("mode", "state", "slot")))


class Stop(ctypes.Structure):
    """``hs_stop``."""

    reason: int
    mode: int
    dimension: int
    edge: int
    failure: int
    surface: int
    segment: int
    time: float
    h: float
    x: Any
    slope: Any
    scales: Any

    _fields_ = (
        *((name, c_int32) for name in ("reason", "mode", "dimension", "edge", "failure", "surface")),
        ("segment", c_int64),
        ("time", c_double),
        ("h", c_double),
        ("x", c_void_p),
        ("slope", c_void_p),
        ("scales", c_void_p),
    )


Ask = ctypes.CFUNCTYPE(c_int, c_void_p)
Grow = ctypes.CFUNCTYPE(c_int, c_void_p, POINTER(Visited))


class Task(ctypes.Structure):
    """``hs_task``."""

    model: Any
    method: Any
    timeline: Any
    settings: Settings
    interpolation: Any
    mode: int
    dimension: int
    x: Any
    workspace: Any
    chunk: Chunk
    visited: Visited
    flush: Any
    poll: Any
    grow: Any
    now: float
    made: int
    stop: Stop

    _fields_ = (
        ("model", POINTER(Model)),
        ("method", POINTER(Method)),
        ("timeline", POINTER(Timeline)),
        ("settings", Settings),
        ("interpolation", POINTER(Interpolation)),
        ("mode", c_int32),
        ("dimension", c_int32),
        ("x", c_void_p),
        ("workspace", c_void_p),
        ("chunk", Chunk),
        ("visited", Visited),
        ("flush", Ask),
        ("poll", Ask),
        ("grow", Grow),
        ("now", c_double),
        ("made", c_int64),
        ("stop", Stop),
    )


ENSEMBLE_COLUMNS = (
    "timeline", "settings", "start", "time", "layout_of", "stop", "reason", "mode", "kind", "transitions", "ended",
    "final", "outputs", "crossed", "states", "results",
)  # fmt: skip


class Sampling(ctypes.Structure):
    """``hs_sampling``."""

    samples: int
    width: int
    outputs: int
    columns: int
    left: int
    column: int
    time: int
    row: int
    states: int
    results: int
    scratch: int

    _fields_ = (
        ("model", POINTER(Model)),
        ("timeline", POINTER(Timeline)),
        *((name, c_int64) for name in ("rows", "arcs", "samples")),
        *((name, c_int32) for name in ("width", "degree", "outputs", "columns", "left")),
        *((name, c_void_p) for name in ("times", "values", "recorded", "pieces", "arc", "layout", "dimension")),
        *((name, c_void_p) for name in ("column", "time", "row", "states", "results", "scratch")),
    )


class Ensemble(ctypes.Structure):
    """``hs_ensemble``."""

    task: Task
    sampling: Sampling
    done: int

    _fields_ = (
        ("task", Task),
        ("sampling", Sampling),
        *((name, c_int64) for name in ("instances", "samples", "most_transitions")),
        *((name, c_void_p) for name in ENSEMBLE_COLUMNS),
        *((name, c_int64) for name in ("done", "base", "made", "next")),
        ("layout", c_int32),
        ("layouts", c_void_p),
    )


def address_of(array: Array) -> int:
    """Where the numbers of an array are that is not empty and can be written: four times as fast as NumPy's own."""
    return ctypes.addressof(c_char.from_buffer(array.data))


STRUCTURES = (  # as in hs_sizes
    Edge, Mode, Model, Row, Collocation, Method, Timeline, Interpolation, Settings,
    Chunk, Visited, Stop, Task, Sampling, Ensemble,
)  # fmt: skip
