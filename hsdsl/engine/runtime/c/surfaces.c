/* A mode's surfaces at a point, as polynomials along a step, and where polynomials rise.
   See hsdsl/engine/simulate/surfaces.py, which defines when a surface is active or emerging.
   A status is 0, or RAISED where a routine has no value. */

#define ROOT_ITERATIONS 200

/* Evaluate the interpolant of a step at s = theta, to `value`: its states `from` to `to`. */
HS_INLINE void part_at(const hs_run *run, const hs_polynomial *piece, hs_real theta, int from, int to, hs_real *value) {
  const int w = run->width, last = piece->degree - 1;
  for (int s = from; s < to; s++) {
    hs_real v = piece->c[last * w + s] * theta;
    for (int m = last - 1; m >= 0; m--) v = (piece->c[m * w + s] + v) * theta;
    value[s] = run->x[s] + v;
  }
}

/* The same of all states. */
static void at(const hs_run *run, const hs_polynomial *piece, hs_real theta, hs_real *value) {
  part_at(run, piece, theta, 0, run->here.dimension, value);
}

/* The part of an interpolant before theta, over [0, 1] again. */
static void shortened(const hs_run *run, const hs_polynomial *piece, hs_real theta, hs_polynomial *part) {
  const int degree = piece->degree, w = run->width;
  part->degree = degree;
  for (int s = 0; s < run->here.dimension; s++) {
    const hs_real *from = piece->c + s;
    hs_real *to = part->c + s, power = theta;
    for (int m = 0; m < degree; m++, from += w, to += w) {
      *to = *from * power;
      power = power * theta;
    }
  }
}

/* Value of surface k at a point. */
static int surface(hs_run *run, int k, hs_time t, const hs_real *x, hs_real *r) {
  if (run->here.table->values(run->here.p, t, x, run->surfaces.values)) return RAISED;
  *r = run->surfaces.values[k];
  return 0;
}

/* The slopes of surface k by time and all states, to run->gradient. */
static int gradient_of(hs_run *run, int k, hs_time t, const hs_real *x) {
  const hs_sparse *const row = &run->here.table->gradients[k];
  if (hs_call(&row->values, run->here.p, t, x, run->gradient)) return RAISED;
  hs_spread_out(row, run->here.dimension + 1, run->gradient);
  return 0;
}

/* The magnitudes of all surfaces, for the bounds at one point. */
static int magnitudes_at(hs_run *run, hs_time t, const hs_real *x, hs_real *magnitudes) {
  return run->here.table->magnitudes(run->here.p, t, x, magnitudes) ? RAISED : 0;
}

/* The bound of surface k from the magnitudes at its point. */
static hs_real bound_from(hs_run *run, const hs_real *magnitudes, int k, hs_time t, const hs_real *x, int entry) {
  const hs_mode_state *here = &run->here;
  hs_real total = magnitudes[k];
  const hs_sparse *const row = &here->table->gradients[k];
  hs_real *const g = run->gradient;
  if (!hs_call(&row->values, here->p, t, x, g) && hs_finite(sum_of(g, row->count))) {
    const int push = is_push(run, k), scaled = entry || run->surfaces.active[k];
    for (int i = 0; i < row->count; i++) {
      const int s = row->place[i] - 1;
      const hs_real size = s < 0 ? fabs(t) : push ? state_size(run, s) : scaled ? fabs(run->sizes.scale[s]) : 0.0;
      total = total + fabs(g[i]) * (s < 0 ? size : hs_max(fabs(x[s]), size));
    }
  }
  return ROUNDOFF_UNITS * HS_UNIT * total;
}

/* Below this surface k counts as zero at a point; where its gradient has no value only the sides count. */
static int roundoff_bound(hs_run *run, int k, hs_time t, const hs_real *x, int entry, hs_real *noise) {
  if (magnitudes_at(run, t, x, run->surfaces.magnitudes)) return RAISED;
  *noise = bound_from(run, run->surfaces.magnitudes, k, t, x, entry);
  return 0;
}

/* The surfaces where the located step starts, unless they are known from the end of the one before. */
HS_INLINE int starts_of(hs_run *run) {
  hs_at_surfaces *const at = &run->surfaces;
  if (!at->has_starts && run->here.table->values(run->here.p, run->span.t, run->x, at->starts)) return RAISED;
  at->has_starts = 1;
  return 0;
}

/* The surfaces where it ends. */
HS_INLINE int ends_of(hs_run *run) {
  if (run->here.table->values(run->here.p, run->span.t1, run->z, run->surfaces.ends)) return RAISED;
  run->surfaces.has_ends = 1;
  return 0;
}

enum { AT_START = 1, AT_END = 2 };

/* The bound of surface k at the start or the end of the located step, whose magnitudes are made once. */
static int bound_at(hs_run *run, int k, int end, hs_real *noise) {
  const hs_time t = end == AT_END ? run->span.t1 : run->span.t;
  const hs_real *const x = end == AT_END ? run->z : run->x;
  hs_real *const magnitudes = end == AT_END ? run->surfaces.ended : run->surfaces.begun;
  if (!(run->surfaces.weighed & end) && magnitudes_at(run, t, x, magnitudes)) return RAISED;
  run->surfaces.weighed |= end;
  *noise = bound_from(run, magnitudes, k, t, x, 0);
  return 0;
}

/* Look at run->surfaces on entry, whose values are `ahead`: mark as `beyond` those the state is beyond, and note those it
   stands on. A surface that the flow passes within the time `since` counts as stood on. So does one that the state was
   not beyond when it was reset, before it waited in a strip. Where an input `jumped`, one marked `beyond`, as not reached
   before, counts as beyond. The state stood on others, off them by `stood`: no further off them it still does. */
static int enter_surfaces(hs_run *run, hs_time t, hs_real since, int jumped, hs_time reset_at) {
  const hs_real *const values = run->surfaces.ahead, *const then = reset_at < t ? run->surfaces.noise : values;
  int *const beyond = run->surfaces.beyond;
  if (run->here.table->surfaces && magnitudes_at(run, t, run->x, run->surfaces.magnitudes)) return RAISED;
  if (reset_at < t && run->here.table->values(run->here.p, reset_at, run->x, run->surfaces.noise)) return RAISED;
  for (int k = 0; k < run->here.table->surfaces; k++) {
    hs_real noise, rate;
    const int inside = jumped && beyond[k];
    run->surfaces.active[k] = run->surfaces.emerging[k] = beyond[k] = 0;
    noise = hs_max(bound_from(run, run->surfaces.magnitudes, k, t, run->x, 1), fabs(run->surfaces.stood[k]));
    run->surfaces.stood[k] = 0.0;
    if (since != 0 && fabs(values[k]) > noise) {
      if (hs_call(&run->here.table->rates[k], run->here.p, t, run->x, &rate)) return RAISED;
      noise = hs_max(noise, fabs(rate) * since);
    }
    if (values[k] > noise && !(then[k] > noise)) {
      run->surfaces.active[k] = 1, run->here.active++;
      if (hs_call(&run->here.table->rates[k], run->here.p, t, run->x, &rate)) return RAISED;
      if (rate < 0) run->surfaces.emerging[k] = 1, run->here.emerging++;
    } else if (values[k] > noise || (inside && values[k] >= -noise))
      beyond[k] = 1;
    else if (values[k] >= -noise)
      run->surfaces.active[k] = 1, run->here.active++;
  }
  return 0;
}

/* Mark the edges without an `if` whose surfaces the state has not reached, to the round-off that counts on entry. */
static int mark_inside(hs_run *run, hs_time t, const hs_real *x, int *inside) {
  const hs_mode *mode = run->here.table;
  if (mode->values(run->here.p, t, x, run->surfaces.values)) return RAISED;
  const int raised = magnitudes_at(run, t, x, run->surfaces.magnitudes);
  for (int k = 0; k < mode->surfaces; k++) {
    inside[k] = 0;
    if (k >= mode->edges || mode->edge[k].conditional) continue;
    if (raised) return RAISED;
    inside[k] = run->surfaces.values[k] < -bound_from(run, run->surfaces.magnitudes, k, t, x, 1);
  }
  return 0;
}

/* Forget the surfaces that the state stood on and has left: inwards, or outwards where `if` was false. */
static void leave(hs_run *run, hs_time t, const hs_real *x) {
  const hs_mode *const mode = run->here.table;
  if (mode->values(run->here.p, t, x, run->surfaces.values)) return;
  const int raised = magnitudes_at(run, t, x, run->surfaces.magnitudes);
  for (int k = 0; !raised && k < mode->surfaces; k++) {
    if (!run->surfaces.active[k]) continue;
    if (fabs(run->surfaces.values[k]) > bound_from(run, run->surfaces.magnitudes, k, t, x, 0))
      run->surfaces.active[k] = 0, run->here.active--;
  }
  for (int k = 0; run->here.emerging && k < mode->surfaces; k++) {
    hs_real rate = 0.0;
    if (!run->surfaces.emerging[k]) continue;
    if (!(run->surfaces.values[k] <= 0) && (hs_call(&run->here.table->rates[k], run->here.p, t, x, &rate) || rate < 0))
      continue;
    run->surfaces.emerging[k] = 0, run->here.emerging--;
  }
}

/* Whether the `if` of edge k holds: 1, 0, or RAISED. A part that is false decides, even if another has no value. */
static int condition(hs_run *run, int k, hs_time t, const hs_real *x) {
  const hs_edge *edge = &run->here.table->edge[k];
  int answer = 1;
  for (int i = 0; i < edge->parts; i++) {
    hs_real holds;
    if (hs_call(&edge->condition[i], run->here.p, t, x, &holds))
      answer = RAISED;
    else if (holds == 0.0)
      return 0;
  }
  return answer;
}

/* Whether the flow points out of surface k, beyond the round-off of its rate, which is positive. */
static int points_out(hs_run *run, int k, hs_time t, const hs_real *x, hs_real rate) {
  const hs_sparse *const row = &run->here.table->gradients[k];
  hs_real size = 0.0;
  if (hs_call(&row->values, run->here.p, t, x, run->gradient)) return 0;
  if (run->here.table->flow(run->here.p, t, x, run->near)) return 0;
  for (int i = 0; i < row->count; i++)
    size = size + fabs(run->gradient[i]) * (row->place[i] ? fabs(run->near[row->place[i] - 1]) : 1.0);
  return rate > ROUNDOFF_UNITS * HS_UNIT * size;
}

/* Whether surface k, bending as it does in the time `since`, falls again before it has risen by `room`; its rate and
   the flow, in run->near, are known. */
static int turns_back(hs_run *run, int k, hs_time t, const hs_real *x, hs_real rate, hs_real since, hs_real room) {
  hs_real later, bend;
  if (!(since > 0)) return 0;
  for (int s = 0; s < run->here.dimension; s++) run->nearby[s] = x[s] + since * run->near[s];
  if (hs_call(&run->here.table->rates[k], run->here.p, t + since, run->nearby, &later)) return 0;
  bend = (rate - later) / since;
  return bend > 0 && rate * rate <= 2 * bend * room;
}

/* Whether an edge that is crossed at a time is one that is made after it, and the run ends there. */
static int too_late(const hs_run *run, int k, hs_time t, hs_real since) {
  return run->here.table->edge[k].strict && t + since >= run->until;
}

/* Whether the state stands on the guard of edge k, with the flow pointing out and `if` true, and does not only touch it.
   On the guard means to round-off, or within the time `since`: sums of steps are no more exact than that.
   run->surfaces.values and run->surfaces.magnitudes are those at x. */
static int stands_on(hs_run *run, int k, hs_time t, const hs_real *x, hs_real since) {
  const hs_real r = run->surfaces.values[k];
  hs_real rate;
  if (releases(run, k) || too_late(run, k, t, since)) return 0;
  if (hs_call(&run->here.table->rates[k], run->here.p, t, x, &rate) || !(rate > 0)) return 0;
  const hs_real noise = bound_from(run, run->surfaces.magnitudes, k, t, x, 0);
  if (!(fabs(r) <= hs_max(noise, rate * since)) || !points_out(run, k, t, x, rate)) return 0;
  return !turns_back(run, k, t, x, rate, since, noise - r) && condition(run, k, t, x) == 1;
}

/* Mark in run->event.tied, beside the edges that are marked, those on whose guards the state stands so. */
static void standing(hs_run *run, hs_time t, const hs_real *x, hs_real since) {
  const hs_mode *const mode = run->here.table;
  int known = 0; /* whether run->surfaces.values and run->surfaces.magnitudes are those at x */
  for (int k = 0; k < mode->edges; k++) {
    if (run->event.tied[k]) continue;
    if (!known && (mode->values(run->here.p, t, x, run->surfaces.values) ||
                   magnitudes_at(run, t, x, run->surfaces.magnitudes)))
      return;
    known = 1;
    run->event.tied[k] = stands_on(run, k, t, x, since);
  }
}

/* Close a bracket value(a) = fa <= 0 < value(b) = fb (Illinois), to where it is below `small` or a few `unit`. */
HS_INLINE int close_bracket(hs_run *run, hs_value *value, const hs_polynomial *piece, int k, hs_real a, hs_real fa,
                            hs_real b, hs_real fb, hs_real small, hs_real unit, hs_real *theta) {
  hs_real weight_a = fa, weight_b = fb;
  int side = 0;
  *theta = a;
  for (int i = 0; i < ROOT_ITERATIONS; i++) {
    if (-fa <= small || b - a <= 4 * unit) break;
    if (fb <= small) {
      *theta = b;
      break;
    }
    if (weight_b - weight_a == 0) return RAISED;
    hs_real s = a - weight_a * (b - a) / (weight_b - weight_a), f;
    if (!(a < s && s < b)) s = (a + b) / 2;
    if (value(run, piece, k, s, &f)) return RAISED;
    if (f <= 0) {
      if (side < 0) weight_b = weight_b / 2;
      a = s, fa = f, weight_a = f, side = -1;
    } else {
      if (side > 0) weight_a = weight_a / 2;
      b = s, fb = f, weight_b = f, side = 1;
    }
    *theta = a;
  }
  return 0;
}

#define MOST_FIRST 3
#define IN_A_STEP 64
#define SHORTEST 0x1p16
#define LOST_IN_A_STEP 16
#define LOST_SHORTEST 0x1p9

static hs_real *coefficients_of(const hs_curves *curves, int part, int k) {
  return curves->c + ((int64_t)part * curves->count + k) * curves->room;
}

static hs_real *off_of(const hs_curves *curves, int part, int k) { return &curves->off[part * curves->count + k]; }

static int *degree_of(const hs_curves *curves, int part, int k) { return &curves->degree[part * curves->count + k]; }

/* Give the next point where the surface rises through zero and goes on above its level: 1; 0 where there is none. A
   walk in place of the iterator `rises_along`. */
static int next_rise(hs_run *run, hs_path *path, hs_rise *rise) {
  const hs_curves *curves = &run->curves;
  for (; path->part < curves->parts; path->part++, path->walk.at = 0.0) {
    const hs_real *const c = coefficients_of(curves, path->part, path->k), off = *off_of(curves, path->part, path->k);
    const int n = *degree_of(curves, path->part, path->k), last = path->part == curves->parts - 1;
    const hs_real width = curves->width[path->part];
    hs_real root;
    if (!next_root(&run->roots, &path->walk, c, n, off, last, &root)) continue;
    rise->share = curves->start[path->part] + root * width;
    rise->slope = slope_of(c, n, root) / width;
    rise->certain = curves->certain[path->part * curves->count + path->k];
    return 1;
  }
  return 0;
}

/* How far a polynomial is off the values it should have at some points. */
static hs_real residual(const hs_real *c, const hs_interpolation *by, const hs_real *values, int every) {
  hs_real worst = fabs(value_of(c, by->degree, by->tests[0]) - values[0]);
  for (int i = 1; i < HS_TESTS; i++)
    worst = hs_max(worst, fabs(value_of(c, by->degree, by->tests[i]) - values[i * every]));
  return worst;
}

/* Whether a residual of function k is small enough; `allowed` is evaluated only where that decides. */
static int settles(hs_run *run, hs_real off, hs_real enough, hs_allowed *allowed, int k, int *answer) {
  hs_real more;
  *answer = off <= enough;
  if (*answer) return 0;
  if (allowed(run, k, &more)) return RAISED;
  *answer = off <= more + enough;
  return 0;
}

/* Begin curves of `count` surfaces that are one piece each. */
static void begin_curves(hs_curves *curves, int count) {
  curves->parts = 1;
  curves->count = count;
  curves->start[0] = 0.0, curves->width[0] = 1.0;
}

/* The degree of a polynomial, at least 1: along a polynomial solution it is low. */
static int degree_without_zeros(const hs_real *c, int degree) {
  while (degree > 1 && c[degree] == 0) degree--;
  return degree;
}

/* A surface that is affine, with these slopes by time and the states, along a piece over h: the sum of the absolute
   coefficients. Those of powers 1 and up go to c, c[0] is there. */
HS_INLINE hs_real affine_curve(const hs_polynomial *piece, int w, hs_real h, const hs_sparse *row,
                               const hs_real *slopes, hs_real *c, int *degree) {
  const int timed = row->count && row->place[0] == 0;
  hs_real sizes = fabs(c[0]);
  for (int m = 1; m <= piece->degree; m++) {
    hs_real power = m == 1 && timed ? slopes[0] * h : 0.0;
    for (int i = timed; i < row->count; i++) power = power + slopes[i] * piece->c[(m - 1) * w + row->place[i] - 1];
    c[m] = power;
    sizes = sizes + fabs(power);
  }
  *degree = degree_without_zeros(c, piece->degree);
  return sizes;
}

/* Interpolate functions on one part of a step; `settled` says whether all of them are close enough. */
static int interpolate_part(hs_run *run, hs_functions *functions, const hs_interpolation *by, hs_allowed *allowed,
                            int *settled) {
  hs_curves *const curves = &run->curves;
  const int part = curves->parts, count = curves->count, nodes = by->degree + 1;
  const hs_real start = curves->start[part], width = curves->width[part];
  hs_real *const rows = run->curves.rows, *const checks = rows + nodes * count;
  for (int i = 0; i < nodes; i++)
    if (functions(run, start + width * by->nodes[i], rows + i * count)) return RAISED;
  for (int i = 0; i < HS_TESTS; i++)
    if (functions(run, start + width * by->tests[i], checks + i * count)) return RAISED;
  *settled = 1;
  for (int k = 0; k < count; k++) {
    hs_real *const c = coefficients_of(curves, part, k), largest = fabs(rows[k]);
    for (int j = 0; j < nodes; j++) {
      hs_real power = 0.0;
      for (int i = 0; i < nodes; i++) power = power + by->matrix[j * nodes + i] * rows[i * count + k];
      c[j] = power;
    }
    for (int i = 1; i < nodes; i++) largest = hs_max(largest, fabs(rows[i * count + k]));
    int *const certain = &curves->certain[part * count + k];
    const hs_real off = *off_of(curves, part, k) = by->share * largest;
    if (settles(run, residual(c, by, checks + k, count), off, allowed, k, certain)) return RAISED;
    *settled &= *certain;
    *degree_of(curves, part, k) = by->degree;
  }
  return 0;
}

/* Take functions that would not settle on the part as straight lines. */
static void straighten(hs_run *run, int degree) {
  const hs_curves *curves = &run->curves;
  const int part = curves->parts, count = curves->count;
  for (int k = 0; k < count; k++) {
    if (curves->certain[part * count + k]) continue;
    hs_real *const c = coefficients_of(curves, part, k);
    c[0] = run->curves.rows[k];
    c[1] = run->curves.rows[degree * count + k] - run->curves.rows[k];
    *degree_of(curves, part, k) = 1;
    *off_of(curves, part, k) = 0;
  }
}

/* Interpolate `count` functions of s in [0, 1] by pieces, with residuals below a share of their largest value, or
   `allowed` more: to run->curves. Not `far`, only to where the first of them is positive. It may refuse what varies too
   fast: run->reach.refused says so, and the step is to be shorter. */
static int interpolated(hs_run *run, hs_functions *functions, int count, const hs_interpolation *by,
                        hs_allowed *allowed, int far, int most, int may_refuse) {
  struct {
    hs_real start, width;
    int halvings;
  } parts[MOST_SPLITS + 2] = {{0.0, 1.0, 0}};
  hs_curves *const curves = &run->curves;
  int open = count > 0, settled;
  curves->parts = 0;
  curves->count = count;
  while (open) {
    const hs_real start = parts[--open].start, width = parts[open].width;
    const int halvings = parts[open].halvings;
    curves->start[curves->parts] = start, curves->width[curves->parts] = width;
    if (interpolate_part(run, functions, by, allowed, &settled)) return RAISED;
    if (may_refuse && !settled && (curves->parts >= most || (start == 0 && halvings == MOST_FIRST)))
      return run->reach.refused = 1, RAISED;
    if (!settled && halvings < MOST_SPLITS && curves->parts < most) {
      const hs_real half = width / 2;
      parts[open].start = start + half, parts[open].width = half, parts[open++].halvings = halvings + 1;
      parts[open].start = start, parts[open].width = half, parts[open++].halvings = halvings + 1;
      continue;
    }
    if (!settled) straighten(run, by->degree);
    curves->parts++;
    if (!far && run->curves.rows[by->degree * count] > 0) break;
  }
  return 0;
}

/* The surfaces at the share s of the step, by its interpolant. */
static int surfaces_along(hs_run *run, hs_real s, hs_real *values) {
  part_at(run, &run->span.piece, s, 0, run->here.table->own, run->at);
  return run->here.table->values(run->here.p, run->span.t + s * run->span.h, run->at, values);
}

static int noise_at_ends(hs_run *run, int k, hs_real *allowed) {
  const hs_span *span = &run->span;
  hs_real first, last;
  if (roundoff_bound(run, k, span->t, run->x, 0, &first) || roundoff_bound(run, k, span->t + span->h, run->z, 0, &last))
    return RAISED;
  *allowed = hs_max(first, last);
  return 0;
}

/* All surfaces along the step's interpolant where all of them are affine: polynomials of its own degree. Rises below a
   share of their size tell nothing. */
static int affine_curves(hs_run *run, hs_real share) {
  const hs_mode *mode = run->here.table;
  const hs_span *span = &run->span;
  hs_curves *const found = &run->curves;
  if (starts_of(run)) return RAISED;
  begin_curves(found, mode->surfaces);
  for (int k = 0; k < mode->surfaces; k++) {
    hs_real *const c = coefficients_of(found, 0, k);
    const hs_sparse *const row = &mode->gradients[k];
    if (hs_call(&row->values, run->here.p, span->t, run->x, run->gradient)) return RAISED;
    c[0] = run->surfaces.starts[k];
    const hs_real sizes =
        affine_curve(&span->piece, run->width, span->h, row, run->gradient, c, degree_of(found, 0, k));
    *off_of(found, 0, k) = share * sizes;
    found->certain[k] = 1;
  }
  return 0;
}

/* Give up following a mode's surfaces: visits beyond them may be missed from here on. */
static void lose(hs_run *run) {
  const hs_curves *curves = &run->curves;
  run->reach.lost[run->here.mode] = 1;
  for (int k = 0; k < curves->count; k++) {
    int certain = 1;
    for (int part = 0; part < curves->parts; part++) certain &= curves->certain[part * curves->count + k];
    if (!certain) note_unsettled(run, k, run->span.t);
  }
}

/* All surfaces along the step's interpolant. */
static int curves_along(hs_run *run) {
  const hs_interpolation *by = run->task->interpolation;
  if (run->here.table->affine) return affine_curves(run, by->share);
  const int lost = run->reach.lost[run->here.mode], most = lost ? LOST_IN_A_STEP : IN_A_STEP;
  const int refuse = run->span.h * (lost ? LOST_SHORTEST : SHORTEST) > run->until;
  if (interpolated(run, surfaces_along, run->here.table->surfaces, by, noise_at_ends, 1, most, refuse)) return RAISED;
  if (!refuse && run->curves.parts >= most) lose(run);
  return 0;
}
