/* Inner loops that are tuned by hand: see hsdsl/engine/scheme/primitives.py, which gives the same bits. */

#ifndef HS_PRIMITIVES_H
#define HS_PRIMITIVES_H

#include "functions.h"

/* C(n, 0) to C(n, n) for n up to `most`. */
static void fill_binomials(hs_number *row, int most) {
  for (int n = 0; n <= most; n++, row += n)
    for (int k = 0; k <= n; k++) row[k] = k == 0 || k == n ? 1.0 : (row - n)[k - 1] + (row - n)[k];
}

/* Each number has the one before added to it n times, of which the first more stay each time. Two such passes are made
   in one. */
HS_INLINE void add_up(hs_real *b, int n) {
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

HS_INLINE void fill_bernstein(const hs_number *binomials, const hs_real *c, int n, hs_real *b) {
  const hs_number *choose = binomials + n * (n + 1) / 2;
  HS_SIMD for (int k = 0; k <= n; k++) b[k] = c[k] / choose[k];
  add_up(b, n);
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

#if !defined(HS_WIDTH) /* of one run */
/* Four sums at a time need not wait for each other. */
HS_INLINE hs_real sum_of(const hs_real *v, int n) {
  hs_real a = 0.0, b = 0.0, c = 0.0, d = 0.0;
  int i = 0;
  for (; i + 3 < n; i += 4) a += v[i], b += v[i + 1], c += v[i + 2], d += v[i + 3];
  for (; i < n; i++) a += v[i];
  return (a + b) + (c + d);
}

HS_INLINE int flow_at(hs_run *run, hs_time t, const hs_real *x, hs_real *f) {
  return run->here.table->flow(run->here.p, t, x, f) ? RAISED : 0;
}

HS_INLINE int has_terms(const hs_run *run) { return run->here.table->terms != 0; }

/* The routine wants states and sizes as one vector. */
static int terms_at(hs_run *run, hs_time t, const hs_real *x, const hs_real *sizes, hs_real *terms) {
  const int n = run->here.dimension;
  copy(run->sizes.both, x, n);
  copy(run->sizes.both + n, sizes, n);
  return run->here.table->terms(run->here.p, t, run->sizes.both, terms) ? RAISED : 0;
}

static int derivatives_at(hs_run *run, hs_time t, const hs_real *x, hs_real *rows) {
  return hs_call(&run->here.table->jacobian.values, run->here.p, t, x, rows) ? RAISED : 0;
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

#endif
