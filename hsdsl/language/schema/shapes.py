"""The documents of a scene: shapes whose numbers are expressions, drawn while a run is shown.

Exactly one key of a shape is its kind; the value of that key is where the shape is.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator, Discriminator, Field, Tag

from hsdsl.base.names import did_you_mean, shown
from hsdsl.language.schema.fields import (
    Document,
    Expression,
    OptionalExpression,
    described,
    optional,
    refuse,
    required,
    shaped_as_list,
)
from hsdsl.language.source import ABSENT, Scalar

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
