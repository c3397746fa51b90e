/* Steps of the located scheme, as long as their error allows, each with the polynomials of its surfaces.
   See hsdsl/engine/simulate/located_steps.py. */

#define BLUR 2

/* Let steps go to the other stages, and to `end` (of a step from run->x), for a shorter step. */
static void aside(hs_run *run, hs_real **end) {
  hs_real **const kept = run->step.k;
  run->step.k = run->step.other_k;
  run->step.other_k = kept;
  swap(&run->end, &run->step.other_end);
  swap(&run->z, end);
  run->step.k[0] = run->slope;
  run->step.k[run->method->stages] = run->end;
}

/* Time and state at the share s of the step: of a table those of a step that ends there. */
static int span_point(hs_run *run, hs_real s, hs_time *time, hs_real **state) {
  const hs_span *span = &run->span;
  const int n = run->here.dimension;
  *time = s == 1 ? span->t1 : span->t + s * span->h;
  if (s == 1) return copy(*state, run->z, n), 0;
  if (!(s > 0)) return copy(*state, run->x, n), 0;
  if (run->method->kind == HS_TAYLOR) return at(run, &span->piece, s, *state), 0;
  aside(run, state);
  const int status = part_of_step(run, n, span->t, s * span->h);
  aside(run, state);
  return status ? RAISED : 0;
}

/* The same, of Taylor's method the states that surfaces depend on. */
static int span_place(hs_run *run, hs_real s, hs_time *time, hs_real **state) {
  if (run->method->kind != HS_TAYLOR || s == 1 || !(s > 0)) return span_point(run, s, time, state);
  *time = run->span.t + s * run->span.h;
  return part_at(run, &run->span.piece, s, 0, run->here.table->own, *state), 0;
}

/* The other states where span_place() was. */
static void span_rest(hs_run *run, hs_real s, hs_real *state) {
  if (run->method->kind != HS_TAYLOR || s == 1 || !(s > 0)) return;
  part_at(run, &run->span.piece, s, run->here.table->own, run->here.dimension, state);
}

/* The interpolant of the states up to the share s of the step, over [0, 1]. */
static void span_cut(hs_run *run, hs_real s, hs_polynomial *piece) {
  int status = 1;
  if (run->method->kind != HS_TAYLOR) {
    aside(run, &run->q);
    const hs_time t = run->span.t;
    const hs_real h = s * run->span.h;
    status = part_of_step(run, run->here.dimension, t, h) ||
             run->here.table->flow(run->here.p, t + h, run->z, run->end) || method_piece(run, t, h, piece);
    aside(run, &run->q);
  }
  if (status) shortened(run, &run->span.piece, s, piece);
}

/* The sums of the absolute terms that the state at the share s of a step is computed from. */
HS_INLINE hs_real span_size(const hs_run *run, const hs_span *span, hs_real s, int state) {
  if (span->sized) return span->largest[state];
  if (run->method->kind == HS_TABLE)
    return fabs(span->x[state]) + s * span->h * run->method->gain * span->largest[state];
  const int w = run->width, last = span->piece.degree - 1;
  hs_real v = fabs(span->piece.c[last * w + state]) * s;
  for (int m = last - 1; m >= 0; m--) v = (fabs(span->piece.c[m * w + state]) + v) * s;
  return fabs(span->x[state]) + v;
}

static void begin_span(hs_run *run, hs_real h, hs_time t1) {
  hs_span *const span = &run->span;
  span->t = run->here.t;
  span->h = h;
  span->t1 = t1;
  span->sized = 0;
  run->surfaces.weighed = run->surfaces.has_ends = 0;
  copy(span->x, run->x, run->here.dimension);
}

/* Let no rise count that is lower than what the step's error moves a surface by. */
static int blur(hs_run *run, int n, hs_time t1) {
  const hs_curves *curves = &run->curves;
  for (int s = 0; s < n; s++) run->at[s] = run->z[s] + BLUR * run->step.error[s];
  if (run->here.table->values(run->here.p, t1, run->at, run->surfaces.middle)) return RAISED;
  for (int part = 0; part < curves->parts; part++)
    for (int k = 0; k < curves->count; k++) {
      hs_real *const off = off_of(curves, part, k);
      *off = *off + fabs(run->surfaces.middle[k] - run->surfaces.ends[k]);
    }
  return 0;
}

HS_INLINE int is_finite_piece(const hs_run *run, int n, const hs_polynomial *piece) {
  if (n == run->width) return all_finite(piece->c, piece->degree * n);
  for (int m = 0; m < piece->degree; m++)
    if (!all_finite(piece->c + m * run->width, n)) return 0;
  return 1;
}

/* Try a step of a table or of an implicit method, or say what is in its way; `TableSteps._try`. */
HS_INLINE hs_step_failure try_table(hs_run *run, const int n, hs_real h, hs_time t1) {
  hs_span *const span = &run->span;
  const hs_mode *mode = run->here.table;
  const hs_real *p = run->here.p;
  begin_span(run, h, t1);
  const int status = step(run, n, span->t, h);
  if (status == NO_CONVERGENCE) return HS_UNSOLVED;
  if (status || mode->flow(p, t1, run->z, run->end)) return HS_NOT_FINITE;
  if (!hs_finite(sum_of(run->z, n) + sum_of(run->end, n))) return HS_NOT_FINITE;
  if (run->control.tolerance > 0) {
    if (run->method->kind == HS_TABLE) table_error(run, h);
    run->step.ratio = error_ratio(run, h);
    if (!(run->step.ratio <= 1)) return HS_ERROR;
  }
  for (int s = 0; s < n; s++) {
    span->largest[s] = fabs(run->step.k[0][s]);
    for (int i = 1; i < run->method->stages; i++) span->largest[s] = hs_max(span->largest[s], fabs(run->step.k[i][s]));
  }
  if (method_piece(run, span->t, h, &span->piece)) return HS_NOT_FINITE;
  if (!is_finite_piece(run, n, &span->piece)) return HS_NOT_FINITE; /* it may overflow where its end does not */
  if (curves_along(run)) return HS_NOT_FINITE;
  if (ends_of(run)) return HS_NOT_FINITE;
  const int blurred = run->control.implicit && run->control.tolerance > 0;
  return blurred && blur(run, n, t1) ? HS_NOT_FINITE : HS_CLEAR;
}

/* Make one step of a table or of an implicit method: rejected by the error estimate, halved where something has no
   value. */
HS_INLINE hs_step_failure next_table(hs_run *run, const int n, hs_time limit) {
  hs_control *const control = &run->control;
  const hs_time t = run->here.t;
  int halvings = 0;
  if (!run->step.sloped && run->here.table->flow(run->here.p, t, run->x, run->slope)) return HS_NOT_FINITE;
  if (!run->step.sloped) begin_steps(control, run->sizes.scales, run->slope, n);
  run->step.sloped = 1;
  hs_real h = within_reach(run, control->h);
  hs_time t1;
  for (;;) {
    t1 = end_of_step(t, &h, limit);
    run->reach.refused = 0;
    const hs_step_failure tried = t1 > t ? try_table(run, n, h, t1) : HS_ERROR;
    if (tried == HS_CLEAR) {
      if (control->tolerance > 0 && across_jump(run, n, t1)) return HS_JUMP;
      if (control->tolerance > 0 && halvings == 0) accept(control, h, run->step.ratio);
      slow_enough(run, h);
      return count_creeping(&run->pace, halvings) ? HS_CREEPING : HS_CLEAR;
    }
    if (halvings == 0 && (tried == HS_ERROR || (tried == HS_UNSOLVED && control->tolerance > 0))) {
      reject(control, h, run->step.ratio, tried != HS_UNSOLVED);
      h = within_reach(run, control->h);
    } else {
      if (run->reach.refused) too_fast(run, h);
      h = h / 2, halvings++;
    }
    if (halvings > MOST_HALVINGS || !(t + h > t) || struggles(control)) return tried;
  }
}

/* The step at which the first terms that are left out stay below the tolerance; not-a-number where all vanish.
   See hsdsl/engine/integrators/taylor.py. */
static hs_real proposed_step(const hs_run *run, int n, hs_real tolerance) {
  hs_real least = step_of_terms(run->step.lines, run->sizes.scales, n, run->method->order, tolerance);
  for (int s = 0; s < n; s++)
    if (!(tolerance * run->sizes.scales[s] > HS_NOTHING))
      least = smaller(least, from_zero(series_of(run, s), 1, run->method->order, tolerance));
  return least;
}

static hs_real longest(const hs_run *run, int n) {
  const hs_control *control = &run->control;
  if (!(control->tolerance > 0)) return control->h;
  const hs_real proposed = proposed_step(run, n, hs_max(control->tolerance, HS_UNIT));
  return proposed != proposed ? control->largest : hs_min(control->largest, proposed);
}

static int noise_at_end(hs_run *run, int k, hs_real *allowed) {
  hs_real noise;
  if (bound_at(run, k, AT_END, &noise)) return RAISED;
  *allowed = 4 * noise;
  return 0;
}

/* Whether the polynomial c gives surface k to round-off in the middle of the step, by its interpolant. */
static int meets_middle(hs_run *run, const hs_real *c, int n, int k, hs_real noise, int *answer) {
  if (!run->surfaces.has_middle && surfaces_along(run, 0.5, run->surfaces.middle)) return RAISED;
  run->surfaces.has_middle = 1;
  *answer = fabs(value_of(c, n, 0.5) - run->surfaces.middle[k]) <= noise;
  return 0;
}

/* Whether the series of surface k has run out by its last terms, and gives the surface at the end of the step.
   One of a surface that is linear in the states need not run out: it is known by giving the surface to round-off. */
static int converges(hs_run *run, const hs_real *c, int n, int k, int *answer) {
  const hs_real given = run->control.tolerance, end = run->surfaces.ends[k];
  const hs_real tolerance = given > 0 ? hs_max(given, HS_UNIT) : hs_max(UNKNOWN_TOLERANCE, HS_UNIT);
  hs_real most = fabs(c[0]);
  for (int i = 1; i <= n; i++) most = hs_max(most, fabs(c[i]));
  *answer = fabs(c[n]) <= LAST_TERM * tolerance * most && fabs(c[n - 1]) <= TERM_BEFORE * tolerance * most;
  const hs_real off = fabs(value_at_end(c, n) - end);
  hs_real noise;
  if (*answer) return settles(run, off, tolerance * most, noise_at_end, k, answer);
  if (noise_at_end(run, k, &noise)) return RAISED;
  return off <= noise ? meets_middle(run, c, n, k, noise, answer) : 0;
}

/* The surfaces' series where they meet the surfaces at the step's end, interpolation for all where one does not. */
static int series_curves(hs_run *run) {
  const hs_mode *mode = run->here.table;
  const int order = run->method->order, length = series_length(run->method);
  hs_curves *const found = &run->curves;
  const hs_real h = run->span.h, *p = run->here.p;
  int known;
  if (starts_of(run)) return RAISED;
  if (!mode->surfaces) return 0;
  known = !mode->surface_series(p, order, run->step.lines);
  run->surfaces.has_middle = 0;
  begin_curves(found, mode->surfaces);
  for (int k = 0; k < mode->surfaces; k++) {
    hs_real *const c = coefficients_of(found, 0, k), power = 1.0;
    if (!known || mode->surface_line[k] < 0) return curves_along(run);
    const hs_real *line = run->step.lines + mode->surface_line[k] * length;
    for (int m = 0; m <= order; m++) {
      c[m] = line[m] * power;
      power = power * h;
    }
    int met;
    if (converges(run, c, order, k, &met)) return RAISED;
    if (!met) return curves_along(run);
    c[0] = run->surfaces.starts[k];
    *degree_of(found, 0, k) = degree_without_zeros(c, order);
    *off_of(found, 0, k) = 0;
    found->certain[k] = 1;
  }
  return 0;
}

/* Whether a step of Taylor's method does not solve the equation at its end. */
HS_INLINE int is_too_wrong(hs_run *run, hs_real h) {
  return error_ratio(run, h) > hs_max(1, 64 * HS_UNIT / run->control.tolerance);
}

/* Try a step of Taylor's method, or say what is in its way; `SeriesSteps._try`. */
HS_INLINE hs_step_failure try_series(hs_run *run, const int n, hs_real h, hs_time t1) {
  const hs_mode *mode = run->here.table;
  const hs_real *p = run->here.p;
  begin_span(run, h, t1);
  hs_real powers[HS_MOST_ORDER + 1];
  fill_powers(powers, run->method->order, h);
  run->span.piece.degree = run->method->order;
  taylor_span(run->step.lines, run->x, n, run->width, run->method->order, powers, run->span.piece.c, run->z,
              run->step.error);
  if (mode->flow(p, t1, run->z, run->end)) return HS_NOT_FINITE;
  if (!hs_finite(sum_of(run->z, n) + sum_of(run->end, n))) return HS_NOT_FINITE;
  if (run->control.tolerance > 0) {
    left_of(run->step.error, run->end, n, run->method->order, h);
    if (is_too_wrong(run, h)) return HS_ERROR;
  }
  return ends_of(run) || series_curves(run) ? HS_NOT_FINITE : HS_CLEAR;
}

/* Make one step of Taylor's method of a length that is halved where its end does not solve the equation. */
HS_INLINE hs_step_failure halved_series(hs_run *run, const int n, hs_time limit, hs_real h, int halvings) {
  const hs_time t = run->here.t;
  for (int i = halvings; i < MOST_HALVINGS; i++) {
    const hs_time t1 = end_of_step(t, &h, limit);
    if (!(t1 > t)) break;
    run->reach.refused = 0;
    if (try_series(run, n, h, t1) == HS_CLEAR) return slow_enough(run, h), HS_CLEAR;
    if (run->reach.refused) too_fast(run, h);
    h = h / 2;
  }
  return HS_NOT_FINITE;
}

static int expands(hs_run *run) {
  return !run->here.table->series(run->here.p, run->method->order, run->here.t, run->x, run->step.lines);
}

/* Make one step of Taylor's method, as long as the terms left out allow. */
HS_INLINE hs_step_failure next_series(hs_run *run, const int n, hs_time limit) {
  if (!expands(run)) return HS_NOT_FINITE;
  return halved_series(run, n, limit, within_reach(run, longest(run, n)), 0);
}

/* Make one step that the error allows, not beyond `limit`; or return what is in the way. */
HS_INLINE hs_step_failure next_span(hs_run *run, const int n, hs_time limit) {
  return run->method->kind == HS_TAYLOR ? next_series(run, n, limit) : next_table(run, n, limit);
}
