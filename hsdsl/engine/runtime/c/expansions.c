/* Routines along a part of a step: up to third order around its middle, and how far they may be from that. See
   hsdsl/engine/simulate/verdict/flows.py.

   An expansion is a function of u from -1 to 1, no further from value + first u + second u**2 + third u**3 than
   `remainder`;
   that is infinite where nothing is known. What is added to it for rounding is far more than rounding does, that of C's
   library too. An operation is resolved where what it makes beyond third order is no more than an eighth of its terms:
   its result is as smooth as the part is long. `unresolved` is what others may add. `error` is how much the errors of
   states change the result, where no terms cancel. */

#include "moving.c"

#define EXPANSION_ROUNDOFF 0x1p-48 /* of all terms together: more than rounding makes of a coefficient */
#define RESOLVED 8       /* terms are so many times what is beyond them; what moves a state by so many errors is seen */

typedef struct {
  double value, first, second, third, remainder, unresolved, error;
} hs_expansion;

static const hs_expansion anything = {0.0, 0.0, 0.0, 0.0, INFINITY, INFINITY, 0.0};

HS_INLINE hs_expansion expansion(double value, double first, double second, double third, double remainder,
                                 double unresolved, double error) {
  const hs_expansion found = {value, first, second, third, remainder, unresolved, error};
  return remainder <= DBL_MAX ? found : anything;
}

HS_INLINE hs_expansion constant_expansion(double value) {
  return expansion(value, 0.0, 0.0, 0.0, fabs(value) * EXPANSION_ROUNDOFF, 0.0, 0.0);
}

/* How far its polynomial may be from its value, itself, and how far from zero. */
HS_INLINE double variation(hs_expansion a) { return fabs(a.first) + fabs(a.second) + fabs(a.third); }
HS_INLINE double deviation(hs_expansion a) { return variation(a) + a.remainder; }
HS_INLINE double size_of(hs_expansion a) { return fabs(a.value) + deviation(a); }

/* What is unresolved in the result of an operation with so large terms that makes `beyond` and leaves out `off`: where
   it is resolved, that of its operands. */
HS_INLINE double unresolved_in(double beyond, double varies, double unresolved, double off) {
  return beyond * RESOLVED <= varies ? unresolved : off;
}

HS_INLINE hs_expansion expanded_sum(hs_expansion a, hs_expansion b) {
  return expansion(a.value + b.value, a.first + b.first, a.second + b.second, a.third + b.third,
                   a.remainder + b.remainder + (size_of(a) + size_of(b)) * EXPANSION_ROUNDOFF,
                   a.unresolved + b.unresolved, a.error + b.error);
}

HS_INLINE hs_expansion expanded_multiple(hs_expansion a, double by) {
  const double remainder = (a.remainder + size_of(a) * EXPANSION_ROUNDOFF) * fabs(by);
  return expansion(a.value * by, a.first * by, a.second * by, a.third * by, remainder, a.unresolved * fabs(by),
                   a.error * fabs(by));
}

HS_INLINE hs_expansion negated(hs_expansion a) {
  const hs_expansion found = {-a.value, -a.first, -a.second, -a.third, a.remainder, a.unresolved, a.error};
  return found;
}

/* The powers of a product from the fourth on, without what the factors' rests add. */
HS_INLINE double higher(hs_expansion a, hs_expansion b) {
  return fabs(a.first * b.third + a.second * b.second + a.third * b.first) +
         fabs(a.second * b.third + a.third * b.second) + fabs(a.third * b.third);
}

HS_INLINE hs_expansion expanded_product(hs_expansion a, hs_expansion b) {
  const double size = size_of(a), other = size_of(b), beyond = higher(a, b);
  const double varies = variation(a) * (fabs(b.value) + variation(b)) + fabs(a.value) * variation(b) - beyond;
  const double off = beyond + a.remainder * other + b.remainder * (size - a.remainder);
  const double unresolved = a.unresolved * other + b.unresolved * size;
  return expansion(a.value * b.value, a.value * b.first + a.first * b.value,
                   a.value * b.second + a.first * b.first + a.second * b.value,
                   a.value * b.third + a.first * b.second + a.second * b.first + a.third * b.value,
                   off + size * other * EXPANSION_ROUNDOFF, unresolved_in(beyond, varies, unresolved, off),
                   fabs(a.value) * b.error + a.error * fabs(b.value));
}

/* A function with the coefficients c around an expansion's value; `further` bounds its powers from the fourth on. */
HS_INLINE hs_expansion composed(hs_expansion a, const double c[4], double further) {
  const double by = deviation(a), one = fabs(a.first), slope = fabs(c[1]), bend = fabs(c[2]), twist = fabs(c[3]);
  const double varies = by * (slope + by * (bend + by * twist));
  const double beyond = bend * (by * by - one * (one + 2 * fabs(a.second))) + twist * (by * by * by - one * one * one) +
                        further, off = slope * a.remainder + beyond;
  const double unresolved = a.unresolved * (slope + by * (2 * bend + 3 * by * twist));
  return expansion(c[0], c[1] * a.first, c[1] * a.second + c[2] * a.first * a.first,
                   c[1] * a.third + a.first * (2 * c[2] * a.second + c[3] * a.first * a.first),
                   off + (fabs(c[0]) + varies) * EXPANSION_ROUNDOFF, unresolved_in(beyond, varies, unresolved, off),
                   slope * a.error);
}

/* What the fourth derivative of a function makes of it, that being at most `most`. */
HS_INLINE double fourth(double by, double most) { return by * by * by * by / 24 * most; }

/* The powers of a share from the fourth on. */
HS_INLINE double geometric(double share) {
  return share < 1.0 ? share * share * share * share / (1 - share) : INFINITY;
}

static hs_expansion expanded_reciprocal(hs_expansion a) {
  const double v = 1 / a.value, c[4] = {v, -v * v, v * v * v, -v * v * v * v};
  return composed(a, c, fabs(v) * geometric(deviation(a) * fabs(v)));
}

/* Of the binomials of 1/2 the fourth, 5/128, is the largest from there on. */
static hs_expansion expanded_root(hs_expansion a) {
  if (!(a.value > 0.0)) return anything;
  const double s = sqrt(a.value), v = 1 / a.value, c[4] = {s, s * v / 2, -s * v * v / 8, s * v * v * v / 16};
  return composed(a, c, s * 5 / 128 * geometric(deviation(a) * v));
}

static hs_expansion expanded_exponential(hs_expansion a) {
  const double here = exp(a.value), c[4] = {here, here, here / 2, here / 6};
  return composed(a, c, fourth(deviation(a), here * exp(deviation(a))));
}

static hs_expansion expanded_logarithm(hs_expansion a) {
  if (!(a.value > 0.0)) return anything;
  const double less = 1 / a.value, c[4] = {log(a.value), less, -less * less / 2, less * less * less / 3};
  return composed(a, c, geometric(deviation(a) * less) / 4);
}

/* Where `here` is its sine and `across` its cosine; or its cosine, and minus its sine. */
static hs_expansion expanded_sine(hs_expansion a, double here, double across) {
  const double c[4] = {here, across, -here / 2, -across / 6};
  return composed(a, c, fourth(deviation(a), 1.0));
}

/* 2/(1 + exp(-2 a)) - 1, for minus a where that is smaller. */
static hs_expansion expanded_tanh(hs_expansion a) {
  const int minus = a.value < 0.0;
  const hs_expansion less = expanded_exponential(expanded_multiple(a, minus ? 2.0 : -2.0));
  const hs_expansion share = expanded_reciprocal(expanded_sum(constant_expansion(1.0), less));
  const hs_expansion found = expanded_sum(expanded_multiple(share, 2.0), constant_expansion(-1.0));
  return minus ? negated(found) : found;
}

/* The slope of atan has poles sqrt(1 + c**2) away. */
static hs_expansion expanded_angle(hs_expansion a) {
  const double x = a.value, m = 1 / (1 + x * x), c[4] = {atan(x), m, -x * m * m, (x * x - 1.0 / 3) * m * m * m};
  return composed(a, c, geometric(deviation(a) * sqrt(m)) / 4);
}

static hs_expansion expanded_power(hs_expansion a, int exponent) {
  if (exponent == 1) return a;
  const hs_expansion half = expanded_power(a, exponent / 2), square = expanded_product(half, half);
  return exponent % 2 ? expanded_product(square, a) : square;
}

/* The smaller of two, where it is the same one everywhere. */
static hs_expansion expanded_least(hs_expansion a, hs_expansion b) {
  const double apart = deviation(a) + deviation(b);
  return b.value - a.value > apart ? a : a.value - b.value > apart ? b : anything;
}

/* The product with a number: as expanded_product() has it, without what is zero. */
HS_INLINE hs_expansion expanded_share(hs_expansion number, hs_expansion a) {
  const double by = number.value, size = fabs(by) + number.remainder, other = size_of(a);
  const double off = number.remainder * other + a.remainder * (size - number.remainder);
  return expansion(by * a.value, by * a.first, by * a.second, by * a.third, off + size * other * EXPANSION_ROUNDOFF,
                   a.unresolved * size, fabs(by) * a.error);
}

static hs_expansion series_of_operation(const hs_operation *o, const hs_expansion *a, const hs_expansion *b) {
  const double c = a->value, r = deviation(*a);
  switch (o->kind) {
  case HS_ADD: return expanded_sum(*a, *b);
  case HS_SUB: return expanded_sum(*a, negated(*b));
  case HS_MUL: return expanded_product(*a, *b);
  case HS_DIV: return expanded_product(*a, expanded_reciprocal(*b));
  case HS_NEG: return negated(*a);
  case HS_SQUARE: return expanded_product(*a, *a);
  case HS_POWER: return expanded_power(*a, o->b);
  case HS_ABS: return fabs(c) > r ? expanded_multiple(*a, sign_of(c)) : anything;
  case HS_MIN: return expanded_least(*a, *b);
  case HS_MAX: return negated(expanded_least(negated(*a), negated(*b)));
  case HS_SQRT: return expanded_root(*a);
  case HS_EXP: return expanded_exponential(*a);
  case HS_LOG: return expanded_logarithm(*a);
  case HS_SIN: return expanded_sine(*a, sin(c), cos(c));
  case HS_COS: return expanded_sine(*a, cos(c), -sin(c));
  case HS_TANH: return expanded_tanh(*a);
  case HS_ATAN: return expanded_angle(*a);
  case HS_SIGN: return fabs(c) > r ? constant_expansion(sign_of(c)) : anything;
  case HS_FLOOR: return floor(c - r) == floor(c + r) ? constant_expansion(floor(c)) : anything;
  default: return anything;
  }
}

/* Where less is unresolved in all that the result of an operation may be than in its series, take a constant. */
static hs_expansion less_unresolved(const hs_operation *o, const hs_expansion *a, const hs_expansion *b,
                                          hs_expansion found) {
  if (o->kind == HS_SQRT || !hs_finite(a->remainder) || !hs_finite(b->remainder)) return found;
  const double r = deviation(*a), s = deviation(*b);
  const hs_range one = {a->value - r, a->value + r}, other = {b->value - s, b->value + s};
  const hs_range all = range_of(o, one, other);
  const double half = (all.high - all.low) / 2, value = all.low + half;
  if (!(half < found.unresolved)) return found;
  return expansion(value, 0.0, 0.0, 0.0, half + fabs(value) * EXPANSION_ROUNDOFF, half, found.error);
}

static hs_expansion expansion_of(const hs_operation *o, const hs_expansion *a, const hs_expansion *b) {
  const hs_expansion found = series_of_operation(o, a, b);
  return found.unresolved > 0.0 ? less_unresolved(o, a, b, found) : found;
}

/* Carry out operations from one up to another after time and n states; registers of results begin at `base`. */
static void expand_operations(const hs_formulas *f, int first, int last, int n, int base, hs_expansion *v) {
  const int numbers = base + f->fixed; /* registers after the states and before this one hold one number each */
  for (int i = first; i < last; i++) {
    const hs_operation *const o = &f->operation[i];
    if (o->kind == HS_MUL && o->a > n && o->a < numbers) v[base + i] = expanded_share(v[o->a], v[o->b]);
    else if (o->kind == HS_MUL && o->b > n && o->b < numbers) v[base + i] = expanded_share(v[o->b], v[o->a]);
    else v[base + i] = expansion_of(o, &v[o->a], &v[o->kind == HS_POWER ? o->a : o->b]);
  }
}
