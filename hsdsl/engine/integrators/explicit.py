"""Explicit methods: Euler, midpoint, Heun, Ralston, Runge-Kutta of fixed step, and Dormand-Prince 5(4).

The paper's error bound at omega = 1 is shown with `euler`, its oscillator (Sec. V-B) with `midpoint`. `ralston` has the
least bound on the truncation error among methods of two stages.

Dormand-Prince 5(4) is the adaptive pair, with the fourth-order dense output of its authors' codes. Every coefficient is
a fraction, so the table is exact at any precision. The dense output is written in the literature as nested brackets
with weights d; :func:`_dense` multiplies them out into powers of s.
"""

from fractions import Fraction

from hsdsl.engine.integrators.tableau import ButcherTableau, Vector, fractions

_ROWS = ((), fractions("1/2"), fractions("0 1/2"), fractions("0 0 1"))
_HEUN = "Heun (explicit trapezoidal rule)"
_RALSTON = "Ralston 1962, doi:10.1090/S0025-5718-1962-0150954-0"
_RUNGE = "Runge 1895, doi:10.1007/BF01446807"

EULER = ButcherTableau("euler", "Explicit Euler", 1, ((),), fractions("1"), "Euler 1768")
MIDPOINT = ButcherTableau("midpoint", "Explicit midpoint", 2, _ROWS[:2], fractions("0 1"), _RUNGE)
HEUN = ButcherTableau("heun", _HEUN, 2, ((), fractions("1")), fractions("1/2 1/2"), "Heun 1900")
RALSTON = ButcherTableau("ralston", "Ralston", 2, ((), fractions("2/3")), fractions("1/4 3/4"), _RALSTON)
RK4 = ButcherTableau("rk4", "Classical Runge-Kutta", 4, _ROWS, fractions("1/6 1/3 1/3 1/6"), "Kutta 1901")

_B = fractions("35/384 0 500/1113 125/192 -2187/6784 11/84 0")
_D = fractions(
    "-12715105075/11282082432 0 87487479700/32700410799 -10690763975/1880347072"
    " 701980252875/199316789632 -1453857185/822651844 69997945/29380423"
)


def _dense() -> tuple[Vector, ...]:
    """Powers of s in x + s (dx + (1-s) (p + s (q + (1-s) r))).

    Here dx = h sum b k, p = h k_1 - dx, q = dx - h k_7 - p and r = h sum d k.
    """
    rows: list[Vector] = []
    for i, (b, d) in enumerate(zip(_B, _D, strict=True)):
        first, last = Fraction(i == 0), Fraction(i == 6)
        p = first - b
        q = b - last - p
        rows.append((b + p, q - p + d, -q - 2 * d, d))
    return tuple(rows)


DOPRI5 = ButcherTableau(
    name="dopri5",
    title="Dormand-Prince 5(4)",
    order=5,
    a=(
        (),
        fractions("1/5"),
        fractions("3/40 9/40"),
        fractions("44/45 -56/15 32/9"),
        fractions("19372/6561 -25360/2187 64448/6561 -212/729"),
        fractions("9017/3168 -355/33 46732/5247 49/176 -5103/18656"),
        fractions("35/384 0 500/1113 125/192 -2187/6784 11/84"),
    ),
    b=_B,
    embedded=fractions("5179/57600 0 7571/16695 393/640 -92097/339200 187/2100 1/40"),
    dense=_dense(),
    dense_order=4,
    source="Dormand and Prince 1980, doi:10.1016/0771-050X(80)90013-3; dense output: Hairer, Norsett, Wanner, II.6",
)
