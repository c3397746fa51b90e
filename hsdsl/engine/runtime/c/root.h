/* Steps from the sizes of terms. See hsdsl/engine/integrators/taylor.py. */

#ifndef HS_ROOT_H
#define HS_ROOT_H

#include <string.h>

#include "run.h"

#if !defined(HS_FLOAT32)
/* 2**k, where that is a normal number. */
static double power_of_two(int k) {
  const uint64_t bits = (uint64_t)(k + 1023) << 52;
  double power;
  memcpy(&power, &bits, sizeof power);
  return power;
}

/* The logarithm of a normal number to the base 2, or up to 0.09 less. */
HS_INLINE double low_log2(double x) {
  int64_t bits;
  memcpy(&bits, &x, sizeof bits);
  return (double)bits * 0x1p-52 - 1023;
}
#else
#define low_log2(x) NAN
#endif

/* exponent / m, rounded down, of exponents of numbers; this division need not wait for the exponent. */
static int rounded_down(int exponent, int m) {
  const int64_t inverse = (1 << 30) / m + 1;
  return (int)(((exponent + 2048 * m) * inverse) >> 30) - 2048;
}

/* x**(-1/m); of x 2**(k m) it is exactly 2**-k times as much. */
static hs_real root(hs_real x, int m) {
#if !defined(HS_FLOAT32)
  if (x >= 0x1p-900 && x <= 0x1p900) { /* frexp and ldexp cost as much as pow */
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    const int shift = rounded_down((int)(bits >> 52) - 1022, m);
    return pow(x * power_of_two(-shift * m), -1.0 / m) * power_of_two(-shift);
  }
#endif
  int exponent;
  const hs_real fraction = frexp(x, &exponent);
  const int shift = rounded_down(exponent, m);
  return ldexp(pow(ldexp(fraction, exponent - shift * m), (hs_real)-1 / m), -shift);
}

/* The smaller of two steps; of not-a-number and another one the other. */
static hs_real smaller(hs_real least, hs_real h) { return h != h ? least : least != least ? h : hs_min(h, least); }

/* The step at which the first terms of a state that are left out stay below the tolerance beside the first that is not
   0; not-a-number where there are none, or where that is in the later half. Coefficient m is c[m * stride]. */
static hs_real from_zero(const hs_real *c, int stride, int order, hs_real tolerance) {
  hs_real least = NAN;
  int first = 1;
  while (first < order && c[first * stride] == 0) first++;
  const hs_real allowed = tolerance * fabs(c[first * stride]);
  if (first > (order + 2) / 2 || !(allowed > HS_NOTHING)) return NAN;
  for (int m = order; m <= order + 1; m++)
    if (c[m * stride] != 0) least = smaller(least, root(fabs(c[m * stride]) / allowed, m - first));
  return least;
}

#endif
