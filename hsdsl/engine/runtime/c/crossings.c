/* Crossings of a located step: the first of each surface, isolated on the surface's polynomials, settled to round-off.
   See hsdsl/engine/simulate/crossings.py. */

#define TURNINGS 60
#define MOST_CORRECTIONS 8

/* Whether a crossing's state is on surface k, within the error of a step, and the flow has no value beyond. */
static int ends_at(hs_run *run, int k, const hs_crossing *crossing) {
  const hs_mode_state *here = &run->here;
  const int n = here->dimension;
  hs_real r, off = 0.0, norm = 0.0;
  const hs_time time = crossing->time;
  const hs_real *const q = crossing->state, *const g = run->gradient + 1;
  if (gradient_of(run, k, time, q)) return RAISED;
  for (int i = 0; i < n; i++) off = off + fabs(g[i]) * (run->control.tolerance * hs_max(run->sizes.scales[i], fabs(q[i])));
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

/* Find where in the step surface k, whose slope at the end is known, is reached so and its condition holds: 1, 0 or
   RAISED. */
static int reached(hs_run *run, int k, hs_real slope, hs_crossing *crossing) {
  const hs_span *span = &run->span;
  const hs_real *const c = coefficients_of(&run->curves, 0, k);
  const int n = *degree_of(&run->curves, 0, k);
  hs_real rate, noise, share = 1.0;
  if (hs_call(&run->here.table->rates[k], run->here.p, span->t1, run->z, &rate)) return RAISED;
  if (rate > 0) {
    if (!(slope < 0)) return 0;
    share = turning(c, n);
    crossing->time = span->t + share * span->h;
    at(run, &span->piece, share, crossing->state);
  } else {
    if (bound_at(run, k, AT_START, &noise)) return RAISED;
    if (!(fabs(run->surfaces.ends[k]) <= noise)) return 0;
    crossing->time = span->t1;
    copy(crossing->state, run->z, run->here.dimension);
  }
  const int ends = ends_at(run, k, crossing);
  if (ends != 1) return ends;
  crossing->theta = share;
  crossing->edge = k;
  crossing->depth = 0.0;
  return k >= run->here.table->edges ? 1 : condition(run, k, crossing->time, crossing->state);
}

/* The same of a surface that may still rise there. */
HS_INLINE int reaches(hs_run *run, int k, hs_crossing *crossing) {
  const hs_real *const c = coefficients_of(&run->curves, 0, k);
  if (!may_be_reached(run, k)) return 0;
  const hs_real slope = slope_of(c, *degree_of(&run->curves, 0, k), 1.0);
  return slope > ROUNDOFF_UNITS * HS_UNIT * c[1] ? 0 : reached(run, k, slope, crossing);
}

/* Whether the polynomials of surface k say that it is not crossed. */
static int is_passed_by(hs_run *run, int k) {
  const hs_curves *curves = &run->curves;
  run->roots.of = 0;
  if (run->surfaces.active[k]) coefficients_of(curves, 0, k)[0] = coefficients_of(curves, 0, k)[0] * 0; /* deflated */
  if (!(run->surfaces.ends[k] <= 0)) return 0;
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
    if (roundoff_bound(run, k, crossing->time, crossing->state, run->surfaces.active[k], &noise)) return RAISED;
    if (fabs(r) <= noise) return span_rest(run, s, crossing->state), 0;
    s = hs_min(1.0, hs_max(s * 0, s - r / rise->slope));
  }
  if (bracketed(run, k, &best)) return RAISED;
  crossing->theta = best;
  return span_point(run, best, &crossing->time, &crossing->state);
}

/* Find where surface k first rises along the step: run->event.waiting says so; 1 where it is reached without a rise,
   else 0. The Python twin is `rises_of`. */
static int first_rise(hs_run *run, int k, hs_crossing *crossing) {
  hs_riser *const waiting = &run->event.waiting[k];
  hs_real first, last;
  waiting->open = 0;
  if (is_passed_by(run, k)) return reaches(run, k, crossing);
  if (bound_at(run, k, AT_START, &first) || bound_at(run, k, AT_END, &last)) return RAISED;
  const int beyond = coefficients_of(&run->curves, 0, k)[0] > first;
  const hs_path path = {k, 0, {hs_max(first, last), beyond, run->surfaces.ends[k] > last, 0.0}};
  waiting->path = path;
  waiting->open = next_rise(run, &waiting->path, &waiting->rise);
  return waiting->open ? 0 : reaches(run, k, crossing);
}

/* Find the first point of the step, from its first rise on, where surface k is crossed and its condition holds: 1, or 0. */
static int first_crossing(hs_run *run, int k, hs_crossing *crossing) {
  hs_riser *const waiting = &run->event.waiting[k];
  hs_rise *const rise = &waiting->rise;
  waiting->open = 0;
  do {
    if (settled(run, k, rise, crossing)) return RAISED;
    const int holds = k >= run->here.table->edges ? 1 : condition(run, k, crossing->time, crossing->state);
    if (holds == RAISED) return RAISED;
    if (!holds && !(run->surfaces.active[k] && holds_next(run, k, crossing->time, crossing->state))) continue;
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
  hs_crossing *const crossing = &run->event.crossings[k];
  if (!found || (k < run->here.table->edges && too_late(run, k, crossing->time, tie(crossing->time)))) {
    crossing->edge = -1;
    return first;
  }
  return !first || crossing->time < first->time ? crossing : first;
}

/* Mark in run->surfaces.beyond the surfaces that rise after the first crossing: there they are inside, beyond round-off
   and by more than they rise while crossings are tied. The Python twin is `rises_after`, of one surface. */
static int mark_after(hs_run *run, const hs_crossing *first) {
  const hs_mode *mode = run->here.table;
  const hs_real since = tie(first->time);
  int known = 0; /* whether run->surfaces.values and run->surfaces.magnitudes are those at the crossing */
  for (int k = 0; k < mode->surfaces; k++) {
    const hs_riser *const waiting = &run->event.waiting[k];
    hs_real rate;
    run->surfaces.beyond[k] = 0;
    if (!waiting->open || !waiting->rise.certain || !(waiting->rise.share > first->theta)) continue;
    if (!known && (mode->values(run->here.p, first->time, first->state, run->surfaces.values) ||
                   magnitudes_at(run, first->time, first->state, run->surfaces.magnitudes)))
      return RAISED;
    known = 1;
    if (hs_call(&mode->rates[k], run->here.p, first->time, first->state, &rate)) continue;
    const hs_real noise = bound_from(run, run->surfaces.magnitudes, k, first->time, first->state, 0);
    run->surfaces.beyond[k] = run->surfaces.values[k] < -hs_max(noise, fabs(rate) * since);
  }
  return 0;
}

/* Find the first crossing of each surface of the step, to its place in run->event.crossings, with edge -1 where there is
   none: whether there is any, or RAISED. Surfaces that rise after the first of all are not looked at any closer, but of an implicit method: to a point of
   its step it iterates from the one before. */
static int crossings_along(hs_run *run) {
  const hs_mode *mode = run->here.table;
  const hs_crossing *first = 0;
  int open = 0;
  for (int k = 0; k < mode->surfaces; k++) {
    int found = first_rise(run, k, &run->event.crossings[k]);
    if (run->event.waiting[k].open && run->control.implicit) found = first_crossing(run, k, &run->event.crossings[k]);
    if (found == RAISED) return RAISED;
    first = kept_crossing(run, first, k, found);
    open += run->event.waiting[k].open;
  }
  for (; open && !first; open--) {
    int next = -1;
    const hs_riser *const waiting = run->event.waiting;
    for (int k = 0; k < mode->surfaces; k++)
      if (waiting[k].open && (next < 0 || waiting[k].rise.share < waiting[next].rise.share)) next = k;
    const int found = first_crossing(run, next, &run->event.crossings[next]);
    if (found == RAISED) return RAISED;
    first = kept_crossing(run, first, next, found);
  }
  if (open && mark_after(run, first)) return RAISED;
  for (int k = 0; open && k < mode->surfaces; k++) {
    if (!run->event.waiting[k].open) continue;
    open--;
    if (run->surfaces.beyond[k]) continue;
    const int found = first_crossing(run, k, &run->event.crossings[k]);
    if (found == RAISED) return RAISED;
    first = kept_crossing(run, first, k, found);
  }
  return first != 0;
}

/* Crossings, with those before the first one, of `count`, that rise by less than the step's polynomials are off by: how
   many there are then, or RAISED. A surface may be beyond its guard so and be crossed again after the first one. */
static int with_unseen(hs_run *run, int count) {
  const hs_mode *mode = run->here.table;
  const hs_span *span = &run->span;
  const hs_crossing *first = &run->event.crossings[0];
  const int seen = count;
  int known = 0; /* whether run->surfaces.values are those at the first crossing */
  for (int i = 1; i < count; i++)
    if (run->event.crossings[i].time < first->time) first = &run->event.crossings[i];
  if (!(first->theta > 0)) return count;
  for (int k = 0; k < mode->edges; k++) {
    int place = count;
    for (int i = 0; i < seen; i++)
      if (run->event.crossings[i].edge == k) place = i;
    hs_crossing *const found = &run->event.crossings[place];
    if (releases(run, k) || (place < count && found->time - first->time <= tie(first->time))) continue;
    hs_real start, end, before, noise, s = 0.0;
    if (!known && mode->values(run->here.p, first->time, first->state, run->surfaces.values)) return RAISED;
    known = !(run->surfaces.values[k] > 0);
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
    if (!holds && !(run->surfaces.active[k] && holds_next(run, k, found->time, found->state))) {
      found->time = later; /* not tied with the first one: its state does not count */
      continue;
    }
    found->edge = k;
    found->theta = s, found->depth = 0.0;
    count += place == count;
  }
  return count;
}
