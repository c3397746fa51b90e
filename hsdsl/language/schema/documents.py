"""The documents of a model file: the keys of each mapping, and the values that each may hold."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, cast

from pydantic import BeforeValidator, ConfigDict, Discriminator, Field, Tag, model_validator

from hsdsl.base.defaults import MOST_WAITING
from hsdsl.base.names import did_you_mean, shown
from hsdsl.language.schema.fields import (
    AnyKey,
    ArgumentName,
    Completion,
    Document,
    Equation,
    Expression,
    Flag,
    Hold,
    Inequality,
    Items,
    Label,
    ModeTable,
    OpenTable,
    OptionalCondition,
    OptionalExpression,
    OptionalLabel,
    Priority,
    Scheme,
    StateTable,
    Table,
    Text,
    ValuesOf,
    Version,
    Whole,
    Word,
    described,
    items,
    mapping,
    optional,
    refuse,
    required,
    shaped_as_list,
)
from hsdsl.language.source.nodes import ABSENT, Mapping, Node, Scalar, Sequence, absent

KINDS = ("point", "line", "circle", "spring", "box")


def _is_reported(value: Any) -> bool:
    """Whether a value is in the place of one that was at fault."""
    return isinstance(value, Scalar) and value.value == ABSENT


def _pair(value: Any) -> Any:
    if _is_reported(value):
        return [value, value]
    if not isinstance(value, list) or len(value) != 2:  # pyright: ignore[reportUnknownArgumentType]
        got = f"a list of {len(value)}" if isinstance(value, list) else described(value)  # pyright: ignore[reportUnknownArgumentType]
        raise refuse("HS203", f"expected two coordinates, got {got}", "write [x, y]")
    return value  # pyright: ignore[reportUnknownVariableType]


def _points(value: Any, kind: str, most: int | None) -> Any:
    if _is_reported(value):
        return [value, value]
    points = shaped_as_list(value)
    if len(points) < 2 or (most is not None and len(points) > most):
        expected = "two points" if most == 2 else "at least two points"
        raise refuse("HS203", f"expected {expected}, got {len(points)}", f"write {kind}: [[0, 0], [x, y]]")
    return points


Pair = Annotated[list[Expression], BeforeValidator(_pair), Field(min_length=2, max_length=2)]
Points = Annotated[list[Pair], BeforeValidator(lambda value: _points(value, "line", None)), Field(min_length=2)]
Ends = Annotated[
    list[Pair], BeforeValidator(lambda value: _points(value, "spring", 2)), Field(min_length=2, max_length=2)
]


class ShapeDocument(Document):
    """A shape: its ``kind``, its ``points``, and its ``sizes`` in the order of `hsdsl.language.system.SIZES`."""

    kind: ClassVar[str]
    sized_by: ClassVar[tuple[str, ...]] = ()

    @property
    def points(self) -> list[list[Scalar]]:
        """The coordinates of each point."""
        where = getattr(self, self.kind)
        return where if self.kind in ("line", "spring") else [where]

    @property
    def sizes(self) -> list[Scalar | None]:
        """Further numbers; None for one that is left out, which is zero."""
        return [getattr(self, name) for name in self.sized_by]


class PointShape(ShapeDocument):
    """A point, drawn as a dot of fixed size."""

    kind = "point"
    point: Pair = required("Where it is.", ["x", "y"])


class LineShape(ShapeDocument):
    """A line from point to point."""

    kind = "line"
    line: Points = required("Its points, at least two.", [[0, 0], ["L*sin(phi)", "-L*cos(phi)"]])


class CircleShape(ShapeDocument):
    """A circle."""

    kind = "circle"
    sized_by = ("radius",)
    circle: Pair = required("Its centre.", ["x", "y"])
    radius: Expression = required("Its radius.", "0.1")


class SpringShape(ShapeDocument):
    """A spring between two points, drawn as a zigzag."""

    kind = "spring"
    spring: Ends = required("Its two ends.", [[0, 0], ["x", 0]])


class BoxShape(ShapeDocument):
    """A rectangle."""

    kind = "box"
    sized_by = ("width", "height", "angle")
    box: Pair = required("Its centre.", ["x", "y"])
    width: Expression = required("Its width.", "0.4")
    height: Expression = required("Its height.", "0.2")
    angle: OptionalExpression = optional("By how much it is turned, counterclockwise, in radians.", "theta")


def _kind(value: Any) -> str:
    """The tag of a shape; the kind is checked before."""
    return next((f"<{kind}>" for kind in KINDS if kind in value), "<point>")


def _with_kind(value: Any) -> Any:
    if not isinstance(value, dict):
        raise refuse("HS203", f"expected a shape, got {described(value)}", "write {point: [x, y]}")
    if not any(kind in value for kind in KINDS):
        near = (did_you_mean(str(key), KINDS) for key in value)  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
        keys = ", ".join(f"'{shown(str(key))}'" for key in value) or "nothing"  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
        hint = next((hint for hint in near if hint), None)
        raise refuse("HS203", f"expected a point, a line, a circle, a spring or a box, got {keys}", hint)
    return value  # pyright: ignore[reportUnknownVariableType]


Shape = Annotated[
    Annotated[PointShape, Tag("<point>")]
    | Annotated[LineShape, Tag("<line>")]
    | Annotated[CircleShape, Tag("<circle>")]
    | Annotated[SpringShape, Tag("<spring>")]
    | Annotated[BoxShape, Tag("<box>")],
    Discriminator(_kind),
    BeforeValidator(_with_kind),
]


def _mapping_or_not(value: Any) -> str:
    return "<mapping>" if isinstance(value, dict) else "<expression>"


def _kind_of_input(value: Any) -> str:
    if not isinstance(value, dict):
        return "<expression>"
    keys = set(map(str, cast("dict[Any, Any]", value)))
    if not keys <= {"file", "column", "times", "values", "hold"}:
        from hsdsl.language.diagnosis.values import input_keys_meant

        keys = input_keys_meant(keys)
    return "<file>" if keys & {"file", "column"} and not keys & {"times", "values"} else "<samples>"


AsExpression = Annotated[Expression, Tag("<expression>")]


class ParameterEntry(Document):
    """A parameter with more than its value."""

    value: Expression = required("A number, or an expression of earlier parameters.", "9.81", "2*omega")
    unit: Text = optional("Its unit, such as `m/s`.", "m/s**2")
    min: OptionalExpression = optional("The least value it may have.", 0)
    max: OptionalExpression = optional("The largest value it may have.", 1)
    about: Text = optional("What it is, for people.", "coefficient of restitution")


Parameter = Annotated[AsExpression | Annotated[ParameterEntry, Tag("<mapping>")], Discriminator(_mapping_or_not)]
_HOLD = (
    "Between samples: `zero` keeps the last sample's value, `linear` joins them by straight lines. "
    "With `linear` two samples at one time are a jump."
)


class InputSamples(Document):
    """An input given by samples in the file."""

    times: Items[Expression] = required("The times of the samples, increasing.", [0, 1, 2])
    values: Items[Expression] = required("The values at those times.", [0, 5, 0])
    hold: Hold = optional(_HOLD, "linear", default="zero")


class InputFile(Document):
    """An input given by samples in a CSV file."""

    file: Label = required(
        "A CSV file with a column `time`, by its path from the model's own folder, inside it.", "u.csv"
    )
    column: Label | None = optional("The name of its column with the values. Left out, the name of the input.", "u (V)")
    hold: Hold = optional(_HOLD, "linear", default="zero")


Input = Annotated[
    AsExpression | Annotated[InputSamples, Tag("<samples>")] | Annotated[InputFile, Tag("<file>")],
    Discriminator(_kind_of_input),
]


class FunctionDocument(Document):
    """A function of its arguments, of parameters and of other functions, written out where it is called."""

    of: Items[ArgumentName] = required("The names of its arguments, in the order of a call.", ["x", "k"])
    expression: Expression = required("Its value.", "x**2/(k**2 + x**2)", alias="is")


class SolveDocument(Document):
    """Unknowns that linear equations give, for use as names of `let`; they are solved at each evaluation."""

    unknowns: Items[ArgumentName] = required("The names of the unknowns.", ["a", "force"])
    equations: Items[Equation] = required(
        "As many equations, linear in the unknowns.", ["m*a == force - m*g", "force == k*x - d*a"]
    )


OPTIONS = ("delay", "values", "persistent", "waiting", "initially", "priority")  # of a transition


class TransitionDocument(Document):
    """An edge that leaves a mode: with `when` and `to`, or with `event`."""

    when: Inequality = required(
        "One inequality, such as `x >= x_max`: the surface at which the transition fires.", "x >= x_max", "h <= 0"
    )
    event: OptionalCondition = optional(
        "A condition, instead of `when`: the transition fires where it turns true. Without `to` the mode stays.",
        "x >= 1 and y < 2",
    )
    condition: OptionalCondition = optional(
        "Which part of the surface is the guard: a condition.", "v > 0 and y < 1", alias="if"
    )
    to: Label = required("The mode entered.", "free")
    reset: OpenTable[Expression] = mapping(
        "State of the target: its value after the transition, in terms of the values before it. States not named keep "
        "their value.",
        {"v": "-c*v"},
    )
    name: OptionalLabel = optional("What to call the transition; left out, it is `SRC->DST`.", "impact")
    priority: Priority = optional(
        "Of transitions reached together, the one with the largest priority goes first. That of an event may be an "
        "expression, whose value at that instant counts.",
        1,
        "2*x",
        default=0,
    )
    delay: OptionalExpression = optional(
        "With `event`: how long after its condition turned true the transition is made; see `values`.", 2
    )
    values: ValuesOf = optional(
        "With `delay`: whether the `reset` has the values of the `trigger`, where the condition turned true, or those "
        "of the `execution`, where the transition is made.",
        "execution",
        default="trigger",
    )
    persistent: Flag = optional(
        "With `event`: whether the transition is made even if its condition turns false before.", False, default=True
    )
    waiting: Whole = optional(
        "With `delay`: how many executions can wait at a time; one more ends the run with `waiting_limit`.",
        50,
        default=MOST_WAITING,
    )
    initially: Flag = optional(
        "With `event`: what its condition counts as before the mode is entered; with `false` it fires there if it "
        "holds.",
        False,
        default=True,
    )

    @property
    def target(self) -> str | None:
        """The mode entered; None where the mode stays, or is not known."""
        label: Scalar | None = self.to
        return None if label is None or label.value == ABSENT else label.value  # pyright: ignore[reportUnnecessaryComparison]

    @property
    def options(self) -> tuple[str, ...]:
        """What differs from the defaults, as people read it: `delay 2`, `persistent false`."""
        found: list[str] = []
        for key in OPTIONS:
            value = getattr(self, key)
            if value != type(self).model_fields[key].default:
                found.append(f"{key} {value.value if isinstance(value, Scalar) else str(value).lower()}")
        return tuple(found)

    @model_validator(mode="before")
    @classmethod
    def _of_event(cls, value: Any) -> Any:
        whole: dict[Any, Any] = value if isinstance(value, dict) else {}  # pyright: ignore[reportUnknownVariableType]
        given = whole.get("event")
        if not isinstance(given, Scalar):
            return value  # pyright: ignore[reportUnknownVariableType]
        return {"when": absent(given.place), "to": absent(given.place), **whole}


class ModeDocument(Document):
    """A mode: how the state flows, where it may be, and how it is left."""

    flow: StateTable[Expression] | None = optional(
        "State: its time derivative. The keys are the mode's states.", {"x": "v", "v": "-omega**2*x"}
    )
    domain: Items[Inequality] = items(
        "Inequalities that are walls without a guard: leaving through one stops the run.", ["x >= -1", "x <= 1"]
    )
    final: Flag = optional("Whether the run ends on entering the mode. It then needs no `flow`.", True, default=False)
    let: Table[Expression] = mapping(
        "Named subexpressions of this mode, each of earlier ones; they shadow the top ones.", {"force": "-k*x"}
    )
    solve: SolveDocument | None = optional(
        "Unknowns of this mode, which linear equations give.", {"unknowns": ["a"], "equations": ["m*a == -k*x"]}
    )
    outputs: Table[Expression] = mapping(
        "Outputs of this mode. They go before those of the model with the same name, and have no value in modes that "
        "do not define them.",
        {"power": "k*v**2"},
    )
    transitions: Items[TransitionDocument] = items(
        "The edges that leave the mode.", [{"when": "x >= 1", "to": "free", "reset": {"v": "-v"}}]
    )


class InitialDocument(Document):
    """Where a run starts."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[AnyKey, Expression]  # pyright: ignore[reportIncompatibleVariableOverride]

    mode: Label = required("The mode a run starts in.", "free")


class MultiplesDocument(Document):
    """Times at a fixed distance, from 0 to the end."""

    every: Expression = required("The time between two samples.", "1/50")


Samples = Annotated[
    AsExpression | Annotated[Items[Expression], Tag("<list>")] | Annotated[MultiplesDocument, Tag("<mapping>")],
    Discriminator(lambda value: "<list>" if isinstance(value, list) else _mapping_or_not(value)),
]


class ExperimentDocument(Document):
    """How to run the model by default. Numbers are expressions of parameters."""

    until: Expression = required("The time at which a run ends; it starts at 0.", "40*pi")
    scheme: Scheme = optional("How transitions are made.", "relaxed")
    completion: Completion = optional(
        "How a run goes on where transitions accumulate: `contact` along the guard of a transition to the same mode, "
        "`auto` also along a surface that two modes press on (sliding), `none` not at all. Left out, `contact`.",
        "auto",
    )
    method: Word = optional("The integrator, such as `midpoint`, or `auto`.", "auto", "midpoint")
    step: OptionalExpression = optional("The step of a fixed-step method. Excludes `tolerance`.", "1e-3")
    tolerance: OptionalExpression = optional(
        "The bound on the local error of an adaptive method, relative to the largest size each state has had. Excludes "
        "`step`.",
        "1e-9",
    )
    relaxation: OptionalExpression = optional(
        "The paper's epsilon: depth of the strips, in the model's own units and in time. Left out, 1e-6, or 1e-6 of a "
        "run that is shorter than 1.",
        "1e-6",
    )
    scale: OpenTable[Expression] = mapping(
        "State: its typical size, positive. The scale of a state is this size until the state has been larger.",
        {"x": "1e-3", "v": 1},
    )
    samples: Samples | None = optional(
        "How many samples to record, or a list of their times, or the time between them.",
        201,
        [0, "1/2", 1],
        {"every": "1/50"},
    )
    max_transitions: OptionalExpression = optional("Stop rather than make more transitions.", "1e6")


class ReferenceTransitionDocument(Document):
    """A transition known exactly."""

    time: Expression = required("When the guard is reached.", "1.25")
    edge: OptionalLabel = optional("The transition's name.", "impact", "heating->idle")
    before: OpenTable[Expression] = mapping("States before it.", {"x": 14, "v": "25.6"})
    after: OpenTable[Expression] = mapping("States after it.", {"v": "-23"})


ReferenceEvent = Annotated[
    AsExpression | Annotated[ReferenceTransitionDocument, Tag("<mapping>")], Discriminator(_mapping_or_not)
]


class ReferenceStateDocument(Document):
    """A state known exactly: further keys are names of states or outputs."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[AnyKey, Expression]  # pyright: ignore[reportIncompatibleVariableOverride]

    time: Expression = required("When.", 1)
    mode: OptionalLabel = optional("In which mode.", "free")


class ReferenceDocument(Document):
    """Exact knowledge of a run. Numbers are expressions of parameters."""

    settings: OpenTable[Expression] = mapping(
        "What differs from the file, as for `--set`: `initial.w: -0.4`.", {"initial.w": "-0.4"}, alias="set"
    )
    source: Text = optional("Where the numbers come from.", "closed form")
    trust: OptionalExpression = optional("The bound on their absolute error.", "1e-12")
    transitions: Items[ReferenceEvent] = items(
        "The first transitions: their times, or mappings.", [1, {"time": 2, "edge": "impact"}]
    )
    states: Items[ReferenceStateDocument] = items("States at times.", [{"time": 1, "mode": "free", "x": "1/2"}])


def _one_or_many(value: Any) -> Any:
    if isinstance(value, Scalar) and value.kind == "null":
        return []
    return value if isinstance(value, list) else [value]  # pyright: ignore[reportUnknownVariableType]


class ModelDocument(Document):
    """A controlled hybrid system."""

    hsdsl: Version = required("The version of the language.", 1)
    title: Text = optional("What the model is, in a few words.", "Bouncing ball")
    source: Text = optional("Where the model comes from.", "Burden et al. 2013, Fig. 1")
    assumptions: Items[Text] = items(
        "Sentences on what the model takes for granted, as an import does: each run gives them as warnings.",
        ["the constraint S <= 2 of the file is not checked"],
    )
    parameters: Table[Parameter] = mapping(
        "Name: number, expression of earlier parameters, or a mapping with its value.",
        {"g": "9.81", "e": {"value": "0.8", "min": 0, "max": 1}},
    )
    functions: Table[FunctionDocument] = mapping(
        "Name: a function for use in every expression of the file.",
        {"hill": {"of": ["x", "k"], "is": "x**2/(k**2 + x**2)"}},
    )
    inputs: Table[Input] = mapping(
        "Name: expression of `t` and parameters, or samples, or a CSV file.", {"u": "20*cos(2.5*t)"}
    )
    let: Table[Expression] = mapping("Named subexpressions, each of earlier ones.", {"energy": "v**2/2"})
    solve: SolveDocument | None = optional(
        "Unknowns that linear equations give.", {"unknowns": ["a"], "equations": ["m*a == -k*x"]}
    )
    modes: ModeTable[ModeDocument] = required("The modes.", {"fall": {"flow": {"h": "v", "v": "-g"}}})
    outputs: Table[Expression] = mapping(
        "Name: expression, recorded with the states. Each mode reads it with its own `let`; it has no value in a "
        "mode that lacks one of its names.",
        {"energy": "m*g*h + m*v**2/2"},
    )
    scene: Items[Shape] = items(
        "Shapes that show the states, drawn in this order; x goes right and y up. Their numbers are read as outputs "
        "are; in a mode that lacks one of its numbers a shape is not drawn.",
        [{"line": [[0, 0], ["x", "y"]]}, {"circle": ["x", "y"], "radius": "0.1"}],
    )
    units: OpenTable[Text] = mapping("Unit of a state, parameter, input or output, or of `t`.", {"h": "m", "v": "m/s"})
    initial: InitialDocument = required(
        "Where a run starts: `mode`, and a value for each of its states.", {"mode": "fall", "h": 10, "v": 0}
    )
    experiment: ExperimentDocument = required("How to run the model by default.", {"until": 12})
    reference: Annotated[list[ReferenceDocument], BeforeValidator(_one_or_many)] = items(
        "Exact knowledge: one mapping, or a list of them.", {"trust": "1e-12", "transitions": ["1.428"]}
    )


class PartTransitionDocument(TransitionDocument):
    """An edge that leaves a mode of a part."""

    when: Inequality | None = optional(  # pyright: ignore[reportIncompatibleVariableOverride]
        "One inequality, such as `x >= x_max`: the surface at which the transition fires.", "x >= x_max", "h <= 0"
    )
    on: OptionalLabel = optional(
        "A transition of another instance, instead of `when`: this one fires together with it. The name of an "
        "automaton stands for all of its instances.",
        "a.too_warm",
        "leg[index - 1].touchdown",
    )
    to: OptionalLabel = optional("The mode entered; left out, the mode stays.", "free")  # pyright: ignore[reportIncompatibleVariableOverride]
    reset: OpenTable[Expression] = mapping(
        "State: its value after the transition, in terms of the values before it. States not named keep their value. "
        "States of other instances can be set as well.",
        {"v": "-c*v", "body.v": 0},
    )


class PartModeDocument(ModeDocument):
    """A mode of a part."""

    transitions: Items[PartTransitionDocument] = items(  # pyright: ignore[reportIncompatibleVariableOverride]
        "The edges that leave the mode.", [{"when": "x >= 1", "to": "free", "reset": {"v": "-v"}}]
    )


class AutomatonDocument(Document):
    """A kind of part: modes with what they need to know of the rest of the model."""

    parameters: Table[Parameter] = mapping("Parameters, which each instance may set.", {"power": 30})
    inputs: Items[ArgumentName] = items("Names that each instance connects to an expression.", ["beside"])
    let: Table[Expression] = mapping("Named subexpressions.", {"gain": "wall*(beside - T)"})
    outputs: Table[Expression] = mapping("Name: expression, recorded as `instance.name`.", {"energy": "v**2/2"})
    units: OpenTable[Text] = mapping("Unit of a state, parameter, input or output of the instances.", {"v": "m/s"})
    modes: ModeTable[PartModeDocument] = required("The modes.", {"fall": {"flow": {"h": "v", "v": "-g"}}})


class AutomatonFile(Document):
    """A kind of part that is in a file of its own."""

    file: Label = required(
        "A YAML file with the keys of an automaton, by its path from the model's own folder, inside it.", "leg.yaml"
    )


Automaton = Annotated[
    Annotated[AutomatonDocument, Tag("<mapping>")] | Annotated[AutomatonFile, Tag("<file>")],
    Discriminator(lambda value: "<file>" if isinstance(value, dict) and "file" in value else "<mapping>"),
]


class PartInitialDocument(Document):
    """Where an instance starts."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[AnyKey, Expression]  # pyright: ignore[reportIncompatibleVariableOverride]

    mode: OptionalLabel = optional("The mode it starts in; of an automaton with one mode it is left out.", "on")


class InstanceDocument(Document):
    """A part of the system: an automaton with its numbers and connections."""

    automaton: Label = required("Which automaton.", "room")
    initial: PartInitialDocument = optional(
        "Where it starts: `mode`, and a value for each of its states.", {"mode": "on", "T": 20}
    )
    inputs: OpenTable[Expression] = mapping("Each input of the automaton: an expression.", {"beside": "b.T"})
    parameters: OpenTable[Expression] = mapping("Parameters that differ from the automaton's.", {"power": 20})
    count: Whole | None = optional("How many: `NAME[1]`, `NAME[2]` and so on, with `index` in expressions.", 20)
    at_ends: OpenTable[Expression] = mapping(
        "Name: what `NAME[0].name` and those behind the last one are; `index` is the number beyond the end. For the "
        "name of a transition, the one that `on` means there.",
        {"x": 0, "spike": "neuron[5].spike"},
    )


class SystemDocument(ModelDocument):
    """A controlled hybrid system, as modes or as a system of parts."""

    modes: ModeTable[ModeDocument] = mapping("The modes.", {"fall": {"flow": {"h": "v", "v": "-g"}}})
    initial: InitialDocument = optional(
        "Where a run starts: `mode`, and a value for each of its states.", {"mode": "fall", "h": 10, "v": 0}
    )
    automata: Table[Automaton] = mapping(
        "Kinds of parts by name, each with its modes, or in a file.",
        {"clock": {"modes": {"run": {"flow": {"s": 1}}}}, "leg": {"file": "leg.yaml"}},
    )
    system: StateTable[InstanceDocument] = mapping(
        "The parts of the model by name: their automata, numbers and connections. A model has either these or `modes`.",
        {"a": {"automaton": "room", "initial": {"mode": "on", "T": 20}, "inputs": {"beside": "b.T"}}},
    )


# the document of each kind of mapping by its path, and a phrase for it; `*` is any key or index
SHAPES: dict[tuple[str, ...], tuple[type[Document], str]] = {
    (): (SystemDocument, "a model"),
    ("parameters", "*"): (ParameterEntry, "a parameter"),
    ("functions", "*"): (FunctionDocument, "a function"),
    ("solve",): (SolveDocument, "`solve`"),
    ("modes", "*", "solve"): (SolveDocument, "`solve`"),
    ("inputs", "*", "<samples>"): (InputSamples, "an input"),
    ("inputs", "*", "<file>"): (InputFile, "an input"),
    ("experiment", "samples", "<mapping>"): (MultiplesDocument, "`samples`"),
    ("modes", "*"): (ModeDocument, "a mode"),
    ("modes", "*", "transitions", "*"): (TransitionDocument, "a transition"),
    ("automata", "*", "<file>"): (AutomatonFile, "an automaton"),
    ("automata", "*", "<mapping>"): (AutomatonDocument, "an automaton"),
    ("automata", "*", "<mapping>", "parameters", "*"): (ParameterEntry, "a parameter"),
    ("automata", "*", "<mapping>", "modes", "*"): (PartModeDocument, "a mode"),
    ("automata", "*", "<mapping>", "modes", "*", "transitions", "*"): (PartTransitionDocument, "a transition"),
    ("system", "*"): (InstanceDocument, "an instance"),
    ("system", "*", "initial"): (PartInitialDocument, "`initial`"),
    ("scene", "*", "<point>"): (PointShape, "a point"),
    ("scene", "*", "<line>"): (LineShape, "a line"),
    ("scene", "*", "<circle>"): (CircleShape, "a circle"),
    ("scene", "*", "<spring>"): (SpringShape, "a spring"),
    ("scene", "*", "<box>"): (BoxShape, "a box"),
    ("initial",): (InitialDocument, "`initial`"),
    ("experiment",): (ExperimentDocument, "`experiment`"),
    ("reference", "*"): (ReferenceDocument, "a reference"),
    ("reference", "*", "transitions", "*"): (ReferenceTransitionDocument, "a transition of a reference"),
    ("reference", "*", "states", "*"): (ReferenceStateDocument, "a state of a reference"),
}


def keys_of(*pattern: str) -> list[str]:
    """The keys of a kind of mapping, as they are written in a file."""
    return [field.alias or name for name, field in SHAPES[pattern][0].model_fields.items()]


def plain(node: Node) -> Any:
    """A node as plain mappings and lists, with the nodes of single values in them."""
    if isinstance(node, Mapping):
        return {key: plain(value) for key, value in node}
    return [plain(item) for item in node.items] if isinstance(node, Sequence) else node
