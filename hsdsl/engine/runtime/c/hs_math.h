/* The functions of generated code, without a value exactly where Python's `math` raises.

   `bad` is set where a ValueError, OverflowError or ZeroDivisionError would be raised; what is returned then is not
   looked at. Not-a-number and infinity as arguments are no error by themselves, as in Python. */

#ifndef HS_MATH_H
#define HS_MATH_H

#include <float.h>
#if defined(HS_FLOAT32)
#include <tgmath.h> /* the functions of floats */
#define HS_UNIT 0x1p-24f
#else
#include <math.h>
#define HS_UNIT 0x1p-53
#endif

#include "hs.h"

#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16
#error "doubles must be computed as doubles, or engines would not agree"
#endif

static inline int hs_finite(hs_real x) { return x - x == 0.0; }

static inline hs_real hs_div(hs_real a, hs_real b, int *bad) {
  *bad |= b == 0.0;
  return a / b;
}

static inline hs_real hs_checked(hs_real r, hs_real x, int *bad) {
  if (!hs_finite(r)) *bad |= r != r ? x == x : hs_finite(x);
  return r;
}

/* Of a number these have a finite value or none: no branch is compiled for others. */
static inline hs_real hs_sin(hs_real x, int *bad) {
  const hs_real r = sin(x);
  *bad |= (r != r) & (x == x);
  return r;
}
static inline hs_real hs_cos(hs_real x, int *bad) {
  const hs_real r = cos(x);
  *bad |= (r != r) & (x == x);
  return r;
}
static inline hs_real hs_sqrt(hs_real x, int *bad) {
  *bad |= x < 0.0;
  return sqrt(x);
}

#define HS_FUNCTION(name) \
  static inline hs_real hs_##name(hs_real x, int *bad) { return hs_checked(name(x), x, bad); }
HS_FUNCTION(tan)
HS_FUNCTION(asin)
HS_FUNCTION(acos)
HS_FUNCTION(atan)
HS_FUNCTION(sinh)
HS_FUNCTION(cosh)
HS_FUNCTION(tanh)
HS_FUNCTION(asinh)
HS_FUNCTION(acosh)
HS_FUNCTION(atanh)
HS_FUNCTION(exp)
HS_FUNCTION(log)
#undef HS_FUNCTION

static inline hs_real hs_pow(hs_real x, hs_real y, int *bad) {
  hs_real r = pow(x, y);
  *bad |= !hs_finite(r) && hs_finite(x) && hs_finite(y);
  return r;
}

static inline hs_real hs_atan2(hs_real y, hs_real x, int *bad) {
  (void)bad;
  return atan2(y, x);
}

static inline hs_real hs_floor(hs_real x, int *bad) {
  *bad |= !hs_finite(x);
  return floor(x) + 0.0; /* Python's comes from an integer, which has no negative zero */
}

static inline hs_real hs_abs(hs_real x, int *bad) {
  (void)bad;
  return fabs(x);
}

static inline hs_real hs_sign(hs_real x, int *bad) {
  (void)bad;
  return (hs_real)((x > 0.0) - (x < 0.0));
}

static inline hs_real hs_heaviside(hs_real x, int *bad) { return 0.5 * (1.0 + hs_sign(x, bad)); }

/* A routine a few units of round-off of time away from where it has no value. */
static inline int hs_beside(hs_routine *routine, const hs_real *p, hs_real t, const hs_real *x, hs_real *out) {
  const hs_real unit = HS_UNIT, size = t < 0.0 ? -t : t;
  int failed = 1;
  for (int units = 2; units <= 32 && failed; units *= 4)
    failed = routine(p, t + units * unit * size, x, out) && routine(p, t - units * unit * size, x, out);
  return failed;
}

/* the first of two that compare equal, or cannot be compared */
static inline hs_real hs_min(hs_real a, hs_real b) { return b < a ? b : a; }
static inline hs_real hs_max(hs_real a, hs_real b) { return b > a ? b : a; }

#endif
