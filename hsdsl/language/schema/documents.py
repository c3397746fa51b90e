"""The documents of a model file: the keys of each mapping, and the values that each may hold.

What the keys mean, in words and with examples, is in ``keys.toml``.
"""

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
    refuse,
    shaped_as_list,
)
from hsdsl.language.source.nodes import ABSENT, Key, Mapping, Node, Scalar, Sequence, absent

KINDS = ("point", "line", "circle", "spring", "box", "view")


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
    """A shape: its ``kind``, its ``points``, and its ``sizes`` in the order of ``sized_by``."""

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
    point: Pair


class LineShape(ShapeDocument):
    """A line from point to point."""

    kind = "line"
    line: Points


class CircleShape(ShapeDocument):
    """A circle."""

    kind = "circle"
    sized_by = ("radius",)
    circle: Pair
    radius: Expression


class SpringShape(ShapeDocument):
    """A spring between two points, drawn as a zigzag."""

    kind = "spring"
    spring: Ends


class BoxShape(ShapeDocument):
    """A rectangle."""

    kind = "box"
    sized_by = ("width", "height", "angle")
    box: Pair
    width: Expression
    height: Expression
    angle: OptionalExpression = None


class ViewShape(ShapeDocument):
    """What a film shows at a time: a camera that follows."""

    kind = "view"
    sized_by = ("width", "height")
    view: Pair
    width: Expression
    height: Expression


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
        raise refuse("HS203", f"expected a point, a line, a circle, a spring, a box or a view, got {keys}", hint)
    return value  # pyright: ignore[reportUnknownVariableType]


Shape = Annotated[
    Annotated[PointShape, Tag("<point>")]
    | Annotated[LineShape, Tag("<line>")]
    | Annotated[CircleShape, Tag("<circle>")]
    | Annotated[SpringShape, Tag("<spring>")]
    | Annotated[BoxShape, Tag("<box>")]
    | Annotated[ViewShape, Tag("<view>")],
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

    value: Expression
    unit: Text = None
    min: OptionalExpression = None
    max: OptionalExpression = None
    about: Text = None


Parameter = Annotated[AsExpression | Annotated[ParameterEntry, Tag("<mapping>")], Discriminator(_mapping_or_not)]


class InputSamples(Document):
    """An input given by samples in the file."""

    times: Items[Expression]
    values: Items[Expression]
    hold: Hold = "zero"


class InputFile(Document):
    """An input given by samples in a CSV file."""

    file: Label
    column: Label | None = None
    hold: Hold = "zero"


Input = Annotated[
    AsExpression | Annotated[InputSamples, Tag("<samples>")] | Annotated[InputFile, Tag("<file>")],
    Discriminator(_kind_of_input),
]


class FunctionDocument(Document):
    """A function of its arguments, of parameters and of other functions, written out where it is called."""

    of: Items[ArgumentName]
    expression: Expression = Field(alias="is")


class SolveDocument(Document):
    """Unknowns that linear equations give, for use as names of `let`; they are solved at each evaluation."""

    unknowns: Items[ArgumentName]
    equations: Items[Equation]


OPTIONS = ("delay", "values", "persistent", "waiting", "initially", "priority")  # of a transition


class TransitionDocument(Document):
    """An edge that leaves a mode: with `when` and `to`, or with `event`."""

    when: Inequality
    event: OptionalCondition = None
    condition: OptionalCondition = Field(None, alias="if")
    to: Label
    reset: OpenTable[Expression] = mapping()
    name: OptionalLabel = None
    priority: Priority = 0
    delay: OptionalExpression = None
    values: ValuesOf = "trigger"
    persistent: Flag = True
    waiting: Whole = MOST_WAITING
    initially: Flag = True

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

    flow: StateTable[Expression] | None = None
    domain: Items[Inequality] = items()
    final: Flag = False
    let: Table[Expression] = mapping()
    solve: SolveDocument | None = None
    outputs: Table[Expression] = mapping()
    transitions: Items[TransitionDocument] = items()


class RangeDocument(Document):
    """Values from one to another: a side of an initial box."""

    min: Expression
    max: Expression


class InitialDocument(Document):
    """Where a run starts: a value for each state, or a range, whose centre a run takes."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[  # pyright: ignore[reportIncompatibleVariableOverride]
        AnyKey, Annotated[AsExpression | Annotated[RangeDocument, Tag("<mapping>")], Discriminator(_mapping_or_not)]
    ]

    mode: Label

    @property
    def ranges(self) -> dict[Key, RangeDocument]:
        """The states that start anywhere in a range."""
        return {key: given for key, given in self.__pydantic_extra__.items() if isinstance(given, RangeDocument)}

    @property
    def values(self) -> dict[Key, Scalar]:
        """The values that a run takes."""

        def centre(given: RangeDocument) -> Scalar:
            return Scalar(f"(({given.min.value}) + ({given.max.value}))/2", False, given.min.place)

        given = self.__pydantic_extra__.items()
        return {key: centre(value) if isinstance(value, RangeDocument) else value for key, value in given}


class MultiplesDocument(Document):
    """Times at a fixed distance, from 0 to the end."""

    every: Expression


Samples = Annotated[
    AsExpression | Annotated[Items[Expression], Tag("<list>")] | Annotated[MultiplesDocument, Tag("<mapping>")],
    Discriminator(lambda value: "<list>" if isinstance(value, list) else _mapping_or_not(value)),
]


class ExperimentDocument(Document):
    """How to run the model by default. Numbers are expressions of parameters."""

    until: Expression
    scheme: Scheme = None
    completion: Completion = None
    method: Word = None
    step: OptionalExpression = None
    tolerance: OptionalExpression = None
    relaxation: OptionalExpression = None
    scale: OpenTable[Expression] = mapping()
    samples: Samples | None = None
    max_transitions: OptionalExpression = None


class ReferenceTransitionDocument(Document):
    """A transition known exactly."""

    time: Expression
    edge: OptionalLabel = None
    before: OpenTable[Expression] = mapping()
    after: OpenTable[Expression] = mapping()


ReferenceEvent = Annotated[
    AsExpression | Annotated[ReferenceTransitionDocument, Tag("<mapping>")], Discriminator(_mapping_or_not)
]


class ReferenceStateDocument(Document):
    """A state known exactly: further keys are names of states or outputs."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[AnyKey, Expression]  # pyright: ignore[reportIncompatibleVariableOverride]

    time: Expression
    mode: OptionalLabel = None


class ReferenceDocument(Document):
    """Exact knowledge of a run. Numbers are expressions of parameters."""

    settings: OpenTable[Expression] = mapping(alias="set")
    source: Text = None
    trust: OptionalExpression = None
    transitions: Items[ReferenceEvent] = items()
    states: Items[ReferenceStateDocument] = items()


def _one_or_many(value: Any) -> Any:
    if isinstance(value, Scalar) and value.kind == "null":
        return []
    return value if isinstance(value, list) else [value]  # pyright: ignore[reportUnknownVariableType]


class ModelDocument(Document):
    """A controlled hybrid system."""

    hsdsl: Version
    title: Text = None
    source: Text = None
    assumptions: Items[Text] = items()
    parameters: Table[Parameter] = mapping()
    functions: Table[FunctionDocument] = mapping()
    inputs: Table[Input] = mapping()
    let: Table[Expression] = mapping()
    solve: SolveDocument | None = None
    modes: ModeTable[ModeDocument]
    outputs: Table[Expression] = mapping()
    scene: Items[Shape] = items()
    units: OpenTable[Text] = mapping()
    initial: InitialDocument
    experiment: ExperimentDocument
    reference: Annotated[list[ReferenceDocument], BeforeValidator(_one_or_many)] = items()


class PartTransitionDocument(TransitionDocument):
    """An edge that leaves a mode of a part."""

    when: Inequality | None = None  # pyright: ignore[reportIncompatibleVariableOverride]
    on: OptionalLabel = None
    to: OptionalLabel = None  # pyright: ignore[reportIncompatibleVariableOverride]
    reset: OpenTable[Expression] = mapping()


class PartModeDocument(ModeDocument):
    """A mode of a part."""

    transitions: Items[PartTransitionDocument] = items()  # pyright: ignore[reportIncompatibleVariableOverride]


class AutomatonDocument(Document):
    """A kind of part: modes with what they need to know of the rest of the model."""

    parameters: Table[Parameter] = mapping()
    inputs: Items[ArgumentName] = items()
    let: Table[Expression] = mapping()
    outputs: Table[Expression] = mapping()
    units: OpenTable[Text] = mapping()
    modes: ModeTable[PartModeDocument]


class AutomatonFile(Document):
    """A kind of part that is in a file of its own."""

    file: Label


Automaton = Annotated[
    Annotated[AutomatonDocument, Tag("<mapping>")] | Annotated[AutomatonFile, Tag("<file>")],
    Discriminator(lambda value: "<file>" if isinstance(value, dict) and "file" in value else "<mapping>"),
]


class PartInitialDocument(Document):
    """Where an instance starts."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[AnyKey, Expression]  # pyright: ignore[reportIncompatibleVariableOverride]

    mode: OptionalLabel = None


class InstanceDocument(Document):
    """A part of the system: an automaton with its numbers and connections."""

    automaton: Label
    initial: PartInitialDocument = None  # pyright: ignore[reportAssignmentType]
    inputs: OpenTable[Expression] = mapping()
    parameters: OpenTable[Expression] = mapping()
    count: Whole | None = None
    at_ends: OpenTable[Expression] = mapping()


class SystemDocument(ModelDocument):
    """A controlled hybrid system, as modes or as a system of parts."""

    modes: ModeTable[ModeDocument] = mapping()
    initial: InitialDocument = None  # pyright: ignore[reportAssignmentType]
    automata: Table[Automaton] = mapping()
    system: StateTable[InstanceDocument] = mapping()


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
    ("scene", "*", "<view>"): (ViewShape, "a view"),
    ("initial",): (InitialDocument, "`initial`"),
    ("initial", "*", "<mapping>"): (RangeDocument, "a range"),
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
