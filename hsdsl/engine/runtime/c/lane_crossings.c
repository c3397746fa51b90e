/* The first crossings on steps in lanes, those of crossings_along() in crossings.c. Where polynomials first rise above a
   level is what next_root() of the text finds from a start below it. A lane in which that is not plain is left out. */

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
   rises() and last_root(). The lanes that have one. Parts of lanes that are cut together are put aside together; a
   bit for each says whether a lane still has its own. */
static hs_mask part_that_rises(lane_part *here, int n, hs_mask lanes, int last) {
  lane_part aside[MOST_ASIDE];
  uint32_t open[HS_WIDTH] = {0};
  int asides = 0;
  hs_mask found = lanes & ~lanes;
  for (hs_mask live = lanes; hs_any(live);) {
    const hs_real *const b = here->b;
    uint32_t kept = 0;
    hs_mask never;
    const hs_mask gone = live & (last ? least_of(b, n) > 0 : largest_of(b, n) <= 0), once = changes_once(b, n, &never);
    const hs_mask hit = live & ~gone & (b[0] <= 0) & (b[n] > 0) & (last ? once | never : once);
    const hs_mask cut = live & ~gone & ~hit & (here->high - here->low > HS_UNIT) & (last ? lanes : b[0] <= 0);
    found |= hit;
    live = gone;
    if (hs_any(cut) && asides < MOST_ASIDE) {
      hs_real middle = (here->low + here->high) / 2, half[HS_MOST_ORDER + 1];
      lane_part *const other = &aside[asides];
      hs_real *const later = last ? half : other->b, *const nearer = last ? other->b : half;
      for (int i = 0; i <= n; i++) later[i] = b[i];
      split(later, n, HS_ALL(0.5), nearer);
      other->low = last ? here->low : middle, other->high = last ? middle : here->high;
      here->low = hs_choose(cut, last ? middle : here->low, here->low);
      here->high = hs_choose(cut, last ? here->high : middle, here->high);
      for (int i = 0; i <= n; i++) here->b[i] = hs_choose(cut, half[i], b[i]);
      for (uint32_t bits = bits_of(cut); bits; bits &= bits - 1) open[__builtin_ctz(bits)] |= 1u << asides;
      asides++;
      live |= cut;
    }
    for (uint32_t bits = bits_of(gone); bits; bits &= bits - 1) {
      const int lane = __builtin_ctz(bits), newest = open[lane] ? 31 - __builtin_clz(open[lane]) : -1;
      if (newest < 0)
        live[lane] = 0;
      else
        move_part(here, &aside[newest], n, lane), open[lane] ^= 1u << newest;
    }
    for (int lane = 0; hs_any(gone) && lane < HS_WIDTH; lane++) kept |= open[lane];
    while (hs_any(gone) && asides && !(kept >> (asides - 1))) asides--;
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

/* What other surfaces than the first one are, where that is crossed. */
typedef struct {
  hs_mask apart; /* not crossed there, and of edges the state does not stand on it: see standing() */
  hs_mask tied;  /* crossed with it */
  hs_mask stood; /* the run stands on it, and did before: see stands() */
} lane_other;

/* The lanes in which surface k is not crossed or is crossed with the first one: see mark_after() and with_unseen(). */
static hs_mask agrees(const hs_lane_mode *mode, const hs_lanes *l, int k, hs_real share, hs_mask settled, hs_real theta,
                      hs_real time, const hs_real *q, lane_other *other) {
  const hs_real r = ((hs_real *)l->values)[k], since = HS_TIE * fabs(time), own = ((hs_real *)l->time)[k];
  hs_real *const open = (hs_real *)l->open + k, noise, rate;
  const hs_mask rises = share < 2, all = rises | ~rises, later = (own > time) | (((hs_real *)l->theta)[k] == theta);
  const hs_mask close = settled & later & (own - time <= since);
  const int edge = k < mode->edges;
  other->apart = other->tied = other->stood = ~all;
  if (bound_of(mode, l, k, time, q, ((hs_real *)l->weights)[k], &noise)) return ~all;
  if (mode->rates[k].shape(mode->rates[k].of, (hs_real *)l->p, time, q, &rate)) return ~all;
  const hs_real near = hs_max(noise, fabs(rate) * since);
  const hs_mask counts = rises & ~((share > theta) & (r < -near));
  *open = hs_choose(rises & ~counts, *open * 0, *open);
  other->apart = ~counts & (edge ? fabs(r) > near : all);
  if (edge && is_plain(&l->modes[l->mode].edge[k])) other->tied = counts & close;
  other->stood = (((hs_real *)l->standing)[k] != 0) & (fabs(r) <= noise);
  return (counts & close) | (~counts & (edge ? ~(r > 0) : all));
}

/* Write a number in some lanes. */
HS_INLINE void put_in(hs_mask lanes, double *column, hs_real number) {
  *(hs_real *)column = hs_choose(lanes, number, *(hs_real *)column);
}

/* Choose, where edges are crossed together, which one goes from the first crossing: see choose(). */
static void choose_in_lanes(const hs_lane_mode *mode, hs_lanes *l, hs_mask lanes, hs_real first, const lane_other *others,
                               hs_real theta, hs_real time) {
  const int n = mode->dimension;
  const hs_edge *const edge = l->modes[l->mode].edge;
  const hs_real *const standing = (hs_real *)l->standing, *const q = (hs_real *)l->q;
  hs_real chosen = first, priority = first * 0;
  hs_mask stood = lanes & ~lanes;
  for (int k = 0; k < mode->edges; k++) priority = hs_choose(first == k, HS_ALL(edge[k].priority), priority);
  for (int k = 0; k < mode->edges && mode->surfaces > 1; k++) {
    const hs_mask before = (edge[k].priority > priority) | ((edge[k].priority == priority) & (k < chosen));
    const hs_mask goes = others[k].tied & before;
    chosen = hs_choose(goes, HS_ALL(k), chosen), priority = hs_choose(goes, HS_ALL(edge[k].priority), priority);
  }
  for (int k = 0; k < mode->surfaces; k++) {
    const hs_mask on = standing[k] != 0;
    if (mode->surfaces > 1) stood |= others[k].stood;
    stood |= ((first == k) | (chosen == k)) & on;
    for (int j = 0; k < mode->edges && j < mode->surfaces; j++) {
      const hs_mask moved = lanes & (chosen == k) & (first == j);
      if (j == k || !hs_any(moved)) continue;
      put_in(moved, l->time + k * HS_WIDTH, time), put_in(moved, l->theta + k * HS_WIDTH, theta);
      for (int s = 0; s < n; s++) put_in(moved, l->q + (k * n + s) * HS_WIDTH, q[j * n + s]);
    }
  }
  *(hs_real *)l->first = chosen;
  *(hs_real *)l->stood = hs_choose(stood, HS_ALL(1.0), theta * 0);
}

static int locate_lanes(hs_lanes *l) {
  const hs_lane_mode *const mode = &lane_modes[l->mode];
  const int n = mode->dimension;
  hs_real *const sizes = (hs_real *)l->sizes, *const shares = (hs_real *)l->shares, *const slopes = (hs_real *)l->slopes;
  hs_real first = HS_ALL(-1.0), least = HS_ALL(2.0), theta = least, time = least, q[n];
  hs_mask settled[mode->surfaces + 1], plain = first == first, alone = plain;
  lane_other others[mode->surfaces + 1];
  l->landed = l->jumped = 0;
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
  for (int k = 0; k < mode->surfaces; k++) {
    const hs_mask is_first = first == k;
    if (mode->surfaces == 1) {
      time = *(hs_real *)l->time;
      break;
    }
    plain &= is_first | agrees(mode, l, k, shares[k], settled[k], theta, time, q, &others[k]);
    alone &= is_first | others[k].apart | others[k].tied;
    others[k].tied &= ~is_first, others[k].stood &= ~is_first;
  }
  for (int s = 0; s < n; s++) sizes[s] = hs_max(((hs_real *)l->before)[s], size_at(l, n, theta, s));
  alone &= plain & (first < mode->edges) & (time < *(hs_real *)l->limit) & (time - *(hs_real *)l->t > HS_TIE * fabs(time));
  choose_in_lanes(mode, l, alone, first, others, theta, time);
  l->landed = (int32_t)bits_of(plain);
  l->jumped = (int32_t)bits_of(alone);
  return 0;
}
