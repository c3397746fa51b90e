# pyright: basic
"""Steps of a table, their interpolants and error estimates; sums go from left to right."""

from __future__ import annotations

import jax.numpy as jnp


def weighted(row, stages):
    """The sum of a row's weights times the stages."""
    total = jnp.zeros_like(stages[0])
    for i, (stage, weight) in enumerate(row):
        term = weight * stages[stage]
        total = term if i == 0 else total + term
    return total


def evaluated(method, flow, i, t, h, x, stages):
    """Stage i of a step."""
    return flow(t + method.nodes[i] * h, x + h * weighted(method.a[i], stages))


def step(method, flow, t, h, x):
    """One step from (t, x): its end and its stages."""
    stages = [flow(t, x)]
    for i in range(1, method.stages):
        stages.append(evaluated(method, flow, i, t, h, x, stages))
    return x + h * weighted(method.b, stages), stages


def secant(x, z):
    """The straight line, as coefficients of s, s**2, ..."""
    return (z - x)[None]


def hermite(h, x, z, slope, end):
    """The cubic from the ends of a step and the flow there."""
    return jnp.stack([h * slope, 3 * (z - x) - h * (2 * slope + end), h * (slope + end) - 2 * (z - x)])


def piece_of(method, flow, t, h, x, z, stages, end):
    """The method's interpolant."""
    if method.interpolant == "secant":
        return secant(x, z)
    if method.interpolant == "hermite":
        return hermite(h, x, z, stages[0], end)
    stages = [*stages, end]
    for i in range(method.extra):
        stages.append(evaluated(method, flow, method.stages + 1 + i, t, h, x, stages))
    return jnp.stack([h * weighted(row, stages) for row in method.dense])


def at(x, piece, s):
    """A point of an interpolant, x + c_1 s + c_2 s**2 + ..."""
    value = piece[-1] * s
    for c in piece[-2::-1]:
        value = (c + value) * s
    return x + value


def slope_at(piece, s):
    """The derivative of an interpolant by s."""
    value = len(piece) * piece[-1]
    for m in range(len(piece) - 1, 0, -1):
        value = m * piece[m - 1] + s * value
    return value


def error_of(method, h, stages, end):
    """The estimate of a step's error."""
    fine = h * weighted(method.error, [*stages, end])
    if not method.coarse:
        return fine
    coarse = h * weighted(method.coarse, [*stages, end])
    square = fine * fine
    total = square + coarse * coarse / 100
    return jnp.where(total > 0, square / jnp.sqrt(jnp.where(total > 0, total, 1.0)), square)
