"""Units read by our own grammar: what pint would make of the same text, and nothing evaluated."""

from fractions import Fraction

import pint
import pytest

from hsdsl.analysis.lint.units import Unit, UnknownUnit, read

TEXTS = ["m", "kg*m/s**2", "km/h", "1/min", "N*mm**-1", "m**(1/2)", "rad/s", "degree", "W/(m**2*K)", "2*m", "µs", "rpm"]


@pytest.mark.parametrize("text", TEXTS)
def test_as_pint_reads_it(text):
    quantity = pint.UnitRegistry().parse_expression(text).to_base_units()
    found = read(text)
    assert found.factor == pytest.approx(quantity.magnitude, rel=1e-12)
    expected = {name: float(power) for name, power in quantity.dimensionality.items()}
    assert {name: float(power) for name, power in found.powers} == pytest.approx(expected)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "m/s^2",
        "m s",
        "furlongz",
        "m**(10**9)",
        "m**1e9",
        "m+s",
        "sin(m)",
        "0*m",
        "-m",
        "m" * 101,
        "().__class__",
        "1/0",
    ],
)
def test_refused(text):
    with pytest.raises(UnknownUnit):
        read(text)


@pytest.mark.parametrize(
    ("text", "better"),
    [("m/s^2", "m/s**2"), ("kg m/s²", "kg*m/s**2"), ("N·m", "N*m"), ("s⁻¹", "s**-1"), ("metrs m", None), ("m/", None)],
)
def test_units_written_as_elsewhere_are_answered(text, better):
    with pytest.raises(UnknownUnit) as raised:
        read(text)
    assert raised.value.better == better


def test_said_as_people_write_it():
    for text in ("m", "m/s", "kg*m/s**2", "1/s", "m**(1/2)", "1/(m*s)", "mV/ms", "1/ms", "degree", "10*mm"):
        assert str(read(text)) == text
        assert str(read(f"({text})**2").to(Fraction(1, 2))) == text


def test_many_names_are_said_in_base_units():
    assert str(read("kg*m*A*mm*s*K/ms")) == "kg*A*m**2*K"


@pytest.mark.parametrize(
    ("one", "other", "printed"),
    [
        ("V", "mV", "V (1000 mV)"),
        ("nA/uF", "mV/ms", "nA/uF (0.001 mV/ms)"),
        ("degree", "1", "degree (0.0174533)"),
        ("V", "A", "V"),
    ],
)
def test_a_size_is_said_where_it_is_all_that_differs(one, other, printed):
    assert read(one).compared_with(read(other)) == printed


def test_size_counts():
    assert (
        read("J").same(read("N*m")) and not read("mm").same(read("m")) and read("rad").pure and not read("degree").pure
    )
    assert Unit().pure and not read("s").pure
