"""The documents: what keys a model has, and what each may hold."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, ConfigDict, Discriminator, Field, Tag

from hsdsl.schema.inputs import Input, InputFile, InputSamples
from hsdsl.schema.leaves import (
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
from hsdsl.source import Scalar


class ParameterEntry(Document):
    """A parameter with more than its value."""

    value: Expression = Field(description="A number, or an expression of earlier parameters.")
    unit: Text = Field(None, description="Its unit, such as `m/s`.")
    min: OptionalExpression = Field(None, description="The least value it may have.")
    max: OptionalExpression = Field(None, description="The largest value it may have.")
    about: Text = Field(None, description="What it is, for people.")


def _mapping_or_not(value: Any) -> str:
    return "<mapping>" if isinstance(value, dict) else "<expression>"


Parameter = Annotated[
    Annotated[Expression, Tag("<expression>")] | Annotated[ParameterEntry, Tag("<mapping>")],
    Discriminator(_mapping_or_not),
]


class Transition(Document):
    """An edge that leaves a mode."""

    when: Inequality = Field(
        description="One inequality, such as `x >= x_max`: the surface at which the transition fires."
    )
    condition: OptionalCondition = Field(
        None, alias="if", description="Which part of the surface is the guard: a condition."
    )
    to: Label = Field(description="The mode entered.")
    reset: OpenTable[Expression] = Field(
        default_factory=empty,
        description="State of the target: its value after the transition, in terms of the values before it. "
        "States not named keep their value.",
    )
    name: OptionalLabel = Field(None, description="What to call the transition; `SRC->DST` where nothing is said.")
    priority: Whole = Field(
        0, description="Of transitions reached together, the one with the largest priority goes first."
    )


class Mode(Document):
    """A mode: how the state flows, where it may be, and how it is left."""

    flow: StateTable[Expression] | None = Field(
        None, description="State: its time derivative. The keys are the mode's states."
    )
    domain: Items[Inequality] = Field(
        default_factory=list[Any],
        description="Inequalities that are walls without a guard: leaving through one stops the run.",
    )
    final: Flag = Field(False, description="Whether the run ends on entering the mode. It then needs no `flow`.")
    let: Table[Expression] = Field(
        default_factory=empty,
        description="Named subexpressions of this mode, each of earlier ones; they shadow the top ones.",
    )
    transitions: Items[Transition] = Field(default_factory=list[Any], description="The edges that leave the mode.")


class Initial(Document):
    """Where a run starts."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[AnyKey, Expression]  # pyright: ignore[reportIncompatibleVariableOverride]

    mode: Label = Field(description="The mode a run starts in.")


def _list_or_not(value: Any) -> str:
    return "<list>" if isinstance(value, list) else "<expression>"


Samples = Annotated[
    Annotated[Expression, Tag("<expression>")] | Annotated[Items[Expression], Tag("<list>")],
    Discriminator(_list_or_not),
]


class Experiment(Document):
    """How to run the model unless told otherwise. Numbers are expressions of parameters."""

    until: Expression = Field(description="The time at which a run ends; it starts at 0.")
    scheme: Scheme = Field(None, description="How transitions are made.")
    method: Word = Field(None, description="The integrator, such as `midpoint`, or `auto`.")
    step: OptionalExpression = Field(None, description="The step of a fixed-step method. Excludes `tolerance`.")
    tolerance: OptionalExpression = Field(
        None, description="The bound on the local error, relative to 1 + |x|, of an adaptive method. Excludes `step`."
    )
    relaxation: OptionalExpression = Field(
        None, description="The paper's epsilon: depth of the strips, in the model's own units and in time."
    )
    samples: Samples | None = Field(None, description="How many samples to record, or a list of their times.")
    max_transitions: OptionalExpression = Field(None, description="Stop rather than make more transitions.")


class ReferenceTransition(Document):
    """A transition known exactly."""

    time: Expression = Field(description="When the guard is reached.")
    edge: OptionalLabel = Field(None, description="The transition's name.")
    before: OpenTable[Expression] = Field(default_factory=empty, description="States before it.")
    after: OpenTable[Expression] = Field(default_factory=empty, description="States after it.")


ReferenceEvent = Annotated[
    Annotated[Expression, Tag("<expression>")] | Annotated[ReferenceTransition, Tag("<mapping>")],
    Discriminator(_mapping_or_not),
]


class ReferenceState(Document):
    """A state known exactly: further keys are names of states or outputs."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[AnyKey, Expression]  # pyright: ignore[reportIncompatibleVariableOverride]

    time: Expression = Field(description="When.")
    mode: OptionalLabel = Field(None, description="In which mode.")


class Reference(Document):
    """What is known exactly of a run. Numbers are expressions of parameters."""

    settings: OpenTable[Expression] = Field(
        default_factory=empty, alias="set", description="What differs from the file, as for `--set`: `initial.w: -0.4`."
    )
    source: Text = Field(None, description="Where the numbers come from.")
    trust: OptionalExpression = Field(None, description="The bound on their absolute error.")
    transitions: Items[ReferenceEvent] = Field(
        default_factory=list[Any], description="The first transitions: their times, or mappings."
    )
    states: Items[ReferenceState] = Field(default_factory=list[Any], description="States at times.")


def _one_or_many(value: Any) -> Any:
    if isinstance(value, Scalar) and value.kind == "null":
        return []
    return value if isinstance(value, list) else [value]  # pyright: ignore[reportUnknownVariableType]


class Model(Document):
    """A controlled hybrid system."""

    hsdsl: Version = Field(description="The version of the language.")
    title: Text = Field(None, description="What the model is, in a few words.")
    source: Text = Field(None, description="Where the model comes from.")
    parameters: Table[Parameter] = Field(
        default_factory=empty,
        description="Name: number, expression of earlier parameters, or a mapping with its value.",
    )
    inputs: Table[Input] = Field(
        default_factory=empty, description="Name: expression of `t` and parameters, or samples, or a CSV file."
    )
    let: Table[Expression] = Field(default_factory=empty, description="Named subexpressions, each of earlier ones.")
    modes: ModeTable[Mode] = Field(description="The modes.")
    outputs: Table[Expression] = Field(
        default_factory=empty, description="Name: expression, recorded beside the states."
    )
    units: OpenTable[Text] = Field(default_factory=empty, description="Unit of a state, parameter, input or output.")
    initial: Initial = Field(description="Where a run starts: `mode`, and a value for each of its states.")
    experiment: Experiment = Field(description="How to run the model unless told otherwise.")
    reference: Annotated[list[Reference], BeforeValidator(_one_or_many)] = Field(
        default_factory=list[Any],
        description="What is known exactly: one mapping, or a list of them.",
        json_schema_extra={},
    )


# the document at each kind of place; `*` is any key or index
SHAPES: dict[tuple[str, ...], type[Document]] = {
    (): Model,
    ("parameters", "*"): ParameterEntry,
    ("inputs", "*", "<samples>"): InputSamples,
    ("inputs", "*", "<file>"): InputFile,
    ("modes", "*"): Mode,
    ("modes", "*", "transitions", "*"): Transition,
    ("initial",): Initial,
    ("experiment",): Experiment,
    ("reference", "*"): Reference,
    ("reference", "*", "transitions", "*"): ReferenceTransition,
    ("reference", "*", "states", "*"): ReferenceState,
}
__all__ = [
    "SHAPES",
    "Condition",
    "Experiment",
    "Initial",
    "Mode",
    "Model",
    "Parameter",
    "ParameterEntry",
    "Reference",
    "ReferenceState",
    "ReferenceTransition",
    "Transition",
]
