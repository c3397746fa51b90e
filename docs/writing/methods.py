"""The page of the integrators, from their tables."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from textwrap import fill
from typing import Any

from writing.markdown import table

from hsdsl.engine import integrators
from hsdsl.engine.integrators import ButcherTableau

INTEGRATORS = """# Integrators

The values of `method` and `--method`. `auto` is chosen for each run, and the run says why: `radau` where the start is
stiff or the run becomes stiff, else `taylor` where every flow is smooth and has derivatives at the start, else
`{auto}`, and `{auto}` with a fixed step. It is `{auto}`, too, where a flow has no Taylor series when an input begins to
follow another branch, such as `sqrt(max(sin(t), 0))`. Where a stage of the shortest first steps of `{auto}` has no
value, as the root of a tank that begins empty, it is `dop853`. A method with an embedded error estimate is adaptive and
keeps a `tolerance`; any method takes fixed steps of size `step`. The numbers of the tables are on
[their own page](coefficients.md).

"""

COEFFICIENTS = """# Coefficients

The Butcher tableaux of the [integrators](integrators.md), as the program has them.

"""

TAYLOR = """The coefficients of the solution's own series come from recurrences, and inside a step the polynomial is the
answer. With the tolerance e the order is 3 - log(e)/2, rounded up: 14 for 1e-9, 61 for 1e-50; a fixed step takes the
order of round-off, 22 for float64. Flows must be smooth: with `abs`, `sign`, `min`, `max` or `floor` of a
state in one the method is refused, and a run stops where a flow has a value but no series (the square root of 0)."""

RADAU = """A step is implicit: its increments solve a system of equations, by Newton's method with the derivatives of
the flow, which come from the model's expressions. Derivatives and factored matrices are kept from step to step as long
as they do, and a step keeps its length where it would change by little. The method is L-stable, so that what
decays fast does not bound the step once it has decayed. Inside a step: the collocation polynomial, of degree 3 and
order 3 in general (its error is O(h^4)), exact to order 5 at the step's end. The error estimate falls as h^4 and holds
for the curve between the samples too; right after a switch to a fast decay the steps are therefore short enough to
show it. Where the equations are not solved, the step
is halved. When to take it is in
[theory](../theory.md#stiff-modes)."""

INTERPOLANTS = {
    "secant": "the straight line between its ends",
    "hermite": "the cubic Hermite polynomial of its ends",
    "dense": "dense output of order {order}, from the stages",
}


def integrator_page() -> str:
    """Document every integrator from its table."""
    methods, taylor, radau = integrators.INTEGRATORS, integrators.METHODS["taylor"], integrators.RADAU
    summary = [
        (f"[`{name}`](#{name})", str(m.order), str(m.stages), "adaptive" if m.adaptive else "fixed")
        for name, m in methods.items()
    ] + [(f"[`{taylor.name}`](#{taylor.name})", "by the tolerance", "", "adaptive")]
    summary.append((f"[`{radau.name}`](#{radau.name})", str(radau.order), "3, implicit", "adaptive"))
    parts = [INTEGRATORS.format(auto=integrators.FALLBACK), table(("method", "order", "stages", "steps"), summary)]
    for name, method in methods.items():
        between = INTERPOLANTS[method.interpolant].format(order=method.dense_order)
        error = f"; embedded method of order {method.estimated_order}" if method.adaptive else ""
        error += f", and a coarser one of order {method.estimated_order - 2}" if method.coarse else ""
        known = "" if method.digits is None else f" Coefficients of {method.digits} digits."
        about = f"{method.title}, order {method.order}{error}. Inside a step: {between}.{known}"
        parts.append(f"## {name}\n\n{fill(about, 120)}\n\n")
        parts.append(f"Source: {method.source}. [Coefficients](coefficients.md#{name}).\n\n")
    about = fill(f"{taylor.title}. {TAYLOR}", 120)
    parts.append(f"## {taylor.name}\n\n{about}\n\nSource: {taylor.source}.\n")
    about = fill(f"{radau.title}, order {radau.order}. {RADAU}", 120)
    parts.append(f"\n## {radau.name}\n\n{about}\n\nSource: {radau.source}.\n")
    return "".join(parts)


def coefficient_page() -> str:
    """Write the tableau of every Runge-Kutta method."""
    return COEFFICIENTS + "".join(f"## {name}\n\n{tableau(m)}" for name, m in integrators.INTEGRATORS.items())


def tableau(method: ButcherTableau) -> str:
    """Write a Butcher tableau, and the dense output's weights where there are any."""
    stages = [f"k{i + 1}" for i in range(method.stages)]
    triangle = zip(method.c, method.a, strict=True)
    rows = [weights(f"**{node(c)}**", row) + [""] * (method.stages - len(row)) for c, row in triangle]
    rows.append(weights("**b**", method.b))
    if method.embedded is not None:
        rows.append(weights("**b̂**", method.embedded))
    if method.coarse is not None:
        rows.append(weights("**coarser**", method.coarse))
    text = table(["c", *stages], rows)
    if method.extra:
        extended = [f"k{i + 1}" for i in range(len(method.rows))]
        text += f"{extended[method.stages]} is the flow at the step's end. For the dense output only:\n\n"
        text += table(["c", *extended], [weights(f"**{node(sum(row))}**", row) for row in method.extra])
        stages = extended
    if method.dense is not None:
        text += "Dense output: each stage's weight as a polynomial in s = (t - t_k)/h.\n\n"
        powers = [f"s^{m + 1}" for m in range(len(method.dense[0]))]
        text += table(["stage", *powers], [weights(k, row) for k, row in zip(stages, method.dense, strict=True)])
    return text


def node(value: Any) -> str:
    """Write a fraction, or a decimal where a fraction would be long."""
    return str(value) if value.denominator < 10**20 else f"{float(value):.17g}"


def weights(label: str, row: Iterable[Fraction]) -> list[str]:
    """Make a table row of exact weights."""
    return [label, *(node(value) for value in row)]
