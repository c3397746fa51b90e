/* Where polynomials first rise above a level, in lanes: what next_root() of the text finds from a start below it. A lane
   in which that is not plain is left out. */

#define MOST_ASIDE 24
#define MOST_NEWTON 40

/* A part of the interval in each lane, and the Bernstein coefficients of a polynomial on it. */
typedef struct {
  hs_real low, high, b[HS_MOST_ORDER + 1];
} lane_part;

/* Of lanes in which it begins at zero or below and ends above, those whose sign changes once, zeros left out; or not at
   all: see changes(). */
static hs_mask changes_once(const hs_real *b, int n, hs_mask *never) {
  hs_mask below = ~(b[0] >= 0), above = below & ~below, again = above;
  for (int i = 1; i <= n; i++) {
    above |= b[i] > 0;
    again |= above & ~(b[i] >= 0);
    below |= ~above & ~(b[i] >= 0);
  }
  *never = ~again & ~below;
  return ~again & below;
}

static void move_part(lane_part *to, const lane_part *from, int n, int lane) {
  to->low[lane] = from->low[lane], to->high[lane] = from->high[lane];
  for (int i = 0; i <= n; i++) to->b[i][lane] = from->b[i][lane];
}

/* The first part on which the polynomial rises once through zero, or the `last` one behind which it stays above: see
   rises() and last_root(). The lanes that have one. */
static hs_mask part_that_rises(lane_part *here, int n, hs_mask lanes, int last) {
  lane_part aside[MOST_ASIDE], left, right;
  int open[HS_WIDTH] = {0};
  hs_mask found = lanes & ~lanes;
  for (hs_mask live = lanes; hs_any(live);) {
    const hs_real *const b = here->b;
    hs_mask never;
    const hs_mask gone = live & (last ? least_of(b, n) > 0 : largest_of(b, n) <= 0), once = changes_once(b, n, &never);
    const hs_mask hit = live & ~gone & (b[0] <= 0) & (b[n] > 0) & (last ? once | never : once);
    const hs_mask cut = live & ~gone & ~hit & (here->high - here->low > HS_UNIT) & (last ? lanes : b[0] <= 0);
    found |= hit;
    live = gone | cut;
    if (hs_any(cut)) {
      right = *here;
      split(right.b, n, HS_ALL(0.5), left.b);
      left.low = here->low, right.high = here->high;
      left.high = right.low = (here->low + here->high) / 2;
      lane_part *const other = last ? &left : &right, *const next = last ? &right : &left;
      for (int lane = 0; lane < HS_WIDTH; lane++)
        if (cut[lane] && open[lane] < MOST_ASIDE)
          move_part(&aside[open[lane]++], other, n, lane), move_part(here, next, n, lane);
        else if (cut[lane])
          live[lane] = 0;
    }
    for (int lane = 0; hs_any(gone) && lane < HS_WIDTH; lane++)
      if (gone[lane] && open[lane])
        move_part(here, &aside[--open[lane]], n, lane);
      else if (gone[lane])
        live[lane] = 0;
  }
  return found;
}

/* Solve for the root in a bracket: see refined(). The lanes that have one. */
static hs_mask refined_in_lanes(const hs_real *c, int n, hs_mask lanes, hs_real a, hs_real b, hs_real *root) {
  const hs_real fa = value_of(c, n, a), fb = value_of(c, n, b);
  hs_real sizes = a * 0, slope;
  for (int k = 0; k <= n; k++) sizes = sizes + fabs(c[k]);
  const hs_real noise = ROUNDING * HS_UNIT * sizes;
  hs_mask live = lanes & (fa < -noise) & (fb > noise) & (a != b), found = live & ~live;
  hs_real s = a - fa * (b - a) / (fb - fa);
  for (int i = 0; i < MOST_NEWTON && hs_any(live); i++) {
    s = hs_choose((a < s) & (s < b), s, (a + b) / 2);
    live &= (a < s) & (s < b);
    const hs_real f = value_and_slope(c, n, s, &slope);
    a = hs_choose(f < 0, s, a);
    b = hs_choose(f < 0, b, s);
    const hs_real after = hs_choose(slope > 0, s - f / slope, a);
    const hs_mask near = (after - s) * (after - s) <= HS_UNIT * after * after;
    const hs_mask hit = live & (slope > 0) & (a <= after) & (after <= b) & near;
    *root = hs_choose(hit, after, *root);
    found |= hit;
    live &= ~hit;
    s = after;
  }
  return found;
}

/* The last root before `end` of c, whose Bernstein coefficients are `whole`; with 1 `taken` it begins with zero: see
   last_root(). The lanes that have one. */
static hs_mask last_root_in_lanes(const hs_real *c, const hs_real *whole, int n, int taken, hs_mask lanes, hs_real end,
                                  hs_real *root) {
  const hs_real *const own = whole + taken;
  const int m = n - taken;
  hs_mask never;
  const hs_mask at_once = lanes & (end == 1) & (own[0] <= 0) & (own[m] > 0) & (changes_once(own, m, &never) | never);
  hs_mask others = lanes & ~at_once;
  lane_part part;
  hs_real before[HS_MOST_ORDER + 1];
  part.low = end * 0, part.high = end;
  if (hs_any(others)) {
    for (int k = 0; k <= m; k++) part.b[k] = taken ? own[k] * n / (k + 1) : own[k];
    for (int k = 0; k <= m; k++) before[k] = part.b[k];
    split(before, m, end, part.b);
    for (int k = 0; k <= m; k++) part.b[k] = hs_choose(end < 1, part.b[k], taken ? own[k] * n / (k + 1) : own[k]);
    others = part_that_rises(&part, m, others, 1);
    part.low = hs_choose(at_once, end * 0, part.low), part.high = hs_choose(at_once, end, part.high);
  }
  return refined_in_lanes(c + taken, m, at_once | others, part.low, part.high, root);
}

/* The root before the first rise above a level, of some lanes; those in which it is found. */
static hs_mask rise_in_lanes(const double *binomials, const hs_real *c, int n, hs_mask lanes, hs_real level,
                             hs_real *root) {
  hs_real whole[HS_MOST_ORDER + 1], sizes = level * 0;
  lane_part part;
  for (int k = 0; k <= n; k++) sizes = sizes + fabs(c[k]);
  const hs_real above = hs_max(level, ROUNDING * HS_UNIT * sizes);
  fill_bernstein(binomials, c, n, whole);
  for (int k = 0; k <= n; k++) part.b[k] = whole[k] - above;
  part.low = level * 0, part.high = HS_ALL(1.0);
  const hs_mask rises = part_that_rises(&part, n, lanes, 0), behind = rises & (c[0] == 0);
  hs_mask found = rises & ~rises;
  if (hs_any(rises & ~behind)) found |= last_root_in_lanes(c, whole, n, 0, rises & ~behind, part.high, root);
  if (hs_any(behind)) found |= last_root_in_lanes(c, whole, n, 1, behind, part.high, root);
  return found;
}
