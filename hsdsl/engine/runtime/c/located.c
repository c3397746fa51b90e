/* The located scheme: Burden et al. 2013, Fig. 8. See hsdsl/engine/simulate/located.py. */

#include "functions.h"

#define MOST_CORRECTIONS 8

/* Whether the polynomials of surface k say that it is not crossed. */
static int is_passed_by(hs_run *run, int k) {
  const hs_curves *curves = &run->curves;
  run->bernstein_of = 0;
  if (run->active_surfaces[k]) coefficients_of(curves, 0, k)[0] = coefficients_of(curves, 0, k)[0] * 0; /* deflated */
  if (!(run->ends[k] <= 0)) return 0;
  for (int i = 0; i < curves->parts; i++)
    if (!stays_below(run, coefficients_of(curves, i, k), *degree_of(curves, i, k), *off_of(curves, i, k))) return 0;
  return 1;
}

/* Surface k at the share s of the step; the state there is run->q. */
static int residual_of(hs_run *run, const hs_polynomial *piece, int k, hs_real s, hs_real *r) {
  hs_time time;
  (void)piece;
  return span_place(run, s, &time, &run->q) || surface(run, k, time, run->q, r) ? RAISED : 0;
}

/* Close in on a rise near s where Newton's method fails (a root of higher order), if one is bracketed there. */
static int bracketed(hs_run *run, int k, hs_real *s) {
  hs_real width = 8 * HS_UNIT * hs_max(*s, HS_UNIT), below, above;
  while (width < 1) {
    const hs_real low = hs_max(*s * 0, *s - width), high = hs_min(1.0, *s + width);
    if (residual_of(run, 0, k, low, &below) || residual_of(run, 0, k, high, &above)) return RAISED;
    if (below < 0 && above == 0) return *s = high, 0;
    if (below <= 0 && 0 < above)
      return close_bracket(run, residual_of, 0, k, low, below, high, above, *s * 0, HS_UNIT * *s, s);
    width = width * 16;
  }
  return 0;
}

/* Correct a crossing on the surface itself to round-off: by Newton's method, else in a bracket. */
static int settled(hs_run *run, int k, const hs_rise *rise, hs_crossing *crossing) {
  hs_real s = rise->share, best = s, least = NAN, r, noise;
  for (int i = 0; i < MOST_CORRECTIONS; i++) {
    if (span_place(run, s, &crossing->time, &crossing->state) || surface(run, k, crossing->time, crossing->state, &r))
      return RAISED;
    if (i && !(fabs(r) < least)) break;
    least = fabs(r), best = s;
    crossing->theta = s;
    if (rise->slope == 0) return span_rest(run, s, crossing->state), 0;
    if (roundoff_bound(run, k, crossing->time, crossing->state, run->active_surfaces[k], &noise)) return RAISED;
    if (fabs(r) <= noise) return span_rest(run, s, crossing->state), 0;
    s = hs_min(1.0, hs_max(s * 0, s - r / rise->slope));
  }
  if (bracketed(run, k, &best)) return RAISED;
  crossing->theta = best;
  return span_point(run, best, &crossing->time, &crossing->state);
}

/* Find the first point of the step where surface k is crossed and its condition holds: 1, or 0. */
static int first_crossing(hs_run *run, int k, hs_crossing *crossing) {
  const hs_span *span = &run->span;
  hs_real first, last;
  if (is_passed_by(run, k)) return touched(run, k, crossing);
  if (roundoff_bound(run, k, span->t, run->x, 0, &first) || roundoff_bound(run, k, span->t1, run->z, 0, &last))
    return RAISED;
  const int beyond = coefficients_of(&run->curves, 0, k)[0] > first;
  hs_walk walk = begin_walk(k, hs_max(first, last), beyond, run->ends[k] > last);
  hs_rise rise;
  while (next_rise(run, &walk, &rise)) {
    if (settled(run, k, &rise, crossing)) return RAISED;
    const int holds = k >= run->here.table->edges ? 1 : condition(run, k, crossing->time, crossing->state);
    if (holds == RAISED) return RAISED;
    if (!holds && !(run->active_surfaces[k] && holds_next(run, k, crossing->time, crossing->state))) continue;
    if (!rise.certain) note_unsettled(run, k, crossing->time);
    crossing->edge = k;
    crossing->depth = 0.0;
    return 1;
  }
  return touched(run, k, crossing);
}

/* Whether a crossing's state is on a surface that the state was on that it came from, or one holds it: 1, 0 or RAISED. */
static int stands(hs_run *run, const hs_crossing *crossing) {
  int stood = run->here.p == run->held_p;
  for (int k = 0; run->here.standing && k < run->here.table->surfaces && !stood; k++) {
    hs_real r, noise;
    if (!run->active_surfaces[k]) continue;
    if (surface(run, k, crossing->time, crossing->state, &r)) return RAISED;
    if (roundoff_bound(run, k, crossing->time, crossing->state, 0, &noise)) return RAISED;
    stood = k == crossing->edge || fabs(r) <= noise;
  }
  return stood;
}

/* The sizes of the numbers behind the chosen crossing's state, to run->landed: the terms of its step and of the one
   before. */
static int largest(hs_run *run) {
  const hs_crossing *crossing = &run->chosen;
  const int stood = stands(run, crossing);
  if (stood == RAISED) return RAISED;
  sizes(run, run->x, crossing->state, stood);
  for (int s = 0; s < run->here.table->own; s++) {
    hs_real *const found = &run->landed[s];
    *found = joined(*found, span_size(run, &run->span, crossing->theta, s));
    if (run->has_before) *found = joined(*found, span_size(run, &run->before, 1.0, s));
    if (run->here.p == run->held_p) *found = hs_max(*found, run->scales[s]); /* off guards that hold it by as much */
  }
  return 0;
}

/* Record the part of the step that leads to a crossing. */
static void write_crossing(hs_run *run, const hs_crossing *crossing) {
  if (!(crossing->theta > 0)) return;
  if (run->method->degree > 0) span_cut(run, crossing->theta, &run->cubic);
  append(run, crossing->time, crossing->state, &run->cubic);
}

static int walked_out(hs_run *run, const hs_crossing *wall) {
  write_crossing(run, wall);
  copy(run->x, wall->state, run->here.dimension);
  run->task->stop.surface = wall->edge - run->here.table->edges + run->model->mode[run->here.mode].edges;
  return stopped(run, HS_LEFT, wall->time);
}

/* A wall is reached before any guard: take the guards that it is reached together with, how many there are. */
static int guards_at(hs_run *run, const hs_crossing *wall) {
  const hs_time time = wall->time, theta = wall->theta, depth = wall->depth;
  int count = 0;
  copy(run->q, wall->state, run->here.dimension);
  standing(run, time, run->q, tie(time), run->tied);
  for (int k = 0; k < run->here.table->edges; k++) {
    if (!run->tied[k]) continue;
    hs_crossing *const crossing = &run->crossings[count++];
    crossing->edge = k;
    crossing->theta = theta, crossing->time = time, crossing->depth = depth;
    copy(crossing->state, run->q, run->here.dimension);
  }
  return count;
}

/* Crossings, with those before the first one, of `count`, that rise by less than the step's polynomials are off by: how
   many there are then, or RAISED. A surface may be beyond its guard so and be crossed again behind the first one. */
static int with_unseen(hs_run *run, int count) {
  const hs_mode *mode = run->here.table;
  const hs_span *span = &run->span;
  const hs_crossing *first = &run->crossings[0];
  const int seen = count;
  int known = 0; /* whether run->values are those at the first crossing */
  for (int i = 1; i < count; i++)
    if (run->crossings[i].time < first->time) first = &run->crossings[i];
  if (!(first->theta > 0)) return count;
  for (int k = 0; k < mode->edges; k++) {
    int place = count;
    for (int i = 0; i < seen; i++)
      if (run->crossings[i].edge == k) place = i;
    hs_crossing *const found = &run->crossings[place];
    if (releases(run, k) || (place < count && found->time - first->time <= tie(first->time))) continue;
    hs_real start, end, before, noise, s = 0.0;
    if (!known && mode->values(run->here.p, first->time, first->state, run->values)) return RAISED;
    known = !(run->values[k] > 0);
    if (known) continue;
    if (surface(run, k, span->t, run->x, &start) || surface(run, k, first->time, first->state, &end)) return RAISED;
    if (roundoff_bound(run, k, first->time, first->state, 0, &noise)) return RAISED;
    if (!(end > noise)) continue;
    if (roundoff_bound(run, k, span->t, run->x, 0, &before)) return RAISED;
    if (start > before) continue;
    const hs_real unit = HS_UNIT * first->theta;
    if (!(start > 0) && close_bracket(run, residual_of, 0, k, 0.0, start, first->theta, end, 0.0, unit, &s))
      return RAISED;
    const hs_time later = found->time;
    if (span_point(run, s, &found->time, &found->state)) return RAISED;
    const int holds = condition(run, k, found->time, found->state);
    if (holds == RAISED) return RAISED;
    if (!holds && !(run->active_surfaces[k] && holds_next(run, k, found->time, found->state))) {
      found->time = later; /* not tied with the first one: its state does not count */
      continue;
    }
    found->edge = k;
    found->theta = s, found->depth = 0.0;
    count += place == count;
  }
  return count;
}

/* Say what happens first along the step: a guard, a wall with no guard on it, or nothing (GOES_ON). */
static int first_event(hs_run *run) {
  const hs_mode *mode = run->here.table;
  int guards = 0, tied = 0;
  hs_crossing *wall = 0;
  run->weighed = 0;
  for (int k = 0; k < mode->surfaces; k++) {
    hs_crossing *const crossing = &run->crossings[k < mode->edges ? guards : k];
    const int found = first_crossing(run, k, crossing);
    if (found == RAISED) return WITHOUT_VALUE;
    if (!found) continue;
    if (k < mode->edges)
      guards++;
    else if (!wall || crossing->time < wall->time)
      wall = crossing;
  }
  for (int i = 0; wall && i < guards; i++) tied |= run->crossings[i].time <= wall->time + tie(wall->time);
  if (wall && !tied && !(guards = guards_at(run, wall))) return walked_out(run, wall);
  if (!guards) return GOES_ON;
  if ((guards = with_unseen(run, guards)) == RAISED) return WITHOUT_VALUE;
  choose(run, guards);
  write_crossing(run, &run->chosen);
  return largest(run) ? WITHOUT_VALUE : LANDED;
}

/* No step is short enough: take a guard on which the state is, or stop with the reason. */
static int located_stuck(hs_run *run, hs_step_failure kind) {
  const int count = kind == HS_NOT_FINITE || kind == HS_UNSOLVED ? standing_on(run) : 0;
  if (count) {
    choose(run, count);
    sizes(run, run->x, run->x, 0);
    return LANDED;
  }
  if (run->here.table->flow(run->here.p, run->here.t, run->x, run->task->stop.slope))
    return stopped(run, HS_HERE_NOT_FINITE, run->here.t);
  run->task->stop.failure = kind;
  run->task->stop.surface = -1;
  return stopped(run, HS_STUCK, run->here.t);
}

static int step_not_finite(hs_run *run) {
  copy(run->task->stop.slope, run->z, run->here.dimension);
  stopped(run, HS_STEP_NOT_FINITE, run->here.t);
  run->task->stop.h = run->span.t1;
  return HS_STEP_NOT_FINITE;
}

/* Go on at the end of the step. */
HS_INLINE void go_to_end(hs_run *run) {
  const hs_span before = run->before;
  run->before = run->span;
  run->span = before;
  run->has_before = 1;
  run->here.t = run->before.t1;
  swap(&run->x, &run->z);
  swap(&run->slope, &run->end);
  run->k[0] = run->slope;
  run->k[run->method->stages] = run->end;
}

/* Step until a surface is crossed, or to a time in the segment. */
static int follow(hs_run *run, hs_time limit) {
  hs_mode_state *const here = &run->here;
  const int n = here->dimension;
  run->sloped = run->creeping = run->has_before = run->chatter = 0;
  run->ratio = 1;
  forget_steps(run);
  begin_pace(run);
  while (here->t < limit && !is_slow(run)) {
    if (interrupted(run)) return stopped(run, HS_INTERRUPTED, here->t);
    const hs_step_failure failure = next_span(run, n, limit);
    if (failure != HS_CLEAR) return located_stuck(run, failure);
    const int event = first_event(run);
    if (event == WITHOUT_VALUE) return step_not_finite(run);
    if (event != GOES_ON) return event;
    if (here->standing) leave(run, run->span.t1, run->z);
    HS_MOVE(run, move_along(run, run->span.t1, run->z, run->span.h));
    append(run, run->span.t1, run->z, &run->span.piece);
    go_to_end(run);
  }
  return here->t < limit ? located_stuck(run, HS_SLOW) : AT_BOUNDARY;
}

/* Forget the ends of contacts among what else might have been. */
static void drop_releases(hs_run *run) {
  int kept = 0;
  for (int i = 0; i < run->alternatives_count; i++)
    if (!releases(run, run->alternatives[i])) run->alternatives[kept++] = run->alternatives[i];
  run->alternatives_count = kept;
}

/* Go on in the mode itself from run->x, which a guard no longer holds; not on that of edge `at_once`, -1 for none,
   which to round-off neither holds the state nor lets go. */
static int released(hs_run *run, hs_time t, int at_once) {
  hs_mode_state *const here = &run->here;
  be_held_exactly(run, t, run->x, -1);
  if (at_once >= 0 && run->active_surfaces[at_once]) run->active_surfaces[at_once] = 0, here->standing--;
  const int standing_before = here->standing;
  copy(run->scale, run->landed, here->dimension);
  place(run, here->mode, here->dimension, t, 0);
  here->standing = standing_before;
  return GOES_ON;
}

/* Note how far the chosen crossing's state is off those of the first surfaces that it stands on. */
static void stand(hs_run *run, const int *on, int surfaces) {
  const hs_mode_state *here = &run->here;
  if (here->table->values(here->p, run->chosen.time, run->chosen.state, run->values)) return;
  for (int k = 0; k < surfaces; k++) run->stood[k] = on[k] ? run->values[k] : 0.0;
}

/* Flow along guards until one lets go of the state. */
static int along_guards(hs_run *run, hs_time limit) {
  hs_mode_state *const here = &run->here;
  const hs_time from = here->t;
  for (;;) {
    const int outcome = follow(run, limit), end = run->chosen.edge;
    if (outcome == LANDED && releases(run, end)) {
      hs_time t = run->chosen.time;
      copy(run->x, run->chosen.state, here->dimension);
      int ends = in_touch(run, end);
      if (!ends) {
        ends = behind_end(run, end, &t);
        if (t > run->chosen.time) {
          secant(run, &run->cubic);
          append(run, t, run->z, &run->cubic);
        }
        swap(&run->x, &run->z);
      }
      leave(run, t, run->x);
      if (ends) return released(run, t, t == from && end < run->model->mode[here->mode].edges ? end : -1);
      here->t = t;
      continue;
    }
    if (outcome == LANDED) {
      drop_releases(run);
      be_held_exactly(run, run->chosen.time, run->chosen.state, end);
      stand(run, run->kept, here->table->edges);
    } else if (outcome == AT_BOUNDARY) {
      be_held_exactly(run, here->t, run->x, -1);
    } else {
      run->still = same_state(run->began, run->x, here->dimension);
      after_contact(run);
    }
    return outcome;
  }
}

/* Flow until a surface is crossed or to the segment's end; along guards that hold the state until one lets go. */
static int located_flow(hs_run *run) {
  const hs_time limit = segment_end(run), from = run->here.t;
  const hs_mode *const own = run->here.table;
  const int n = run->here.dimension, held = contact_at(run);
  if (held != GOES_ON) return held;
  if (run->here.table == own) return follow(run, limit);
  copy(run->began, run->x, n);
  for (int k = 0; k < own->edges; k++) run->held[k] = in_touch(run, k);
  const int outcome = along_guards(run, limit);
  for (int k = 0; k < own->edges; k++)
    if (run->held[k]) note(run, HS_IN_CONTACT, k, run->still, from, run->task->now);
  return outcome;
}

/* Whether the transition before this one was made at the same instant. */
static int same_instant(const hs_run *run, hs_time t) {
  if (!run->jump) return 0;
  const hs_time resumed = made_before(run, 0)->resumed;
  return resumed == resumed && t - resumed <= tie(t);
}

/* Whether as many transitions as cost no time have fallen within the relaxation of flow, and run to no limit.
   Those of one instant count only where the edge is one of theirs. Those of contacts that move the state run to one. */
static int crowded(hs_run *run, const hs_crossing *crossing) {
  hs_real flight, ratio;
  const hs_time t = crossing->time;
  const int k = crossing->edge;
  int again = 0;
  if (run->jump < FREE || contraction(run, &flight, &ratio) || flown(run, t) > run->epsilon) return 0;
  const hs_time since = t - made_before(run, FREE - 1)->time;
  for (int i = 0; i < FREE; i++) again |= made_before(run, i)->edge == k && made_before(run, i)->mode == run->here.mode;
  if (!again && since <= tie(t)) return 0;
  return !(of_contacts(run) && run->here.table->edge[k].contact >= 0 && !keeps(run, t, crossing->state, k));
}

/* Make a transition, at its own instant or behind a strip, and look whether it belongs to a Zeno tail. */
static int jump(hs_run *run) {
  const hs_crossing *crossing = &run->chosen;
  const hs_time t = crossing->time, until = run->until;
  const int k = crossing->edge;
  const hs_edge *edge = &run->here.table->edge[k];
  const int mode = run->here.mode;
  hs_time resumed = t;
  if (limit_reached(run)) return stopped(run, HS_LIMIT, t);
  if (crossing->theta == 0 && run->here.standing) stand(run, run->active_surfaces, run->here.table->surfaces);
  if (edge->target != mode)
    for (int j = 0; j < run->model->surfaces; j++) run->stood[j] = 0.0;
  HS_MOVE(run, move_crossing(run));
  const int waits = crowded(run, crossing), without_value = reset(run, run->landed);
  if (waits) {
    if (!run->noted_crowded) note(run, HS_CROWDED, k, 0, t, t);
    run->noted_crowded = 1;
    resumed = t + run->epsilon;
    if (resumed > until + tie(until)) {
      hs_time rows[2][2] = {{t, 0.0}, {until, until - t}};
      strip(run, 2, rows, crossing->state);
      record(run, crossing, NAN, without_value ? 0 : run->after, 0);
      return in_strip(run, HS_UNTIL_IN_STRIP, until);
    }
    resumed = earlier(resumed, until);
  }
  if (without_value) return in_strip(run, HS_RESET_NOT_FINITE, t);
  if (resumed > t) {
    hs_time rows[2][2] = {{t, 0.0}, {resumed, run->epsilon}};
    strip(run, 2, rows, crossing->state);
  }
  const hs_real since = run->alternatives_count || same_instant(run, t) ? tie(t) : 0.0;
  const int flowed = has_flowed(run, t);
  record(run, crossing, resumed, run->after, 0);
  copy(run->x, run->after, edge->target_dimension);
  copy(run->scale, run->both, edge->target_dimension);
  const int entered = enter(run, edge->target, edge->target_dimension, resumed, 1, since, 0, t);
  if (entered != GOES_ON) return entered;
  if (returns(run, flowed)) return slides(run, mode, k);
  const int closed = close_tail(run, k);
  return closed == GOES_ON && run->here.mode == mode ? unresolved(run, k) : closed;
}

/* Go on behind a sample of an input, or end: a jump at the end is made, and a guard reached there fires. */
static int located_at_boundary(hs_run *run) {
  const hs_time t = run->here.t;
  if (t >= run->pause) return PAUSED;
  if (t < run->until || segment_follows(run)) return go_on(run);
  const hs_mode *const own = run->here.table;
  const int count = contact_at(run) == GOES_ON ? standing_on(run) : 0;
  if (count) {
    choose(run, count);
    sizes(run, run->x, run->x, 0);
  }
  if (run->here.table != own) after_contact(run);
  return count ? jump(run) : (int)stopped(run, HS_UNTIL, t);
}

/* Follow the execution until it stops or pauses. */
static int located(hs_run *run, int outcome) {
  while (outcome == GOES_ON) {
    if (interrupted(run))
      outcome = stopped(run, HS_INTERRUPTED, run->here.t);
    else
      outcome = run->here.t < segment_end(run) ? located_flow(run) : AT_BOUNDARY;
    if (outcome == LANDED)
      outcome = jump(run);
    else if (outcome == AT_BOUNDARY)
      outcome = located_at_boundary(run);
    if (outcome == GOES_ON && pauses(run)) return PAUSED;
  }
  return outcome;
}
