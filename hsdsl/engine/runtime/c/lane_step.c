/* One step of Taylor's method in lanes: that of next_series() in located.c, and whether crossings_along() there would
   find nothing on it. Nothing is decided here that is not plain: in a lane where it is not, the loop for one run decides.
   The text of a model's routines stands before this file, with the table `lane_modes`. */

#define FAR 0x1p500 /* sums of some numbers below it are finite */

/* How far a polynomial goes, beyond which all lanes have zeros. */
static int degree_of_lanes(const hs_real *c, int n) {
  while (n > 1 && !hs_any(c[n] != 0)) n--;
  return n;
}

/* Whether a surface with this polynomial, and the value `end`, is passed by for certain: see is_passed_by() and
   reaches(). */
static hs_mask passed_by(const double *binomials, const hs_real *c, int order, hs_mask standing, hs_real end,
                         int adaptive) {
  const int n = degree_of_lanes(c, order);
  hs_real b[HS_MOST_ORDER + 1], from[HS_MOST_ORDER + 1];
  hs_real total = hs_choose(standing, c[0] * 0, c[0]), bound = from[0] = total;
  for (int k = 1; k <= n; k++) {
    from[k] = c[k];
    total = total + c[k];
    bound = hs_choose(~(total <= bound), total, bound);
  }
  hs_mask below = bound <= 0;
  const hs_mask ends = end <= 0;
  if (hs_any(ends & ~below)) {
    fill_bernstein(binomials, from, n, b);
    below |= (largest_of(b, n) <= 0) & (c[n] != 0);
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

/* Go on at the end of the step in some lanes. */
static void go_to_ends(const hs_lanes *l, int n, hs_mask passed) {
  hs_real *const x = (hs_real *)l->x, *const z = (hs_real *)l->z, *const scales = (hs_real *)l->scales;
  *(hs_real *)l->t = hs_choose(passed, *(hs_real *)l->t1, *(hs_real *)l->t);
  for (int s = 0; s < n; s++) {
    x[s] = hs_choose(passed, z[s], x[s]);
    scales[s] = hs_choose(passed, hs_max(scales[s], fabs(z[s])), scales[s]);
  }
}

static int step_lanes(hs_lanes *l) {
  const hs_lane_mode *const mode = &lane_modes[l->mode];
  const int n = mode->dimension, order = l->order, adaptive = l->tolerance > 0;
  const hs_real *const p = (hs_real *)l->p, *const x = (hs_real *)l->x, *const scales = (hs_real *)l->scales;
  const hs_real t = *(hs_real *)l->t, longest = *(hs_real *)l->longest;
  hs_real *const lines = (hs_real *)l->lines, *const z = (hs_real *)l->z, *const end = (hs_real *)l->end;
  hs_real *const starts = (hs_real *)l->starts, *const ends = (hs_real *)l->ends;
  const hs_real *const standing = (hs_real *)l->standing;
  hs_real *const error = (hs_real *)l->error;
  hs_real powers[HS_MOST_ORDER + 1], h = longest;
  hs_mask good = t == t, exact = good;
  l->failed = -1;
  l->crossed = l->doubtful = 0;
  if (mode->series(p, order, t, x, lines)) return 0;
  if (adaptive) {
    const double least = l->tolerance > HS_UNIT ? l->tolerance : HS_UNIT;
    h = step_of_terms(lines, scales, n, order, least);
    for (int s = 0; s < n; s++) {
      const hs_mask small = ~(least * scales[s] > HS_NOTHING);
      if (hs_any(small)) h = smaller(h, wide_from_zero(small, lines + (s + 1) * (order + 2), order, least));
    }
    h = hs_choose(h != h, longest, hs_min(longest, h));
  }
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
  hs_mask crossed = good & ~good;
  if (mode->surfaces) {
    const double tolerance = adaptive ? l->tolerance : UNKNOWN_TOLERANCE;
    if (mode->surface_series(p, order, lines)) return 0;
    good &= curves_of(mode, l, powers, tolerance > HS_UNIT ? tolerance : HS_UNIT);
  }
  for (int k = 0; k < mode->surfaces; k++) {
    const hs_real *const c = (hs_real *)l->curves + k * (order + 1);
    crossed |= ~passed_by(l->binomials, c, order, standing[k] != 0, ends[k], adaptive);
  }
  l->failed = (int32_t)bits_of(~good);
  l->crossed = (int32_t)bits_of(crossed & good);
  l->doubtful = (int32_t)bits_of(good & ~exact);
  go_to_ends(l, n, good & exact & ~crossed);
  return 0;
}

extern const hs_lane_program hs_the_lanes;
HS_EXPORT const hs_lane_program hs_the_lanes = {HS_WIDTH, lanes_are_for, step_lanes};
