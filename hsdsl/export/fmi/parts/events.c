/* Events in model exchange.

   Surface k of a mode has the indicator max(margin - r, -length * rate): positive inside the domain, and beyond the
   surface as long as the flow leads back. It falls through zero where the state is beyond by the margin and moves on
   outwards. A state may be beyond an edge with a condition without having crossed it: inside, the indicator is
   margin - r; outside, margin / 4 - r. So an event is on the side that it leads to, even where an indicator is zero.
   The margin is far above what a search for roots leaves, so that nothing stays undecided, and far below any
   state. The state is then taken back along the flow onto the surface, so no reset begins beyond it. */

#include "events.h"

#include <string.h>

#include "hs_math.h"

#define MARGIN 0x1p-32    /* relative to the sizes of states */
#define ROUNDOFF 0x1p-14  /* of a margin: what counts as on a surface where an input jumps */
#define MOST_AT_ONCE 1000 /* transitions at one instant */
#define MOST_RESETS 60    /* until they change nothing */

/* The values of all surfaces and the rates of one. */
static int rate_of(const hs_mode *mode, int k, const double *p, double t, const double *x, double *rate) {
  return mode->rates[k](p, t, x, rate) || !hs_finite(*rate);
}

static double length_of(void) { return problem_settings.largest; }

const hs_mode *fmu_table(const fmu *unit) {
  const hs_mode *mode = &hs_the_model.mode[unit->now.mode];
  return unit->now.resting < 0 ? mode : &hs_the_model.mode[mode->held];
}

int32_t fmu_segment_at(double time) {
  int32_t low = 0, high = PROBLEM_SEGMENTS;
  while (high - low > 1) {
    const int32_t middle = (low + high) / 2;
    if (time < problem_timeline.start[middle])
      high = middle;
    else
      low = middle;
  }
  return low;
}

void fmu_enter(fmu *unit, int mode, int edge, const double *after) {
  const hs_mode *source = &hs_the_model.mode[mode];
  const hs_edge *made = &source->edge[edge];
  const hs_mode *target = &hs_the_model.mode[made->target];
  const hs_mode *named = target->dimension ? target : source; /* a final mode without a flow keeps the states */
  for (int s = 0; s < made->target_dimension; s++) unit->now.state[named->state[s]] = after[s];
  unit->now.mode = made->target;
  if (target->final) unit->now.ended = 1;
}

/* All slopes of surface k, by time and the states. */
static int gradient_of(const hs_mode *mode, int k, const double *p, double t, const double *x, double *out) {
  if (mode->gradients[k].values(p, t, x, out)) return 1;
  hs_spread_out(&mode->gradients[k], mode->dimension + 1, out);
  return 0;
}

/* The state behind the reset of edge k. */
static int reset_of(const hs_mode *mode, int k, const double *p, double t, const double *x, double *after) {
  return hs_changed(&mode->edge[k], mode->edge[k].reset, p, t, x, x, after);
}

/* Sizes of states, and from them the margins of the present mode's surfaces. */
static int set_margins(fmu *unit) {
  fmu_data *const now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  double x[PROBLEM_WIDTH + 1], gradient[PROBLEM_WIDTH + 2];
  const double *p = fmu_bind(unit);
  for (int i = 0; i < PROBLEM_STATES; i++)
    now->scale[i] = hs_max(hs_max(now->scale[i], fmu_nominal[i]), fabs(now->state[i]));
  fmu_local(unit, x);
  for (int k = 0; k < mode->surfaces; k++) {
    if (gradient_of(mode, k, p, now->time, x, gradient)) return 1;
    double size = fabs(gradient[0]) * hs_max(10 * length_of(), fabs(now->time));
    for (int s = 0; s < mode->dimension; s++) size = size + fabs(gradient[s + 1]) * now->scale[mode->state[s]];
    if (!hs_finite(size)) return 1;
    now->margin[k] = MARGIN * size;
  }
  return 0;
}

/* The slope of surface k's rate along the flow: positive where the flow pushes the state out. */
static int push_of(const hs_mode *mode, int k, const double *p, double t, const double *x, double *push) {
  double f[PROBLEM_WIDTH + 1], ahead[PROBLEM_WIDTH + 1], here, there, span = sqrt(0x1p-53) * length_of();
  if (mode->flow(p, t, x, f)) return 1;
  for (int s = 0; s < mode->dimension; s++) ahead[s] = x[s] + span * f[s];
  if (rate_of(mode, k, p, t, x, &here) || rate_of(mode, k, p, t + span, ahead, &there)) return 1;
  *push = (there - here) / span;
  return 0;
}

/* Whether surface k ends the motion along the guard that holds the state. */
static int lets_go(const fmu *unit, int k) {
  const fmu_data *now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  if (now->resting < 0 || k >= mode->edges) return 0;
  return mode->edge[k].releases == hs_the_model.mode[now->mode].edge[now->resting].contact;
}

/* Whether a state may be beyond surface k without having crossed it. */
static int may_be_beyond(const fmu *unit, int k) {
  const hs_mode *mode = fmu_table(unit);
  return k < mode->edges && mode->edge[k].conditional && !lets_go(unit, k);
}

/* The indicator of surface k. */
static int indicator(const fmu *unit, int k, const double *p, const double *x, const double *r, double *z) {
  const fmu_data *now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  double rate;
  *z = (now->outside[k] ? now->margin[k] / 4 : now->margin[k]) - r[k];
  if (!may_be_beyond(unit, k) && !rate_of(mode, k, p, now->time, x, &rate)) /* the flow may end at the surface */
    *z = hs_max(*z, -length_of() * rate);
  return !hs_finite(*z);
}

fmu_status fmu_get_indicators(fmu *unit, double *z) {
  double x[PROBLEM_WIDTH + 1], r[PROBLEM_SURFACES + 1];
  const hs_mode *mode = fmu_table(unit);
  const double *p = fmu_bind(unit);
  for (int k = 0; k < PROBLEM_SURFACES; k++) z[k] = 1.0;
  if (!p) return FMU_NO_VALUE;
  if (unit->now.ended) return FMU_OK;
  fmu_local(unit, x);
  if (mode->values(p, unit->now.time, x, r)) return FMU_NO_VALUE;
  for (int k = 0; k < mode->surfaces; k++)
    if (indicator(unit, k, p, x, r, &z[k])) return FMU_NO_VALUE;
  return FMU_OK;
}

/* The point of surface k that is nearest to x, relative to the sizes of states. */
static int projected(const fmu *unit, const hs_mode *mode, int k, const double *p, double t, double *x) {
  double g[PROBLEM_WIDTH + 2], r[PROBLEM_SURFACES + 1], total = 0.0;
  if (mode->values(p, t, x, r) || gradient_of(mode, k, p, t, x, g)) return 1;
  for (int s = 0; s < mode->dimension; s++) {
    const double size = unit->now.scale[mode->state[s]];
    total = total + g[s + 1] * size * g[s + 1] * size;
  }
  if (!(total > 0)) return 0;
  for (int s = 0; s < mode->dimension; s++) {
    const double size = unit->now.scale[mode->state[s]];
    x[s] = x[s] - r[k] / total * g[s + 1] * size * size;
  }
  return 0;
}

/* Where the flow through x crossed surface k: time and state, to round-off; 1 where it has no value or turns before. */
static int crossed(const hs_mode *mode, int k, const double *p, double *t, double *x) {
  double f[PROBLEM_WIDTH + 1], r[PROBLEM_SURFACES + 1], rate;
  for (int i = 0; i < 4; i++) {
    if (mode->values(p, *t, x, r) || rate_of(mode, k, p, *t, x, &rate) || mode->flow(p, *t, x, f)) return 1;
    if (!(rate > 0)) return 1;
    if (r[k] == 0) return 0;
    for (int s = 0; s < mode->dimension; s++) x[s] = x[s] - r[k] / rate * f[s];
    *t = *t - r[k] / rate;
  }
  return rate_of(mode, k, p, *t, x, &rate) || !(rate > 0);
}

/* Take a state that is beyond surface k back onto it: along the flow, else straight. */
static int taken_back(const fmu *unit, const hs_mode *mode, int k, const double *p, double *t, double *x) {
  double q[PROBLEM_WIDTH + 1], at = *t;
  memcpy(q, x, sizeof q);
  if (crossed(mode, k, p, &at, q)) return projected(unit, mode, k, p, *t, x);
  memcpy(x, q, sizeof q);
  *t = at;
  return 0;
}

static int holds(const hs_mode *mode, int k, const double *p, double t, const double *x) {
  double answer;
  for (int i = 0; i < mode->edge[k].parts; i++)
    if (mode->edge[k].condition[i](p, t, x, &answer) || answer == 0.0) return 0;
  return 1;
}

/* Whether the state is beyond surface k on entry: also an edge that an input's jump carried from inside onto zero. */
static int entered_beyond(const fmu *unit, int k, double r) {
  const fmu_data *now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  const double noise = ROUNDOFF * now->margin[k];
  if (may_be_beyond(unit, k)) return 0;
  return r > now->margin[k] || (k < mode->edges && now->left_known && now->left[k] < -noise && r >= -noise);
}

/* Whether surface k fires: crossed since the last event and above a level, or beyond on `entry`. A flow that has no
   value beyond a surface counts as leading out. */
static int fires(const fmu *unit, int k, const double *p, const double *x, const double *r, double level, int entry) {
  const fmu_data *now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  const int wall = k >= mode->edges;
  double rate, t = now->time, q[PROBLEM_WIDTH + 1];
  if (entry && entered_beyond(unit, k, r[k])) return 1;
  if (now->outside[k] || !(r[k] > level)) return 0;
  if (!rate_of(mode, k, p, t, x, &rate) && !(rate > 0)) return 0;
  if (wall) return 1;
  memcpy(q, x, sizeof q);
  return !taken_back(unit, mode, k, p, &t, q) && holds(mode, k, p, t, q);
}

/* What fires: of the edges crossed, and of those within the margin then, the one of highest priority, the first of them
   in the file; else a wall; else -1. */
static int first_of(const fmu *unit, const double *p, const double *x, const double *r, int entry) {
  const hs_mode *mode = fmu_table(unit);
  const double *const margin = unit->now.margin;
  int chosen = -1;
  for (int k = 0; k < mode->surfaces && chosen < 0; k++)
    if (fires(unit, k, p, x, r, margin[k] / 2, entry)) chosen = k;
  if (chosen < 0) return chosen;
  for (int k = 0; k < mode->edges; k++) {
    const int later = chosen < mode->edges && mode->edge[k].priority <= mode->edge[chosen].priority && k > chosen;
    if (k != chosen && !later && fires(unit, k, p, x, r, entry ? margin[k] / 2 : -margin[k], entry))
      if (chosen >= mode->edges || mode->edge[k].priority >= mode->edge[chosen].priority) chosen = k;
  }
  return chosen;
}

/* The state that resets of edge k run to. */
static int fixed_point(const hs_mode *mode, int k, const double *p, double t, double *x) {
  double one[PROBLEM_WIDTH + 1], two[PROBLEM_WIDTH + 1];
  for (int i = 0; i < MOST_RESETS; i++) {
    int same = 1;
    if (reset_of(mode, k, p, t, x, one) || reset_of(mode, k, p, t, one, two)) return 1;
    for (int s = 0; s < mode->dimension; s++) {
      const double bend = two[s] - 2 * one[s] + x[s];
      const double next = bend != 0 ? x[s] - (one[s] - x[s]) * (one[s] - x[s]) / bend : two[s];
      same &= next == x[s];
      x[s] = next;
    }
    if (same) return 0;
  }
  return 1;
}

/* Go on along the guard of edge k, where a flight after its reset would not leave the margin: 1; 0 where flights go on;
   -1 where they end and nothing says how to go on. */
static int rests(fmu *unit, int k, const double *p, double t, const double *before) {
  fmu_data *const now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  double x[PROBLEM_WIDTH + 1], q[PROBLEM_WIDTH + 1], r[PROBLEM_SURFACES + 1], rate, push;
  fmu_local(unit, x);
  if (rate_of(mode, k, p, t, x, &rate) || push_of(mode, k, p, t, x, &push)) return 0;
  if (!(push > 0) || !(rate <= 0) || !(rate * rate < 2 * push * now->margin[k])) return 0;
  memcpy(q, before, sizeof q);
  if (fixed_point(mode, k, p, t, q) || mode->values(p, t, q, r)) return 0;
  if (!(fabs(r[k]) <= now->margin[k])) return 0; /* it leads away from the guard */
  if (mode->edge[k].contact < 0 || !problem_settings.contacts) return -1;
  now->resting = k;
  if (hs_the_model.mode[mode->held].values(fmu_bind(unit), t, q, r) || !(r[k] < 0)) return now->resting = -1, 0;
  for (int s = 0; s < mode->dimension; s++) now->state[mode->state[s]] = q[s];
  return 1;
}

/* Mark the edges with a condition that the state is beyond at time t without having crossed them; those that it had
   `crossed` in a mode that stays may fire. */
static int enter_surfaces(fmu *unit, double t, const hs_mode *before, const int *crossed) {
  fmu_data *const now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  double x[PROBLEM_WIDTH + 1], r[PROBLEM_SURFACES + 1];
  memset(now->outside, 0, sizeof now->outside);
  now->left_known = 0;
  if (set_margins(unit)) return 1;
  fmu_local(unit, x);
  if (mode->values(fmu_bind(unit), t, x, r)) return 0;
  for (int k = 0; k < mode->edges; k++)
    now->outside[k] = may_be_beyond(unit, k) && r[k] > now->margin[k] && !(mode == before && crossed[k]);
  return 0;
}

/* Make the transition of edge k; why the run ends, if it does. */
static const char *make(fmu *unit, int k, const double *p, double *x, const double *r, int entry) {
  fmu_data *const now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  double after[PROBLEM_WIDTH + 1], t = now->time;
  const int source = now->mode;
  int crossed[PROBLEM_SURFACES + 1];
  for (int j = 0; j < mode->edges; j++) crossed[j] = j != k && !now->outside[j] && r[j] > now->margin[j] / 2;
  if (!entry && taken_back(unit, mode, k, p, &t, x)) return "not_finite";
  if (reset_of(mode, k, p, t, x, after)) return "not_finite";
  for (int s = 0; s < mode->edge[k].target_dimension; s++)
    if (!hs_finite(after[s])) return "not_finite";
  const hs_mode *const own = &hs_the_model.mode[source], *const next = &hs_the_model.mode[mode->edge[k].target];
  const int full = hs_let_wait(&hs_the_model, unit->run.waiting.tail, &unit->run.task, own, x, next, after);
  if (full >= 0) return fmu_too_many_wait;
  fmu_enter(unit, source, k, after);
  now->jumps++;
  now->resting = -1;
  if (now->mode == source && rests(unit, k, p, now->time, x) < 0) return "zeno";
  return !now->ended && enter_surfaces(unit, t, mode, crossed) ? "not_finite" : 0;
}

/* The values of all surfaces now. */
static int values_now(fmu *unit, double *r) {
  double x[PROBLEM_WIDTH + 1];
  const double *p = fmu_bind(unit);
  fmu_local(unit, x);
  return !p || fmu_table(unit)->values(p, unit->now.time, x, r);
}

/* Which edges with a condition the state is beyond and did not fire; where inputs `jumped`, those that it was inside
   before, as it has not crossed them. */
static int set_outside(fmu *unit, int jumped) {
  fmu_data *const now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  double r[PROBLEM_SURFACES + 1];
  if (values_now(unit, r)) return 1;
  for (int k = 0; k < mode->edges; k++)
    if (may_be_beyond(unit, k) && (!jumped || !(now->left[k] > now->margin[k] / 2)))
      now->outside[k] = r[k] > now->margin[k] / 2;
  return 0;
}

void fmu_enter_events(fmu *unit) {
  fmu_data *const now = &unit->now;
  now->left_known = !unit->co_simulation && !now->ended && !values_now(unit, now->left);
}

/* Make the transitions that are due; why the run ends, if it does. */
static const char *transitions(fmu *unit, int entry) {
  fmu_data *const now = &unit->now;
  double x[PROBLEM_WIDTH + 1], r[PROBLEM_SURFACES + 1];
  for (int count = 0; count < MOST_AT_ONCE && !now->ended; count++) {
    const hs_mode *mode = fmu_table(unit);
    const double *p = fmu_bind(unit);
    fmu_local(unit, x);
    if (set_margins(unit) || mode->values(p, now->time, x, r)) return "not_finite";
    const int k = first_of(unit, p, x, r, entry);
    if (k < 0) return 0;
    if (k >= mode->edges) return "left_domain";
    if (lets_go(unit, k)) {
      now->resting = -1;
      if (enter_surfaces(unit, now->time, 0, 0)) return "not_finite";
      continue;
    }
    const char *const ends = make(unit, k, p, x, r, entry && entered_beyond(unit, k, r[k]));
    if (ends) return ends;
    entry = 1;
  }
  return now->ended ? 0 : "zeno: more than a thousand transitions at one instant";
}

/* Whether a time is reached, to the round-off of sums. */
static int has_come(double time, double start) { return time >= start - 0x1p-50 * fabs(start); }

fmu_status fmu_update(fmu *unit, int *jumped, double *next) {
  fmu_data *const now = &unit->now;
  const int64_t jumps = now->jumps;
  const int resting = now->resting, segments = PROBLEM_SEGMENTS;
  int entry = now->changed;
  *jumped = 0;
  *next = INFINITY;
  if (unit->co_simulation) {
    *jumped = now->shows_before;
    now->shows_before = 0;
    return FMU_OK;
  }
  if (!fmu_bind(unit)) return FMU_ERROR;
  while (now->segment + 1 < segments && has_come(now->time, problem_timeline.start[now->segment + 1])) {
    now->segment++;
    entry |= problem_timeline.jump[now->segment];
    unit->bound = 0;
  }
  now->changed = 0;
  if (!now->events++ && enter_surfaces(unit, now->time, 0, 0)) return FMU_ERROR;
  if (entry && now->left_known && !now->ended) (void)set_outside(unit, 1); /* no value ends the run below */
  if (!now->ended && (unit->complaint = transitions(unit, entry)) != 0) now->ended = 1;
  now->left_known = 0;
  if (!now->ended && set_outside(unit, 0)) return FMU_ERROR;
  *jumped = now->jumps != jumps || now->resting != resting;
  if (now->segment + 1 < segments) *next = problem_timeline.start[now->segment + 1];
  return FMU_OK;
}
