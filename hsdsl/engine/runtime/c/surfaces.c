/* Geometry of a trial step against a mode's surfaces: round-off, depth, and where a surface was crossed.
   See hsdsl/engine/simulate/surfaces.py. A status is 0, or RAISED where a routine has no value. */

#include "functions.h"

#define SCAN 8
#define ROOT_ITERATIONS 200
#define ROOT_SHARE (1.0 / 16)

static hs_found failure(hs_step_failure kind, int surface) {
  const hs_found found = {kind, surface, 0};
  return found;
}

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

/* The size of numbers of two sizes, of which the first is negative where a reset's terms gave it: see hs_run. */
HS_INLINE hs_real joined(hs_real scale, hs_real size) { return scale < 0 ? -hs_max(-scale, size) : hs_max(scale, size); }

/* Value of surface k at a point. */
static int surface(hs_run *run, int k, hs_time t, const hs_real *x, hs_real *r) {
  if (run->here.table->values(run->here.p, t, x, run->values)) return RAISED;
  *r = run->values[k];
  return 0;
}

/* The slopes of surface k by time and all states, to run->gradient. */
static int gradient_of(hs_run *run, int k, hs_time t, const hs_real *x) {
  const hs_sparse *const row = &run->here.table->gradients[k];
  if (row->values(run->here.p, t, x, run->gradient)) return RAISED;
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
  if (!row->values(here->p, t, x, g) && hs_finite(sum(g, row->count))) {
    const int push = is_push(run, k), scaled = entry || run->active_surfaces[k];
    for (int i = 0; i < row->count; i++) {
      const int s = row->place[i] - 1;
      const hs_real size = s < 0 ? fabs(t) : push ? state_size(run, s) : scaled ? fabs(run->scale[s]) : 0.0;
      total = total + fabs(g[i]) * (s < 0 ? size : hs_max(fabs(x[s]), size));
    }
  }
  return ROUNDOFF_UNITS * HS_UNIT * total;
}

/* Below this surface k counts as zero at a point; where its gradient has no value only the sides count. */
static int roundoff_bound(hs_run *run, int k, hs_time t, const hs_real *x, int entry, hs_real *noise) {
  if (magnitudes_at(run, t, x, run->magnitudes)) return RAISED;
  *noise = bound_from(run, run->magnitudes, k, t, x, entry);
  return 0;
}

/* Look at the surfaces on entry, whose values are run->ahead: mark in run->beyond those the state is beyond, and note
   those it stands on. A surface that the flow passes within the time `since` counts as stood on. So does one that the
   state was not beyond when it was reset, before it waited in a strip. Where an input `jumped`, one that run->beyond
   marks as not reached before counts as beyond. It stood on others, off them by run->stood: no further off them it still
   does. */
static int enter_surfaces(hs_run *run, hs_time t, hs_real since, int jumped, hs_time reset_at) {
  const hs_real *const values = run->ahead, *const then = reset_at < t ? run->noise : values;
  int *const beyond = run->beyond;
  if (run->here.table->surfaces && magnitudes_at(run, t, run->x, run->magnitudes)) return RAISED;
  if (reset_at < t && run->here.table->values(run->here.p, reset_at, run->x, run->noise)) return RAISED;
  for (int k = 0; k < run->here.table->surfaces; k++) {
    hs_real noise, rate;
    const int inside = jumped && beyond[k];
    run->active_surfaces[k] = run->emerging[k] = beyond[k] = 0;
    noise = hs_max(bound_from(run, run->magnitudes, k, t, run->x, 1), fabs(run->stood[k]));
    run->stood[k] = 0.0;
    if (since != 0 && fabs(values[k]) > noise) {
      if (run->here.table->rates[k](run->here.p, t, run->x, &rate)) return RAISED;
      noise = hs_max(noise, fabs(rate) * since);
    }
    if (values[k] > noise && !(then[k] > noise)) {
      run->active_surfaces[k] = 1, run->here.standing++;
      if (run->here.table->rates[k](run->here.p, t, run->x, &rate)) return RAISED;
      if (rate < 0) run->emerging[k] = 1, run->here.emerging++;
    } else if (values[k] > noise || (inside && values[k] >= -noise))
      beyond[k] = 1;
    else if (values[k] >= -noise)
      run->active_surfaces[k] = 1, run->here.standing++;
  }
  return 0;
}

/* Mark the edges without an `if` whose surfaces the state has not reached, to the round-off that counts on entry. */
static int mark_inside(hs_run *run, hs_time t, const hs_real *x, int *inside) {
  const hs_mode *mode = run->here.table;
  if (mode->values(run->here.p, t, x, run->values)) return RAISED;
  const int raised = magnitudes_at(run, t, x, run->magnitudes);
  for (int k = 0; k < mode->surfaces; k++) {
    inside[k] = 0;
    if (k >= mode->edges || mode->edge[k].conditional) continue;
    if (raised) return RAISED;
    inside[k] = run->values[k] < -bound_from(run, run->magnitudes, k, t, x, 1);
  }
  return 0;
}

/* Forget the surfaces that the state stood on and has left: inwards, or outwards where `if` was false. */
static void leave(hs_run *run, hs_time t, const hs_real *x) {
  const hs_mode *const mode = run->here.table;
  if (mode->values(run->here.p, t, x, run->values)) return;
  const int raised = magnitudes_at(run, t, x, run->magnitudes);
  for (int k = 0; !raised && k < mode->surfaces; k++) {
    if (!run->active_surfaces[k]) continue;
    if (fabs(run->values[k]) > bound_from(run, run->magnitudes, k, t, x, 0))
      run->active_surfaces[k] = 0, run->here.standing--;
  }
  for (int k = 0; run->here.emerging && k < mode->surfaces; k++) {
    hs_real rate = 0.0;
    if (!run->emerging[k]) continue;
    if (!(run->values[k] <= 0) && (run->here.table->rates[k](run->here.p, t, x, &rate) || rate < 0)) continue;
    run->emerging[k] = 0, run->here.emerging--;
  }
}

/* |grad r| in (t, x). */
static int norm_of(hs_run *run, hs_time t, const hs_real *x, int k, hs_real *norm) {
  hs_real total = 0.0;
  const hs_sparse *const row = &run->here.table->gradients[k];
  if (row->values(run->here.p, t, x, run->gradient)) return RAISED;
  for (int i = 0; i < row->count; i++) total = total + run->gradient[i] * run->gradient[i];
  *norm = sqrt(total);
  return 0;
}

/* Whether the `if` of edge k holds: 1, 0, or RAISED. A part that is false decides, even if another has no value. */
static int condition(hs_run *run, int k, hs_time t, const hs_real *x) {
  const hs_edge *edge = &run->here.table->edge[k];
  int answer = 1;
  for (int i = 0; i < edge->parts; i++) {
    hs_real holds;
    if (edge->condition[i](run->here.p, t, x, &holds))
      answer = RAISED;
    else if (holds == 0.0)
      return 0;
  }
  return answer;
}

/* Whether the flow points out of surface k, beyond the round-off of its rate. */
static int points_out(hs_run *run, int k, hs_time t, const hs_real *x, hs_real rate) {
  const hs_sparse *const row = &run->here.table->gradients[k];
  hs_real size = 0.0;
  if (!(rate > 0)) return 0;
  if (row->values(run->here.p, t, x, run->gradient) || run->here.table->flow(run->here.p, t, x, run->near)) return 0;
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
  if (run->here.table->rates[k](run->here.p, t + since, run->nearby, &later)) return 0;
  bend = (rate - later) / since;
  return bend > 0 && rate * rate <= 2 * bend * room;
}

/* Mark the edges on whose guards the state stands, with the flow pointing out and `if` true, which are not only touched.
   On the guard means to round-off, or within the time `since`: sums of steps are no more exact than that. */
static int standing(hs_run *run, hs_time t, const hs_real *x, hs_real since, int *found) {
  const hs_mode *const mode = run->here.table;
  const int raised = mode->edges && (mode->values(run->here.p, t, x, run->values) ||
                                     magnitudes_at(run, t, x, run->magnitudes));
  int count = 0;
  for (int k = 0; k < mode->edges; k++) {
    hs_real rate;
    found[k] = 0;
    if (raised || releases(run, k) || mode->rates[k](run->here.p, t, x, &rate)) continue;
    const hs_real noise = bound_from(run, run->magnitudes, k, t, x, 0);
    const int near = fabs(run->values[k]) <= hs_max(noise, rate * since);
    if (!near || !points_out(run, k, t, x, rate)) continue;
    if (turns_back(run, k, t, x, rate, since, noise - run->values[k])) continue;
    if (condition(run, k, t, x) == 1) found[k] = 1, count++;
  }
  return count;
}

/* Ask for the flow at a trial's end once; beyond a guard it need not have a value. */
static int ends(hs_run *run, hs_trial *trial) {
  if (!trial->looked) {
    trial->looked = 1;
    trial->ends = 0;
    if (!run->here.table->flow(run->here.p, trial->t1, run->z, run->end)) {
      const hs_real total = sum(run->end, run->here.dimension);
      trial->ends = total - total == 0;
    }
  }
  return trial->ends;
}

/* The step's interpolant, to trial->piece. */
static int piece_of(hs_run *run, hs_trial *trial) {
  if (trial->has_piece) return 0;
  if (!ends(run, trial))
    secant(run, &trial->piece);
  else if (method_piece(run, trial->t, trial->h, &trial->piece))
    return RAISED;
  trial->has_piece = 1;
  return 0;
}

/* Whether a step is beyond surface k on the way: at its eighths, and then ever nearer around the highest point. */
static int beyond_within(hs_run *run, hs_trial *trial, int k) {
  hs_real top, r, noise, place = 0.0, width = 1.0 / SCAN, shares[SCAN];
  if (surface(run, k, trial->t, run->x, &top) || surface(run, k, trial->t1, run->z, &r)) return RAISED;
  if (roundoff_bound(run, k, trial->t, run->x, 0, &noise)) return RAISED;
  if (top > noise) return 0; /* transparent, and beyond already */
  if (roundoff_bound(run, k, trial->t1, run->z, 0, &noise)) return RAISED;
  if (r > noise) return 0; /* crossed */
  int count = SCAN - 1;
  for (int i = 1; i < SCAN; i++) shares[i - 1] = (0.0 + i) / SCAN;
  while (count) {
    const hs_real crest = top;
    hs_real least = top;
    for (int i = 0; i < count; i++) {
      const hs_real s = shares[i];
      const hs_time t = trial->t + s * trial->h;
      if (piece_of(run, trial)) return RAISED;
      at(run, &trial->piece, s, run->at);
      if (surface(run, k, t, run->at, &r)) return RAISED;
      if (r > 0 && roundoff_bound(run, k, t, run->at, 0, &noise)) return RAISED;
      if (r > 0 && r > noise) return 1;
      if (r > top)
        place = s, top = r;
      else
        least = r < least ? r : least;
    }
    const int within = count == 2 && top == crest;
    if (!(width * trial->h > run->epsilon) || (within && top + (top - least) <= 0)) break;
    width = width / 2;
    count = 0;
    if (place - width > 0 && place - width < 1) shares[count++] = place - width;
    if (place + width > 0 && place + width < 1) shares[count++] = place + width;
  }
  return 0;
}

static int rate_along(hs_run *run, int k, hs_time t, const hs_real *x, const hs_real *flow, hs_real *rate) {
  const hs_sparse *const row = &run->here.table->gradients[k];
  if (row->values(run->here.p, t, x, run->gradient)) return RAISED;
  *rate = 0.0;
  for (int i = 0; i < row->count; i++)
    *rate = *rate + run->gradient[i] * (row->place[i] ? flow[row->place[i] - 1] : 1.0);
  return 0;
}

/* Look for a surface that a step went beyond and came back from, on its interpolant: its failure, or what was found. */
static hs_found excursion(hs_run *run, hs_trial *trial, hs_found found) {
  if (!ends(run, trial)) return found;
  for (int k = 0; k < run->here.table->surfaces; k++) {
    hs_real out, back;
    if (rate_along(run, k, trial->t, run->x, run->slope, &out)) continue;
    if (rate_along(run, k, trial->t1, run->z, run->end, &back)) continue;
    const int looked = run->active_surfaces[k] || (out > 0 && 0 >= back);
    if (looked && beyond_within(run, trial, k) == 1) return failure(HS_DEEP, k);
  }
  return found;
}

static int on_piece(hs_run *run, const hs_polynomial *piece, int k, hs_real s, hs_real *r) {
  at(run, piece, s, run->at);
  return surface(run, k, run->trial.t + s * run->trial.h, run->at, r);
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

/* Find the last s in [0, 1] where surface k rises through zero on an interpolant, knowing that it ends above;
   not-a-number if it never does. */
static int last_up_crossing(hs_run *run, const hs_polynomial *piece, int k, hs_real small, hs_real *theta) {
  hs_real a, fa, b = 1.0, fb;
  if (on_piece(run, piece, k, b, &fb)) return RAISED;
  for (int i = SCAN - 1; i >= 0; i--) {
    a = 1.0 * i / SCAN;
    if (on_piece(run, piece, k, a, &fa)) return RAISED;
    if (fa <= 0) return close_bracket(run, on_piece, piece, k, a, fa, b, fb, small, HS_UNIT, theta);
    b = a, fb = fa;
  }
  *theta = NAN;
  return 0;
}

/* The round-off of surface k over this step, from the step's own numbers. */
static int smallest(hs_run *run, int k, hs_real *small) {
  hs_real *const sizes = run->at;
  for (int s = 0; s < run->here.dimension; s++) sizes[s] = hs_max(fabs(run->x[s]), fabs(run->z[s]));
  if (roundoff_bound(run, k, run->trial.t1, sizes, 0, small)) return RAISED;
  *small = *small * ROOT_SHARE;
  return 0;
}

/* Whether a state may be beyond surface k without having crossed it. */
static int is_transparent(const hs_run *run, int k) {
  const hs_mode *mode = run->here.table;
  return run->emerging[k] || k >= mode->edges || mode->edge[k].conditional;
}

/* Whether a step was further beyond surface k than `end` between the crossing and its end: that is on another flank. */
static int deeper_before(hs_run *run, const hs_polynomial *piece, hs_real theta, int k, hs_real end) {
  for (int i = 1; i < SCAN; i++) {
    hs_real r;
    if (on_piece(run, piece, k, theta + (1 - theta) * i / SCAN, &r)) return RAISED;
    if (r > end) return 1;
  }
  return 0;
}

/* Where surface k was last crossed upwards on an interpolant: 1; 0 if it was beyond all along. */
static int crossed_on(hs_run *run, const hs_polynomial *piece, int k, hs_crossing *crossing) {
  const hs_trial *trial = &run->trial;
  hs_real small, theta, r, noise;
  if (smallest(run, k, &small) || last_up_crossing(run, piece, k, small, &theta)) return RAISED;
  if (theta != theta) {
    if (is_transparent(run, k)) {
      at(run, piece, 0.0, run->at);
      if (surface(run, k, trial->t + 0.0 * trial->h, run->at, &r)) return RAISED;
      if (roundoff_bound(run, k, trial->t, run->x, 0, &noise)) return RAISED;
      if (r > noise) return 0;
    }
    theta = 0.0; /* on the surface to round-off: it is crossed as the step begins */
  }
  crossing->theta = theta;
  crossing->time = theta == 0 ? trial->t : trial->t + theta * trial->h;
  if (theta == 0)
    copy(crossing->state, run->x, run->here.dimension);
  else
    at(run, piece, theta, crossing->state);
  return 1;
}

/* How far the flow at a crossing would take r back inside over this step; 0 when not beyond round-off. */
static int inward_of(hs_run *run, int k, const hs_crossing *crossing, hs_real *inward) {
  hs_real rate;
  if (run->here.table->rates[k](run->here.p, crossing->time, crossing->state, &rate)) return RAISED;
  *inward = -rate * run->trial.h;
  if (!(*inward > run->noise[k])) *inward = 0.0;
  return 0;
}

/* Whether the `if` of edge k holds next, on whose surface the state is, after a hop that round-off hides: where the
   flow comes back to the surface, which is at `end` at the step's end. */
static int holds_after_hop(hs_run *run, const hs_polynomial *piece, int k, const hs_crossing *crossing, hs_real end) {
  const hs_trial *trial = &run->trial;
  hs_real rate;
  if (run->here.table->rates[k](run->here.p, crossing->time, crossing->state, &rate)) return RAISED;
  const hs_real back = -rate * trial->h;
  if (!(back > 0)) return holds_next(run, k, crossing->time, crossing->state);
  const hs_real s = crossing->theta + (1 - crossing->theta) * (back / (back + end));
  at(run, piece, s, run->near);
  return holds_next(run, k, trial->t + s * trial->h, run->near);
}

/* 1 where the trial's end is too deep beyond surface k, or its depth is not defined (`found` says which). */
static int too_deep(hs_run *run, int k, const hs_real *values, hs_found *found) {
  hs_real norm;
  if (norm_of(run, run->trial.t1, run->z, k, &norm)) return RAISED;
  if (!(norm > 0)) return *found = failure(HS_FLAT, k), 1;
  if (values[k] <= run->epsilon * norm + run->noise[k]) return 0;
  return *found = failure(HS_DEEP, k), 1;
}

/* Find the last up-crossing of surface k: 1 with the crossing, 0 where it is transparent there, or with an failure. */
static int crossing_of(hs_run *run, int k, const hs_real *values, hs_crossing *crossing, hs_found *found) {
  hs_trial *trial = &run->trial;
  const hs_polynomial *piece = &trial->piece;
  hs_real norm, inward;
  int status = piece_of(run, trial);
  if (status) return status;
  status = crossed_on(run, piece, k, crossing);
  if (status != 1) return status;
  if (norm_of(run, trial->t1, run->z, k, &norm) || inward_of(run, k, crossing, &inward)) return RAISED;
  if (inward != 0 && inward <= run->epsilon * norm) {
    if (trial->ends) {
      hermite(run, trial->h, &run->cubic);
      piece = &run->cubic;
    }
    if (crossed_on(run, piece, k, crossing) == RAISED || inward_of(run, k, crossing, &inward)) return RAISED;
  }
  if (inward != 0) return *found = failure(HS_INWARD, k), 0;
  status = condition(run, k, crossing->time, crossing->state);
  if (!status && (crossing->theta == 0 || run->active_surfaces[k]))
    status = holds_after_hop(run, piece, k, crossing, values[k]);
  if (status != 1) return status;
  status = too_deep(run, k, values, found);
  if (status) return status == RAISED ? RAISED : 0;
  status = deeper_before(run, piece, crossing->theta, k, values[k] + run->noise[k]);
  if (status) return status == RAISED ? RAISED : (*found = failure(HS_DEEP, k), 0);
  crossing->edge = k;
  crossing->depth = hs_min(run->epsilon, values[k] / norm);
  crossing->piece = piece;
  return 1;
}

/* Say whether a trial's end is in the relaxed domain: inside (no crossing), in strips, or neither.
   `values` are those of the surfaces there. */
static int judge(hs_run *run, const hs_real *values, hs_found *found) {
  const hs_mode *mode = run->here.table;
  *found = CLEAR;
  for (int k = 0, looked = 0; k < mode->surfaces; k++) {
    if (values[k] <= 0) continue;
    if (!looked++ && magnitudes_at(run, run->trial.t1, run->z, run->magnitudes)) return RAISED;
    run->noise[k] = bound_from(run, run->magnitudes, k, run->trial.t1, run->z, 0);
  }
  for (int k = 0; k < mode->surfaces; k++) {
    if (values[k] <= 0 || values[k] <= run->noise[k]) continue;
    if (k >= mode->edges && !run->emerging[k]) return *found = failure(HS_WALL, k), 0;
    if (is_transparent(run, k)) continue;
    const int status = too_deep(run, k, values, found);
    if (status) return status == RAISED ? RAISED : 0;
  }
  int count = 0;
  for (int k = 0; k < mode->edges; k++) {
    if (values[k] <= 0 || values[k] <= run->noise[k]) continue;
    const int status = crossing_of(run, k, values, &run->crossings[count], found);
    if (status == RAISED) return RAISED;
    if (found->failure != HS_CLEAR) return 0;
    count += status;
  }
  found->crossings = count;
  return 0;
}
