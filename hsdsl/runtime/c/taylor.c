/* Steps by Taylor series of any order. See hsdsl/integrators/taylor.py. */

/* Room for the coefficients of one line. */
static int series_length(const hs_method *method) { return method->order + 2; }

/* Coefficients of state s. */
static const double *series_of(const hs_run *run, int s) { return run->lines + (s + 1) * series_length(run->method); }

/* Whether the coefficients are those along the flow through (t, run->x). */
static int is_expanded(const hs_run *run, double t) {
  if (!run->expanded || run->lines[0] != t) return 0;
  for (int s = 0; s < run->here.dimension; s++)
    if (series_of(run, s)[0] != run->x[s]) return 0;
  return 1;
}

/* Have the coefficients along the flow through (t, run->x); trials from one point share them. Not 0 where it has none. */
static int expand(hs_run *run, double t) {
  if (is_expanded(run, t)) return 0;
  run->expanded = !run->here.table->series(run->here.p, run->method->order, t, run->x, run->lines);
  return !run->expanded;
}

static int taylor_step(hs_run *run, double t, double h) {
  if (expand(run, t)) return 1;
  for (int s = 0; s < run->here.dimension; s++) {
    const double *c = series_of(run, s);
    double z = c[run->method->order];
    for (int m = run->method->order - 1; m > 0; m--) z = c[m] + h * z;
    run->z[s] = run->x[s] + h * z;
  }
  return 0;
}

static void taylor_piece(const hs_run *run, double h, hs_polynomial *piece) {
  double power = 1.0;
  piece->degree = run->method->order;
  for (int m = 1; m <= run->method->order; m++) {
    power = power * h;
    for (int s = 0; s < run->here.dimension; s++) piece->c[(m - 1) * run->width + s] = series_of(run, s)[m] * power;
  }
}

/* How badly the polynomial solves the equation at its end: h (X' - f) / (order + 1). */
static void taylor_error(hs_run *run, double h) {
  const int order = run->method->order;
  for (int s = 0; s < run->here.dimension; s++) {
    const double *c = series_of(run, s);
    double slope = order * c[order];
    for (int m = order - 1; m > 0; m--) slope = m * c[m] + h * slope;
    run->error[s] = h * (slope - run->end[s]) / (order + 1);
  }
}
