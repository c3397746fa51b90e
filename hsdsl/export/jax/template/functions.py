# pyright: basic
"""The functions of routines: not-a-number where a function of finite numbers has no finite real value."""

from __future__ import annotations

import jax
import jax.numpy as jnp

jax.config.update("jax_enable_x64", True)  # before the first array: all numbers here have 64 bits

NAN, INF = jnp.nan, jnp.inf


def f_div(a, b):
    """A quotient; the divisor that is put in place of zero keeps derivatives finite."""
    return jnp.where(b == 0, NAN, a / jnp.where(b == 0, 1.0, b))


def checked(value, *arguments):
    """Not-a-number where a value is infinite for finite arguments."""
    finite = True
    for argument in arguments:
        finite = finite & jnp.isfinite(argument)
    return jnp.where(finite & jnp.isinf(value), NAN, value)


def f_sin(x):
    """Sine."""
    return jnp.sin(x)


def f_cos(x):
    """Cosine."""
    return jnp.cos(x)


def f_tan(x):
    """Tangent."""
    return jnp.tan(x)


def f_asin(x):
    """Inverse sine."""
    return jnp.arcsin(x)


def f_acos(x):
    """Inverse cosine."""
    return jnp.arccos(x)


def f_atan(x):
    """Inverse tangent."""
    return jnp.arctan(x)


def f_sinh(x):
    """Hyperbolic sine."""
    return checked(jnp.sinh(x), x)


def f_cosh(x):
    """Hyperbolic cosine."""
    return checked(jnp.cosh(x), x)


def f_tanh(x):
    """Hyperbolic tangent."""
    return jnp.tanh(x)


def f_asinh(x):
    """Inverse hyperbolic sine."""
    return jnp.arcsinh(x)


def f_acosh(x):
    """Inverse hyperbolic cosine."""
    return jnp.arccosh(x)


def f_atanh(x):
    """Inverse hyperbolic tangent."""
    return checked(jnp.arctanh(x), x)


def f_exp(x):
    """Exponential."""
    return checked(jnp.exp(x), x)


def f_log(x):
    """Logarithm."""
    return jnp.where(x > 0, jnp.log(jnp.where(x > 0, x, 1.0)), NAN)


def f_sqrt(x):
    """Square root."""
    return jnp.sqrt(x)


def f_pow(x, y):
    """Power."""
    return checked(jnp.power(x, y), x, y)


def f_atan2(y, x):
    """Angle of a point; its derivative at the origin is none."""
    return jnp.arctan2(y, x)


def f_abs(x):
    """Absolute value."""
    return jnp.abs(x)


def f_sign(x):
    """Sign."""
    return jnp.sign(x)


def f_heaviside(x):
    """Unit step, a half at zero."""
    return 0.5 * (1.0 + jnp.sign(x))


def f_floor(x):
    """Largest integer not above a number."""
    return jnp.where(jnp.isfinite(x), jnp.floor(x), NAN)


def f_min(a, b):
    """The smaller; the first where they are equal."""
    return jnp.where(b < a, b, a)


def f_max(a, b):
    """The larger; the first where they are equal."""
    return jnp.where(b > a, b, a)


def padded(values, width, fill=0.0):
    """A vector of numbers, filled up to a width."""
    rows = [jnp.asarray(value, float) for value in values]
    rows += [jnp.asarray(fill, float)] * (width - len(rows))
    return jnp.stack(rows) if rows else jnp.zeros(0)


def frozen(value):
    """The same numbers as constants for every derivative."""
    return jax.tree.map(jax.lax.stop_gradient, value)


def keeping(value, source):
    """A value with the derivatives of another expression for it."""
    return jax.lax.stop_gradient(value) + (source - jax.lax.stop_gradient(source))


def with_derivatives_of(source):
    """A function (numbers, arguments) that is its first argument, with the derivatives of ``source(*arguments)``.

    The source is computed only where derivatives are.
    """

    @jax.custom_jvp
    def call(numbers, arguments):
        return numbers

    @call.defjvp
    def _(primals, tangents):
        return primals[0], jax.jvp(source, primals[1], tangents[1])[1]

    return call


def chosen(mask, ours, theirs):
    """Fields of one structure where ``mask`` holds, of the other elsewhere."""
    return jax.tree.map(lambda a, b: jnp.where(mask, a, b), ours, theirs)


def when(wanted, compute, otherwise):
    """The result of a function where it is wanted; of a batch it is called only if one of it wants that.

    It has no derivatives.
    """
    state = wanted, otherwise
    return jax.lax.while_loop(lambda state: state[0], lambda state: (jnp.zeros_like(state[0]), compute()), state)[1]
