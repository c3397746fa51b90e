"""The generated module of a crate: sizes, routines, tables, inputs and settings."""

from __future__ import annotations

from collections.abc import Iterable

from hsdsl.backends.c.source import width
from hsdsl.export.parameters import derived, followed
from hsdsl.export.routines import data_names, definitions, mode_definitions, parameters_in
from hsdsl.export.rust.language import array, function, literal, numbers, string
from hsdsl.export.source import Source
from hsdsl.integrators import ButcherTableau
from hsdsl.integrators.numbers import Row, table_numbers
from hsdsl.program import ModeProgram, Program
from hsdsl.simulate.control import LARGEST_SHARE

_HEAD = """\
#![allow(unused_imports, unused_mut, unused_parens, unused_variables, clippy::all)]

use crate::kernel::{Edge, Interpolant, Method, Mode, Routine, Segment, Settings};
use crate::math::*;
"""


def model_text(source: Source, table: ButcherTableau) -> str:
    """The text of ``model.rs``."""
    program = source.problem.program
    heading = "".join(f"// {line}\n" for line in source.heading)
    parts = [
        heading + _HEAD,
        _sizes(program, table),
        *_functions(program, source.problem.mode),
        _modes(program),
        _method(table),
    ]
    return "\n".join([*parts, _segments(source), _values(source), _settings(source)])


def _sizes(program: Program, table: ButcherTableau) -> str:
    found = table_numbers(table)
    sizes = {
        "W": (width(program), "states of the largest mode"),
        "M": (max(len(mode.surfaces) for mode in program.modes), "surfaces of the mode with most"),
        "E": (max(len(mode.edges) for mode in program.modes), "edges of the mode with most"),
        "P": (len(program.parameters), "parameters"),
        "D": (3 * len(program.inputs) + len(program.switches), "numbers of a segment of inputs"),
        "CONTACTS": (program.contact_count, "motions along guards"),
        "STATES": (len(program.all_states), "states of all modes"),
        "OUTPUTS": (len(program.outputs), "outputs"),
        "STAGES": (found.stages + 1 + found.extra, "stages of a step"),
        "DEGREE": (max(3, table.degree), "of the interpolants of steps"),
    }
    return "".join(f"/// {why}\npub const {name}: usize = {size};\n" for name, (size, why) in sizes.items())


def _functions(program: Program, start: int) -> Iterable[str]:
    data = {name: f"p[{i}]" for i, name in enumerate(data_names(program))}
    for j, mode in enumerate(program.modes):
        for name, definition in mode_definitions(mode, terms=True).items():
            yield function(f"mode_{j}_{name}", definition, data)
        if mode.held is not None:
            yield function(f"mode_{j}_held", mode_definitions(program.flows[mode.held])["flow"], data)
    held = program.modes[start].held is not None
    jacobian = program.modes[start].jacobian
    if held:
        yield function("start_jacobian", definitions(jacobian.routines)["jacobian"], data)
    places = array(map(str, jacobian.places if held else ()))
    yield "/// The derivatives of the flow of the initial mode, if it has motion along guards, and their places.\n"
    yield f"pub static JACOBIAN: Option<Routine> = {'Some(start_jacobian)' if held else 'None'};\n"
    yield f"pub static JACOBIAN_PLACES: &[usize] = &{places};\n"


def _modes(program: Program) -> str:
    rows = "".join(_mode(j, mode, program.all_states) for j, mode in enumerate(program.modes))
    lists = {"PARAMETERS": program.parameters, "STATE_NAMES": program.all_states, "OUTPUT_NAMES": program.outputs}
    texts = [f"pub static {name}: &[&str] = &{array(map(string, texts))};\n" for name, texts in lists.items()]
    return f"pub static MODES: [Mode; {len(program.modes)}] = [\n{rows}];\n" + "".join(texts)


def _mode(j: int, mode: ModeProgram, states: tuple[str, ...]) -> str:
    edges = "".join(_edge(j, k, mode) for k in range(len(mode.edges)))
    plain = ("flow", "surfaces", "magnitudes", "outputs")
    flow, values, magnitudes, outputs = (f"mode_{j}_{name}" for name in plain)
    gradients, rates = (array(f"mode_{j}_{kind}_{k}" for k in mode.surfaces) for kind in ("gradient", "rate"))
    places = array(str(states.index(name)) for name in mode.states)
    terms = f"Some(mode_{j}_terms)" if mode.terms else "None"
    held = "None" if mode.held is None else f"Some(mode_{j}_held)"
    return (
        f"    Mode {{\n        name: {string(mode.name)},\n        dimension: {len(mode.states)},\n"
        f"        edges: &[{edges}],\n        surfaces: {len(mode.surfaces)},\n"
        f"        is_final: {_truth(mode.final)},\n"
        f"        flow: {flow},\n        values: {values},\n        magnitudes: {magnitudes},\n"
        f"        outputs: {outputs},\n        gradients: &{gradients},\n        rates: &{rates},\n"
        f"        terms: {terms},\n        held: {held},\n        states: &{places},\n"
        f"        queues: &{array(str(queue.waiting) for queue in mode.queues)},\n    }},\n"
    )


def _edge(j: int, k: int, mode: ModeProgram) -> str:
    edge = mode.edges[k]
    parts = array(f"mode_{j}_{name}" for name in mode.conditions[k])
    changes = array(map(str, edge.changes))
    contact = "None" if edge.contact is None else f"Some({edge.contact})"
    return (
        f"Edge {{\n            name: {string(edge.name)},\n            target: {edge.target},\n"
        f"            dimension: {len(edge.target_states)},\n            conditional: {_truth(edge.conditional)},\n"
        f"            priority: {edge.priority},\n            condition: &{parts},\n"
        f"            reset: mode_{j}_reset_{k},\n            spread: mode_{j}_spread_{k},\n"
        f"            changes: &{changes}, contact: {contact},\n        }}, "
    )


def _truth(value: bool) -> str:
    return "true" if value else "false"


def _method(table: ButcherTableau) -> str:
    found = table_numbers(table)
    lists = {"a": found.a, "dense": found.dense}
    rows = {name: f"&{_row(getattr(found, name))}" for name in ("b", "error", "coarse")}
    rows |= {name: f"&{array(f'&{_row(row)}' for row in each)}" for name, each in lists.items()}
    fields = {
        "stages": str(found.stages), "extra": str(found.extra), "order": str(table.error_order),
        "interpolant": f"Interpolant::{table.interpolant.title()}", "nodes": f"&{numbers(found.nodes)}", **rows,
    }  # fmt: skip
    lines = "".join(f"    {name}: {value},\n" for name, value in fields.items())
    return f"/// {table.name}\npub static METHOD: Method = Method {{\n{lines}}};\n"


def _row(row: Row) -> str:
    return array(f"({stage}, {literal(weight)})" for stage, weight in row)


def _segments(source: Source) -> str:
    segments, count = source.problem.timeline.segments, len(source.problem.program.parameters)
    rows = "".join(
        f"    Segment {{ start: {literal(s.start)}, end: {literal(s.end)}, jump: {_truth(s.jump)}, "
        f"data: {numbers(s.data[count:])} }},\n"
        for s in segments
    )
    return f"pub static SEGMENTS: [Segment; {len(segments)}] = [\n{rows}];\n"


def _values(source: Source) -> str:
    """Functions for parameters, those that follow others, and the initial state."""
    problem, program = source.problem, source.problem.program
    count, own = len(program.parameters), derived(problem)
    routines = definitions(program.constants)
    data = {f"p{i}": f"p[{i}]" for i in range(count)}
    given = problem.timeline.segments[0].data[:count]
    texts, follow = list[str](), list[str]()
    for i in (i for i, name in enumerate(program.parameters) if name in own):
        name = f"parameter_{i}"
        texts.append(function(name, routines[name], data))
        follow.append(f"    let mut value = [0.0];\n    {name}(p, 0.0, &[], &mut value);\n    p[{i}] = value[0];\n")
    x, start = [literal(float(value)) for value in problem.x], ""
    if parameters_in(routines["initial"]):
        texts.append(function("initial_values", routines["initial"], data))
        size = len(program.initial_states)
        start = f"    let mut found = [0.0; {size}];\n    initial_values(p, 0.0, &[], &mut found);\n"
        pairs = zip(x, followed(problem), strict=True)
        x = [number if place is None else f"found[{place}]" for number, place in pairs]
    x += ["0.0"] * (width(program) - len(x))
    return (
        "".join(texts)
        + "/// The values of the parameters.\n"
        + f"pub fn parameters() -> [f64; P] {{\n    {numbers(given)}\n}}\n"
        + "/// Compute the parameters that depend on others again.\n"
        + f"pub fn follow(p: &mut [f64; P]) {{\n{''.join(follow)}}}\n"
        + "/// The initial state.\n"
        + f"pub fn initial(p: &[f64; P]) -> [f64; W] {{\n{start}    {array(x)}\n}}\n"
        + f"/// The number of the initial mode.\npub const START: usize = {problem.mode};\n"
    )


def _settings(source: Source) -> str:
    program, settings = source.problem.program, source.problem.settings
    largest = settings.step if settings.step is not None else settings.until * LARGEST_SHARE
    step = settings.step if settings.step is not None else largest / 100
    scales = numbers(float(settings.scale.get(name, 0.0)) for name in program.all_states)
    fields = {
        "step": literal(float(step)), "tolerance": literal(float(settings.tolerance or 0.0)),
        "largest": literal(float(largest)), "relaxation": literal(float(settings.relaxation)),
        "until": literal(float(settings.until)), "max_transitions": str(settings.max_transitions),
    }  # fmt: skip
    lines = "".join(f"    {name}: {value},\n" for name, value in fields.items())
    return (
        f"pub const SETTINGS: Settings = Settings {{\n{lines}}};\n"
        f"/// Sizes of states, 0 where none is known.\npub const SCALES: [f64; STATES] = {scales};\n"
    )
