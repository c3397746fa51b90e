/* A guard that the flow reaches and has no value beyond, as that of an empty tank. See hsdsl/simulate/touching.py. */

#define TURNINGS 60

/* Whether a crossing's state is on surface k, within the error of a step, and the flow has no value beyond. */
static int ends_at(hs_run *run, int k, const hs_crossing *crossing) {
  const hs_here *here = &run->here;
  const int n = here->dimension;
  double r, off = 0.0, norm = 0.0;
  const double time = crossing->time, *const q = crossing->state, *const g = run->gradient + 1;
  if (here->table->gradients[k](here->p, time, q, run->gradient)) return RAISED;
  for (int i = 0; i < n; i++) off = off + fabs(g[i]) * (run->control.tolerance * hs_max(run->scales[i], fabs(q[i])));
  for (int i = 0; i < n; i++) norm = norm + g[i] * g[i];
  if (!(norm > 0)) return 0;
  if (surface(run, k, time, q, &r)) return RAISED;
  if (r < -off) return 0;
  for (int i = 0; i < n; i++) run->at[i] = q[i] + 2 * off / norm * g[i];
  return here->table->flow(here->p, time, run->at, run->source) || !hs_finite(sum(run->source, n));
}

/* Whether surface k rises at the start of the step and falls at its end, both by its polynomial. */
HS_INLINE int turns_back(const hs_run *run, int k) {
  const double *const c = coefficients_of(&run->curves, 0, k);
  if (!(c[1] > 0) || run->curves.parts > 1 || !(run->control.tolerance > 0)) return 0;
  return slope_of(c, *degree_of(&run->curves, 0, k), 1.0) < 0;
}

/* Find where in the step surface k is reached so and its condition holds: 1, 0 or RAISED. */
static int touched(hs_run *run, int k, hs_crossing *crossing) {
  const double *const c = coefficients_of(&run->curves, 0, k);
  const int n = *degree_of(&run->curves, 0, k);
  double rate, low = 0.0, high = 1.0;
  if (!turns_back(run, k)) return 0;
  if (run->here.table->rates[k](run->here.p, run->span.t1, run->z, &rate)) return RAISED;
  if (!(rate > 0)) return 0;
  for (int i = 0; i < TURNINGS; i++) {
    const double middle = (low + high) / 2;
    if (slope_of(c, n, middle) > 0)
      low = middle;
    else
      high = middle;
  }
  crossing->time = run->span.t + low * run->span.h;
  at(run, &run->span.piece, low, crossing->state);
  const int ends = ends_at(run, k, crossing);
  if (ends != 1) return ends;
  crossing->theta = low;
  crossing->edge = k;
  crossing->depth = 0.0;
  return k >= run->here.table->edges ? 1 : condition(run, k, crossing->time, crossing->state);
}
