/* Routines at one point: what they give, and how far round-off may have moved that.

   A range around one point says the same; to carry a value and one bound takes a third of the time. Rounding adds what
   it does to the ends of a range. An infinite bound says that nothing is known. */

#include "ranges.c"

typedef struct {
  double value, off;
} hs_rounded;

HS_INLINE hs_rounded rounded(double value, double off, double units) {
  const hs_rounded found = {value, off + fabs(value) * units};
  return found;
}

HS_INLINE hs_rounded rounded_product(hs_rounded a, hs_rounded b) {
  return rounded(a.value * b.value, fabs(a.value) * b.off + (fabs(b.value) + b.off) * a.off, 0x1p-52);
}

/* |a/b - (a + e)/(b + d)| = |e - (a/b) d|/|b + d| */
static hs_rounded rounded_quotient(hs_rounded a, hs_rounded b) {
  const double value = a.value / b.value, least = fabs(b.value) - b.off;
  return rounded(value, least > 0.0 ? (a.off + fabs(value) * b.off) / least : INFINITY, 0x1p-51);
}

static hs_rounded rounded_power(hs_rounded a, int exponent) {
  if (exponent == 1) return a;
  const hs_rounded half = rounded_power(a, exponent / 2), square = rounded_product(half, half);
  return exponent % 2 ? rounded_product(square, a) : square;
}

/* A function whose slope is at most `steepest` wherever its argument may be. */
HS_INLINE hs_rounded rounded_function(double value, hs_rounded a, double steepest) {
  return rounded(value, a.off > 0.0 ? a.off * steepest : 0.0, LIBRARY);
}

static hs_rounded rounded_of(const hs_operation *o, hs_rounded a, hs_rounded b) {
  const double x = a.value, least = x - a.off;
  switch (o->kind) {
  case HS_ADD: return rounded(x + b.value, a.off + b.off, 0x1p-52);
  case HS_SUB: return rounded(x - b.value, a.off + b.off, 0x1p-52);
  case HS_MUL: return rounded_product(a, b);
  case HS_DIV: return rounded_quotient(a, b);
  case HS_NEG: return rounded(-x, a.off, 0.0);
  case HS_SQUARE: return rounded_product(a, a);
  case HS_POWER: return rounded_power(a, o->b);
  case HS_ABS: return rounded(fabs(x), a.off, 0.0);
  case HS_MIN: return rounded(hs_min(x, b.value), hs_max(a.off, b.off), 0.0);
  case HS_MAX: return rounded(hs_max(x, b.value), hs_max(a.off, b.off), 0.0);
  case HS_SQRT: return rounded_function(sqrt(x), a, least > 0.0 ? 0.5 / sqrt(least) : INFINITY);
  case HS_EXP: return rounded_function(exp(x), a, exp(x + a.off));
  case HS_LOG: return rounded_function(log(x), a, least > 0.0 ? 1 / least : INFINITY);
  case HS_SIN: return rounded_function(sin(x), a, 1.0);
  case HS_COS: return rounded_function(cos(x), a, 1.0);
  case HS_TANH: return rounded_function(tanh(x), a, 1.0);
  case HS_ATAN: return rounded_function(atan(x), a, 1.0);
  case HS_SIGN: return rounded(sign_of(x), fabs(x) > a.off ? 0.0 : INFINITY, 0.0);
  case HS_FLOOR: return rounded(floor(x), floor(x - a.off) == floor(x + a.off) ? 0.0 : INFINITY, 0.0);
  default: return rounded(NAN, INFINITY, 0.0);
  }
}

static void rounded_operations(const hs_formulas *f, int first, int last, int base, hs_rounded *v) {
  for (int i = first; i < last; i++) {
    const hs_operation *const o = &f->operation[i];
    v[base + i] = rounded_of(o, v[o->a], v[o->kind == HS_POWER ? o->a : o->b]);
  }
}
