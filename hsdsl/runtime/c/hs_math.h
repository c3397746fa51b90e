/* The functions of generated code, without a value exactly where Python's `math` raises.

   `bad` is set where a ValueError, OverflowError or ZeroDivisionError would be raised; what is returned then is not
   looked at. Not-a-number and infinity as arguments are no error by themselves, as in Python. */

#ifndef HS_MATH_H
#define HS_MATH_H

#include <float.h>
#include <math.h>

#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16
#error "doubles must be computed as doubles, or engines would not agree"
#endif

static inline int hs_finite(double x) { return x - x == 0.0; }

static inline double hs_div(double a, double b, int *bad) {
  *bad |= b == 0.0;
  return a / b;
}

static inline double hs_checked(double r, double x, int *bad) {
  if (!hs_finite(r)) *bad |= r != r ? x == x : hs_finite(x);
  return r;
}

#define HS_FUNCTION(name) \
  static inline double hs_##name(double x, int *bad) { return hs_checked(name(x), x, bad); }
HS_FUNCTION(sin)
HS_FUNCTION(cos)
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
HS_FUNCTION(sqrt)
#undef HS_FUNCTION

static inline double hs_pow(double x, double y, int *bad) {
  double r = pow(x, y);
  *bad |= !hs_finite(r) && hs_finite(x) && hs_finite(y);
  return r;
}

static inline double hs_atan2(double y, double x, int *bad) {
  (void)bad;
  return atan2(y, x);
}

static inline double hs_floor(double x, int *bad) {
  *bad |= !hs_finite(x);
  return floor(x) + 0.0; /* Python's comes from an integer, which has no negative zero */
}

static inline double hs_abs(double x, int *bad) {
  (void)bad;
  return fabs(x);
}

static inline double hs_sign(double x, int *bad) {
  (void)bad;
  return (double)((x > 0.0) - (x < 0.0));
}

static inline double hs_heaviside(double x, int *bad) { return 0.5 * (1.0 + hs_sign(x, bad)); }

/* the first of two that compare equal, or cannot be compared */
static inline double hs_min(double a, double b) { return b < a ? b : a; }
static inline double hs_max(double a, double b) { return b > a ? b : a; }

#endif
