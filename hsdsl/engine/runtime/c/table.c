/* Steps by a Butcher tableau: sums go left to right, as in the functions hsdsl/engine/integrators/stepper.py writes out. */

#include "functions.h"

HS_INLINE hs_real weighted(const hs_row *row, hs_real *const *k, int state) {
  if (!row->terms) return 0.0;
  hs_real total = row->weight[0] * k[row->stage[0]][state];
  for (int i = 1; i < row->terms; i++) total += row->weight[i] * k[row->stage[i]][state];
  return total;
}

/* Evaluate stage i of a step from (t, run->x); not 0 where the flow has no value. */
HS_INLINE int evaluate(hs_run *run, int n, int i, hs_time t, hs_real h) {
  const hs_method *method = run->method;
  for (int s = 0; s < n; s++) run->at[s] = run->x[s] + h * weighted(&method->a[i], run->k, s);
  return run->here.table->flow(run->here.p, t + method->c[i] * h, run->at, run->k[i]);
}

/* One step from (t, run->x) to run->z; not 0 where the flow has no value. */
HS_INLINE int table_step(hs_run *run, int n, hs_time t, hs_real h) {
  for (int i = 1; i < run->method->stages; i++)
    if (evaluate(run, n, i, t, h)) return 1;
  for (int s = 0; s < n; s++) run->z[s] = run->x[s] + h * weighted(&run->method->b, run->k, s);
  return 0;
}

/* Cubic Hermite interpolant of a step from its ends and the flow there. */
static void hermite(const hs_run *run, hs_real h, hs_polynomial *piece) {
  const int w = run->width;
  piece->degree = 3;
  for (int s = 0; s < run->here.dimension; s++) {
    const hs_real a = run->x[s], b = run->z[s], f = run->slope[s], g = run->end[s];
    piece->c[s] = h * f;
    piece->c[w + s] = 3 * (b - a) - h * (2 * f + g);
    piece->c[2 * w + s] = h * (f + g) - 2 * (b - a);
  }
}

static void secant(const hs_run *run, hs_polynomial *piece) {
  piece->degree = 1;
  for (int s = 0; s < run->here.dimension; s++) piece->c[s] = run->z[s] - run->x[s];
}

/* The method's own interpolant of the step from (t, run->x) to run->z; not 0 where the flow has no value. */
static int table_piece(hs_run *run, hs_time t, hs_real h, hs_polynomial *piece) {
  const hs_method *method = run->method;
  if (method->interpolant == HS_HERMITE) return hermite(run, h, piece), 0;
  if (method->interpolant == HS_SECANT) return secant(run, piece), 0;
  for (int i = 0; i < method->extra; i++)
    if (evaluate(run, run->here.dimension, method->stages + 1 + i, t, h)) return 1;
  piece->degree = method->degree;
  for (int m = 0; m < method->degree; m++)
    for (int s = 0; s < run->here.dimension; s++)
      piece->c[m * run->width + s] = h * weighted(&method->dense[m], run->k, s);
  return 0;
}

/* One error estimate of two: e**2 / sqrt(e**2 + c**2 / 100). */
static hs_real sharpened(hs_real fine, hs_real coarse) {
  const hs_real square = fine * fine, total = square + coarse * coarse / 100;
  return total > 0 ? square / sqrt(total) : square;
}

static void table_error(hs_run *run, hs_real h) {
  const hs_method *method = run->method;
  for (int s = 0; s < run->here.dimension; s++) {
    run->error[s] = h * weighted(&method->error, run->k, s);
    if (method->coarse.terms) run->error[s] = sharpened(run->error[s], h * weighted(&method->coarse, run->k, s));
  }
}
