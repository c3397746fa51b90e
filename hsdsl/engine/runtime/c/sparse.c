/* Systems of linear equations with few entries: LU in a pattern known before. See hsdsl/engine/integrators/linear.py.
   Rows and columns are numbered in the order of elimination; `row`, `c`, `d`, `a`, `b` are scratch of n numbers. */

#include "functions.h"

/* Factor the entries `a` in place, inverse pivots on the diagonal; not 0 where a pivot is zero. */
static int sparse_factored(int n, const hs_elimination *of, hs_real *restrict a, hs_real *restrict row) {
  for (int i = 0; i < n; i++) {
    for (int at = of->start[i]; at < of->start[i + 1]; at++) row[of->column[at]] = a[at];
    for (int at = of->start[i]; at < of->diagonal[i]; at++) {
      const int k = of->column[at];
      const hs_real share = row[k] = row[k] * a[of->diagonal[k]];
      for (int above = of->diagonal[k] + 1; above < of->start[k + 1]; above++)
        row[of->column[above]] = row[of->column[above]] - share * a[above];
    }
    for (int at = of->start[i]; at < of->start[i + 1]; at++) a[at] = row[of->column[at]];
    if (!(fabs(row[i]) > 0)) return 1;
    a[of->diagonal[i]] = 1 / row[i];
  }
  return 0;
}

/* Solve for a right-hand side, to `found`. */
static void sparse_solve(int n, const hs_elimination *of, const hs_real *restrict values, const hs_real *restrict right,
                         hs_real *restrict y, hs_real *restrict found) {
  for (int i = 0; i < n; i++) {
    hs_real left = right[of->order[i]];
    for (int at = of->start[i]; at < of->diagonal[i]; at++) left = left - values[at] * y[of->column[at]];
    y[i] = left;
  }
  for (int i = n - 1; i >= 0; i--) {
    hs_real left = y[i];
    for (int at = of->diagonal[i] + 1; at < of->start[i + 1]; at++) left = left - values[at] * y[of->column[at]];
    y[i] = left * values[of->diagonal[i]];
    found[of->order[i]] = y[i];
  }
}

/* The same of a complex matrix, real and imaginary parts apart. */
static int sparse_factored_complex(int n, const hs_elimination *of, hs_real *restrict re, hs_real *restrict im,
                                   hs_real *restrict c, hs_real *restrict d) {
  for (int i = 0; i < n; i++) {
    for (int at = of->start[i]; at < of->start[i + 1]; at++) c[of->column[at]] = re[at], d[of->column[at]] = im[at];
    for (int at = of->start[i]; at < of->diagonal[i]; at++) {
      const int k = of->column[at];
      const hs_real p = c[k], q = d[k], u = re[of->diagonal[k]], v = im[of->diagonal[k]];
      const hs_real r = c[k] = u * p - v * q, s = d[k] = u * q + v * p;
      for (int above = of->diagonal[k] + 1; above < of->start[k + 1]; above++) {
        const int j = of->column[above];
        c[j] = c[j] - (r * re[above] - s * im[above]);
        d[j] = d[j] - (r * im[above] + s * re[above]);
      }
    }
    for (int at = of->start[i]; at < of->start[i + 1]; at++) re[at] = c[of->column[at]], im[at] = d[of->column[at]];
    const hs_real size = c[i] * c[i] + d[i] * d[i];
    if (!(size > 0)) return 1;
    re[of->diagonal[i]] = c[i] / size, im[of->diagonal[i]] = -d[i] / size;
  }
  return 0;
}

static void sparse_solve_complex(int n, const hs_elimination *of, const hs_real *restrict re, const hs_real *restrict im,
                                 const hs_real *const right[2], hs_real *restrict a, hs_real *restrict b,
                                 hs_real *restrict one, hs_real *restrict two) {
  for (int i = 0; i < n; i++) {
    hs_real u = right[0][of->order[i]], v = right[1][of->order[i]];
    for (int at = of->start[i]; at < of->diagonal[i]; at++) {
      const hs_real c = re[at], d = im[at], p = a[of->column[at]], q = b[of->column[at]];
      u = u - (c * p - d * q);
      v = v - (c * q + d * p);
    }
    a[i] = u, b[i] = v;
  }
  for (int i = n - 1; i >= 0; i--) {
    hs_real u = a[i], v = b[i];
    for (int at = of->diagonal[i] + 1; at < of->start[i + 1]; at++) {
      const hs_real c = re[at], d = im[at], p = a[of->column[at]], q = b[of->column[at]];
      u = u - (c * p - d * q);
      v = v - (c * q + d * p);
    }
    const hs_real c = re[of->diagonal[i]], d = im[of->diagonal[i]];
    a[i] = one[of->order[i]] = c * u - d * v;
    b[i] = two[of->order[i]] = c * v + d * u;
  }
}
