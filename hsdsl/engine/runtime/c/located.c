/* The located scheme: Burden et al. 2013, Fig. 8. Its steps, the first crossing of a step, transitions there.
   See hsdsl/engine/simulate/located.py. */

#define BLUR 2

/* Let steps go to the other stages, and to `end` (of a step from run->x), for a shorter step. */
static void aside(hs_run *run, hs_real **end) {
  hs_real **const kept = run->k;
  run->k = run->other_k;
  run->other_k = kept;
  swap(&run->end, &run->other_end);
  swap(&run->z, end);
  run->k[0] = run->slope;
  run->k[run->method->stages] = run->end;
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
  run->weighed = 0;
  copy(span->x, run->x, run->here.dimension);
}

/* Let no rise count that is lower than what the step's error moves a surface by. */
static int blur(hs_run *run, int n, hs_time t1) {
  const hs_curves *curves = &run->curves;
  for (int s = 0; s < n; s++) run->at[s] = run->z[s] + BLUR * run->error[s];
  if (run->here.table->values(run->here.p, t1, run->at, run->middle)) return RAISED;
  for (int part = 0; part < curves->parts; part++)
    for (int k = 0; k < curves->count; k++) {
      hs_real *const off = off_of(curves, part, k);
      *off = *off + fabs(run->middle[k] - run->ends[k]);
    }
  return 0;
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
    local_error(run, h);
    run->ratio = error_ratio(run, h);
    if (!(run->ratio <= 1)) return HS_ERROR;
  }
  for (int s = 0; s < n; s++) {
    span->largest[s] = fabs(run->k[0][s]);
    for (int i = 1; i < run->method->stages; i++) span->largest[s] = hs_max(span->largest[s], fabs(run->k[i][s]));
  }
  if (method_piece(run, span->t, h, &span->piece)) return HS_NOT_FINITE;
  for (int m = 0; m < span->piece.degree; m++) /* it may overflow where its end does not */
    if (!all_finite(span->piece.c + m * run->width, n)) return HS_NOT_FINITE;
  if (curves_along(run)) return HS_NOT_FINITE;
  if (mode->values(p, t1, run->z, run->ends)) return HS_NOT_FINITE;
  const int blurred = run->control.implicit && run->control.tolerance > 0;
  return blurred && blur(run, n, t1) ? HS_NOT_FINITE : HS_CLEAR;
}

/* Make one step of a table or of an implicit method: rejected by the error estimate, halved where something has no value. */
HS_INLINE hs_step_failure next_table(hs_run *run, const int n, hs_time limit) {
  hs_control *const control = &run->control;
  const hs_time t = run->here.t;
  int halvings = 0;
  if (!run->sloped && run->here.table->flow(run->here.p, t, run->x, run->slope)) return HS_NOT_FINITE;
  if (!run->sloped) begin_steps(control, run->scales, run->slope, n);
  run->sloped = 1;
  hs_real h = within_reach(run, control->h);
  hs_time t1;
  for (;;) {
    t1 = end_of_step(t, &h, limit);
    run->refused = 0;
    const hs_step_failure tried = t1 > t ? try_table(run, n, h, t1) : HS_ERROR;
    if (tried == HS_CLEAR) {
      if (control->tolerance > 0 && across_jump(run, n, t1)) return HS_JUMP;
      if (control->tolerance > 0 && halvings == 0) accept(control, h, run->ratio);
      slow_enough(run, h);
      return count_creeping(&run->pace, halvings) ? HS_CREEPING : HS_CLEAR;
    }
    if (halvings == 0 && (tried == HS_ERROR || (tried == HS_UNSOLVED && control->tolerance > 0))) {
      reject(control, h, run->ratio, tried != HS_UNSOLVED);
      h = within_reach(run, control->h);
    } else {
      if (run->refused) too_fast(run, h);
      h = h / 2, halvings++;
    }
    if (halvings > MOST_HALVINGS || !(t + h > t) || struggles(control)) return tried;
  }
}

/* The step at which the first terms that are left out stay below the tolerance; not-a-number where all vanish.
   See hsdsl/engine/integrators/taylor.py. */
static hs_real proposed_step(const hs_run *run, int n, hs_real tolerance) {
  hs_real least = step_of_terms(run->lines, run->scales, n, run->method->order, tolerance);
  for (int s = 0; s < n; s++)
    if (!(tolerance * run->scales[s] > HS_NOTHING)) least = smaller(least, from_zero(series_of(run, s), 1, run->method->order, tolerance));
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
  if (!run->has_middle && surfaces_along(run, 0.5, run->middle)) return RAISED;
  run->has_middle = 1;
  *answer = fabs(value_of(c, n, 0.5) - run->middle[k]) <= noise;
  return 0;
}

/* Whether the series of surface k has run out by its last terms, and gives the surface at the end of the step.
   One of a surface that is linear in the states need not run out: it is known by giving the surface to round-off. */
static int converges(hs_run *run, const hs_real *c, int n, int k, int *answer) {
  const hs_real given = run->control.tolerance, end = run->ends[k];
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
  if (mode->values(p, run->span.t, run->x, run->values)) return RAISED;
  if (!mode->surfaces) return 0;
  copy(run->starts, run->values, mode->surfaces);
  known = !mode->surface_series(p, order, run->lines);
  run->has_middle = 0;
  begin_curves(found, mode->surfaces);
  for (int k = 0; k < mode->surfaces; k++) {
    hs_real *const c = coefficients_of(found, 0, k), power = 1.0;
    if (!known || mode->surface_line[k] < 0) return curves_along(run);
    const hs_real *line = run->lines + mode->surface_line[k] * length;
    for (int m = 0; m <= order; m++) {
      c[m] = line[m] * power;
      power = power * h;
    }
    int met;
    if (converges(run, c, order, k, &met)) return RAISED;
    if (!met) return curves_along(run);
    c[0] = run->starts[k];
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
  taylor_span(run->lines, run->x, n, run->width, run->method->order, powers, run->span.piece.c, run->z, run->error);
  if (mode->flow(p, t1, run->z, run->end)) return HS_NOT_FINITE;
  if (!hs_finite(sum_of(run->z, n) + sum_of(run->end, n))) return HS_NOT_FINITE;
  if (run->control.tolerance > 0) {
    left_of(run->error, run->end, n, run->method->order, h);
    if (is_too_wrong(run, h)) return HS_ERROR;
  }
  return mode->values(p, t1, run->z, run->ends) || series_curves(run) ? HS_NOT_FINITE : HS_CLEAR;
}

/* Make one step of Taylor's method of a length that is halved where its end does not solve the equation. */
HS_INLINE hs_step_failure halved_series(hs_run *run, const int n, hs_time limit, hs_real h, int halvings) {
  const hs_time t = run->here.t;
  for (int i = halvings; i < MOST_HALVINGS; i++) {
    const hs_time t1 = end_of_step(t, &h, limit);
    if (!(t1 > t)) break;
    run->refused = 0;
    if (try_series(run, n, h, t1) == HS_CLEAR) return slow_enough(run, h), HS_CLEAR;
    if (run->refused) too_fast(run, h);
    h = h / 2;
  }
  return HS_NOT_FINITE;
}

static int expands(hs_run *run) {
  return !run->here.table->series(run->here.p, run->method->order, run->here.t, run->x, run->lines);
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
  return here->table->flow(here->p, time, run->at, run->source) || !hs_finite(sum_of(run->source, n));
}

/* Whether surface k rises from the start of the step, and is followed by one polynomial. */
HS_INLINE int may_be_reached(const hs_run *run, int k) {
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
static int reaches(hs_run *run, int k, hs_crossing *crossing) {
  const hs_span *span = &run->span;
  const hs_real *const c = coefficients_of(&run->curves, 0, k);
  const int n = *degree_of(&run->curves, 0, k);
  hs_real rate, noise, share = 1.0;
  if (!may_be_reached(run, k)) return 0;
  const hs_real slope = slope_of(c, n, 1.0);
  if (slope > ROUNDOFF_UNITS * HS_UNIT * c[1]) return 0;
  if (hs_call(&run->here.table->rates[k], run->here.p, span->t1, run->z, &rate)) return RAISED;
  crossing->time = span->t1;
  copy(crossing->state, run->z, run->here.dimension);
  if (rate > 0) {
    if (!(slope < 0)) return 0;
    share = turning(c, n);
    crossing->time = span->t + share * span->h;
    at(run, &span->piece, share, crossing->state);
  } else {
    if (bound_at(run, k, AT_START, &noise)) return RAISED;
    if (!(fabs(run->ends[k]) <= noise)) return 0;
  }
  const int ends = ends_at(run, k, crossing);
  if (ends != 1) return ends;
  crossing->theta = share;
  crossing->edge = k;
  crossing->depth = 0.0;
  return k >= run->here.table->edges ? 1 : condition(run, k, crossing->time, crossing->state);
}

#define MOST_CORRECTIONS 8

/* Whether the polynomials of surface k say that it is not crossed. */
static int is_passed_by(hs_run *run, int k) {
  const hs_curves *curves = &run->curves;
  run->roots.of = 0;
  if (run->active_surfaces[k]) coefficients_of(curves, 0, k)[0] = coefficients_of(curves, 0, k)[0] * 0; /* deflated */
  if (!(run->ends[k] <= 0)) return 0;
  for (int i = 0; i < curves->parts; i++)
    if (!stays_below(&run->roots, coefficients_of(curves, i, k), *degree_of(curves, i, k), *off_of(curves, i, k))) return 0;
  return 1;
}

/* Surface k at the share s of the step; the state there is run->q. */
static int residual_of(hs_run *run, const hs_polynomial *piece, int k, hs_real s, hs_real *r) {
  hs_time time;
  (void)piece;
  return span_place(run, s, &time, &run->q) || surface(run, k, time, run->q, r) ? RAISED : 0;
}

/* Close in on a rise near s where Newton's method fails (a root of higher order), if one is bracketed there. */
static int bracketed(hs_run *run, int k, hs_real *s) {
  hs_real width = 8 * HS_UNIT * hs_max(*s, HS_UNIT), below, above;
  while (width < 1) {
    const hs_real low = hs_max(*s * 0, *s - width), high = hs_min(1.0, *s + width);
    if (residual_of(run, 0, k, low, &below) || residual_of(run, 0, k, high, &above)) return RAISED;
    if (below < 0 && above == 0) return *s = high, 0;
    if (below <= 0 && 0 < above)
      return close_bracket(run, residual_of, 0, k, low, below, high, above, *s * 0, HS_UNIT * *s, s);
    width = width * 16;
  }
  return 0;
}

/* Correct a crossing on the surface itself to round-off: by Newton's method, else in a bracket. */
static int settled(hs_run *run, int k, const hs_rise *rise, hs_crossing *crossing) {
  hs_real s = rise->share, best = s, least = NAN, r, noise;
  for (int i = 0; i < MOST_CORRECTIONS; i++) {
    if (span_place(run, s, &crossing->time, &crossing->state) || surface(run, k, crossing->time, crossing->state, &r))
      return RAISED;
    if (i && !(fabs(r) < least)) break;
    least = fabs(r), best = s;
    crossing->theta = s;
    if (rise->slope == 0) return span_rest(run, s, crossing->state), 0;
    if (roundoff_bound(run, k, crossing->time, crossing->state, run->active_surfaces[k], &noise)) return RAISED;
    if (fabs(r) <= noise) return span_rest(run, s, crossing->state), 0;
    s = hs_min(1.0, hs_max(s * 0, s - r / rise->slope));
  }
  if (bracketed(run, k, &best)) return RAISED;
  crossing->theta = best;
  return span_point(run, best, &crossing->time, &crossing->state);
}

/* Find where surface k first rises along the step: run->waiting says so; 1 where it is reached without a rise, else 0.
   The Python twin is `rises_of`. */
static int first_rise(hs_run *run, int k, hs_crossing *crossing) {
  hs_riser *const waiting = &run->waiting[k];
  hs_real first, last;
  waiting->open = 0;
  if (is_passed_by(run, k)) return reaches(run, k, crossing);
  if (bound_at(run, k, AT_START, &first) || bound_at(run, k, AT_END, &last)) return RAISED;
  const int beyond = coefficients_of(&run->curves, 0, k)[0] > first;
  const hs_path path = {k, 0, {hs_max(first, last), beyond, run->ends[k] > last, 0.0}};
  waiting->path = path;
  waiting->open = next_rise(run, &waiting->path, &waiting->rise);
  return waiting->open ? 0 : reaches(run, k, crossing);
}

/* Find the first point of the step, from its first rise on, where surface k is crossed and its condition holds: 1, or 0. */
static int first_crossing(hs_run *run, int k, hs_crossing *crossing) {
  hs_riser *const waiting = &run->waiting[k];
  hs_rise *const rise = &waiting->rise;
  waiting->open = 0;
  do {
    if (settled(run, k, rise, crossing)) return RAISED;
    const int holds = k >= run->here.table->edges ? 1 : condition(run, k, crossing->time, crossing->state);
    if (holds == RAISED) return RAISED;
    if (!holds && !(run->active_surfaces[k] && holds_next(run, k, crossing->time, crossing->state))) continue;
    if (!rise->certain) note_unsettled(run, k, crossing->time);
    crossing->edge = k;
    crossing->depth = 0.0;
    return 1;
  } while (next_rise(run, &waiting->path, rise));
  return reaches(run, k, crossing);
}

/* Keep the crossing of surface k where one was `found` that counts, else mark that it has none; return the first one.
   The Python twin is `keep` in `crossings_along`. */
static const hs_crossing *kept_crossing(hs_run *run, const hs_crossing *first, int k, int found) {
  hs_crossing *const crossing = &run->crossings[k];
  if (!found || (k < run->here.table->edges && too_late(run, k, crossing->time, tie(crossing->time)))) {
    crossing->edge = -1;
    return first;
  }
  return !first || crossing->time < first->time ? crossing : first;
}

/* Mark in run->beyond the surfaces that rise behind the first crossing: there they are inside, beyond round-off and by
   more than they rise while crossings are tied. The Python twin is `is_behind`, of one surface. */
static int mark_behind(hs_run *run, const hs_crossing *first) {
  const hs_mode *mode = run->here.table;
  const hs_real since = tie(first->time);
  int known = 0; /* whether run->values and run->magnitudes are those at the crossing */
  for (int k = 0; k < mode->surfaces; k++) {
    const hs_riser *const waiting = &run->waiting[k];
    hs_real rate;
    run->beyond[k] = 0;
    if (!waiting->open || !waiting->rise.certain || !(waiting->rise.share > first->theta)) continue;
    if (!known && (mode->values(run->here.p, first->time, first->state, run->values) ||
                   magnitudes_at(run, first->time, first->state, run->magnitudes)))
      return RAISED;
    known = 1;
    if (hs_call(&mode->rates[k], run->here.p, first->time, first->state, &rate)) continue;
    const hs_real noise = bound_from(run, run->magnitudes, k, first->time, first->state, 0);
    run->beyond[k] = run->values[k] < -hs_max(noise, fabs(rate) * since);
  }
  return 0;
}

/* Find the first crossing of each surface of the step, to its place in run->crossings, with edge -1 where there is none.
   Surfaces that rise behind the first of all are not looked at any closer, but of an implicit method: to a point of its
   step it iterates from the one before. */
static int crossings_along(hs_run *run) {
  const hs_mode *mode = run->here.table;
  const hs_crossing *first = 0;
  int open = 0;
  for (int k = 0; k < mode->surfaces; k++) {
    int found = first_rise(run, k, &run->crossings[k]);
    if (run->waiting[k].open && run->control.implicit) found = first_crossing(run, k, &run->crossings[k]);
    if (found == RAISED) return RAISED;
    first = kept_crossing(run, first, k, found);
    open += run->waiting[k].open;
  }
  for (; open && !first; open--) {
    int next = -1;
    for (int k = 0; k < mode->surfaces; k++)
      if (run->waiting[k].open && (next < 0 || run->waiting[k].rise.share < run->waiting[next].rise.share)) next = k;
    const int found = first_crossing(run, next, &run->crossings[next]);
    if (found == RAISED) return RAISED;
    first = kept_crossing(run, first, next, found);
  }
  if (open && mark_behind(run, first)) return RAISED;
  for (int k = 0; open && k < mode->surfaces; k++) {
    if (!run->waiting[k].open) continue;
    open--;
    if (run->beyond[k]) continue;
    const int found = first_crossing(run, k, &run->crossings[k]);
    if (found == RAISED) return RAISED;
    first = kept_crossing(run, first, k, found);
  }
  return 0;
}

/* Whether a crossing's state is on a surface that the state was on that it came from, or one holds it: 1, 0 or RAISED. */
static int stands(hs_run *run, const hs_crossing *crossing) {
  int stood = run->here.p == run->held_p;
  for (int k = 0; run->here.active && k < run->here.table->surfaces && !stood; k++) {
    hs_real r, noise;
    if (!run->active_surfaces[k]) continue;
    if (surface(run, k, crossing->time, crossing->state, &r)) return RAISED;
    if (roundoff_bound(run, k, crossing->time, crossing->state, 0, &noise)) return RAISED;
    stood = k == crossing->edge || fabs(r) <= noise;
  }
  return stood;
}

/* The sizes of the numbers behind the chosen crossing's state, to run->landed: the terms of its step and of the one
   before. */
static int largest(hs_run *run) {
  const hs_crossing *crossing = &run->chosen;
  const int stood = stands(run, crossing);
  if (stood == RAISED) return RAISED;
  sizes(run, run->x, crossing->state, stood);
  for (int s = 0; s < run->here.table->own; s++) {
    hs_real *const found = &run->landed[s];
    *found = joined(*found, span_size(run, &run->span, crossing->theta, s));
    if (run->has_before) *found = joined(*found, span_size(run, &run->before, 1.0, s));
    if (run->here.p == run->held_p) *found = hs_max(*found, run->scales[s]); /* off guards that hold it by as much */
  }
  return 0;
}

/* Record the part of the step that leads to a crossing; `write` in Python. */
static void write_crossing(hs_run *run, const hs_crossing *crossing) {
  if (!(crossing->theta > 0)) return;
  if (run->method->degree > 0 && !run->bare) span_cut(run, crossing->theta, &run->cubic);
  append(run, crossing->time, crossing->state, &run->cubic);
}

/* A wall is reached before any guard: take the guards that it is reached together with, how many there are. */
static int guards_at(hs_run *run, const hs_crossing *wall) {
  const hs_time time = wall->time, theta = wall->theta, depth = wall->depth;
  int count = 0;
  copy(run->q, wall->state, run->here.dimension);
  untie(run);
  standing(run, time, run->q, tie(time));
  for (int k = 0; k < run->here.table->edges; k++) {
    if (!run->tied[k]) continue;
    hs_crossing *const crossing = &run->crossings[count++];
    crossing->edge = k;
    crossing->theta = theta, crossing->time = time, crossing->depth = depth;
    copy(crossing->state, run->q, run->here.dimension);
  }
  return count;
}

/* Crossings, with those before the first one, of `count`, that rise by less than the step's polynomials are off by: how
   many there are then, or RAISED. A surface may be beyond its guard so and be crossed again behind the first one. */
static int with_unseen(hs_run *run, int count) {
  const hs_mode *mode = run->here.table;
  const hs_span *span = &run->span;
  const hs_crossing *first = &run->crossings[0];
  const int seen = count;
  int known = 0; /* whether run->values are those at the first crossing */
  for (int i = 1; i < count; i++)
    if (run->crossings[i].time < first->time) first = &run->crossings[i];
  if (!(first->theta > 0)) return count;
  for (int k = 0; k < mode->edges; k++) {
    int place = count;
    for (int i = 0; i < seen; i++)
      if (run->crossings[i].edge == k) place = i;
    hs_crossing *const found = &run->crossings[place];
    if (releases(run, k) || (place < count && found->time - first->time <= tie(first->time))) continue;
    hs_real start, end, before, noise, s = 0.0;
    if (!known && mode->values(run->here.p, first->time, first->state, run->values)) return RAISED;
    known = !(run->values[k] > 0);
    if (known) continue;
    if (surface(run, k, span->t, run->x, &start) || surface(run, k, first->time, first->state, &end)) return RAISED;
    if (roundoff_bound(run, k, first->time, first->state, 0, &noise)) return RAISED;
    if (!(end > noise)) continue;
    if (roundoff_bound(run, k, span->t, run->x, 0, &before)) return RAISED;
    if (start > before) continue;
    const hs_real unit = HS_UNIT * first->theta;
    if (!(start > 0) && close_bracket(run, residual_of, 0, k, 0.0, start, first->theta, end, 0.0, unit, &s))
      return RAISED;
    const hs_time later = found->time;
    if (span_point(run, s, &found->time, &found->state)) return RAISED;
    const int holds = condition(run, k, found->time, found->state);
    if (holds == RAISED) return RAISED;
    if (!holds && !(run->active_surfaces[k] && holds_next(run, k, found->time, found->state))) {
      found->time = later; /* not tied with the first one: its state does not count */
      continue;
    }
    found->edge = k;
    found->theta = s, found->depth = 0.0;
    count += place == count;
  }
  return count;
}

/* Say what happens first along the step, of the crossings of its surfaces: a guard, a wall with no guard on it, or
   nothing (GOES_ON). */
static int first_event(hs_run *run) {
  const hs_mode *mode = run->here.table;
  int guards = 0, tied = 0;
  hs_crossing *wall = 0;
  for (int k = 0; k < mode->surfaces; k++) {
    hs_crossing *const crossing = &run->crossings[k];
    if (crossing->edge < 0) continue;
    if (k < mode->edges) {
      const hs_crossing other = run->crossings[guards];
      run->crossings[guards++] = *crossing;
      *crossing = other;
    } else if (!wall || crossing->time < wall->time)
      wall = crossing;
  }
  for (int i = 0; wall && i < guards; i++) tied |= run->crossings[i].time <= wall->time + tie(wall->time);
  if (wall && !tied && !(guards = guards_at(run, wall))) {
    write_crossing(run, wall);
    copy(run->x, wall->state, run->here.dimension);
    run->task->stop.surface = wall->edge - run->here.table->edges + run->model->mode[run->here.mode].edges;
    return stopped(run, HS_LEFT, wall->time);
  }
  if (!guards) return GOES_ON;
  if ((guards = with_unseen(run, guards)) == RAISED) return WITHOUT_VALUE;
  choose(run, guards);
  write_crossing(run, &run->chosen);
  return largest(run) ? WITHOUT_VALUE : LANDED;
}

/* No step is short enough: take a guard on which the state is, or stop with the reason; `stuck` in Python. */
static int located_stuck(hs_run *run, hs_step_failure kind) {
  const int count = kind == HS_NOT_FINITE || kind == HS_UNSOLVED ? standing_on(run) : 0;
  if (count) {
    choose(run, count);
    sizes(run, run->x, run->x, 0);
    return LANDED;
  }
  if (run->here.table->flow(run->here.p, run->here.t, run->x, run->task->stop.slope))
    return stopped(run, HS_HERE_NOT_FINITE, run->here.t);
  run->task->stop.failure = kind;
  run->task->stop.surface = -1;
  return stopped(run, HS_STUCK, run->here.t);
}

/* Go on at the end of the step. */
HS_INLINE void go_to_end(hs_run *run) {
  const hs_span before = run->before;
  run->before = run->span;
  run->span = before;
  run->has_before = 1;
  run->here.t = run->before.t1;
  swap(&run->x, &run->z);
  swap(&run->slope, &run->end);
  run->k[0] = run->slope;
  run->k[run->method->stages] = run->end;
}

/* Begin to step through a flow. */
static void begin_following(hs_run *run) {
  run->sloped = run->has_before = 0;
  run->ratio = 1;
  forget_steps(run);
  begin_pace(run);
}

/* Whether there is a step to make before `limit`: GOES_ON, or what ends the flow. */
HS_INLINE int before_step(hs_run *run, hs_time limit) {
  if (!(run->here.t < limit)) return AT_BOUNDARY;
  if (count_step(&run->pace, run->here.t)) return located_stuck(run, HS_SLOW);
  return interrupted(run) ? (int)stopped(run, HS_INTERRUPTED, run->here.t) : GOES_ON;
}

/* Go on at the end of a step on which nothing happens. */
HS_INLINE int pass(hs_run *run) {
  if (run->here.active) leave(run, run->span.t1, run->z);
  HS_MOVE(run, move_along(run, run->span.t1, run->z, run->span.h));
  append(run, run->span.t1, run->z, &run->span.piece);
  go_to_end(run);
  return GOES_ON;
}

/* Go on behind a step on which this happens first: GOES_ON, or what happens. */
static int behind_event(hs_run *run, int event) {
  if (event == GOES_ON) return pass(run);
  if (event != WITHOUT_VALUE) return event;
  copy(run->task->stop.slope, run->z, run->here.dimension);
  stopped(run, HS_STEP_NOT_FINITE, run->here.t);
  run->task->stop.h = run->span.t1;
  return HS_STEP_NOT_FINITE;
}

/* Go on behind a step that was made. */
static int behind_step(hs_run *run) {
  return behind_event(run, crossings_along(run) ? WITHOUT_VALUE : first_event(run));
}

HS_INLINE int behind(hs_run *run, hs_step_failure failure) {
  return failure == HS_CLEAR ? behind_step(run) : located_stuck(run, failure);
}

/* Make one step: GOES_ON, or what ends the flow. */
HS_INLINE int one_step(hs_run *run, const int n, hs_time limit) { return behind(run, next_span(run, n, limit)); }

/* Step until a surface is crossed, or to a time in the segment. */
static int follow_on(hs_run *run, hs_time limit) {
  const int n = run->here.dimension;
  int event;
  do {
    event = before_step(run, limit);
    if (event == GOES_ON) event = one_step(run, n, limit);
  } while (event == GOES_ON);
  return event;
}

static int follow(hs_run *run, hs_time limit) {
  begin_following(run);
  return follow_on(run, limit);
}

/* Forget the ends of contacts among what else might have been. */
static void drop_releases(hs_run *run) {
  int kept = 0;
  for (int i = 0; i < run->alternatives_count; i++)
    if (!releases(run, run->alternatives[i])) run->alternatives[kept++] = run->alternatives[i];
  run->alternatives_count = kept;
}

/* Go on in the mode itself from run->x, which a guard no longer holds; not on that of edge `at_once`, -1 for none,
   which to round-off neither holds the state nor lets go. */
static int released(hs_run *run, hs_time t, int at_once) {
  hs_mode_state *const here = &run->here;
  be_held_exactly(run, t, run->x, -1);
  if (at_once >= 0 && run->active_surfaces[at_once]) run->active_surfaces[at_once] = 0, here->active--;
  const int standing_before = here->active;
  copy(run->scale, run->landed, here->dimension);
  place(run, here->mode, here->dimension, t, 0);
  here->active = standing_before;
  return GOES_ON;
}

/* Note how far the chosen crossing's state is off those of the first surfaces that it stands on. */
static void stand(hs_run *run, const int *on, int surfaces) {
  const hs_mode_state *here = &run->here;
  if (here->table->values(here->p, run->chosen.time, run->chosen.state, run->values)) return;
  for (int k = 0; k < surfaces; k++) run->stood[k] = on[k] ? run->values[k] : 0.0;
}

/* Flow along guards until one lets go of the state. */
static int along_guards(hs_run *run, hs_time limit) {
  hs_mode_state *const here = &run->here;
  const hs_time from = here->t;
  for (;;) {
    const int outcome = follow(run, limit), end = run->chosen.edge;
    if (outcome == LANDED && releases(run, end)) {
      hs_time t = run->chosen.time;
      copy(run->x, run->chosen.state, here->dimension);
      int ends = in_touch(run, end);
      if (!ends) {
        ends = behind_end(run, end, &t);
        if (t > run->chosen.time) {
          secant(run, &run->cubic);
          append(run, t, run->z, &run->cubic);
        }
        swap(&run->x, &run->z);
      }
      leave(run, t, run->x);
      if (ends) return released(run, t, t == from && end < run->model->mode[here->mode].edges ? end : -1);
      here->t = t;
      continue;
    }
    if (outcome == LANDED) {
      drop_releases(run);
      be_held_exactly(run, run->chosen.time, run->chosen.state, end);
      stand(run, run->kept, here->table->edges);
    } else if (outcome == AT_BOUNDARY) {
      be_held_exactly(run, here->t, run->x, -1);
    } else {
      run->still = same_state(run->began, run->x, here->dimension);
      after_contact(run);
    }
    return outcome;
  }
}

/* Flow until a surface is crossed or to the segment's end; along guards that hold the state until one lets go. The
   Python twin is `flow`. */
static int located_flow(hs_run *run) {
  const hs_time limit = segment_end(run), from = run->here.t;
  const hs_mode *const own = run->here.table;
  const int n = run->here.dimension, held = contact_at(run);
  if (held != GOES_ON) return held;
  if (run->here.table == own) return run->parks ? PARKED : follow(run, limit);
  copy(run->began, run->x, n);
  for (int k = 0; k < own->edges; k++) run->held[k] = in_touch(run, k);
  const int outcome = along_guards(run, limit);
  for (int k = 0; k < own->edges; k++)
    if (run->held[k]) note(run, HS_IN_CONTACT, k, run->still, from, run->task->now);
  return outcome;
}

/* Whether as many transitions as cost no time have fallen within the relaxation of flow, and run to no limit.
   Those of one instant count only where the edge is one of theirs. Those of contacts that move the state run to one. */
static int crowded(hs_run *run, const hs_crossing *crossing) {
  hs_real flight, ratio;
  const hs_time t = crossing->time;
  const int k = crossing->edge;
  int again = 0;
  if (run->jump < FREE || contraction(run, &flight, &ratio) || flown(run, t) > run->epsilon) return 0;
  const hs_time since = t - made_before(run, FREE - 1)->time;
  for (int i = 0; i < FREE; i++) again |= made_before(run, i)->edge == k && made_before(run, i)->mode == run->here.mode;
  if (!again && since <= tie(t)) return 0;
  return !(of_contacts(run) && run->here.table->edge[k].contact >= 0 && !keeps(run, t, crossing->state, k));
}

/* Make a transition, at its own instant or behind a strip, and look whether it belongs to a Zeno tail. The Python
   twin is `make_transition`. */
static int jump(hs_run *run) {
  const hs_crossing *crossing = &run->chosen;
  const hs_time t = crossing->time, until = run->until;
  const int k = crossing->edge;
  const hs_edge *edge = &run->here.table->edge[k];
  const int mode = run->here.mode;
  hs_time resumed = t;
  if (limit_reached(run)) return stopped(run, HS_LIMIT, t);
  if (crossing->theta == 0 && run->here.active) stand(run, run->active_surfaces, run->here.table->surfaces);
  if (edge->target != mode)
    for (int j = 0; j < run->model->surfaces; j++) run->stood[j] = 0.0;
  HS_MOVE(run, move_crossing(run));
  const int waits = crowded(run, crossing), without_value = reset(run, run->landed);
  if (waits) {
    if (!run->noted_crowded) note(run, HS_CROWDED, k, 0, t, t);
    run->noted_crowded = 1;
    resumed = t + run->epsilon;
    if (resumed > until + tie(until)) {
      hs_time rows[2][2] = {{t, 0.0}, {until, until - t}};
      strip(run, 2, rows, crossing->state);
      record(run, crossing, NAN, without_value ? 0 : run->after, 0);
      return in_strip(run, HS_UNTIL_IN_STRIP, until);
    }
    resumed = earlier(resumed, until);
  }
  if (without_value) return in_strip(run, HS_RESET_NOT_FINITE, t);
  if (resumed > t) {
    hs_time rows[2][2] = {{t, 0.0}, {resumed, run->epsilon}};
    strip(run, 2, rows, crossing->state);
  }
  const hs_time last = run->jump ? made_before(run, 0)->resumed : NAN;
  const hs_real since = run->alternatives_count || t - last <= tie(t) ? tie(t) : 0.0;
  const int flowed = has_flowed(run, t);
  record(run, crossing, resumed, run->after, 0);
  copy(run->x, run->after, edge->target_dimension);
  copy(run->scale, run->both, edge->target_dimension);
  const int entered = enter(run, edge->target, edge->target_dimension, resumed, 1, since, 0, t);
  if (entered != GOES_ON) return entered;
  if (comes_back(run, flowed)) return slides(run, mode, k);
  if (run->here.mode != mode) return at_limit(run);
  int closed = close_tail(run, k);
  if (closed == GOES_ON) closed = at_limit(run);
  return closed == GOES_ON ? unresolved(run, k) : closed;
}

/* Go on behind a sample of an input, or end: a jump at the end is made, and a guard reached there fires. The
   Python twin is `at_boundary`. */
static int located_at_boundary(hs_run *run) {
  const hs_time t = run->here.t;
  if (t >= run->pause) return PAUSED;
  if (t < run->until || segment_follows(run)) return go_on(run);
  const hs_mode *const own = run->here.table;
  const int count = contact_at(run) == GOES_ON ? standing_on(run) : 0;
  if (count) {
    choose(run, count);
    sizes(run, run->x, run->x, 0);
  }
  if (run->here.table != own) after_contact(run);
  return count ? jump(run) : (int)stopped(run, HS_UNTIL, t);
}

/* Go on behind a flow that has ended. */
static int behind_flow(hs_run *run, int outcome) {
  if (outcome == LANDED)
    outcome = jump(run);
  else if (outcome == AT_BOUNDARY)
    outcome = located_at_boundary(run);
  return outcome == GOES_ON && pauses(run) ? PAUSED : outcome;
}

/* Follow the execution until it stops, pauses or, where it does so, parks before the steps of a flow. */
static int located(hs_run *run, int outcome) {
  while (outcome == GOES_ON) {
    if (interrupted(run)) return stopped(run, HS_INTERRUPTED, run->here.t);
    outcome = run->here.t < segment_end(run) ? located_flow(run) : AT_BOUNDARY;
    outcome = behind_flow(run, outcome);
  }
  return outcome;
}
