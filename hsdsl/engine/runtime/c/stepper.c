/* One step by whichever method the run has: a table, Taylor series or Radau IIA. Other files
   tell tables and series apart, at most. Sums of a Butcher tableau go left to right, as in the functions that
   hsdsl/engine/integrators/stepper.py writes out. */

HS_INLINE hs_real weighted_row(const hs_row *row, hs_real *const *k, int state) {
  if (!row->terms) return 0.0;
  hs_real total = row->weight[0] * k[row->stage[0]][state];
  for (int i = 1; i < row->terms; i++) total += row->weight[i] * k[row->stage[i]][state];
  return total;
}

/* Evaluate stage i of a step from (t, run->x); not 0 where the flow has no value. */
HS_INLINE int evaluate(hs_run *run, int n, int i, hs_time t, hs_real h) {
  const hs_method *method = run->method;
  for (int s = 0; s < n; s++) run->at[s] = run->x[s] + h * weighted_row(&method->a[i], run->step.k, s);
  return run->here.table->flow(run->here.p, t + method->c[i] * h, run->at, run->step.k[i]);
}

/* One step from (t, run->x) to run->z; not 0 where the flow has no value. */
HS_INLINE int table_step(hs_run *run, int n, hs_time t, hs_real h) {
  for (int i = 1; i < run->method->stages; i++)
    if (evaluate(run, n, i, t, h)) return 1;
  for (int s = 0; s < n; s++) run->z[s] = run->x[s] + h * weighted_row(&run->method->b, run->step.k, s);
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
      piece->c[m * run->width + s] = h * weighted_row(&method->dense[m], run->step.k, s);
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
    run->step.error[s] = h * weighted_row(&method->error, run->step.k, s);
    if (method->coarse.terms)
      run->step.error[s] = sharpened(run->step.error[s], h * weighted_row(&method->coarse, run->step.k, s));
  }
}

/* One step from (t, run->x) to run->z; NO_VALUE or NO_CONVERGENCE where the method has none. */
HS_INLINE int step(hs_run *run, int n, hs_time t, hs_real h) {
  switch (run->method->kind) {
    case HS_TAYLOR: return taylor_step(run, t, h);
    case HS_RADAU: return implicit_step(run, t, h);
    default: return table_step(run, n, t, h);
  }
}

/* A part of the step just made, from (t, run->x) to run->z: by Radau IIA it is solved to round-off. */
HS_INLINE int part_of_step(hs_run *run, int n, hs_time t, hs_real h) {
  return run->method->kind == HS_RADAU ? implicit_landing(run, t, h) : step(run, n, t, h);
}

/* The method's own interpolant of the step from (t, run->x) to run->z; not 0 where the flow has no value. */
static int method_piece(hs_run *run, hs_time t, hs_real h, hs_polynomial *piece) {
  switch (run->method->kind) {
    case HS_TAYLOR: return taylor_piece(run, run->here.dimension, h, piece), 0;
    case HS_RADAU: return implicit_piece(run, piece), 0;
    default: return table_piece(run, t, h, piece);
  }
}

/* The estimate of the local error, to run->step.error; the flow at the step's end is run->end. */
HS_APART static void local_error(hs_run *run, hs_real h) {
  switch (run->method->kind) {
    case HS_TAYLOR: taylor_error(run, run->here.dimension, h); break;
    case HS_RADAU: break; /* the step has made it there */
    default: table_error(run, h);
  }
}

/* The scales of the states that errors of the step just made are measured by. */
static const hs_real *error_scales(const hs_run *run) {
  return run->method->kind == HS_RADAU ? run->step.radau.scales : run->sizes.scales;
}

/* The same with a look at what the flow is computed from; 0 where it has no value. See hsdsl/engine/simulate/control.py. */
static const hs_real *closer_scales(hs_run *run, hs_real h) {
  hs_resolved *const by = &run->step.radau.resolved;
  const hs_mode_state *const here = &run->here;
  if (run->method->kind == HS_RADAU) {
    look_closer(run, blocks_of(here->table), &run->step.radau, here->t, h, run->x, run->sizes.scales);
    return run->step.radau.scales;
  }
  return resolve(run, by, here->dimension, here->t, h, run->x, run->sizes.scales, 0) ? 0 : by->found;
}

static int is_implicit(const hs_method *method) { return method->kind == HS_RADAU; }

/* Give the arrays of the method their places. */
static void lay_out_method(hs_run *run, hs_store *store) {
  if (run->method->kind == HS_TAYLOR)
    run->step.lines = numbers(store, (int64_t)run->model->lines * series_length(run->method));
  if (run->method->kind == HS_RADAU)
    lay_out_radau(&run->step.radau, run->width, run->model->factors, run->model->varied, store);
}

/* Forget what a method knows of the place it was at: the mode or the segment of the inputs is another one. */
static void forget_steps(hs_run *run) {
  run->step.expanded = 0;
  if (run->method->kind == HS_RADAU) begin_stretch(&run->step.radau, blocks_of(run->here.table));
}

/* Error ratio of a step of length h to run->z, errors compared with these scales. */
HS_INLINE hs_real ratio_with(hs_run *run, hs_real h, const hs_real *scales) {
  return ratio_to(&run->control, h, run->step.error, run->z, scales, run->sizes.scales, run->here.dimension);
}

/* The same with a look at what the flow is computed from; see hsdsl/engine/simulate/control.py. */
static hs_real ratio_closer(hs_run *run, hs_real h, hs_real ratio) {
  hs_control *const control = &run->control;
  const int again = run->here.t == control->failed_at;
  control->failed_at = run->here.t;
  if (!control->closer && !again) return ratio;
  const hs_real *const scales = closer_scales(run, h);
  if (!scales) return ratio;
  ratio = ratio_with(run, h, scales);
  control->closer = ratio <= 1;
  return ratio;
}

/* Error ratio of a step of length h from run->x to run->z; at most 1 is acceptable. */
HS_INLINE hs_real error_ratio(hs_run *run, hs_real h) {
  const hs_real ratio = ratio_with(run, h, error_scales(run));
  return !(ratio > 1) ? ratio : ratio_closer(run, h, ratio);
}

/* Cut a step to what the surfaces of the mode allow. */
static hs_real within_reach(const hs_run *run, hs_real h) {
  const hs_real reach = run->reach.step[run->here.mode];
  return reach > 0 ? hs_min(h, reach) : h;
}

/* Learn that surfaces vary too fast for a step. */
static void too_fast(hs_run *run, hs_real tried) { run->reach.step[run->here.mode] = tried / 2; }

/* Learn that they do not for another one. */
static void slow_enough(hs_run *run, hs_real taken) {
  hs_real *const reach = &run->reach.step[run->here.mode];
  if (*reach > 0 && taken >= *reach) *reach = 2 * taken;
}
