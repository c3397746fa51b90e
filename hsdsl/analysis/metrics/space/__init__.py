"""From a model's mathematics to the geometry of its hybrid quotient space (Def. 12)."""

from hsdsl.analysis.metrics.geometry import Space
from hsdsl.analysis.metrics.space.maker import make_space

__all__ = ["Space", "make_space"]
