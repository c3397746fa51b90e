/* Routines at one point whose round-off is followed: what they give, and how far off that may be.

   `traced` operations know what they lose, with its sign; else all rounding counts either way and at its most: a range
   around one point says the same, and a value and one bound take a third of the time. An infinite bound says that
   nothing is known. See hsdsl/base/numbers/roundoff.py. */

#include "ranges.c"

#define ROUNDED 0x1p-52 /* units in the last place that an operation, or a state that moves, is rounded to */

/* The exact number is value + error, but for `off` at most. */
typedef struct {
  double value, error, off;
} hs_rounded;

HS_INLINE hs_rounded rounded(double value, double error, double off) {
  const hs_rounded found = {value, error, off};
  return found;
}

/* What an operation makes, which has lost so much. */
HS_INLINE hs_rounded made(double value, double error, double off, double lost, double units, int traced) {
  return traced ? rounded(value, error + lost, off) : rounded(value, 0.0, off + fabs(value) * units);
}

HS_INLINE hs_rounded rounded_sum(hs_rounded a, hs_rounded b, int traced) {
  const double value = a.value + b.value, part = value - a.value;
  const double lost = (a.value - (value - part)) + (b.value - part);
  return made(value, a.error + b.error, a.off + b.off, lost, ROUNDED, traced);
}

HS_INLINE hs_rounded opposite(hs_rounded a) { return rounded(-a.value, -a.error, a.off); }

HS_INLINE hs_rounded rounded_product(hs_rounded a, hs_rounded b, int traced) {
  const double value = a.value * b.value, off = fabs(a.value) * b.off + (fabs(b.value) + b.off) * a.off;
  if (!traced) return rounded(value, 0.0, off + fabs(value) * ROUNDED);
  const double error = a.value * b.error + b.value * a.error + a.error * b.error;
  return rounded(value, error + fma(a.value, b.value, -value), off);
}

/* |a/b - (a + e)/(b + d)| = |e - (a/b) d|/|b + d| */
static hs_rounded rounded_quotient(hs_rounded a, hs_rounded b, int traced) {
  const double value = a.value / b.value, least = fabs(b.value) - b.off;
  const double off = least > 0.0 ? (a.off + fabs(value) * b.off) / least : INFINITY;
  const double lost = traced ? a.error - value * b.error - fma(value, b.value, -a.value) : 0.0;
  return made(value, 0.0, off, traced ? lost / (b.value + b.error) : 0.0, 2 * ROUNDED, traced);
}

static hs_rounded rounded_power(hs_rounded a, int exponent, int traced) {
  if (exponent == 1) return a;
  const hs_rounded half = rounded_power(a, exponent / 2, traced), square = rounded_product(half, half, traced);
  return exponent % 2 ? rounded_product(square, a, traced) : square;
}

static hs_rounded rounded_root(hs_rounded a, int traced) {
  const double value = sqrt(a.value), least = a.value - a.off, beyond = a.value + a.error;
  const double off = a.off > 0.0 ? (least > 0.0 ? a.off * (0.5 / sqrt(least)) : INFINITY) : 0.0;
  if (!traced) return rounded(value, 0.0, off + fabs(value) * LIBRARY);
  const double lost = a.error - fma(value, value, -a.value);
  return rounded(value, lost != 0.0 ? lost / (value + sqrt(beyond > 0.0 ? beyond : 0.0)) : lost, off);
}

HS_INLINE double over_number(double a, double b) { return b != 0.0 ? a / b : INFINITY; }

/* A function of the library that has a slope where its argument is, and is at most so steep wherever it may be. */
HS_INLINE hs_rounded rounded_function(double value, hs_rounded a, double slope, double steepest) {
  const double error = a.error != 0.0 ? slope * a.error : 0.0;
  return rounded(value, error, (a.off > 0.0 ? a.off * steepest : 0.0) + fabs(value) * LIBRARY);
}

HS_INLINE hs_rounded rounded_smooth(double value, hs_rounded a, double slope) {
  return rounded_function(value, a, slope, fabs(slope));
}

/* The same of two arguments. */
static hs_rounded rounded_pair(double value, hs_rounded a, hs_rounded b, double one, double other) {
  double error = a.error != 0.0 ? one * a.error : 0.0, off = a.off > 0.0 ? a.off * fabs(one) : 0.0;
  error = b.error != 0.0 ? error + other * b.error : error;
  off = b.off > 0.0 ? off + b.off * fabs(other) : off;
  return rounded(value, error, off + fabs(value) * LIBRARY);
}

static hs_rounded rounded_pow(hs_rounded a, hs_rounded b, int traced) {
  const double x = a.value, y = b.value;
  if (b.error == 0.0 && b.off == 0.0 && y > 0.0 && y < 1 << 20 && y == floor(y)) return rounded_power(a, (int)y, traced);
  const double value = pow(x, y);
  return rounded_pair(value, a, b, over_number(value * y, x), x > 0.0 ? value * log(x) : 0.0);
}

HS_INLINE double sign_of(double x);

static hs_rounded rounded_step(double (*step)(double), hs_rounded a, int traced, int clear) {
  const double value = step(a.value), at = a.value + a.error;
  if (!traced) return rounded(value, 0.0, clear ? 0.0 : INFINITY);
  return rounded(value, step(at) - value, step(at + a.off) - step(at - a.off));
}

static double step_of_sign(double x) { return sign_of(x); }

/* One of two numbers, of which round-off may make the other. */
HS_INLINE hs_rounded rounded_choice(double value, hs_rounded meant, double off) {
  return rounded(value, (meant.value - value) + meant.error, off);
}

static hs_rounded rounded_extreme(hs_rounded a, hs_rounded b, int most) {
  const double p = a.value + a.error, q = b.value + b.error;
  const double value = most ? hs_max(a.value, b.value) : hs_min(a.value, b.value);
  const int second = most ? q > p : q < p;
  const hs_rounded chosen = second ? b : a;
  const double reach = (second ? a : b).off - fabs(second ? p - q : q - p); /* of the other one, beyond this */
  return rounded_choice(value, chosen, reach > chosen.off ? reach : chosen.off);
}

static hs_rounded rounded_below(hs_rounded a, hs_rounded b, hs_rounded one, hs_rounded other, int traced) {
  const hs_rounded meant = a.value + a.error < b.value + b.error ? one : other;
  const int unclear = !traced && a.off + b.off > 0.0 && fabs(a.value - b.value) <= a.off + b.off;
  return rounded_choice((a.value < b.value ? one : other).value, meant, unclear ? INFINITY : meant.off);
}

HS_INLINE hs_rounded rounded_of(const hs_operation *o, const hs_rounded *v, int traced) {
  const hs_rounded a = v[o->a], b = v[o->kind == HS_POWER ? o->a : o->b];
  const double x = a.value, y = b.value, least = x - a.off;
  const int moves = a.error != 0.0, wide = a.off > 0.0; /* else the slope, or the steepest, is not asked for */
  switch (o->kind) {
  case HS_ADD: return rounded_sum(a, b, traced);
  case HS_SUB: return rounded_sum(a, opposite(b), traced);
  case HS_MUL: return rounded_product(a, b, traced);
  case HS_DIV: return rounded_quotient(a, b, traced);
  case HS_NEG: return opposite(a);
  case HS_SQUARE: return rounded_product(a, a, traced);
  case HS_POWER: return rounded_power(a, o->b, traced);
  case HS_ABS: return x > 0.0 ? a : x < 0.0 ? opposite(a) : rounded(0.0, fabs(a.error), a.off);
  case HS_MIN: return rounded_extreme(a, b, 0);
  case HS_MAX: return rounded_extreme(a, b, 1);
  case HS_SQRT: return rounded_root(a, traced);
  case HS_EXP: return rounded_function(exp(x), a, exp(x), wide ? exp(x + a.off) : 0.0);
  case HS_LOG: return rounded_function(log(x), a, 1 / x, least > 0.0 ? 1 / least : INFINITY);
  case HS_SIN: return rounded_function(sin(x), a, moves ? cos(x) : 0.0, 1.0);
  case HS_COS: return rounded_function(cos(x), a, moves ? -sin(x) : 0.0, 1.0);
  case HS_TANH: return rounded_function(tanh(x), a, 1 - tanh(x) * tanh(x), 1.0);
  case HS_ATAN: return rounded_function(atan(x), a, 1 / (1 + x * x), 1.0);
  case HS_ASIN: return rounded_smooth(asin(x), a, over_number(1.0, sqrt(1 - x * x)));
  case HS_ACOS: return rounded_smooth(acos(x), a, -over_number(1.0, sqrt(1 - x * x)));
  case HS_SINH: return rounded_smooth(sinh(x), a, cosh(x));
  case HS_COSH: return rounded_smooth(cosh(x), a, sinh(x));
  case HS_ASINH: return rounded_smooth(asinh(x), a, 1 / sqrt(x * x + 1));
  case HS_ACOSH: return rounded_smooth(acosh(x), a, over_number(1.0, sqrt(x * x - 1)));
  case HS_ATANH: return rounded_smooth(atanh(x), a, over_number(1.0, 1 - x * x));
  case HS_ATAN2: return rounded_pair(atan2(x, y), a, b, over_number(y, y * y + x * x), over_number(-x, y * y + x * x));
  case HS_POW: return rounded_pow(a, b, traced);
  case HS_SIGN: return rounded_step(step_of_sign, a, traced, fabs(x) > a.off || a.off == 0.0);
  case HS_FLOOR: return rounded_step(floor, a, traced, floor(least) == floor(x + a.off));
  case HS_BELOW: return rounded_below(a, b, v[o->c], v[o->d], traced);
  default: return rounded(NAN, 0.0, INFINITY);
  }
}

static void rounded_operations(const hs_formulas *f, int first, int last, int base, hs_rounded *v, int traced) {
  for (int i = first; i < last && traced; i++) v[base + i] = rounded_of(&f->operation[i], v, 1);
  for (int i = first; i < last && !traced; i++) v[base + i] = rounded_of(&f->operation[i], v, 0);
}

/* Put data and constants into registers after time and n states, and carry out what depends on them alone. */
static void bind_rounded(const hs_formulas *f, int n, int data, const double *p, hs_rounded *v, int traced) {
  const int constants = 1 + n + data;
  for (int i = 0; i < data; i++) v[1 + n + i] = rounded(p[i], 0.0, 0.0);
  for (int i = 0; i < f->constants; i++) {
    const hs_constant c = f->constant[i];
    const double wide = c.error != 0.0 ? fabs(c.value) * ROUNDED : 0.0;
    v[constants + i] = rounded(c.value, traced ? c.error : 0.0, traced ? 0.0 : wide);
  }
  rounded_operations(f, 0, f->fixed, constants + f->constants, v, traced);
}

/* A formula at a point, whose results are then in its registers; data and constants are bound. */
static void rounded_formula(const hs_formulas *f, const hs_formula *formula, int n, int data, double t, const double *x,
                            hs_rounded *v, int traced) {
  v[0] = rounded(t, 0.0, 0.0);
  for (int i = 0; i < n; i++) v[1 + i] = rounded(x[i], 0.0, 0.0);
  rounded_operations(f, formula->first, formula->last, 1 + n + data + f->constants, v, traced);
}

/* What a traced number is beyond its value; zero where that is not known. */
static double beyond_value(hs_rounded a) {
  const double beyond = a.error < 0.0 ? a.error - a.off : a.error + a.off;
  return hs_finite(beyond) ? beyond : 0.0;
}

/* A traced number moved by its round-off: at least to the next number, if it is not exact or nothing is known. */
static double moved(hs_rounded a) {
  const double off = fabs(a.error) + a.off, least = ROUNDED * fabs(a.value);
  if (!(off - off == 0.0) || off == 0.0) return a.value;
  const double by = off > least ? off : least;
  return a.error < 0.0 ? a.value - by : a.value + by;
}
