/* Rest on a guard (M11): a state that its own reset keeps in place while the flow pushes it out, how long its guard
   holds it, and the steps of that time; run->held is what holds it. See hsdsl/simulate/sticking.py.
   Functions return 1 or 0, or RAISED where a routine has no value. */

#include "functions.h"

#define CORRECTIONS 8
#define LOOKS 8
#define LARGEST_SHARE 0.1
#define SAME_UNITS 4
#define ZERO_UNITS 16

/* For each state the size that its flow has had, to run->flow_sizes; `slope` is the flow. See simulate/scales.py. */
static int flow_sizes(hs_run *run, hs_time t, const hs_real *x, const hs_real *slope) {
  const int n = run->here.dimension;
  if (run->here.table->jacobian(run->here.p, t, x, run->jacobian)) return RAISED;
  for (int i = 0; i < n; i++) {
    hs_real size = fabs(slope[i]);
    for (int j = 0; j < n; j++) size = size + fabs(run->jacobian[i * n + j]) * run->scales[j];
    run->flow_sizes[i] = size;
  }
  return 0;
}

/* A time in which no state moves by more than about half the digits of its scale. */
static hs_real instant(const hs_run *run, const hs_real *slope) {
  hs_real least = run->until;
  for (int s = 0; s < run->here.dimension; s++) {
    const hs_real scale = run->scales[s], speed = fabs(slope[s]);
    if (scale > 0 && least * speed > scale) least = scale / speed;
  }
  return sqrt(HS_UNIT) * least;
}

/* How far a state that rests may be moved. */
static hs_real rest_noise(const hs_run *run, int s) { return SAME_UNITS * HS_UNIT * run->scales[s]; }

/* Whether edge k is possible and its reset leaves the state where it is, on a surface that does not move. */
static int stays(hs_run *run, hs_time t, const hs_real *x, int k) {
  const hs_mode_state *here = &run->here;
  int still = 1;
  if (here->table->edge[k].reset(here->p, t, x, run->after)) return RAISED;
  for (int s = 0; s < here->dimension; s++)
    still &= fabs(run->after[s] - x[s]) <= rest_noise(run, s);
  if (!still) return 0;
  if (here->table->gradients[k](here->p, t, x, run->gradient)) return RAISED;
  return run->gradient[0] == 0 ? condition(run, k, t, x) : 0;
}

/* Which derivative of the surface along the flow decides: 1 or 2; 0 where the first one points inwards. */
static int push_order(hs_run *run, hs_time t, const hs_real *x, int k) {
  const hs_mode_state *here = &run->here;
  hs_real rate, size = 0.0;
  if (here->table->flow(here->p, t, x, run->end) || here->table->gradients[k](here->p, t, x, run->gradient) ||
      here->table->rates[k](here->p, t, x, &rate) || flow_sizes(run, t, x, run->end))
    return RAISED;
  for (int s = 0; s < here->dimension; s++) size = size + fabs(run->gradient[s + 1]) * run->flow_sizes[s];
  if (fabs(rate) <= ZERO_UNITS * HS_UNIT * size) return 2;
  return rate > 0;
}

/* The first or second derivative of surface k along the flow through x, at time t. */
static int push(hs_run *run, hs_time t, const hs_real *x, int k, int order, hs_real *value) {
  const hs_mode_state *here = &run->here;
  const hs_mode *mode = here->table;
  hs_real ahead;
  if (order == 1) return mode->rates[k](here->p, t, x, value);
  if (mode->series) {
    if (mode->series(here->p, 2, t, x, run->second) || mode->surface_series(here->p, 2, run->second)) return RAISED;
    if (mode->surface_line[k] >= 0) return *value = 2 * run->second[4 * mode->surface_line[k] + 2], 0;
  }
  if (mode->flow(here->p, t, x, run->end)) return RAISED;
  const hs_real small = instant(run, run->end);
  for (int s = 0; s < here->dimension; s++) run->at[s] = x[s] + small * run->end[s];
  if (mode->rates[k](here->p, t + small, run->at, &ahead) || mode->rates[k](here->p, t, x, value)) return RAISED;
  *value = (ahead - *value) / small;
  return 0;
}

/* Whether the flow leaves the domain through surface k: by its rate, or where that is zero by the next one. */
static int is_pushed(hs_run *run, hs_time t, const hs_real *x, int k) {
  const int order = push_order(run, t, x, k);
  hs_real value;
  if (order <= 0) return order;
  return push(run, t, x, k, order, &value) ? RAISED : value > 0;
}

/* Whether the flow moves the state only in the direction that the reset takes back. */
static int moves_alone(hs_run *run, hs_time t, const hs_real *x, int k) {
  const hs_mode_state *here = &run->here;
  const int n = here->dimension;
  hs_real *const slope = run->end, *const ahead = run->at, *const back = run->after;
  if (here->table->flow(here->p, t, x, slope)) return RAISED;
  int along = -1;
  for (int s = 0; s < n; s++)
    if (slope[s] != 0) along = along < 0 ? s : along;
  if (along < 0) return 0;
  if (flow_sizes(run, t, x, slope)) return RAISED;
  const hs_real small = instant(run, slope);
  for (int s = 0; s < n; s++) ahead[s] = x[s] + small * slope[s];
  if (here->table->edge[k].reset(here->p, t, ahead, back)) return RAISED;
  for (int s = 0; s < n; s++) back[s] = back[s] - ahead[s], ahead[s] = rest_noise(run, s);
  return takes_back(slope, back, run->flow_sizes, ahead, n);
}

/* The edge on whose guard the state rests; -1 where it moves. */
static int rests(hs_run *run) {
  const hs_mode_state *here = &run->here;
  if (!here->standing || here->dimension != here->table->dimension || !here->dimension) return -1;
  for (int k = 0; k < here->table->edges; k++)
    if (run->active_surfaces[k] && here->table->edge[k].target == here->mode && stays(run, here->t, run->x, k) == 1 &&
        is_pushed(run, here->t, run->x, k) == 1 && moves_alone(run, here->t, run->x, k) == 1)
      return k;
  return -1;
}

/* The longest step over a state at rest. */
static hs_real longest_rest(const hs_run *run) { return run->until * LARGEST_SHARE; }

/* The push of the edge that holds the state, inwards, at the share s of the window. */
static int inward(hs_run *run, hs_real s, hs_real *value) {
  const hs_held *held = &run->held;
  if (push(run, held->start + s * held->width, run->x, held->edge, held->order, value)) return RAISED;
  *value = -*value;
  return 0;
}

static int nothing_more(hs_run *run, int k, hs_real *allowed) {
  (void)run, (void)k;
  *allowed = 0.0;
  return 0;
}

/* When the push falls through zero, isolated on an interpolant over time, then solved on the push itself. */
static int pushed_until(hs_run *run, hs_time start, hs_time end, hs_time *until) {
  run->held.start = start, run->held.width = end - start;
  *until = end;
  if (interpolated(run, inward, 1, &run->task->interpolation[HS_OVER_TIME], nothing_more, 0, MOST_PIECES, 0))
    return RAISED;
  run->bernstein_of = 0;
  hs_walk walk = begin_walk(0, 0.0, 0, 0);
  hs_rise rise;
  if (!next_rise(run, &walk, &rise)) return 0;
  hs_real s = rise.share, value;
  for (int i = 0; i < CORRECTIONS && rise.slope != 0; i++) {
    if (inward(run, s, &value)) return RAISED;
    s = hs_min(1.0, hs_max(0.0, s - value / rise.slope));
  }
  *until = start + s * run->held.width;
  return 0;
}

/* Whether the edge and its reset keep the state in place at time t: 1, 0 or RAISED. */
static int keeps(hs_run *run, hs_time t) {
  const int still = stays(run, t, run->x, run->held.edge);
  return still == 1 ? moves_alone(run, t, run->x, run->held.edge) : still;
}

/* When the edge or its reset no longer keeps the state in place, as where its `if` ends: by looks, then halving. */
static int kept_until(hs_run *run, hs_time start, hs_time end, hs_time *until) {
  hs_time last = start, middle;
  for (int i = 1; i <= LOOKS; i++) {
    hs_time t = start + (end - start) * i / LOOKS;
    int answer = keeps(run, t);
    if (answer == RAISED) return RAISED;
    if (answer) {
      last = t;
      continue;
    }
    while (last < (middle = (last + t) / 2) && middle < t) {
      if ((answer = keeps(run, middle)) == RAISED) return RAISED;
      if (answer)
        last = middle;
      else
        t = middle;
    }
    return *until = t, 0;
  }
  return *until = end, 0;
}

/* Until when the guard of edge k holds the state, at most to the end of the inputs' segment: 1; 0 where it is not held
   for any time, or something has no value later on. */
static int release(hs_run *run, int k, hs_time *until) {
  const hs_time from = run->here.t, end = run->task->timeline->end[run->here.segment];
  hs_time t = from, released;
  run->held.edge = k;
  run->held.order = push_order(run, from, run->x, k);
  if (run->held.order <= 0) return 0;
  while (t < end) {
    const hs_time t1 = earlier(t + longest_rest(run), end);
    if (pushed_until(run, t, t1, &released) || kept_until(run, t, released, until)) return 0;
    if (*until < t1) return *until > from;
    t = t1;
  }
  return *until = end, 1;
}

/* Make one step over a state at rest, shorter where surfaces vary too fast for one. */
static hs_step_failure next_rest(hs_run *run, int n, hs_time limit) {
  const hs_time t = run->here.t;
  hs_span *const span = &run->span;
  hs_real h = longest_rest(run);
  hs_time t1;
  for (;; h = h / 2) {
    t1 = end_of_step(t, &h, limit);
    if (!(t1 > t)) return HS_NOT_FINITE;
    begin_span(run, h, t1);
    span->piece.degree = 1;
    for (int s = 0; s < n; s++) span->piece.c[s] = span->largest[s] = 0.0;
    copy(run->z, run->x, n);
    if (!curves_along(run) && !run->here.table->values(run->here.p, t1, run->z, run->ends)) return HS_CLEAR;
  }
}
