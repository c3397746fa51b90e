"""Ralston's method of order 2: the least bound on the truncation error among two-stage methods."""

from hsdsl.integrators.tableau import ButcherTableau, fractions

RALSTON = ButcherTableau(
    name="ralston",
    title="Ralston",
    order=2,
    a=((), fractions("2/3")),
    b=fractions("1/4 3/4"),
    source="Ralston 1962, doi:10.1090/S0025-5718-1962-0150954-0",
)
