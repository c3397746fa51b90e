/* Coefficient k > 0 of a series from its own earlier coefficients and those of its operands.

   See hsdsl/backends/recurrences.py, whose functions these are: the same sums in the same order. */

#ifndef HS_SERIES_H
#define HS_SERIES_H

#include "hs.h"
#include "hs_math.h"

#define HS_INTEGER_POWERS 64

static inline double hs_convolution(int k, const double *a, const double *b, int first, int last) {
  const int half = k / 2 < last ? k / 2 : last, middle = half > first ? half : first;
  double low = a[middle] * b[k - middle];
  for (int j = middle - 1; j >= first; j--) low = low + a[j] * b[k - j];
  if (last == middle) return low;
  double high = a[middle + 1] * b[k - middle - 1];
  for (int j = middle + 2; j <= last; j++) high = high + a[j] * b[k - j];
  return low + high;
}

static inline double hs_product(int k, const double *a, const double *b, int last) {
  return hs_convolution(k, a, b, 0, last);
}

static inline double hs_symmetric(int k, const double *a, int first) {
  double total = 0.0;
  for (int j = (k - 1) / 2; j >= first; j--) total = total + a[j] * a[k - j];
  total = 2 * total;
  return k % 2 ? total : total + a[k / 2] * a[k / 2];
}

static inline double hs_square(int k, const double *a) { return hs_symmetric(k, a, 0); }

/* b[0] is not zero, or there were no coefficient 0 */
static inline double hs_quotient(int k, const double *z, double a, const double *b, int last) {
  return (a - hs_convolution(k, b, z, 1, last)) / b[0];
}

static inline double hs_root(int k, const double *z, double a, int *bad) {
  return hs_div(a - hs_symmetric(k, z, 1), 2 * z[0], bad);
}

/* In place, from the last coefficient down: each asks for those before it only. */
static inline double hs_repeated(int k, const double *a, int c) {
  double z[HS_MOST_ORDER + 1] = {1.0};
  for (int n = 0; n < c; n++) {
    for (int i = k; i > 0; i--) z[i] = hs_product(i, a, z, i);
    z[0] = z[0] * a[0];
  }
  return z[k];
}

static inline double hs_power(int k, const double *z, const double *a, double c, int last, int *bad) {
  if (a[0] == 0) {
    *bad |= !hs_finite(c);
    if (c == trunc(c) && 0 <= c && c <= HS_INTEGER_POWERS) return hs_repeated(k, a, (int)c);
  }
  double total = c * a[k] * k * z[0];
  for (int j = k - 1 < last ? k - 1 : last; j > 0; j--) total = total + (c * j - (k - j)) * a[j] * z[k - j];
  return hs_div(total, k * a[0], bad);
}

static inline double hs_integral(int k, const double *u, const double *g, int last) {
  const int half = k / 2 < last ? k / 2 : last, middle = half > 1 ? half : 1;
  double low = middle * u[middle] * g[k - middle];
  for (int j = middle - 1; j > 0; j--) low = low + j * u[j] * g[k - j];
  if (last == middle) return low / k;
  double high = (middle + 1) * u[middle + 1] * g[k - middle - 1];
  for (int j = middle + 2; j <= last; j++) high = high + j * u[j] * g[k - j];
  return (low + high) / k;
}

#endif
