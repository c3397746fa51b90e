/* The located scheme: Burden et al. 2013, Fig. 8. The first crossing of a step, transitions there.
   See hsdsl/engine/simulate/located.py. */

/* Whether a crossing's state is on a surface that the state was on that it came from, or one holds it: 1, 0 or RAISED. */
static int stands(hs_run *run, const hs_crossing *crossing) {
  int stood = run->here.p == run->contact.p;
  for (int k = 0; run->here.active && k < run->here.table->surfaces && !stood; k++) {
    hs_real r, noise;
    if (!run->surfaces.active[k]) continue;
    if (surface(run, k, crossing->time, crossing->state, &r)) return RAISED;
    if (roundoff_bound(run, k, crossing->time, crossing->state, 0, &noise)) return RAISED;
    stood = k == crossing->edge || fabs(r) <= noise;
  }
  return stood;
}

/* The sizes of the numbers of the chosen crossing's state, to run->sizes.landed: the terms of its step and of the one
   before. */
static int largest(hs_run *run) {
  const hs_crossing *crossing = &run->event.chosen;
  const int stood = stands(run, crossing);
  if (stood == RAISED) return RAISED;
  sizes(run, run->x, crossing->state, stood);
  for (int s = 0; s < run->here.table->own; s++) {
    hs_real *const found = &run->sizes.landed[s];
    *found = joined(*found, span_size(run, &run->span, crossing->theta, s));
    if (run->has_before) *found = joined(*found, span_size(run, &run->before, 1.0, s));
    if (run->here.p == run->contact.p) *found = hs_max(*found, run->sizes.scales[s]); /* off its guards by as much */
  }
  return 0;
}

/* Record the part of the step that leads to a crossing; `write` in Python. */
static void write_crossing(hs_run *run, const hs_crossing *crossing) {
  if (!(crossing->theta > 0)) return;
  if (run->method->degree > 0 && !run->lanes.bare) span_cut(run, crossing->theta, &run->cubic);
  append(run, crossing->time, crossing->state, &run->cubic);
}

/* A wall is reached before any guard: take the guards that it is reached together with, how many there are. */
static int guards_at(hs_run *run, const hs_crossing *wall) {
  const hs_time time = wall->time, theta = wall->theta, depth = wall->depth;
  int count = 0;
  copy(run->q, wall->state, run->here.dimension);
  untie(run);
  standing(run, time, run->q, tie(time));
  for (int k = 0; k < run->here.table->edges; k++) {
    if (!run->event.tied[k]) continue;
    hs_crossing *const crossing = &run->event.crossings[count++];
    crossing->edge = k;
    crossing->theta = theta, crossing->time = time, crossing->depth = depth;
    copy(crossing->state, run->q, run->here.dimension);
  }
  return count;
}

/* Say what happens first along the step, of the crossings of its surfaces: a guard, a wall with no guard on it, or
   nothing (GOES_ON). */
static int first_event(hs_run *run) {
  const hs_mode *mode = run->here.table;
  int guards = 0, tied = 0;
  hs_crossing *wall = 0;
  for (int k = 0; k < mode->surfaces; k++) {
    hs_crossing *const crossing = &run->event.crossings[k];
    if (crossing->edge < 0) continue;
    if (k < mode->edges) {
      const hs_crossing other = run->event.crossings[guards];
      run->event.crossings[guards++] = *crossing;
      *crossing = other;
    } else if (!wall || crossing->time < wall->time)
      wall = crossing;
  }
  for (int i = 0; wall && i < guards; i++) tied |= run->event.crossings[i].time <= wall->time + tie(wall->time);
  if (wall && !tied && !(guards = guards_at(run, wall))) {
    write_crossing(run, wall);
    copy(run->x, wall->state, run->here.dimension);
    run->task->stop.surface = wall->edge - run->here.table->edges + run->model->mode[run->here.mode].edges;
    return stopped(run, HS_LEFT, wall->time);
  }
  if (!guards) return GOES_ON;
  if ((guards = with_unseen(run, guards)) == RAISED) return WITHOUT_VALUE;
  choose(run, guards);
  write_crossing(run, &run->event.chosen);
  return largest(run) ? WITHOUT_VALUE : LANDED;
}

/* No step is short enough: take a guard on which the state is, or stop with the reason; `stuck` in Python. */
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

/* Go on at the end of the step. */
HS_INLINE void go_to_end(hs_run *run) {
  const hs_span before = run->before;
  run->before = run->span;
  run->span = before;
  run->has_before = 1;
  run->surfaces.has_starts = run->surfaces.has_ends;
  swap(&run->surfaces.starts, &run->surfaces.ends);
  run->here.t = run->before.t1;
  swap(&run->x, &run->z);
  swap(&run->slope, &run->end);
  run->step.k[0] = run->slope;
  run->step.k[run->method->stages] = run->end;
}

/* Begin to step through a flow. */
static void begin_following(hs_run *run) {
  run->step.sloped = run->has_before = run->surfaces.has_starts = 0;
  run->step.ratio = 1;
  forget_steps(run);
  begin_pace(run);
}

/* Whether there is a step to make before `limit`: GOES_ON, or what ends the flow. */
HS_INLINE int before_step(hs_run *run, hs_time limit) {
  if (!(run->here.t < limit)) return AT_BOUNDARY;
  if (count_step(&run->pace, run->here.t)) return located_stuck(run, HS_SLOW);
  return interrupted(run) ? (int)stopped(run, HS_INTERRUPTED, run->here.t) : GOES_ON;
}

/* Go on at the end of a step on which nothing happens. */
HS_INLINE int pass(hs_run *run) {
  if (run->here.active) leave(run, run->span.t1, run->z);
  HS_MOVE(run, move_along(run, run->span.t1, run->z, run->span.h));
  append(run, run->span.t1, run->z, &run->span.piece);
  go_to_end(run);
  return GOES_ON;
}

/* Go on after a step on which this happens first: GOES_ON, or what happens. */
HS_INLINE int after_event(hs_run *run, int event) {
  if (event == GOES_ON) return pass(run);
  if (event != WITHOUT_VALUE) return event;
  copy(run->task->stop.slope, run->z, run->here.dimension);
  stopped(run, HS_STEP_NOT_FINITE, run->here.t);
  run->task->stop.h = run->span.t1;
  return HS_STEP_NOT_FINITE;
}

/* Go on after a step that was made. */
static int after_step(hs_run *run) {
  const int found = crossings_along(run);
  return after_event(run, found == RAISED ? WITHOUT_VALUE : found ? first_event(run) : GOES_ON);
}

HS_INLINE int after_try(hs_run *run, hs_step_failure failure) {
  return failure == HS_CLEAR ? after_step(run) : located_stuck(run, failure);
}

/* Make one step: GOES_ON, or what ends the flow. */
HS_INLINE int one_step(hs_run *run, const int n, hs_time limit) { return after_try(run, next_span(run, n, limit)); }

/* Step until a surface is crossed, or to a time in the segment. */
static int follow_on(hs_run *run, hs_time limit) {
  const int n = run->here.dimension;
  int event;
  do {
    event = before_step(run, limit);
    if (event == GOES_ON) event = one_step(run, n, limit);
  } while (event == GOES_ON);
  return event;
}

static int follow(hs_run *run, hs_time limit) {
  begin_following(run);
  return follow_on(run, limit);
}

/* Forget the ends of contacts among what else might have been. */
static void drop_releases(hs_run *run) {
  int kept = 0;
  for (int i = 0; i < run->event.alternatives_count; i++)
    if (!releases(run, run->event.alternatives[i])) run->event.alternatives[kept++] = run->event.alternatives[i];
  run->event.alternatives_count = kept;
}

/* Go on in the mode itself from run->x, which a guard no longer holds; not on that of edge `at_once`, -1 for none,
   which to round-off neither holds the state nor lets go. */
static int released(hs_run *run, hs_time t, int at_once) {
  hs_mode_state *const here = &run->here;
  be_held_exactly(run, t, run->x, -1);
  if (at_once >= 0 && run->surfaces.active[at_once]) run->surfaces.active[at_once] = 0, here->active--;
  const int standing_before = here->active;
  copy(run->sizes.scale, run->sizes.landed, here->dimension);
  place(run, here->mode, here->dimension, t, 0);
  here->active = standing_before;
  return GOES_ON;
}

/* Note how far the chosen crossing's state is off those of the first surfaces that it stands on. */
static void stand(hs_run *run, const int *on, int surfaces) {
  const hs_mode_state *here = &run->here;
  if (here->table->values(here->p, run->event.chosen.time, run->event.chosen.state, run->surfaces.values)) return;
  for (int k = 0; k < surfaces; k++) run->surfaces.stood[k] = on[k] ? run->surfaces.values[k] : 0.0;
}

/* Flow along guards until one lets go of the state. */
static int along_guards(hs_run *run, hs_time limit) {
  hs_mode_state *const here = &run->here;
  const hs_time from = here->t;
  for (;;) {
    const int outcome = follow(run, limit), end = run->event.chosen.edge;
    if (outcome == LANDED && releases(run, end)) {
      hs_time t = run->event.chosen.time;
      copy(run->x, run->event.chosen.state, here->dimension);
      int ends = in_touch(run, end);
      if (!ends) {
        ends = past_end(run, end, &t);
        if (t > run->event.chosen.time) {
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
      be_held_exactly(run, run->event.chosen.time, run->event.chosen.state, end);
      stand(run, run->contact.kept, here->table->edges);
    } else if (outcome == AT_BOUNDARY) {
      be_held_exactly(run, here->t, run->x, -1);
    } else {
      run->contact.still = same_state(run->contact.began, run->x, here->dimension);
      after_contact(run);
    }
    return outcome;
  }
}

/* Say whether the flow leads out at once, through a guard that the state stands on, to round-off, as it was entered: then
   it is crossed (LANDED), as a step would find at its start. Else GOES_ON. */
static int leads_out(hs_run *run) {
  const hs_mode_state *here = &run->here;
  hs_crossing *const first = &run->event.crossings[0];
  const hs_time t = here->t;
  int known = 0; /* whether run->surfaces.values and run->surfaces.magnitudes are those here */
  for (int k = 0; k < here->table->edges; k++) {
    hs_real rate; /* most flows lead inside: then no more is looked at */
    if (!run->surfaces.active[k]) continue;
    if (hs_call(&here->table->rates[k], here->p, t, run->x, &rate) || !(rate > 0)) continue;
    if (!known && (here->table->values(here->p, t, run->x, run->surfaces.values) ||
                   magnitudes_at(run, t, run->x, run->surfaces.magnitudes)))
      break;
    known = 1;
    const hs_real noise = bound_from(run, run->surfaces.magnitudes, k, t, run->x, 0);
    const hs_real r = run->surfaces.values[k]; /* much round-off in the state is no reason to be on a guard */
    if (!(fabs(r) <= noise && -r <= rate * tie(t)) || !stands_on(run, k, t, run->x, tie(t))) continue;
    first->edge = k;
    first->theta = first->depth = 0.0;
    first->time = t;
    copy(first->state, run->x, here->dimension);
    choose(run, 1);
    sizes(run, run->x, run->event.chosen.state, stands(run, &run->event.chosen) == 1);
    return LANDED;
  }
  return GOES_ON;
}

/* Flow until a surface is crossed or to the segment's end; along guards that hold the state until one lets go. The
   Python twin is `flow`. */
static int located_flow(hs_run *run) {
  const hs_time limit = segment_end(run), from = run->here.t;
  const hs_mode *const own = run->here.table;
  const int n = run->here.dimension, held = contact_at(run);
  if (held != GOES_ON) return held;
  if (run->here.table == own) {
    if (run->here.active && run->method->kind == HS_TAYLOR && leads_out(run) == LANDED) return LANDED;
    return run->lanes.parks ? PARKED : follow(run, limit);
  }
  copy(run->contact.began, run->x, n);
  for (int k = 0; k < own->edges; k++) run->contact.held[k] = in_touch(run, k);
  const int outcome = along_guards(run, limit);
  for (int k = 0; k < own->edges; k++)
    if (run->contact.held[k]) note(run, HS_IN_CONTACT, k, run->contact.still, from, run->task->now);
  return outcome;
}

/* Whether as many transitions as cost no time have fallen within the relaxation of flow, and run to no limit.
   Those of one instant count only where the edge is one of theirs. Those of contacts that move the state run to one. */
static int crowded(hs_run *run, const hs_crossing *crossing) {
  hs_real flight, ratio;
  const hs_time t = crossing->time;
  const int k = crossing->edge;
  int again = 0;
  if (run->written.jump < FREE || contraction(run, &flight, &ratio) || flown(run, t) > run->epsilon) return 0;
  const hs_time since = t - made_before(run, FREE - 1)->time;
  for (int i = 0; i < FREE; i++) again |= made_before(run, i)->edge == k && made_before(run, i)->mode == run->here.mode;
  if (!again && since <= tie(t)) return 0;
  return !(of_contacts(run) && run->here.table->edge[k].contact >= 0 && !keeps(run, t, crossing->state, k));
}

/* Whether the transition of edge k of a mode, which was made, belongs to a Zeno tail that is to end: GOES_ON, or a stop. */
static int ends_tail(hs_run *run, int mode, int k) {
  if (run->here.mode != mode) return at_limit(run);
  int closed = close_tail(run, k);
  if (closed == GOES_ON) closed = at_limit(run);
  return closed == GOES_ON ? unresolved(run, k) : closed;
}

/* Make a transition, at its own instant or after a strip. The Python twin is `make_transition`. */
static int jump(hs_run *run) {
  const hs_crossing *crossing = &run->event.chosen;
  const hs_time t = crossing->time, until = run->until;
  const int k = crossing->edge;
  const hs_edge *edge = &run->here.table->edge[k];
  const int mode = run->here.mode;
  hs_time resumed = t;
  if (limit_reached(run)) return stopped(run, HS_LIMIT, t);
  if (crossing->theta == 0 && run->here.active) stand(run, run->surfaces.active, run->here.table->surfaces);
  if (edge->target != mode)
    for (int j = 0; j < run->model->surfaces; j++) run->surfaces.stood[j] = 0.0;
  HS_MOVE(run, move_crossing(run));
  const int waits = crowded(run, crossing), without_value = reset(run, run->sizes.landed);
  if (waits) {
    if (!run->written.noted_crowded) note(run, HS_CROWDED, k, 0, t, t);
    run->written.noted_crowded = 1;
    resumed = t + run->epsilon;
    if (resumed > until + tie(until)) {
      hs_time rows[2][2] = {{t, 0.0}, {until, until - t}};
      strip(run, 2, rows, crossing->state);
      record(run, crossing, NAN, without_value ? 0 : run->event.after, 0);
      return in_strip(run, HS_UNTIL_IN_STRIP, until);
    }
    resumed = earlier(resumed, until);
  }
  if (without_value) return in_strip(run, HS_RESET_NOT_FINITE, t);
  if (resumed > t) {
    hs_time rows[2][2] = {{t, 0.0}, {resumed, run->epsilon}};
    strip(run, 2, rows, crossing->state);
  }
  const hs_time last = run->written.jump ? made_before(run, 0)->resumed : NAN;
  const hs_real since = run->event.alternatives_count || t - last <= tie(t) ? tie(t) : 0.0;
  const int flowed = has_flowed(run, t);
  record(run, crossing, resumed, run->event.after, 0);
  copy(run->x, run->event.after, edge->target_dimension);
  copy(run->sizes.scale, run->sizes.both, edge->target_dimension);
  const int entered = enter(run, edge->target, edge->target_dimension, resumed, 1, since, 0, t);
  if (entered != GOES_ON) return entered;
  return comes_back(run, flowed) ? slides(run, mode, k) : ends_tail(run, mode, k);
}

/* Go on after a sample of an input, or end: a jump at the end is made, and a guard reached there fires. The
   Python twin is `at_boundary`. */
static int located_at_boundary(hs_run *run) {
  const hs_time t = run->here.t;
  if (t >= run->pausing.at) return PAUSED;
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

/* Go on after a flow that has ended. */
static int after_flow(hs_run *run, int outcome) {
  if (outcome == LANDED)
    outcome = jump(run);
  else if (outcome == AT_BOUNDARY)
    outcome = located_at_boundary(run);
  return outcome == GOES_ON && pauses(run) ? PAUSED : outcome;
}

/* Follow the execution until it stops, pauses or, where it does so, parks before the steps of a flow. */
static int located(hs_run *run, int outcome) {
  while (outcome == GOES_ON) {
    if (interrupted(run)) return stopped(run, HS_INTERRUPTED, run->here.t);
    outcome = run->here.t < segment_end(run) ? located_flow(run) : AT_BOUNDARY;
    outcome = after_flow(run, outcome);
  }
  return outcome;
}
