"""The method of Bogacki and Shampine, of order 3 with an embedded method of order 2."""

from hsdsl.engine.integrators.tableau import ButcherTableau, fractions

BS3 = ButcherTableau(
    name="bs3",
    title="Bogacki and Shampine's method of order 3(2)",
    order=3,
    a=((), fractions("1/2"), fractions("0 3/4"), fractions("2/9 1/3 4/9")),
    b=fractions("2/9 1/3 4/9 0"),
    embedded=fractions("7/24 1/4 1/3 1/8"),
    source="Bogacki and Shampine 1989, doi:10.1016/0893-9659(89)90079-7",
)
