/* Systems of linear equations: dense LU with partial pivoting. See hsdsl/engine/integrators/linear.py. */

#include "functions.h"

static void exchange_rows(hs_real *a, int n, int i, int k) {
  if (i == k) return;
  for (int j = 0; j < n; j++) {
    const hs_real kept = a[i * n + j];
    a[i * n + j] = a[k * n + j];
    a[k * n + j] = kept;
  }
}

static void exchange_places(int *order, int i, int k) {
  const int kept = order[i];
  order[i] = order[k];
  order[k] = kept;
}

/* Whether a is larger than b, each relative to the scale of the unknown of its row; without one only than zero. */
HS_INLINE int is_larger(hs_real a, hs_real of_a, hs_real b, hs_real of_b) {
  return of_a > 0 && of_b > 0 ? a * of_b > b * of_a : b == 0 && a > 0;
}

/* Factor the matrix a of n rows in place, inverse pivots on its diagonal; not 0 where it has no inverse. `scales` are
   those of the unknowns; only rows of one of the `groups` exchange places, where these are not 0. */
HS_INLINE int factored(int n, hs_real *restrict a, int *restrict order, const hs_real *scales, const int *groups) {
  for (int i = 0; i < n; i++) order[i] = i;
  for (int k = 0; k < n; k++) {
    int pivot = k;
    for (int i = k + 1; i < n; i++)
      if (!(groups && groups[i] != groups[k]) &&
          is_larger(fabs(a[i * n + k]), scales[order[i]], fabs(a[pivot * n + k]), scales[order[pivot]]))
        pivot = i;
    exchange_rows(a, n, k, pivot);
    exchange_places(order, k, pivot);
    if (!(fabs(a[k * n + k]) > 0)) return 1;
    a[k * n + k] = 1 / a[k * n + k];
    for (int i = k + 1; i < n; i++) {
      if (a[i * n + k] == 0) continue;
      const hs_real share = a[i * n + k] = a[i * n + k] * a[k * n + k];
      for (int j = k + 1; j < n; j++) a[i * n + j] = a[i * n + j] - share * a[k * n + j];
    }
  }
  return 0;
}

/* Solve for a right-hand side, to `found`. */
HS_INLINE void solve(int n, const hs_real *restrict a, const int *restrict order, const hs_real *restrict right,
                     hs_real *restrict found) {
  for (int i = 0; i < n; i++) found[i] = right[order[i]];
  for (int i = 0; i < n; i++)
    for (int j = 0; j < i; j++) found[i] = found[i] - a[i * n + j] * found[j];
  for (int i = n - 1; i >= 0; i--) {
    for (int j = i + 1; j < n; j++) found[i] = found[i] - a[i * n + j] * found[j];
    found[i] = found[i] * a[i * n + i];
  }
}

/* The same of a complex matrix, real and imaginary parts apart; the size of a pivot is the sum of its parts' sizes. */
HS_INLINE int factored_complex(int n, hs_real *restrict re, hs_real *restrict im, int *restrict order,
                               const hs_real *scales, const int *groups) {
  for (int i = 0; i < n; i++) order[i] = i;
  for (int k = 0; k < n; k++) {
    int pivot = k;
    for (int i = k + 1; i < n; i++)
      if (!(groups && groups[i] != groups[k]) &&
          is_larger(fabs(re[i * n + k]) + fabs(im[i * n + k]), scales[order[i]],
                        fabs(re[pivot * n + k]) + fabs(im[pivot * n + k]), scales[order[pivot]]))
        pivot = i;
    exchange_rows(re, n, k, pivot);
    exchange_rows(im, n, k, pivot);
    exchange_places(order, k, pivot);
    const hs_real size = re[k * n + k] * re[k * n + k] + im[k * n + k] * im[k * n + k];
    if (!(size > 0)) return 1;
    const hs_real c = re[k * n + k] = re[k * n + k] / size, d = im[k * n + k] = -im[k * n + k] / size;
    for (int i = k + 1; i < n; i++) {
      const hs_real a = re[i * n + k], b = im[i * n + k];
      if (a == 0 && b == 0) continue;
      const hs_real p = re[i * n + k] = c * a - d * b, q = im[i * n + k] = c * b + d * a;
      for (int j = k + 1; j < n; j++) {
        const hs_real u = re[k * n + j], v = im[k * n + j];
        re[i * n + j] = re[i * n + j] - (p * u - q * v);
        im[i * n + j] = im[i * n + j] - (p * v + q * u);
      }
    }
  }
  return 0;
}

/* Take the products of row i with what is known off its right-hand side a + i b. */
HS_INLINE void take_off(int n, const hs_real *re, const hs_real *im, hs_real *a, hs_real *b, int i, int first,
                        int end) {
  for (int j = first; j < end; j++) {
    const hs_real c = re[i * n + j], d = im[i * n + j];
    a[i] = a[i] - (c * a[j] - d * b[j]);
    b[i] = b[i] - (c * b[j] + d * a[j]);
  }
}

HS_INLINE void solve_complex(int n, const hs_real *restrict re, const hs_real *restrict im, const int *restrict order,
                             const hs_real *const right[2], hs_real *restrict a, hs_real *restrict b) {
  for (int i = 0; i < n; i++) a[i] = right[0][order[i]], b[i] = right[1][order[i]];
  for (int i = 0; i < n; i++) take_off(n, re, im, a, b, i, 0, i);
  for (int i = n - 1; i >= 0; i--) {
    take_off(n, re, im, a, b, i, i + 1, n);
    const hs_real c = re[i * n + i], d = im[i * n + i], p = a[i], q = b[i];
    a[i] = c * p - d * q;
    b[i] = c * q + d * p;
  }
}
