/* Surfaces along one step, as polynomials of the share s of the step. See hsdsl/engine/simulate/surface_polynomials.py. */

#include "functions.h"

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

static hs_walk begin_walk(int k, hs_real level, int beyond, int risen) {
  const hs_walk walk = {k, risen, beyond, 0, level, 0.0};
  return walk;
}

/* The last root before `end`; a series that begins with zero has it taken out, so that tiny roots stay exact. */
static hs_real root_of(hs_run *run, const hs_real *c, int n, hs_real start, hs_real end) {
  const int reduced = start == 0 && c[0] == 0 && n > 0;
  hs_real root;
  return last_root(run, c, n, reduced, start, end, &root) ? root : start;
}

static hs_real slope_of(const hs_real *c, int n, hs_real s) {
  hs_real slope = s * 0;
  for (int k = n; k > 0; k--) slope = k * c[k] + s * slope;
  return slope;
}

/* The same at 1. */
static hs_real slope_at_end(const hs_real *c, int n) {
  hs_real slope = 0.0;
  for (int k = n; k > 0; k--) slope = k * c[k] + slope;
  return slope;
}

/* Give the next point where the surface rises through zero and goes on above its level: 1; 0 where there is none. */
static int next_rise(hs_run *run, hs_walk *walk, hs_rise *rise) {
  const hs_curves *curves = &run->curves;
  for (; walk->part < curves->parts; walk->part++, walk->at = 0.0) {
    const hs_real *c = coefficients_of(curves, walk->part, walk->k);
    const int n = *degree_of(curves, walk->part, walk->k);
    hs_real sizes = 0.0, high;
    for (int i = 0; i <= n; i++) sizes = sizes + fabs(c[i]);
    const hs_real least = hs_max(walk->level, ROUNDING * HS_UNIT * sizes);
    const hs_real above = hs_max(least, *off_of(curves, walk->part, walk->k));
    if (walk->outside) {
      if (!rises(run, c, n, -1.0, 0.0, walk->at, &walk->at)) continue;
      walk->outside = 0;
    }
    if (!rises(run, c, n, 1.0, above, walk->at, &high)) {
      if (!(walk->part == curves->parts - 1 && walk->risen && walk->at < 1)) continue;
      high = 1.0;
    }
    const hs_real root = root_of(run, c, n, walk->at, high), width = curves->width[walk->part];
    rise->share = curves->start[walk->part] + root * width;
    rise->slope = slope_of(c, n, root) / width;
    rise->certain = curves->certain[walk->part * curves->count + walk->k];
    walk->at = high;
    walk->outside = 1;
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
  hs_real *const rows = run->rows, *const checks = rows + nodes * count;
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
    c[0] = run->rows[k];
    c[1] = run->rows[degree * count + k] - run->rows[k];
    *degree_of(curves, part, k) = 1;
    *off_of(curves, part, k) = 0;
  }
}

/* Interpolate `count` functions of s in [0, 1] by pieces, with residuals below a share of their largest value, or
   `allowed` more: to run->curves. Not `far`, only to where the first of them is positive. It may refuse what varies too
   fast: run->refused says so, and the step is to be shorter. */
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
      return run->refused = 1, RAISED;
    if (!settled && halvings < MOST_SPLITS && curves->parts < most) {
      const hs_real half = width / 2;
      parts[open].start = start + half, parts[open].width = half, parts[open++].halvings = halvings + 1;
      parts[open].start = start, parts[open].width = half, parts[open++].halvings = halvings + 1;
      continue;
    }
    if (!settled) straighten(run, by->degree);
    curves->parts++;
    if (!far && run->rows[by->degree * count] > 0) break;
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
  if (mode->values(run->here.p, span->t, run->x, run->values)) return RAISED;
  begin_curves(found, mode->surfaces);
  for (int k = 0; k < mode->surfaces; k++) {
    hs_real *const c = coefficients_of(found, 0, k);
    const hs_sparse *const row = &mode->gradients[k];
    if (row->values(run->here.p, span->t, run->x, run->gradient)) return RAISED;
    c[0] = run->values[k];
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
  run->lost[run->here.mode] = 1;
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
  const int lost = run->lost[run->here.mode], most = lost ? LOST_IN_A_STEP : IN_A_STEP;
  const int refuse = run->span.h * (lost ? LOST_SHORTEST : SHORTEST) > run->until;
  if (interpolated(run, surfaces_along, run->here.table->surfaces, by, noise_at_ends, 1, most, refuse)) return RAISED;
  if (!refuse && run->curves.parts >= most) lose(run);
  return 0;
}
