/* Steps by Taylor series of any order. See hsdsl/engine/integrators/taylor.py. */

/* Room for the coefficients of one line. */
static int series_length(const hs_method *method) { return method->order + 2; }

/* Coefficients of state s. */
static const hs_real *series_of(const hs_run *run, int s) { return run->step.lines + (s + 1) * series_length(run->method); }

/* Whether the coefficients are those along the flow through (t, run->x). */
static int is_expanded(const hs_run *run, hs_time t) {
  if (!run->step.expanded || run->step.lines[0] != (hs_real)t) return 0;
  for (int s = 0; s < run->here.dimension; s++)
    if (series_of(run, s)[0] != run->x[s]) return 0;
  return 1;
}

/* Compute the coefficients along the flow through (t, run->x), shared by trials from there. Not 0 where it has none. */
static int expand(hs_run *run, hs_time t) {
  if (is_expanded(run, t)) return 0;
  run->step.expanded = !run->here.table->series(run->here.p, run->method->order, t, run->x, run->step.lines);
  return !run->step.expanded;
}

static int taylor_step(hs_run *run, hs_time t, hs_real h) {
  if (expand(run, t)) return 1;
  for (int s = 0; s < run->here.dimension; s++) {
    const hs_real *c = series_of(run, s);
    hs_real z = c[run->method->order];
    for (int m = run->method->order - 1; m > 0; m--) z = c[m] + h * z;
    run->z[s] = run->x[s] + h * z;
  }
  return 0;
}

HS_INLINE void taylor_piece(const hs_run *run, const int n, hs_real h, hs_polynomial *piece) {
  const int order = run->method->order, w = run->width;
  piece->degree = order;
  for (int s = 0; s < n; s++) {
    const hs_real *const line = series_of(run, s);
    hs_real *c = piece->c + s, power = 1.0;
    for (int m = 1; m <= order; m++, c += w) {
      power = power * h;
      *c = line[m] * power;
    }
  }
}

HS_INLINE void taylor_error(hs_run *run, const int n, hs_real h) {
  const int order = run->method->order;
  hs_real powers[HS_MOST_ORDER + 1];
  fill_powers(powers, order, h);
  for (int s = 0; s < n; s++) {
    const hs_real *c = series_of(run, s);
    hs_real moved = order * (c[order] * powers[order]);
    for (int m = order - 1; m > 0; m--) moved = m * (c[m] * powers[m]) + moved;
    run->step.error[s] = moved;
  }
  left_of(run->step.error, run->end, n, order, h);
}
