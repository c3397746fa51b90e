/* A guard that the flow reaches and has no value beyond, as that of an empty tank. See hsdsl/engine/simulate/touching.py. */

#include "functions.h"

#define TURNINGS 60

/* Whether a crossing's state is on surface k, within the error of a step, and the flow has no value beyond. */
static int ends_at(hs_run *run, int k, const hs_crossing *crossing) {
  const hs_mode_state *here = &run->here;
  const int n = here->dimension;
  hs_real r, off = 0.0, norm = 0.0;
  const hs_time time = crossing->time;
  const hs_real *const q = crossing->state, *const g = run->gradient + 1;
  if (gradient_of(run, k, time, q)) return RAISED;
  for (int i = 0; i < n; i++) off = off + fabs(g[i]) * (run->control.tolerance * hs_max(run->scales[i], fabs(q[i])));
  for (int i = 0; i < n; i++) norm = norm + g[i] * g[i];
  if (!(norm > 0)) return 0;
  if (surface(run, k, time, q, &r)) return RAISED;
  if (r < -off) return 0;
  for (int i = 0; i < n; i++) run->at[i] = q[i] + 2 * off / norm * g[i];
  return here->table->flow(here->p, time, run->at, run->source) || !hs_finite(sum(run->source, n));
}

/* Whether surface k rises from the start of the step, and is followed by one polynomial. */
HS_INLINE int may_be_touched(const hs_run *run, int k) {
  return coefficients_of(&run->curves, 0, k)[1] > 0 && run->curves.parts == 1 && run->control.tolerance > 0;
}

/* Where in [0, 1] a polynomial turns that rises at 0 and falls at 1. */
static hs_real turning(const hs_real *c, int n) {
  hs_real low = 0.0, high = 1.0;
  for (int i = 0; i < TURNINGS; i++) {
    const hs_real middle = (low + high) / 2;
    if (slope_of(c, n, middle) > 0)
      low = middle;
    else
      high = middle;
  }
  return low;
}

/* Find where in the step surface k is reached so and its condition holds: 1, 0 or RAISED. */
static int touched(hs_run *run, int k, hs_crossing *crossing) {
  const hs_span *span = &run->span;
  const hs_real *const c = coefficients_of(&run->curves, 0, k);
  const int n = *degree_of(&run->curves, 0, k);
  hs_real rate, share = 1.0;
  if (!may_be_touched(run, k)) return 0;
  const hs_real slope = slope_at_end(c, n);
  if (slope > ROUNDOFF_UNITS * HS_UNIT * c[1]) return 0;
  if (run->here.table->rates[k](run->here.p, span->t1, run->z, &rate)) return RAISED;
  crossing->time = span->t1;
  copy(crossing->state, run->z, run->here.dimension);
  if (rate > 0) {
    if (!(slope < 0)) return 0;
    share = turning(c, n);
    crossing->time = span->t + share * span->h;
    at(run, &span->piece, share, crossing->state);
  } else {
    if (!run->weighed && magnitudes_at(run, span->t, run->x, run->begun)) return RAISED;
    run->weighed = 1;
    if (!(fabs(run->ends[k]) <= bound_from(run, run->begun, k, span->t, run->x, 0))) return 0;
  }
  const int ends = ends_at(run, k, crossing);
  if (ends != 1) return ends;
  crossing->theta = share;
  crossing->edge = k;
  crossing->depth = 0.0;
  return k >= run->here.table->edges ? 1 : condition(run, k, crossing->time, crossing->state);
}
