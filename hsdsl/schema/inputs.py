"""The ways to give an input."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from hsdsl.schema.fields import Document, Expression, Hold, Items, Label


class InputSamples(Document):
    """An input given by samples in the file."""

    times: Items[Expression] = Field(description="The times of the samples, increasing.", examples=[[0, 1, 2]])
    values: Items[Expression] = Field(description="The values at those times.", examples=[[0, 5, 0]])
    hold: Hold = Field(
        "zero",
        description="Between samples: `zero` keeps the last sample's value, `linear` joins them by straight lines.",
        examples=["linear"],
    )


class InputFile(Document):
    """An input given by samples in a CSV file."""

    file: Label = Field(
        description="A CSV file with the header `time,NAME`, by its path from the model's own folder, inside it.",
        examples=["u.csv"],
    )
    hold: Hold = Field(
        "zero",
        description="Between samples: `zero` keeps the last sample's value, `linear` joins them by straight lines.",
        examples=["linear"],
    )


def _way(value: Any) -> str:
    if not isinstance(value, dict):
        return "<expression>"
    return "<file>" if "file" in value else "<samples>"


Input = Annotated[
    Annotated[Expression, Tag("<expression>")]
    | Annotated[InputSamples, Tag("<samples>")]
    | Annotated[InputFile, Tag("<file>")],
    Discriminator(_way),
]
