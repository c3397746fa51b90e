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


def with_checks(function):
    """A function that is not-a-number where its value is infinite for finite arguments."""
    return lambda *arguments: checked(function(*arguments), *arguments)


f_sin, f_cos, f_tan, f_asin, f_acos, f_atan = jnp.sin, jnp.cos, jnp.tan, jnp.arcsin, jnp.arccos, jnp.arctan
f_tanh, f_asinh, f_acosh, f_sqrt, f_abs, f_sign = jnp.tanh, jnp.arcsinh, jnp.arccosh, jnp.sqrt, jnp.abs, jnp.sign
f_atan2 = jnp.arctan2  # its derivative at the origin is none
f_sinh, f_cosh, f_atanh = with_checks(jnp.sinh), with_checks(jnp.cosh), with_checks(jnp.arctanh)
f_exp, f_pow = with_checks(jnp.exp), with_checks(jnp.power)


def f_log(x):
    """Logarithm."""
    return jnp.where(x > 0, jnp.log(jnp.where(x > 0, x, 1.0)), NAN)


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


def when(needed, compute, otherwise):
    """The result of a function where it is needed; of a batch it is called only if one of it needs that.

    It has no derivatives.
    """
    state = needed, otherwise
    return jax.lax.while_loop(lambda state: state[0], lambda state: (jnp.zeros_like(state[0]), compute()), state)[1]
