/* One step of Taylor's method in lanes, that of next_series() in located_steps.c, and the first crossing on such steps,
   that of crossings_along() in crossings.c. Nothing is decided here that is not plain: in a lane where it is not, the loop
   for one run decides. The text of a model's routines stands before this file, with the table `lane_modes`. */

#include "lane_roots.c"

#define FAR 0x1p500 /* sums of some numbers below it are finite */
#define MOST_SETTLINGS 8

/* How far a polynomial goes, beyond which all lanes have zeros. */
static int degree_of_lanes(const hs_real *c, int n) {
  while (n > 1 && !hs_any(c[n] != 0)) n--;
  return n;
}

/* Whether a surface with this polynomial, and the value `end`, is passed by for certain: see is_passed_by() and
   reaches(). A Bernstein coefficient is the sum of all c[k] times weights of at most 1: n sums behind an inverse and a
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

/* The bound of surface k from its magnitude at a point: see bound_from(). Not 0 where its gradient has no value. */
static int bound_of(const hs_lane_mode *mode, const hs_lanes *l, int k, hs_real t, const hs_real *x, hs_real magnitude,
                    hs_real *bound) {
  const hs_lane_sparse *const row = &mode->gradients[k];
  const hs_mask standing = ((hs_real *)l->standing)[k] != 0;
  hs_real *const g = (hs_real *)l->gradient, total = magnitude, sum = t * 0;
  if (row->values.shape(row->values.of, (hs_real *)l->p, t, x, g)) return 1;
  for (int i = 0; i < row->count; i++) {
    const int s = row->place[i] - 1;
    const hs_real size = s < 0 ? fabs(t) : hs_choose(standing, fabs(((hs_real *)l->scale)[s]), t * 0);
    total = total + fabs(g[i]) * (s < 0 ? size : hs_max(fabs(x[s]), size));
    sum = sum + fabs(g[i]);
  }
  *bound = ROUNDOFF_UNITS * HS_UNIT * total;
  return hs_any(~(sum < FAR));
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
  l->crossed = l->doubtful = 0;
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
  return 0;
}

/* Find where each surface first rises that is not passed by: its share of the step, 2 for none, and its slope there. Not
   0 where bounds have no value. The lanes are left that are plain. */
static int first_rises(const hs_lane_mode *mode, const hs_lanes *l, hs_real *shares, hs_real *slopes, hs_mask *plain) {
  const hs_real *const p = (hs_real *)l->p, *const x = (hs_real *)l->x, *const z = (hs_real *)l->z;
  const hs_real t = *(hs_real *)l->t, t1 = *(hs_real *)l->t1, *const open = (hs_real *)l->open;
  hs_real *const begun = (hs_real *)l->values, *const ended = (hs_real *)l->weights, low, high;
  if (mode->magnitudes(p, t, x, begun) || mode->magnitudes(p, t1, z, ended)) return 1;
  for (int k = 0; k < mode->surfaces; k++) {
    const hs_mask on = open[k] != 0;
    shares[k] = HS_ALL(2.0);
    if (!hs_any(on)) continue;
    hs_real *const c = (hs_real *)l->curves + k * (l->order + 1), root = t * 0;
    const int n = degree_of_lanes(c, l->order);
    if (bound_of(mode, l, k, t, x, begun[k], &low) || bound_of(mode, l, k, t1, z, ended[k], &high)) return 1;
    c[0] = hs_choose(((hs_real *)l->standing)[k] != 0, c[0] * 0, c[0]);
    const hs_mask found = rise_in_lanes(l->binomials, c, n, on & (c[n] != 0) & ~(c[0] > low), hs_max(low, high), &root);
    slopes[k] = slope_of(c, n, root);
    *plain &= ~on | (found & (slopes[k] != 0));
    shares[k] = hs_choose(on, root, shares[k]);
  }
  return 0;
}

/* Surfaces and their magnitudes at a share of each lane's step, and the state there: see span_place(). */
static int look_at(const hs_lane_mode *mode, const hs_lanes *l, hs_real share, hs_real *time, hs_real *q) {
  const hs_real *const c = (hs_real *)l->piece, *const x = (hs_real *)l->x, *const z = (hs_real *)l->z;
  const hs_real *const p = (hs_real *)l->p;
  const int n = mode->dimension, last = l->order - 1;
  const hs_mask at_end = share == 1, at_start = ~(share > 0);
  *time = hs_choose(at_end, *(hs_real *)l->t1, *(hs_real *)l->t + share * *(hs_real *)l->h);
  for (int s = 0; s < n; s++) {
    hs_real v = c[last * n + s] * share;
    for (int m = last - 1; m >= 0; m--) v = (c[m * n + s] + v) * share;
    q[s] = hs_choose(at_end, z[s], hs_choose(at_start, x[s], x[s] + v));
  }
  return mode->values(p, *time, q, (hs_real *)l->values) || mode->magnitudes(p, *time, q, (hs_real *)l->weights);
}

/* Correct where surface k is crossed to round-off, in some lanes: see settled(). The lanes in which it is. */
static hs_mask settle_lanes(const hs_lane_mode *mode, const hs_lanes *l, int k, hs_mask lanes, hs_real next,
                            hs_real slope) {
  hs_real *const theta = (hs_real *)l->theta + k, *const time = (hs_real *)l->time + k;
  hs_real *const q = (hs_real *)l->q + k * mode->dimension, least = HS_ALL(INFINITY), noise;
  const hs_mask none = lanes & ~lanes;
  hs_mask active = lanes, done = none;
  for (int i = 0; i < MOST_SETTLINGS && hs_any(active); i++) {
    *theta = next;
    if (look_at(mode, l, next, time, q)) return none;
    const hs_real r = ((hs_real *)l->values)[k];
    if (bound_of(mode, l, k, *time, q, ((hs_real *)l->weights)[k], &noise)) return none;
    active &= fabs(r) < least;
    least = fabs(r);
    done |= active & (least <= noise);
    active &= ~done;
    next = hs_choose(active, hs_min(HS_ALL(1.0), hs_max(next * 0, next - r / slope)), next);
  }
  return done;
}

/* The lanes in which surface k, beside the first one, is not crossed or is crossed with it: see mark_behind() and
   with_unseen(). */
static hs_mask agrees(const hs_lane_mode *mode, const hs_lanes *l, int k, hs_real share, hs_mask settled, hs_real theta,
                      hs_real time, const hs_real *q) {
  const hs_real r = ((hs_real *)l->values)[k], since = HS_TIE * fabs(time), own = ((hs_real *)l->time)[k];
  hs_real *const open = (hs_real *)l->open + k, noise, rate;
  const hs_mask rises = share < 2, tied = settled & (own >= time) & (own - time <= since);
  const hs_mask below = k < mode->edges ? ~(r > 0) : rises | ~rises;
  if (!hs_any(rises)) return below;
  if (bound_of(mode, l, k, time, q, ((hs_real *)l->weights)[k], &noise)) return rises & ~rises;
  if (mode->rates[k].shape(mode->rates[k].of, (hs_real *)l->p, time, q, &rate)) return rises & ~rises;
  const hs_mask behind = rises & (share > theta) & (r < -hs_max(noise, fabs(rate) * since));
  *open = hs_choose(behind, *open * 0, *open);
  return (rises & ~behind & tied) | (~(rises & ~behind) & below);
}

static int locate_lanes(hs_lanes *l) {
  const hs_lane_mode *const mode = &lane_modes[l->mode];
  const int n = mode->dimension;
  hs_real *const sizes = (hs_real *)l->sizes, *const shares = (hs_real *)l->shares, *const slopes = (hs_real *)l->slopes;
  hs_real first = HS_ALL(-1.0), least = HS_ALL(2.0), theta = least, time = least, q[n];
  hs_mask settled[mode->surfaces + 1], plain = first == first;
  l->landed = 0;
  if (first_rises(mode, l, shares, slopes, &plain) || !hs_any(plain)) return 0;
  for (int k = 0; k < mode->surfaces; k++) {
    settled[k] = plain & (shares[k] < 2);
    if (!hs_any(settled[k])) continue;
    settled[k] = settle_lanes(mode, l, k, settled[k], shares[k], slopes[k]);
    const hs_mask earlier = shares[k] < least;
    first = hs_choose(earlier, least * 0 + k, first), least = hs_choose(earlier, shares[k], least);
    theta = hs_choose(earlier, ((hs_real *)l->theta)[k], theta);
    plain &= ~earlier | settled[k];
  }
  plain &= (first >= 0) & (theta > 0);
  if (!hs_any(plain)) return 0;
  if (mode->surfaces > 1 && look_at(mode, l, theta, &time, q)) return 0;
  for (int k = 0; mode->surfaces > 1 && k < mode->surfaces; k++)
    plain &= (first == k) | agrees(mode, l, k, shares[k], settled[k], theta, time, q);
  for (int s = 0; s < n; s++) sizes[s] = hs_max(((hs_real *)l->before)[s], size_at(l, n, theta, s));
  l->landed = (int32_t)bits_of(plain);
  return 0;
}

extern const hs_lane_program hs_the_lanes;
HS_EXPORT const hs_lane_program hs_the_lanes = {HS_WIDTH, lanes_are_for, step_lanes, locate_lanes};
