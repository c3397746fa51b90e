"""Explicit midpoint, order 2: the method of the paper's oscillator experiments (Sec. V-B)."""

from hsdsl.integrators.tableau import ButcherTableau, fractions

MIDPOINT = ButcherTableau(
    name="midpoint",
    title="Explicit midpoint",
    order=2,
    a=((), fractions("1/2")),
    b=fractions("0 1"),
    source="Runge 1895, doi:10.1007/BF01446807",
)
