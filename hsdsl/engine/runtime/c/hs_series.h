/* Sums in coefficient k > 0 of a series, from its own earlier coefficients and those of its operands.

   See hsdsl/engine/backends/taylor.py, whose functions these are: the same sums in the same order. */

#ifndef HS_SERIES_H
#define HS_SERIES_H

#include "hs.h"
#include "hs_math.h"

#define HS_INTEGER_POWERS 64
#if defined(__GNUC__)
#define HS_CALLED __attribute__((noinline, unused)) /* as fast as copies, which take long to compile */
#else
#define HS_CALLED inline
#endif

#if defined(HS_COLUMNS)
typedef hs_real hs_pair __attribute__((vector_size(2 * sizeof(hs_real))));
#endif

static const hs_number hs_inverse[HS_MOST_ORDER + 2] = {
  0.0, 1.0 / 1, 1.0 / 2, 1.0 / 3, 1.0 / 4, 1.0 / 5, 1.0 / 6, 1.0 / 7, 1.0 / 8, 1.0 / 9, 1.0 / 10, 1.0 / 11, 1.0
  / 12, 1.0 / 13, 1.0 / 14, 1.0 / 15, 1.0 / 16, 1.0 / 17, 1.0 / 18, 1.0 / 19, 1.0 / 20, 1.0 / 21, 1.0 / 22, 1.0
  / 23, 1.0 / 24, 1.0 / 25, 1.0 / 26, 1.0 / 27, 1.0 / 28, 1.0 / 29, 1.0 / 30, 1.0 / 31};

static inline hs_real hs_pairs(int k, const hs_real *a, const hs_real *b, int first) {
  hs_real low = HS_ALL(0.0), high = k % 2 ? HS_ALL(0.0) : a[k / 2] * b[k / 2];
  for (int j = (k - 1) / 2; j >= first; j--) {
    low = low + a[j] * b[k - j];
    high = high + a[k - j] * b[j];
  }
  return low + high;
}

static HS_CALLED hs_real hs_product(int k, const hs_real *a, const hs_real *b) { return hs_pairs(k, a, b, 0); }

static HS_CALLED hs_real hs_behind(int k, const hs_real *a, const hs_real *b) {
  return hs_pairs(k, a, b, 1) + a[k] * b[0];
}

static inline hs_real hs_few(int k, const hs_real *a, const hs_real *b, int last) {
  hs_real total = a[last] * b[k - last];
  for (int j = last - 1; j > 0; j--) total = total + a[j] * b[k - j];
  return total;
}

static HS_CALLED hs_real hs_symmetric(int k, const hs_real *a, int first) {
  hs_real total = HS_ALL(0.0);
  for (int j = (k - 1) / 2; j >= first; j--) total = total + a[j] * a[k - j];
  total = 2 * total;
  return k % 2 ? total : total + a[k / 2] * a[k / 2];
}

static HS_CALLED hs_real hs_square(int k, const hs_real *a) { return hs_symmetric(k, a, 0); }

#if !defined(HS_WIDTH)
static inline hs_real hs_below(hs_real s, hs_real bound, hs_real a, hs_real b) { return s < bound ? a : b; }
#endif

static HS_CALLED hs_real hs_root(int k, const hs_real *z, hs_real a, int *bad) {
  return hs_div(a - hs_symmetric(k, z, 1), 2 * z[0], bad);
}

/* In place, from the last coefficient down: each asks for those before it only. */
static HS_CALLED hs_real hs_repeated(int k, const hs_real *a, int c) {
  hs_real z[HS_MOST_ORDER + 1] = {HS_ALL(1.0)};
  for (int n = 0; n < c; n++) {
    for (int i = k; i > 0; i--) z[i] = hs_product(i, a, z);
    z[0] = z[0] * a[0];
  }
  return z[k];
}

static HS_CALLED hs_real hs_power(int k, const hs_real *z, const hs_real *a, hs_real c, int *bad) {
#if defined(HS_WIDTH)
  *bad |= hs_any(a[0] == 0);
#else
  if (a[0] == 0) {
    *bad |= !hs_finite(c);
    if (c == trunc(c) && 0 <= c && c <= HS_INTEGER_POWERS) return hs_repeated(k, a, (int)c);
  }
#endif
  hs_real total = c * a[k] * k * z[0];
  for (int j = k - 1; j > 0; j--) total = total + (c * j - (k - j)) * a[j] * z[k - j];
  return hs_div(total, k * a[0], bad);
}

/* Begin the lines of time and of n states at (t, x). */
static inline void hs_begin_series(int n, int length, hs_real t, const hs_real *x, hs_real *lines) {
  lines[0] = t;
  lines[1] = HS_ALL(1.0);
  for (int k = 2; k < length; k++) lines[k] = HS_ALL(0.0);
  for (int i = 0; i < n; i++) lines[(i + 1) * length] = x[i];
}

#endif
