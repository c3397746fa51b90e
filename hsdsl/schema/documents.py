"""The documents: what keys a model has, and what each may hold."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, ConfigDict, Discriminator, Field, Tag

from hsdsl.schema.fields import (
    AnyKey,
    Condition,
    Document,
    Expression,
    Flag,
    Inequality,
    Items,
    Label,
    ModeTable,
    OpenTable,
    OptionalCondition,
    OptionalExpression,
    OptionalLabel,
    Scheme,
    StateTable,
    Table,
    Text,
    Version,
    Whole,
    Word,
    empty,
)
from hsdsl.schema.inputs import Input, InputFile, InputSamples
from hsdsl.source import Scalar


class ParameterEntry(Document):
    """A parameter with more than its value."""

    value: Expression = Field(
        description="A number, or an expression of earlier parameters.", examples=["9.81", "2*omega"]
    )
    unit: Text = Field(None, description="Its unit, such as `m/s`.", examples=["m/s**2"])
    min: OptionalExpression = Field(None, description="The least value it may have.", examples=[0])
    max: OptionalExpression = Field(None, description="The largest value it may have.", examples=[1])
    about: Text = Field(None, description="What it is, for people.", examples=["coefficient of restitution"])


def _mapping_or_not(value: Any) -> str:
    return "<mapping>" if isinstance(value, dict) else "<expression>"


Parameter = Annotated[
    Annotated[Expression, Tag("<expression>")] | Annotated[ParameterEntry, Tag("<mapping>")],
    Discriminator(_mapping_or_not),
]


class TransitionDocument(Document):
    """An edge that leaves a mode."""

    when: Inequality = Field(
        description="One inequality, such as `x >= x_max`: the surface at which the transition fires.",
        examples=["x >= x_max", "h <= 0"],
    )
    condition: OptionalCondition = Field(
        None,
        alias="if",
        description="Which part of the surface is the guard: a condition.",
        examples=["v > 0 and y < 1"],
    )
    to: Label = Field(description="The mode entered.", examples=["free"])
    reset: OpenTable[Expression] = Field(
        default_factory=empty,
        description="State of the target: its value after the transition, in terms of the values before it. "
        "States not named keep their value.",
        examples=[{"v": "-c*v"}],
    )
    name: OptionalLabel = Field(
        None, description="What to call the transition; `SRC->DST` where nothing is said.", examples=["impact"]
    )
    priority: Whole = Field(
        0,
        description="Of transitions reached together, the one with the largest priority goes first.",
        examples=[1],
    )


class ModeDocument(Document):
    """A mode: how the state flows, where it may be, and how it is left."""

    flow: StateTable[Expression] | None = Field(
        None,
        description="State: its time derivative. The keys are the mode's states.",
        examples=[{"x": "v", "v": "-omega**2*x"}],
    )
    domain: Items[Inequality] = Field(
        default_factory=list[Any],
        description="Inequalities that are walls without a guard: leaving through one stops the run.",
        examples=[["x >= -1", "x <= 1"]],
    )
    final: Flag = Field(
        False, description="Whether the run ends on entering the mode. It then needs no `flow`.", examples=[True]
    )
    let: Table[Expression] = Field(
        default_factory=empty,
        description="Named subexpressions of this mode, each of earlier ones; they shadow the top ones.",
        examples=[{"force": "-k*x"}],
    )
    outputs: Table[Expression] = Field(
        default_factory=empty,
        description="Outputs of this mode. They go before those of the model with the same name, and have no value in "
        "modes that do not define them.",
        examples=[{"power": "k*v**2"}],
    )
    transitions: Items[TransitionDocument] = Field(
        default_factory=list[Any],
        description="The edges that leave the mode.",
        examples=[[{"when": "x >= 1", "to": "free", "reset": {"v": "-v"}}]],
    )


class InitialDocument(Document):
    """Where a run starts."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[AnyKey, Expression]  # pyright: ignore[reportIncompatibleVariableOverride]

    mode: Label = Field(description="The mode a run starts in.", examples=["free"])


def _list_or_not(value: Any) -> str:
    return "<list>" if isinstance(value, list) else "<expression>"


Samples = Annotated[
    Annotated[Expression, Tag("<expression>")] | Annotated[Items[Expression], Tag("<list>")],
    Discriminator(_list_or_not),
]


class ExperimentDocument(Document):
    """How to run the model unless told otherwise. Numbers are expressions of parameters."""

    until: Expression = Field(description="The time at which a run ends; it starts at 0.", examples=["40*pi"])
    scheme: Scheme = Field(None, description="How transitions are made.", examples=["relaxed"])
    method: Word = Field(
        None, description="The integrator, such as `midpoint`, or `auto`.", examples=["auto", "midpoint"]
    )
    step: OptionalExpression = Field(
        None, description="The step of a fixed-step method. Excludes `tolerance`.", examples=["1e-3"]
    )
    tolerance: OptionalExpression = Field(
        None,
        description="The bound on the local error of an adaptive method, relative to the largest size each state has "
        "had. Excludes `step`.",
        examples=["1e-9"],
    )
    relaxation: OptionalExpression = Field(
        None,
        description="The paper's epsilon: depth of the strips, in the model's own units and in time. Left out, 1e-6, "
        "or 1e-6 of a run that is shorter than 1.",
        examples=["1e-6"],
    )
    scale: OpenTable[Expression] = Field(
        default_factory=empty,
        description="State: its typical size, positive. The scale of a state is this size until the state has been "
        "larger.",
        examples=[{"x": "1e-3", "v": 1}],
    )
    samples: Samples | None = Field(
        None, description="How many samples to record, or a list of their times.", examples=[201, [0, "1/2", 1]]
    )
    max_transitions: OptionalExpression = Field(
        None, description="Stop rather than make more transitions.", examples=["1e6"]
    )


class ReferenceTransitionDocument(Document):
    """A transition known exactly."""

    time: Expression = Field(description="When the guard is reached.", examples=["1.25"])
    edge: OptionalLabel = Field(None, description="The transition's name.", examples=["impact", "heating->idle"])
    before: OpenTable[Expression] = Field(
        default_factory=empty, description="States before it.", examples=[{"x": 14, "v": "25.6"}]
    )
    after: OpenTable[Expression] = Field(default_factory=empty, description="States after it.", examples=[{"v": "-23"}])


ReferenceEvent = Annotated[
    Annotated[Expression, Tag("<expression>")] | Annotated[ReferenceTransitionDocument, Tag("<mapping>")],
    Discriminator(_mapping_or_not),
]


class ReferenceStateDocument(Document):
    """A state known exactly: further keys are names of states or outputs."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[AnyKey, Expression]  # pyright: ignore[reportIncompatibleVariableOverride]

    time: Expression = Field(description="When.", examples=[1])
    mode: OptionalLabel = Field(None, description="In which mode.", examples=["free"])


class ReferenceDocument(Document):
    """What is known exactly of a run. Numbers are expressions of parameters."""

    settings: OpenTable[Expression] = Field(
        default_factory=empty,
        alias="set",
        description="What differs from the file, as for `--set`: `initial.w: -0.4`.",
        examples=[{"initial.w": "-0.4"}],
    )
    source: Text = Field(None, description="Where the numbers come from.", examples=["closed form"])
    trust: OptionalExpression = Field(None, description="The bound on their absolute error.", examples=["1e-12"])
    transitions: Items[ReferenceEvent] = Field(
        default_factory=list[Any],
        description="The first transitions: their times, or mappings.",
        examples=[[1, {"time": 2, "edge": "impact"}]],
    )
    states: Items[ReferenceStateDocument] = Field(
        default_factory=list[Any], description="States at times.", examples=[[{"time": 1, "mode": "free", "x": "1/2"}]]
    )


def _one_or_many(value: Any) -> Any:
    if isinstance(value, Scalar) and value.kind == "null":
        return []
    return value if isinstance(value, list) else [value]  # pyright: ignore[reportUnknownVariableType]


class ModelDocument(Document):
    """A controlled hybrid system."""

    hsdsl: Version = Field(description="The version of the language.", examples=[1])
    title: Text = Field(None, description="What the model is, in a few words.", examples=["Bouncing ball"])
    source: Text = Field(None, description="Where the model comes from.", examples=["Burden et al. 2013, Fig. 1"])
    parameters: Table[Parameter] = Field(
        default_factory=empty,
        description="Name: number, expression of earlier parameters, or a mapping with its value.",
        examples=[{"g": "9.81", "e": {"value": "0.8", "min": 0, "max": 1}}],
    )
    inputs: Table[Input] = Field(
        default_factory=empty,
        description="Name: expression of `t` and parameters, or samples, or a CSV file.",
        examples=[{"u": "20*cos(2.5*t)"}],
    )
    let: Table[Expression] = Field(
        default_factory=empty,
        description="Named subexpressions, each of earlier ones.",
        examples=[{"energy": "v**2/2"}],
    )
    modes: ModeTable[ModeDocument] = Field(
        description="The modes.", examples=[{"fall": {"flow": {"h": "v", "v": "-g"}}}]
    )
    outputs: Table[Expression] = Field(
        default_factory=empty,
        description="Name: expression, recorded beside the states. Each mode reads it with its own `let`; it has no "
        "value in a mode that lacks one of its names.",
        examples=[{"energy": "m*g*h + m*v**2/2"}],
    )
    units: OpenTable[Text] = Field(
        default_factory=empty,
        description="Unit of a state, parameter, input or output, or of `t`.",
        examples=[{"h": "m", "v": "m/s"}],
    )
    initial: InitialDocument = Field(
        description="Where a run starts: `mode`, and a value for each of its states.",
        examples=[{"mode": "fall", "h": 10, "v": 0}],
    )
    experiment: ExperimentDocument = Field(
        description="How to run the model unless told otherwise.", examples=[{"until": 12}]
    )
    reference: Annotated[list[ReferenceDocument], BeforeValidator(_one_or_many)] = Field(
        default_factory=list[Any],
        description="What is known exactly: one mapping, or a list of them.",
        json_schema_extra={},
        examples=[{"trust": "1e-12", "transitions": ["1.428"]}],
    )


# the document at each kind of place; `*` is any key or index
SHAPES: dict[tuple[str, ...], type[Document]] = {
    (): ModelDocument,
    ("parameters", "*"): ParameterEntry,
    ("inputs", "*", "<samples>"): InputSamples,
    ("inputs", "*", "<file>"): InputFile,
    ("modes", "*"): ModeDocument,
    ("modes", "*", "transitions", "*"): TransitionDocument,
    ("initial",): InitialDocument,
    ("experiment",): ExperimentDocument,
    ("reference", "*"): ReferenceDocument,
    ("reference", "*", "transitions", "*"): ReferenceTransitionDocument,
    ("reference", "*", "states", "*"): ReferenceStateDocument,
}
__all__ = [
    "SHAPES",
    "Condition",
    "ExperimentDocument",
    "InitialDocument",
    "ModeDocument",
    "ModelDocument",
    "Parameter",
    "ParameterEntry",
    "ReferenceDocument",
    "ReferenceStateDocument",
    "ReferenceTransitionDocument",
    "TransitionDocument",
]
