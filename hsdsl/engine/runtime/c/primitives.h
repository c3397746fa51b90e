/* Inner loops that are tuned by hand: see hsdsl/engine/scheme/primitives.py, which gives the same bits. */

#ifndef HS_PRIMITIVES_H
#define HS_PRIMITIVES_H

#include "functions.h"

/* C(n, 0) to C(n, n) for n up to `most`. */
static void fill_binomials(hs_real *row, int most) {
  for (int n = 0; n <= most; n++, row += n)
    for (int k = 0; k <= n; k++) row[k] = k == 0 || k == n ? 1.0 : (row - n)[k - 1] + (row - n)[k];
}

/* Each number has the one before added to it n times, of which the first more stay each time. Two such passes are made
   in one. */
HS_INLINE void fill_bernstein(const hs_real *binomials, const hs_real *c, int n, hs_real *b) {
  const hs_real *choose = binomials + n * (n + 1) / 2;
  HS_SIMD for (int k = 0; k <= n; k++) b[k] = c[k] / choose[k];
  for (int k = 1; k <= n; k += 2) {
    hs_real before = b[k], once = before + b[k - 1];
    b[k] = once;
    for (int i = k + 1; i <= n; i++) {
      const hs_real own = b[i], sum = own + before;
      b[i] = sum + once;
      before = own, once = sum;
    }
  }
}

HS_INLINE hs_real largest_of(const hs_real *b, int n) {
  hs_real most = b[0];
  for (int i = 1; i <= n; i++) most = hs_max(most, b[i]);
  return most;
}

HS_INLINE hs_real least_of(const hs_real *b, int n) {
  hs_real least = b[0];
  for (int i = 1; i <= n; i++) least = hs_min(least, b[i]);
  return least;
}

static int flow_between(hs_run *run, int k, hs_time t, const hs_real *x, hs_time t1, const hs_real *z, hs_real s,
                        hs_real *f) {
  const hs_mode_state *here = &run->here;
  for (int i = 0; i < here->dimension; i++) run->at[i] = x[i] + s * (z[i] - x[i]);
  if (here->table->flow(here->p, t + s * (t1 - t), run->at, run->source)) return RAISED;
  *f = run->source[k];
  return 0;
}

#endif
