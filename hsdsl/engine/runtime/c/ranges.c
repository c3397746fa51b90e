/* Routines over ranges of numbers. See hsdsl/base/numbers/enclosures.py.

   Rounding outwards: a result y in round-to-nearest is off by at most |y| u + m, with u = 2**-53 and m the least number
   that is not zero. `y - (|y| 2u + m)` is computed with an error of at most u times its own size, which is no more than
   |y| u + m, so it is no larger than the exact result. Functions of the C library are right to a few units in the last
   place; they get `LIBRARY` of them. */

#include "functions.h"
#include "hs_screen.h"

#define TINIEST 0x1p-1074
#define LIBRARY 0x1p-49
#define ANGLE 0x1p-49 /* more than rounding makes of a number of turns, relative to that number and 1 */

typedef struct {
  double low, high;
} hs_range;

static const hs_range everything = {-INFINITY, INFINITY};

HS_INLINE double under(double y, double units) {
  const double low = y - (fabs(y) * units + TINIEST);
  return low == low ? low : -INFINITY;
}

HS_INLINE double over(double y, double units) {
  const double high = y + (fabs(y) * units + TINIEST);
  return high == high ? high : INFINITY;
}

HS_INLINE hs_range outwards(double low, double high, double units) {
  const hs_range found = {under(low, units), over(high, units)};
  return found;
}

/* The same of values that are exact where they are zero, as sums are and functions with one zero. It saves time, too:
   numbers below the least normal one take a hundred times as long as others. */
HS_INLINE hs_range with_exact_zeros(double low, double high, double units) {
  hs_range found = outwards(low, high, units);
  if (low == 0.0) found.low = 0.0;
  if (high == 0.0) found.high = 0.0;
  return found;
}

HS_INLINE hs_range range_sum(double low, double high) { return with_exact_zeros(low, high, 0x1p-52); }

HS_INLINE int is_zero(hs_range a) { return a.low == 0.0 && a.high == 0.0; }

HS_INLINE hs_range range_product(hs_range a, hs_range b) {
  const double p = a.low * b.low, q = a.low * b.high, r = a.high * b.low, s = a.high * b.high;
  if (p != p || q != q || r != r || s != s) return everything;
  if (is_zero(a)) return a;
  if (is_zero(b)) return b;
  hs_range found = outwards(hs_min(hs_min(p, q), hs_min(r, s)), hs_max(hs_max(p, q), hs_max(r, s)), 0x1p-52);
  if (found.low < 0.0 && ((a.low >= 0.0 && b.low >= 0.0) || (a.high <= 0.0 && b.high <= 0.0))) found.low = 0.0;
  return found;
}

static hs_range range_quotient(hs_range a, hs_range b) {
  if (!(b.low > 0.0 || b.high < 0.0)) return everything;
  return range_product(a, outwards(1.0 / b.high, 1.0 / b.low, 0x1p-52));
}

HS_INLINE hs_range range_square(hs_range a) {
  const double p = a.low * a.low, q = a.high * a.high;
  hs_range found = outwards(hs_min(p, q), hs_max(p, q), 0x1p-52);
  if (!(found.low > 0.0) || (a.low <= 0.0 && a.high >= 0.0)) found.low = 0.0;
  return p == p && q == q ? found : everything;
}

static hs_range range_power(hs_range a, int exponent) {
  if (exponent == 1) return a;
  const hs_range half = range_power(a, exponent / 2), square = range_square(half);
  return exponent % 2 ? range_product(square, a) : square;
}

static hs_range range_abs(hs_range a) {
  const double p = fabs(a.low), q = fabs(a.high);
  const hs_range found = {a.low <= 0.0 && a.high >= 0.0 ? 0.0 : hs_min(p, q), hs_max(p, q)};
  return found;
}

/* Sine, or with `quarter` 1 cosine: 1 where a crest lies in the range, -1 where a trough does. */
static hs_range range_sine(hs_range a, double quarter) {
  const double turn = 0.15915494309189535, less = (1.0 - quarter) / 4;
  double low = a.low * turn - less, high = a.high * turn - less;
  low -= ANGLE * (1 + fabs(low)), high += ANGLE * (1 + fabs(high));
  const double p = quarter == 0.0 ? sin(a.low) : cos(a.low), q = quarter == 0.0 ? sin(a.high) : cos(a.high);
  hs_range found = with_exact_zeros(hs_min(p, q), hs_max(p, q), LIBRARY);
  if (!(floor(high + 0.5) < ceil(low + 0.5)) || !(found.low > -1.0)) found.low = -1.0;
  if (!(floor(high) < ceil(low)) || !(found.high < 1.0)) found.high = 1.0;
  return found;
}

HS_INLINE double sign_of(double x) { return (x > 0) - (x < 0); }

HS_INLINE hs_range range_of(const hs_operation *o, hs_range a, hs_range b) {
  hs_range found = everything;
  switch (o->kind) {
  case HS_ADD: return range_sum(a.low + b.low, a.high + b.high);
  case HS_SUB: return range_sum(a.low - b.high, a.high - b.low);
  case HS_MUL: return range_product(a, b);
  case HS_DIV: return range_quotient(a, b);
  case HS_NEG: found.low = -a.high, found.high = -a.low; return found;
  case HS_SQUARE: return range_square(a);
  case HS_POWER: return range_power(a, o->b);
  case HS_ABS: return range_abs(a);
  case HS_MIN: found.low = hs_min(a.low, b.low), found.high = hs_min(a.high, b.high); return found;
  case HS_MAX: found.low = hs_max(a.low, b.low), found.high = hs_max(a.high, b.high); return found;
  case HS_SQRT:
    if (!(a.low >= 0.0)) return everything;
    return with_exact_zeros(sqrt(a.low), sqrt(a.high), LIBRARY);
  case HS_EXP:
    found = outwards(exp(a.low), exp(a.high), LIBRARY);
    if (found.low < 0.0) found.low = 0.0;
    return found;
  case HS_LOG: return a.low > 0.0 ? with_exact_zeros(log(a.low), log(a.high), LIBRARY) : everything;
  case HS_SIN: return range_sine(a, 0.0);
  case HS_COS: return range_sine(a, 1.0);
  case HS_TANH: return with_exact_zeros(tanh(a.low), tanh(a.high), LIBRARY);
  case HS_ATAN: return with_exact_zeros(atan(a.low), atan(a.high), LIBRARY);
  case HS_SIGN: found.low = sign_of(a.low), found.high = sign_of(a.high); return found;
  case HS_FLOOR: found.low = floor(a.low), found.high = floor(a.high); return found;
  default: return everything;
  }
}

/* Carry out operations from one up to another; registers of results begin at `base`. */
static void range_operations(const hs_formulas *f, int first, int last, int base, hs_range *v) {
  for (int i = first; i < last; i++) {
    const hs_operation *const o = &f->operation[i];
    v[base + i] = range_of(o, v[o->a], v[o->kind == HS_POWER ? o->a : o->b]);
  }
}
