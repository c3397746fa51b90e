/* One step of Taylor's method in lanes, that of next_series() in located_steps.c, and transitions, those of jump() in
   located.c. Nothing is decided here that is not plain: in a lane where it is not, the loop for one run decides. The text
   of a model's routines stands before this file, with the table `lane_modes`. */

#define FAR 0x1p500 /* sums of some numbers below it are finite */
#define MOST_SETTLINGS 8

/* How far a polynomial goes, beyond which all lanes have zeros. */
static int degree_of_lanes(const hs_real *c, int n) {
  while (n > 1 && !hs_any(c[n] != 0)) n--;
  return n;
}

/* Whether a surface with this polynomial, and the value `end`, is passed by for certain: see is_passed_by() and
   reaches(). A Bernstein coefficient is the sum of all c[k] times weights of at most 1: n sums after an inverse and a
   product here, or a quotient in fill_bernstein(). So both are off by at most 2 n + 3 units of round-off of the sum of the
   sizes, and little of second order: what is lower by 2 n + 8 of them here is negative there. */
static hs_mask passed_by(const double *inverse, const hs_real *c, int order, hs_mask standing, hs_real end,
                         int adaptive) {
  const int n = degree_of_lanes(c, order);
  hs_real b[HS_MOST_ORDER + 1], total = b[0] = hs_choose(standing, c[0] * 0, c[0]), bound = total, sizes = fabs(total);
  for (int k = 1; k <= n; k++) {
    b[k] = c[k] * inverse[n * (n + 1) / 2 + k];
    sizes = sizes + fabs(c[k]);
    total = total + c[k];
    bound = hs_choose(~(total <= bound), total, bound);
  }
  hs_mask below = bound <= 0;
  const hs_mask ends = end <= 0, apart = (b[0] <= 0) & (c[n] != 0) & (sizes > HS_NOTHING);
  if (hs_any(ends & ~below & apart)) {
    add_up(b, n);
    hs_real most = b[1];
    for (int k = 2; k <= n; k++) most = hs_max(most, b[k]);
    below |= apart & (most <= -(2 * n + 8) * HS_UNIT * sizes);
  }
  below &= ends;
  const hs_mask rises = (c[1] > 0) & below;
  if (adaptive && hs_any(rises)) below &= ~rises | (slope_of(c, n, HS_ALL(1.0)) > ROUNDOFF_UNITS * HS_UNIT * c[1]);
  return below;
}

/* The polynomials of surfaces over the step; the lanes in which they are these for certain: see series_curves(). */
static hs_mask curves_of(const hs_lane_mode *mode, const hs_lanes *l, const hs_real *powers, double tolerance) {
  const int order = l->order;
  const hs_real *const starts = (hs_real *)l->starts, *const ends = (hs_real *)l->ends;
  hs_mask known = starts[0] == starts[0];
  for (int k = 0; k < mode->surfaces; k++) {
    const hs_real *const line = (hs_real *)l->lines + mode->surface_line[k] * (order + 2);
    hs_real *const c = (hs_real *)l->curves + k * (order + 1), most = fabs(line[0]);
    c[0] = line[0];
    for (int m = 1; m <= order; m++) {
      c[m] = line[m] * powers[m];
      most = hs_max(most, fabs(c[m]));
    }
    known &= (fabs(c[order]) <= LAST_TERM * tolerance * most) & (fabs(c[order - 1]) <= TERM_BEFORE * tolerance * most);
    known &= fabs(value_at_end(c, order) - ends[k]) <= tolerance * most;
    c[0] = starts[k];
  }
  return known;
}

/* See span_size(). */
static hs_real size_at(const hs_lanes *l, int n, hs_real share, int s) {
  const hs_real *const c = (hs_real *)l->piece;
  const int last = l->order - 1;
  hs_real v = fabs(c[last * n + s]) * share;
  for (int m = last - 1; m >= 0; m--) v = (fabs(c[m * n + s]) + v) * share;
  return fabs(((hs_real *)l->x)[s]) + v;
}

/* The bound of surface k from its magnitude at a point, in lanes that stand on it by the sizes `scale`: see bound_from().
   Not 0 where its gradient has no value. */
static int bound_with(const hs_lane_mode *mode, const hs_lanes *l, int k, hs_real t, const hs_real *x,
                      hs_real magnitude, const hs_real *scale, hs_mask standing, hs_real *bound) {
  const hs_lane_sparse *const row = &mode->gradients[k];
  hs_real *const g = (hs_real *)l->gradient, total = magnitude, sum = t * 0;
  if (row->values.shape(row->values.of, (hs_real *)l->p, t, x, g)) return 1;
  for (int i = 0; i < row->count; i++) {
    const int s = row->place[i] - 1;
    const hs_real size = s < 0 ? fabs(t) : hs_choose(standing, fabs(scale[s]), t * 0);
    total = total + fabs(g[i]) * (s < 0 ? size : hs_max(fabs(x[s]), size));
    sum = sum + fabs(g[i]);
  }
  *bound = ROUNDOFF_UNITS * HS_UNIT * total;
  return hs_any(~(sum < FAR));
}

/* The same in the mode that the lanes are in. */
static int bound_of(const hs_lane_mode *mode, const hs_lanes *l, int k, hs_real t, const hs_real *x, hs_real magnitude,
                    hs_real *bound) {
  const hs_mask standing = ((hs_real *)l->standing)[k] != 0;
  return bound_with(mode, l, k, t, x, magnitude, (hs_real *)l->scale, standing, bound);
}

/* Forget the surfaces that some lanes stood on and have left; not 0 where that is not known: see leave(). */
static int leave_lanes(const hs_lane_mode *mode, const hs_lanes *l, hs_mask passed) {
  hs_real *const standing = (hs_real *)l->standing, *const weights = (hs_real *)l->weights, noise;
  const hs_real t = *(hs_real *)l->t1, *const z = (hs_real *)l->z;
  hs_mask any = passed & ~passed;
  for (int k = 0; k < mode->surfaces; k++) any |= passed & (standing[k] != 0);
  if (!hs_any(any)) return 0;
  if (mode->magnitudes((hs_real *)l->p, t, z, weights)) return 1;
  for (int k = 0; k < mode->surfaces; k++) {
    const hs_mask on = passed & (standing[k] != 0);
    if (!hs_any(on)) continue;
    if (bound_of(mode, l, k, t, z, weights[k], &noise)) return 1;
    standing[k] = hs_choose(on & (fabs(((hs_real *)l->ends)[k]) > noise), standing[k] * 0, standing[k]);
  }
  return 0;
}

/* Go on at the end of the step in some lanes. */
static void go_to_ends(const hs_lanes *l, int n, hs_mask passed) {
  hs_real *const x = (hs_real *)l->x, *const z = (hs_real *)l->z, *const scales = (hs_real *)l->scales;
  hs_real *const before = (hs_real *)l->before;
  const hs_real *const c = (hs_real *)l->piece;
  const int last = l->order - 1;
  *(hs_real *)l->t = hs_choose(passed, *(hs_real *)l->t1, *(hs_real *)l->t);
  for (int s = 0; s < n; s++) {
    hs_real size = fabs(c[last * n + s]); /* size_at() of 1 */
    for (int m = last - 1; m >= 0; m--) size = fabs(c[m * n + s]) + size;
    before[s] = hs_choose(passed, fabs(x[s]) + size, before[s]);
    x[s] = hs_choose(passed, z[s], x[s]);
    scales[s] = hs_choose(passed, hs_max(scales[s], fabs(z[s])), scales[s]);
  }
}

/* The lanes that may make one more step: see count_step(). */
static hs_mask counted(const hs_lanes *l) {
  const hs_real t = *(hs_real *)l->t;
  hs_real *const made = (hs_real *)l->made, *const since = (hs_real *)l->since;
  const hs_mask later = t - *since > *(hs_real *)l->brief;
  *made = hs_choose(later, *made * 0, *made + 1);
  *since = hs_choose(later, t, *since);
  return *made <= l->most;
}

static hs_real proposed_step(const hs_lanes *l, int n) {
  const hs_real *const lines = (hs_real *)l->lines, *const scales = (hs_real *)l->scales;
  const hs_real longest = *(hs_real *)l->longest;
  const double least = l->tolerance > HS_UNIT ? l->tolerance : HS_UNIT;
  if (!(l->tolerance > 0)) return longest;
  hs_real h = step_of_terms(lines, scales, n, l->order, least);
  for (int s = 0; s < n; s++) {
    const hs_mask small = ~(least * scales[s] > HS_NOTHING);
    if (hs_any(small)) h = smaller(h, wide_from_zero(small, lines + (s + 1) * (l->order + 2), l->order, least));
  }
  return hs_choose(h != h, longest, hs_min(longest, h));
}

static int step_lanes(hs_lanes *l) {
  const hs_lane_mode *const mode = &lane_modes[l->mode];
  const int n = mode->dimension, order = l->order, adaptive = l->tolerance > 0;
  const hs_real *const p = (hs_real *)l->p, *const x = (hs_real *)l->x, *const scales = (hs_real *)l->scales;
  const hs_real t = *(hs_real *)l->t, *const standing = (hs_real *)l->standing;
  hs_real *const lines = (hs_real *)l->lines, *const z = (hs_real *)l->z, *const end = (hs_real *)l->end;
  hs_real *const starts = (hs_real *)l->starts, *const ends = (hs_real *)l->ends, *const open = (hs_real *)l->open;
  hs_real *const error = (hs_real *)l->error;
  hs_real powers[HS_MOST_ORDER + 1];
  const hs_mask all = t == t, few = counted(l);
  hs_mask good = few, exact = all;
  l->failed = -1;
  l->crossed = l->doubtful = l->passed = 0;
  l->slow = (int32_t)bits_of(~few);
  if (mode->series(p, order, t, x, lines)) return 0;
  hs_real h = proposed_step(l, n);
  const hs_real t1 = end_of_step(t, &h, *(hs_real *)l->limit);
  good &= t1 > t;
  *(hs_real *)l->h = h;
  *(hs_real *)l->t1 = t1;
  fill_powers(powers, order, h);
  taylor_span(lines, x, n, n, order, powers, (hs_real *)l->piece, z, error);
  if (mode->flow(p, t1, z, end)) return 0;
  left_of(error, end, n, order, h);
  for (int s = 0; s < n; s++) {
    good &= fabs(z[s]) + fabs(end[s]) < FAR;
    if (adaptive) exact &= fabs(error[s]) <= l->tolerance * hs_max(scales[s], fabs(z[s]));
  }
  if (!hs_any(good) || mode->values(p, t, x, starts) || mode->values(p, t1, z, ends)) return 0;
  hs_mask crossed = all & ~all;
  if (mode->surfaces) {
    const double tolerance = adaptive ? l->tolerance : UNKNOWN_TOLERANCE;
    if (mode->surface_series(p, order, lines)) return 0;
    good &= curves_of(mode, l, powers, tolerance > HS_UNIT ? tolerance : HS_UNIT);
  }
  for (int k = 0; k < mode->surfaces; k++) {
    const hs_real *const c = (hs_real *)l->curves + k * (order + 1);
    const hs_mask passed = passed_by(l->inverse, c, order, standing[k] != 0, ends[k], adaptive);
    open[k] = hs_choose(passed, t * 0, HS_ALL(1.0));
    crossed |= ~passed;
  }
  const hs_mask passed = good & exact & ~crossed;
  if (leave_lanes(mode, l, passed)) return 0;
  l->failed = (int32_t)bits_of(~good);
  l->crossed = (int32_t)bits_of(crossed & good);
  l->doubtful = (int32_t)bits_of(good & ~exact);
  go_to_ends(l, n, passed);
  l->passed = (int32_t)bits_of(passed & (t1 < *(hs_real *)l->limit));
  return 0;
}

/* Whether the transition of an edge is made wherever its surface is crossed. */
static int is_plain(const hs_edge *edge) { return !edge->conditional && !edge->strict && !edge->of_event; }

#include "lane_crossings.c"

/* What an edge's routine makes of the values `before` of the states, to `out`: see hs_changed(). */
static int changed(const hs_edge *edge, const hs_lane_local *routine, const hs_real *p, hs_real t, const hs_real *x,
                   const hs_real *before, hs_real *out) {
  if (routine->shape(routine->of, p, t, x, out)) return 1;
  int i = edge->changes;
  for (int k = edge->target_dimension; i < edge->target_dimension && k-- > 0;)
    out[k] = i > 0 && edge->change[i - 1] == k ? out[--i] : before[k];
  return 0;
}

/* The lanes in which a guard `on` which the state x stands, with these sizes, may hold it in a mode that is entered: see
   contact_at() and keeps(). */
static hs_mask may_hold(const hs_lanes *l, int entered, hs_real t, const hs_real *x, const hs_real *sizes,
                        const hs_mask *on, hs_mask lanes) {
  const hs_mode *const mode = &l->modes[entered];
  hs_real out[mode->dimension];
  hs_mask held = lanes & ~lanes;
  for (int k = 0; l->contacts && mode->held >= 0 && k < mode->edges; k++) {
    const hs_edge *const edge = &mode->edge[k];
    const hs_lane_local *const reset = &lane_modes[entered].edge[k].reset;
    hs_mask still = lanes & on[k];
    if (edge->contact < 0 || !hs_any(still)) continue;
    if (!edge->branched && reset->shape && !changed(edge, reset, (hs_real *)l->p, t, x, x, out)) {
      for (int i = 0; i < edge->counts; i++) out[edge->count[i]] = x[edge->count[i]];
      for (int s = 0; s < mode->dimension; s++) still &= fabs(out[s] - x[s]) <= SAME_UNITS * HS_UNIT * sizes[s];
    }
    held |= still;
  }
  return held;
}

/* Make the transition of edge k in some lanes, and enter its target: see largest(), reset(), place() and enter(). The
   lanes in which this is all: the state after it is beyond no surface, and none may hold it. Those in which the flow may
   lead out at once through a guard are marked: see leads_out(). */
static hs_mask jump_by(const hs_lane_mode *mode, hs_lanes *l, int k, hs_mask lanes) {
  const hs_mode *const own = &l->modes[l->mode];
  const hs_edge *const edge = &own->edge[k];
  const hs_mode *const to = &l->modes[edge->target];
  const hs_lane_mode *const next = &lane_modes[edge->target];
  const int n = mode->dimension, m = next->dimension;
  const hs_real t = ((hs_real *)l->time)[k], *const q = (hs_real *)l->q + k * n, *const p = (hs_real *)l->p;
  hs_real both[2 * n], after[m], spread[m], scales[m], sizes[m], noise, rate;
  hs_real *const values = (hs_real *)l->values, *const weights = (hs_real *)l->weights;
  const hs_real within = *(hs_real *)l->within;
  const hs_mask stood = *(hs_real *)l->stood != 0;
  hs_mask on[next->surfaces + 1];
  for (int s = 0; s < n; s++) {
    const hs_real x = ((hs_real *)l->x)[s], scale = ((hs_real *)l->scale)[s], entered = ((hs_real *)l->entered)[s];
    const hs_real size = hs_max(hs_max(fabs(x), fabs(q[s])), ((hs_real *)l->sizes)[s]);
    both[s] = q[s], both[n + s] = joined(hs_choose(stood | (q[s] == entered), scale, x * 0), size);
    put_in(lanes, l->known + own->state[s] * HS_WIDTH, hs_max(((hs_real *)l->scales)[s], fabs(q[s])));
  }
  if (changed(edge, &mode->edge[k].reset, p, t, q, q, after)) return lanes & ~lanes;
  if (changed(edge, &mode->edge[k].spread, p, t, both, both + n, spread)) return lanes & ~lanes;
  for (int s = 0; s < m; s++) {
    scales[s] = hs_max(((hs_real *)l->known)[to->state[s]], fabs(after[s]));
    sizes[s] = hs_max(scales[s], fabs(spread[s]));
    lanes &= fabs(after[s]) + fabs(spread[s]) < FAR;
  }
  if (next->values(p, t, after, values) || next->magnitudes(p, t, after, weights)) return lanes & ~lanes;
  for (int j = 0; j < next->surfaces; j++) {
    if (bound_with(next, l, j, t, after, weights[j], spread, lanes | ~lanes, &noise)) return lanes & ~lanes;
    lanes &= (values[j] <= noise) & (values[j] > -FAR);
    const hs_mask passed = lanes & (within != 0) & (values[j] < -noise);
    if (hs_any(passed)) {
      if (next->rates[j].shape(next->rates[j].of, p, t, after, &rate)) return lanes & ~lanes;
      noise = hs_choose(passed, hs_max(noise, fabs(rate) * within), noise);
    }
    on[j] = values[j] >= -noise;
    if (!hs_any(lanes & on[j]) || j >= to->edges) continue;
    if (next->rates[j].shape(next->rates[j].of, p, t, after, &noise)) return lanes & ~lanes;
    l->leads |= (int32_t)bits_of(lanes & on[j] & (noise > 0));
  }
  lanes &= ~may_hold(l, edge->target, t, after, sizes, on, lanes);
  for (int s = 0; s < m; s++) {
    const int i = s * HS_WIDTH;
    put_in(lanes, l->x + i, after[s]), put_in(lanes, l->entered + i, after[s]), put_in(lanes, l->before + i, t * 0);
    put_in(lanes, l->scale + i, spread[s]), put_in(lanes, l->scales + i, scales[s]);
  }
  for (int j = 0; j < next->surfaces; j++)
    put_in(lanes, l->standing + j * HS_WIDTH, hs_choose(on[j], HS_ALL(1.0), t * 0));
  put_in(lanes, l->t, t), put_in(lanes, l->since, t), put_in(lanes, l->made, t * 0);
  return lanes;
}

/* The same into a final mode: only the state there counts. */
static hs_mask end_by(const hs_lane_mode *mode, hs_lanes *l, int k, hs_mask lanes) {
  const hs_edge *const edge = &l->modes[l->mode].edge[k];
  const hs_real *const q = (hs_real *)l->q + k * mode->dimension;
  const int m = edge->target_dimension;
  hs_real after[m + 1];
  if (changed(edge, &mode->edge[k].reset, (hs_real *)l->p, ((hs_real *)l->time)[k], q, q, after)) return lanes & ~lanes;
  for (int s = 0; s < m; s++) lanes &= fabs(after[s]) < FAR;
  for (int s = 0; s < m; s++) put_in(lanes, l->x + s * HS_WIDTH, after[s]);
  return lanes;
}

static int jump_lanes(hs_lanes *l) {
  const hs_lane_mode *const mode = &lane_modes[l->mode];
  const hs_real first = *(hs_real *)l->first;
  const hs_mask lanes = mask_of(l->jumped);
  uint32_t jumped = 0;
  l->leads = 0;
  for (int k = 0; k < mode->edges; k++) {
    const hs_edge *const edge = &l->modes[l->mode].edge[k];
    const hs_mask own = lanes & (first == k);
    if (!is_plain(edge) || !mode->edge[k].reset.shape || !hs_any(own)) continue;
    if (l->modes[edge->target].final)
      jumped |= bits_of(end_by(mode, l, k, own));
    else if (lanes_are_for[edge->target])
      jumped |= bits_of(jump_by(mode, l, k, own));
  }
  l->jumped = (int32_t)jumped;
  return 0;
}

extern const hs_lane_program hs_the_lanes;
HS_EXPORT const hs_lane_program hs_the_lanes = {HS_WIDTH, lanes_are_for, step_lanes, locate_lanes, jump_lanes};
