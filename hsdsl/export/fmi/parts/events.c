/* Events in model exchange: which surfaces fire, and what they make.

   What the caller gives may be set at any time, and again. It has jumped where values differ at an event from those that
   the event began with: first comes what is due with the old values, then what the state is beyond with the new ones.
   Callers may find an event with one value of an input and begin it with a later one: what they saw comes before. */

#include "events.h"

#include <string.h>

#include "hs_math.h"

#define ROUNDOFF 0x1p-14  /* of a margin: what counts as on a surface where an input jumps */
#define MOST_AT_ONCE 1000 /* transitions at one instant, or in a row from a surface that the state does not leave */
#define MOST_ON 16        /* of these where an input moves the surface ever further past the state */
#define MOST_RESETS 60    /* until they change nothing */

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

/* The state after the reset of edge k. */
static int reset_of(const hs_mode *mode, int k, const double *p, double t, const double *x, double *after) {
  return hs_changed(&mode->edge[k], &mode->edge[k].reset, p, t, x, x, after);
}

/* The slope of surface k's rate along the flow: positive where the flow pushes the state out. */
static int push_of(const hs_mode *mode, int k, const double *p, double t, const double *x, double *push) {
  double f[PROBLEM_WIDTH + 1], ahead[PROBLEM_WIDTH + 1], here, there, span = sqrt(0x1p-53) * problem_settings.largest;
  if (mode->flow(p, t, x, f)) return 1;
  for (int s = 0; s < mode->dimension; s++) ahead[s] = x[s] + span * f[s];
  if (fmu_rate_of(mode, k, p, t, x, &here) || fmu_rate_of(mode, k, p, t + span, ahead, &there)) return 1;
  *push = (there - here) / span;
  return 0;
}

static int holds(const hs_mode *mode, int k, const double *p, double t, const double *x) {
  double answer;
  for (int i = 0; i < mode->edge[k].parts; i++)
    if (hs_call(&mode->edge[k].condition[i], p, t, x, &answer) || answer == 0.0) return 0;
  return 1;
}

/* Whether the state is beyond surface k on entry. Where what is given has changed, that has carried it there: also an
   edge from inside onto zero. */
static int entered_beyond(const fmu *unit, int k, double r) {
  const fmu_data *now = &unit->now;
  const double noise = ROUNDOFF * now->margin[k], left = unit->left[k];
  if (fmu_may_be_beyond(unit, k) || fmu_is_on(unit, k)) return 0;
  if (!unit->left_known) return r > now->margin[k];
  return r > left && (r > now->margin[k] || (k < fmu_table(unit)->edges && left < -noise && r >= -noise));
}

/* Whether surface k fires: crossed since the last event and above a level, or beyond on `entry`. A flow that has no
   value beyond a surface counts as leading out. */
static int fires(const fmu *unit, int k, const double *p, const double *x, const double *r, double level, int entry) {
  const fmu_data *now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  const int wall = k >= mode->edges, decided = fmu_is_driven(unit, k) && level > 0; /* by values alone */
  double rate, t = now->time, q[PROBLEM_WIDTH + 1];
  if (entry && entered_beyond(unit, k, r[k])) return 1;
  if (fmu_is_on(unit, k)) level = now->furthest[k] + now->margin[k] / 2;
  if (now->side[k] == FMU_OUTSIDE || !(r[k] > level)) return 0;
  if (!decided && !fmu_rate_of(mode, k, p, t, x, &rate) && !(rate > 0)) return 0;
  if (wall) return 1;
  memcpy(q, x, sizeof q);
  return !fmu_take_back(unit, k, p, r[k], &t, q) && holds(mode, k, p, t, q);
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

/* The state after the reset of edge k but for the states that it counts with. */
static int reset_without_counts(const hs_mode *mode, int k, const double *p, double t, const double *x, double *after) {
  const hs_edge *edge = &mode->edge[k];
  if (reset_of(mode, k, p, t, x, after)) return 1;
  for (int i = 0; i < edge->counts; i++) after[edge->count[i]] = x[edge->count[i]];
  return 0;
}

/* The state that resets of edge k run to. */
static int fixed_point(const hs_mode *mode, int k, const double *p, double t, double *x) {
  double one[PROBLEM_WIDTH + 1], two[PROBLEM_WIDTH + 1];
  for (int i = 0; i < MOST_RESETS; i++) {
    int same = 1;
    if (reset_without_counts(mode, k, p, t, x, one) || reset_without_counts(mode, k, p, t, one, two)) return 1;
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
  if (fmu_rate_of(mode, k, p, t, x, &rate) || push_of(mode, k, p, t, x, &push)) return 0;
  if (!(push > 0) || !(rate <= 0) || !(rate * rate < 2 * push * now->margin[k])) return 0;
  memcpy(q, before, sizeof q);
  if (fixed_point(mode, k, p, t, q) || mode->values(p, t, q, r)) return 0;
  if (!(fabs(r[k]) <= now->margin[k])) return 0; /* it leads away from the guard */
  if (fmu_is_driven(unit, k) || mode->edge[k].contact < 0 || !problem_settings.contacts) return -1;
  now->resting = k;
  if (hs_the_model.mode[mode->held].values(fmu_bind(unit), t, q, r) || !(r[k] < 0)) return now->resting = -1, 0;
  for (int s = 0; s < mode->dimension; s++) now->state[mode->state[s]] = q[s];
  return 1;
}

/* Mark the surfaces that the state is beyond at time t without being about to cross them. Those that it had `crossed` in
   a mode that stays may fire; on the surface of the edge that was `made` there it stays where the reset, which began at
   `from` beyond it, has left it. */
static int enter_surfaces(fmu *unit, double t, const hs_mode *before, const int *crossed, int made, double from) {
  fmu_data *const now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  double x[PROBLEM_WIDTH + 1], r[PROBLEM_SURFACES + 1];
  const double *const margin = now->margin;
  unit->left_known = 0;
  fmu_local(unit, x);
  if (mode->values(fmu_bind(unit), t, x, r)) return memset(now->side, 0, sizeof now->side), 0;
  if (fmu_set_margins(unit, r)) return 1;
  for (int k = 0; k < mode->surfaces; k++) {
    const int stays = mode == before;
    const int on = k == made ? fabs(r[k] - from) <= margin[k] : fmu_is_on(unit, k);
    const int outside = fmu_may_be_beyond(unit, k) && r[k] > margin[k] && !(stays && crossed[k]);
    now->side[k] = outside ? FMU_OUTSIDE : FMU_INSIDE;
    const int counts = fmu_is_driven(unit, k) && !fmu_may_be_beyond(unit, k);
    if (stays && on && counts && r[k] > margin[k] / 2) now->side[k] = FMU_ON;
    if (now->side[k] == FMU_ON && k == made) now->furthest[k] = r[k];
    now->inside_at[k] = t;
    if (!stays || k == made) now->left_at[k] = INFINITY;
    if (r[k] < -margin[k]) now->left_at[k] = hs_min(now->left_at[k], t);
    unit->made[k] = stays && (k == made || unit->made[k]);
  }
  return 0;
}

/* Make the transition of edge k; why the run ends, if it does. */
static const char *make(fmu *unit, int k, const double *p, double *x, const double *r, int entry) {
  fmu_data *const now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  double after[PROBLEM_WIDTH + 1], from[PROBLEM_SURFACES + 1], t = now->time;
  const int source = now->mode, was_on = fmu_is_on(unit, k), stayed = !(now->left_at[k] <= t);
  int crossed[PROBLEM_SURFACES + 1];
  for (int j = 0; j < mode->edges; j++) crossed[j] = j != k && !now->side[j] && r[j] > now->margin[j] / 2;
  if (!entry && fmu_take_back(unit, k, p, r[k], &t, x)) return "not_finite";
  if (reset_of(mode, k, p, t, x, after) || mode->values(p, t, x, from)) return "not_finite";
  for (int s = 0; s < mode->edge[k].target_dimension; s++)
    if (!hs_finite(after[s])) return "not_finite";
  const hs_mode *const own = &hs_the_model.mode[source], *const next = &hs_the_model.mode[mode->edge[k].target];
  const int full = hs_let_wait(&hs_the_model, unit->run.waiting.tail, &unit->run.task, own, x, next, after);
  if (full >= 0) return fmu_too_many_wait;
  fmu_enter(unit, source, k, after);
  now->jumps++;
  now->resting = -1;
  if (now->mode == source && rests(unit, k, p, now->time, x) < 0) return "zeno";
  if (now->ended) return 0;
  if (enter_surfaces(unit, t, mode, crossed, k, from[k])) return "not_finite";
  now->again = stayed && fmu_table(unit) == mode ? now->again + 1 : 0;
  if (now->again < (was_on ? MOST_ON : MOST_AT_ONCE)) return 0;
  return "zeno: transitions follow each other from one surface, which the state does not leave";
}

/* The values of all surfaces now. */
static int values_now(fmu *unit, double *r) {
  double x[PROBLEM_WIDTH + 1];
  const double *p = fmu_bind(unit);
  fmu_local(unit, x);
  return !p || fmu_table(unit)->values(p, unit->now.time, x, r);
}

/* Which surfaces the state is beyond and did not fire: of edges with a condition, and those that it is still on. */
static int set_sides(fmu *unit) {
  fmu_data *const now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  double r[PROBLEM_SURFACES + 1];
  if (values_now(unit, r)) return 1;
  for (int k = 0; k < mode->surfaces; k++) {
    if (fmu_may_be_beyond(unit, k))
      now->side[k] = r[k] > now->margin[k] / 2 ? FMU_OUTSIDE : FMU_INSIDE;
    else if (!fmu_is_on(unit, k) || !(r[k] > now->margin[k] / 4))
      now->side[k] = FMU_INSIDE;
    now->furthest[k] = hs_min(now->furthest[k], r[k]);
    now->inside_at[k] = now->time;
  }
  return 0;
}

/* Where other values are given: the state is still on the surfaces of edges whose transitions it just made. Where they
   have `jumped` it has not crossed the edges with a condition that this has carried it beyond. */
static void keep_sides(fmu *unit, int jumped) {
  fmu_data *const now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  double r[PROBLEM_SURFACES + 1];
  if (values_now(unit, r)) return; /* no value ends the run later */
  for (int k = 0; k < mode->surfaces; k++) {
    const int conditional = fmu_may_be_beyond(unit, k), beyond = r[k] > now->margin[k] / 2;
    const int inside = !(unit->left[k] > now->margin[k] / 2);
    const int stays = unit->made[k] && (fmu_is_on(unit, k) || fabs(unit->left[k]) <= now->margin[k]);
    if (conditional && inside && (jumped || stays)) now->side[k] = beyond ? FMU_OUTSIDE : FMU_INSIDE;
    if (conditional || !fmu_is_driven(unit, k) || !stays || !beyond) continue;
    now->side[k] = FMU_ON;
    now->furthest[k] = r[k];
  }
}

/* Copy the inputs that may change in time. */
static void copy_inputs(fmu_given_values *to, const fmu_given_values *from) {
  for (int i = 0; i < FMU_INPUTS; i++) {
    if (fmu_input[i].held) continue; /* it changes at events alone, whenever it was set */
    to->input[i] = from->input[i];
    to->input_set[i] = from->input_set[i];
    if (fmu_input[i].given >= 0) to->parameters[fmu_input[i].given] = to->input_set[i] ? 0.0 : 1.0;
  }
}

void fmu_enter_events(fmu *unit) {
  fmu_data *const now = &unit->now;
  const fmu_given_values seen = now->seen;
  now->at_event = 1;
  copy_inputs(&now->earlier, &now->given);
  now->seen = now->earlier;
  if (!memcmp(now->seen_state, now->state, sizeof now->state)) copy_inputs(&now->seen, &seen);
}

void fmu_leave_events(fmu *unit) { unit->now.at_event = 0; }

/* Make the transitions that are due; why the run ends, if it does. */
static const char *transitions(fmu *unit, int entry) {
  fmu_data *const now = &unit->now;
  double x[PROBLEM_WIDTH + 1], r[PROBLEM_SURFACES + 1];
  for (int count = 0; count < MOST_AT_ONCE && !now->ended; count++) {
    const hs_mode *mode = fmu_table(unit);
    const double *p = fmu_bind(unit);
    fmu_local(unit, x);
    if (mode->values(p, now->time, x, r) || fmu_set_margins(unit, r)) return "not_finite";
    const int k = first_of(unit, p, x, r, entry);
    if (k < 0) return 0;
    if (k >= mode->edges) return "left_domain";
    if (fmu_lets_go(unit, k)) {
      now->resting = -1;
      if (enter_surfaces(unit, now->time, 0, 0, -1, 0.0)) return "not_finite";
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

/* Make the transitions that are due; the run ends where that says so. */
static void settle(fmu *unit, int entry) {
  if (!unit->now.ended && (unit->complaint = transitions(unit, entry)) != 0) unit->now.ended = 1;
}

static int differ(const fmu_given_values *some, const fmu_given_values *others) {
  int differ = 0;
  for (int i = 0; i < PROBLEM_PARAMETERS; i++) differ |= some->parameters[i] != others->parameters[i];
  for (int i = 0; i < FMU_INPUTS; i++)
    differ |= some->input_set[i] != others->input_set[i] || some->input[i] != others->input[i];
  return differ;
}

int fmu_has_changed(const fmu_data *now) { return differ(&now->given, &now->earlier); }

/* Make what is due, then give other values, to which what is given has come smoothly or `jumped`. */
static void settle_and_give(fmu *unit, fmu_given_values values, int jumped) {
  settle(unit, 0);
  unit->left_known = !unit->now.ended && !values_now(unit, unit->left);
  unit->now.given = values;
  unit->now.tuned = 1;
  if (unit->left_known) keep_sides(unit, jumped);
  unit->left_known &= jumped;
}

/* Make what is due with the values that the caller found the event with, then with those that the event began with,
   from which the present ones may have `jumped`. */
static void settle_earlier(fmu *unit, int jumped) {
  fmu_data *const now = &unit->now;
  const fmu_given_values given = now->given, earlier = now->earlier;
  now->given = now->seen;
  now->tuned = 1;
  if (differ(&now->seen, &earlier)) settle_and_give(unit, earlier, 0);
  settle_and_give(unit, given, jumped);
}

/* The segment of the inputs at the present time, and whether one of them `jumped` where it begins. */
static int32_t present_segment(const fmu_data *now, int *jumped) {
  int32_t segment = now->given.segment;
  *jumped = 0;
  while (segment + 1 < PROBLEM_SEGMENTS && has_come(now->time, problem_timeline.start[segment + 1]))
    *jumped |= problem_timeline.jump[++segment];
  return segment;
}

fmu_status fmu_begin(fmu *unit) {
  unit->now.at_event = 1;
  if (enter_surfaces(unit, unit->now.time, 0, 0, -1, 0.0)) return FMU_ERROR;
  settle(unit, 1);
  return !unit->now.ended && set_sides(unit) ? FMU_ERROR : FMU_OK;
}

fmu_status fmu_update(fmu *unit, int *jumped, double *next) {
  fmu_data *const now = &unit->now;
  const int64_t jumps = now->jumps;
  const int resting = now->resting;
  int entry;
  *jumped = 0;
  *next = INFINITY;
  if (unit->co_simulation) {
    *jumped = now->shows_before;
    now->shows_before = 0;
    return FMU_OK;
  }
  if (!fmu_bind(unit)) return FMU_ERROR;
  memset(unit->made, 0, sizeof unit->made);
  now->given.segment = present_segment(now, &entry);
  unit->bound = 0;
  entry |= fmu_has_changed(now);
  if (entry || differ(&now->seen, &now->earlier)) settle_earlier(unit, entry);
  settle(unit, entry);
  unit->left_known = 0;
  now->earlier = now->seen = now->given;
  if (!now->ended && set_sides(unit)) return FMU_ERROR;
  *jumped = now->jumps != jumps || now->resting != resting;
  if (now->given.segment + 1 < PROBLEM_SEGMENTS) *next = problem_timeline.start[now->given.segment + 1];
  return FMU_OK;
}
