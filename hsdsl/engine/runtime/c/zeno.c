/* Zeno tails, which their limit replaces or at which a run stops. See hsdsl/engine/simulate/zeno.py.
   A status is 0, or RAISED where a routine has no value. */

#define LEAST_FLIGHTS 3
#define LAST_TIES 4

/* The last few flights between transitions of the last edge that was reached, the last one first; 0 where they are not
   as many. Where they are `of_flow`, time in strips does not count. */
static int last_flights(const hs_run *run, int of_flow, hs_real *flight) {
  const int count = FREE < run->written.jump ? FREE : (int)run->written.jump;
  int entries = 0, flights = -1;
  while (entries < count - 1 && made_before(run, entries)->entry) entries++;
  const hs_made *const last = made_before(run, entries);
  hs_time later = 0.0, waited = 0.0;
  for (int i = 0; i < count && flights < LEAST_FLIGHTS; i++) {
    const hs_made *const made = made_before(run, i);
    if (made->mode != last->mode || made->mode != made->target || (made->entry && made->edge == last->edge)) break;
    if (of_flow && flights >= 0 && made->resumed == made->resumed) waited = waited + (made->resumed - made->time);
    if (made->edge != last->edge) continue;
    if (flights >= 0) flight[flights] = later - (made->time + waited);
    flights++, later = made->time + waited;
  }
  return flights == LEAST_FLIGHTS;
}

/* After how many transitions those of the last few rounds repeat; 0 where they do not, on entry or in strips. */
static int period(const hs_run *run) {
  for (int n = 1; LEAST_FLIGHTS * n < FREE && LEAST_FLIGHTS * n < run->written.jump; n++) {
    int repeats = 1, waits = 0;
    for (int i = 0; i <= LEAST_FLIGHTS * n && repeats; i++) {
      const hs_made *const made = made_before(run, i), *const other = made_before(run, i < n ? i : i - n);
      repeats = made->edge == other->edge && made->mode == other->mode;
      waits |= made->entry || made->resumed != made->time;
    }
    if (repeats) return waits ? 0 : n;
  }
  return 0;
}

/* Whether the last few flights, of rounds or of the last edge, shrink: the last one, and the largest ratio of them. */
static int shrinking(const hs_run *run, int of_flow, hs_real *flight, hs_real *ratio) {
  hs_real flights[LEAST_FLIGHTS];
  const int n = period(run);
  for (int i = 0; n && i < LEAST_FLIGHTS; i++)
    flights[i] = made_before(run, i * n)->time - made_before(run, (i + 1) * n)->time;
  if (!n && !last_flights(run, of_flow, flights)) return 0;
  *flight = flights[0], *ratio = 0.0;
  for (int i = 0; i < LEAST_FLIGHTS && *ratio < 1; i++) {
    if (!(flights[i] > 0)) return 0;
    if (i) *ratio = hs_max(*ratio, flights[i - 1] / flights[i]);
  }
  return *ratio < 1;
}

/* The same with all time, looked at once after each transition. */
static int contraction(hs_run *run, hs_real *flight, hs_real *ratio) {
  hs_zeno *const last = &run->zeno;
  if (last->contracted != run->written.jump) last->contracts = shrinking(run, 0, &last->flight, &last->ratio);
  last->contracted = run->written.jump;
  *flight = last->flight, *ratio = last->ratio;
  return last->contracts;
}

/* The time of flow up to t since the first of the last transitions, without that in strips. */
static hs_time flown(const hs_run *run, hs_time t) {
  hs_time found = t - made_before(run, FREE - 1)->time;
  for (int i = FREE - 1; i >= 0; i--) {
    const hs_made *made = made_before(run, i);
    if (made->resumed > made->time) found = found - (made->resumed - made->time);
  }
  return found;
}

static int has_place(const int *places, int count, int place) {
  for (int i = 0; i < count; i++)
    if (places[i] == place) return 1;
  return 0;
}

/* Whether edge k makes executions that wait: they end, however close together they are. */
static int empties(const hs_run *run, int k) {
  const hs_mode *const mode = run->here.table;
  const hs_edge *const edge = &mode->edge[k];
  for (int q = 0; q < mode->queues; q++)
    if (has_place(edge->change, edge->changes, mode->queue[q].waiting) &&
        !has_place(edge->change, edge->changes, mode->queue[q].value[0]))
      return 1;
  return 0;
}

/* Whether what each edge of the tail takes back, of its guard or of the rate of that, is no more than pushes make within
   the relaxation: 1, 0 or RAISED. So near is the limit. */
static int is_near(hs_run *run) {
  const hs_mode *const own = run->here.table;
  const hs_time t = run->here.t;
  bind_contacts(run, 0, run->zeno.tail);
  const int raised = magnitudes_at(run, t, run->x, run->surfaces.magnitudes);
  bind_mode(run);
  if (raised || own->values(run->here.p, t, run->x, run->surfaces.values)) return RAISED;
  for (int k = 0; k < own->edges; k++) {
    if (!run->zeno.tail[k]) continue;
    hs_real last = run->surfaces.values[k];
    if (own->edge[k].push_order == 2 && hs_call(&own->rates[k], run->here.p, t, run->x, &last)) return RAISED;
    if (!(fabs(last) <= run->epsilon * run->surfaces.magnitudes[k])) return 0;
  }
  return 1;
}

/* The point that the tail, of `count` edges, runs to at its end, also in contact with run->contact.held, to run->z: 1;
   0 where it is not on the guards. */
static int limit_of(hs_run *run, int count, hs_time end) {
  const hs_mode_state *here = &run->here;
  const int n = here->dimension;
  int along = 0;
  hs_real r, noise, *const q = run->z;
  for (int k = 0; k < here->table->edges; k++) along |= run->zeno.tail[k] && here->table->edge[k].contact >= 0;
  if (along && is_near(run) != 1) return 0;
  copy(q, run->x, n);
  if (in_turn(run, fixed_point, count, here->t)) return RAISED;
  if (along) {
    bind_contacts(run, run->contact.held, run->contact.held);
    const hs_time h = end - here->t;
    int raised = here->table->flow(here->p, here->t, q, run->end);
    for (int s = 0; s < n; s++) run->event.after[s] = q[s] + h * run->end[s];
    raised = raised || here->table->flow(here->p, end, run->event.after, run->at);
    bind_mode(run);
    if (raised) return RAISED;
    for (int s = 0; s < n; s++) q[s] = q[s] + h * (run->end[s] + run->at[s]) / 2;
    if (in_turn(run, onto_guard, count, end)) return RAISED;
  }
  if (in_turn(run, fixed_point, count, end)) return RAISED;
  for (int k = 0; k < here->table->edges; k++) {
    if (!run->zeno.tail[k]) continue;
    if (surface(run, k, end, q, &r) || roundoff_bound(run, k, end, q, 1, &noise)) return RAISED;
    if (!(fabs(r) <= noise)) return 0;
  }
  return 1;
}

/* Whether a surface other than those of the tail is passed on the way from x to a limit q: 1, 0 or RAISED. */
static int meets_another(hs_run *run, hs_time t, const hs_real *x, hs_time end, const hs_real *q) {
  const hs_mode_state *here = &run->here;
  const int m = here->table->surfaces;
  if (here->table->values(here->p, t, x, run->surfaces.ahead) || here->table->values(here->p, end, q, run->surfaces.ends))
    return RAISED;
  for (int j = 0; j < m; j++) {
    hs_real noise, before;
    if (roundoff_bound(run, j, end, q, 0, &noise)) return RAISED;
    if (!(run->surfaces.ends[j] > noise)) continue;
    if (roundoff_bound(run, j, t, x, 0, &before)) return RAISED;
    if (!run->zeno.tail[j] && !(run->surfaces.ahead[j] > before)) return 1;
  }
  return 0;
}

/* Mark in run->zeno.tail the edges of the last transitions, where each leads back to the present mode and its guard can
   hold a state; return how many. */
static int of_contacts(hs_run *run) {
  const hs_mode_state *here = &run->here;
  int count = 0;
  for (int j = 0; j < here->table->surfaces; j++) run->zeno.tail[j] = 0;
  if (!run->task->settings.contacts) return 0;
  for (int i = 0; i < FREE; i++) {
    const hs_made *made = made_before(run, i);
    if (made->entry || made->mode != here->mode || made->target != here->mode) return 0;
    if (here->table->edge[made->edge].contact < 0) return 0;
    count += !run->zeno.tail[made->edge];
    run->zeno.tail[made->edge] = 1;
  }
  return count;
}

/* Mark in run->zeno.tail the edges of a tail that ends within the relaxation, and bound what is `left` of it; return how
   many. The last transition was that of edge k. */
static int nearly_over(hs_run *run, int k, hs_time *left) {
  const hs_mode_state *here = &run->here;
  hs_real flight, ratio;
  if (contraction(run, &flight, &ratio)) {
    for (int j = 0; j < here->table->surfaces; j++) run->zeno.tail[j] = j == k;
    *left = flight * ratio / (1 - ratio);
    return !(*left > run->epsilon);
  }
  if (run->written.jump < FREE) return 0;
  *left = flown(run, here->t);
  if (*left > run->epsilon) return 0;
  const int count = of_contacts(run);
  return count > 1 ? count : 0;
}

/* Whether resets keep a limit q of the tail, of `count` edges, and the flow presses on their guards, or it is reached at
   one `instant`. */
static int is_held(hs_run *run, hs_time end, const hs_real *q, int count, int instant) {
  const int edges = run->here.table->edges;
  int all = 0, presses = 0;
  if (keeping(run, end, q, run->contact.kept) != count) return 0;
  if (instant) return 1;
  for (int j = 0; j < edges; j++) all += run->contact.held[j];
  if (!pressing(run, end, q, run->contact.held, all, run->contact.kept, run->surfaces.beyond)) return 0;
  for (int j = 0; j < edges; j++) presses |= run->zeno.tail[j] && run->contact.kept[j];
  return presses;
}

/* Go to the limit of a tail that is nearly over; stop at one where no motion along the guard goes on. The last
   transition was that of edge k; what it set off has no limit. */
static int close_tail(hs_run *run, int k) {
  hs_mode_state *const here = &run->here;
  hs_time left;
  int touches = 1;
  if (here->dimension != here->table->dimension || !here->dimension) return GOES_ON;
  const int count = nearly_over(run, k, &left);
  if (!count || empties(run, k)) return GOES_ON;
  const hs_time whole = here->t + left;
  hs_time end = earlier(whole, segment_end(run));
  const int instant = count > 1 && end == here->t;
  if (whole > run->pausing.at || !(end > here->t || instant)) return GOES_ON;
  const hs_mode *const own = here->table;
  if (contact_at(run) != GOES_ON) return HS_ACCUMULATED;
  for (int j = 0; j < own->edges; j++) {
    touches &= !run->zeno.tail[j] || in_touch(run, j);
    run->contact.held[j] = run->zeno.tail[j] || in_touch(run, j), run->contact.kept[j] = run->zeno.tail[j];
  }
  if (here->table != own) after_contact(run);
  hs_real *const q = run->z;
  if (touches || limit_of(run, count, end) != 1) return GOES_ON;
  const int meets = meets_another(run, here->t, run->x, end, q);
  if (meets == RAISED) return GOES_ON;
  if (meets) {
    end = here->t;
    if (limit_of(run, count, end) != 1) return GOES_ON;
  }
  for (int j = 0; j < own->edges; j++)
    if (run->zeno.tail[j] && keeps(run, end, q, j) != 1) return GOES_ON;
  if (own->edge[k].contact < 0 || !run->task->settings.contacts || made_before(run, 0)->entry) {
    if (!is_possible(run, k, end, q, run->contact.held)) return GOES_ON;
    note(run, HS_ACCUMULATES, k, 0, end, here->t);
    return stopped(run, HS_ACCUMULATED, here->t);
  }
  if (!is_held(run, end, q, count, instant) || meets_another(run, here->t, run->x, end, q)) return GOES_ON;
  for (int j = 0; j < own->edges; j++)
    if (run->zeno.tail[j]) note(run, HS_REPLACED, j, run->written.jump - 1, end, left);
  if (end > here->t) {
    secant(run, &run->cubic);
    append(run, end, q, &run->cubic);
  }
  swap(&run->x, &run->z);
  place(run, here->mode, here->dimension, end, 0);
  here->table->values(here->p, end, run->x, run->surfaces.ahead);
  enter_surfaces(run, end, 0.0, 0, end);
  for (int j = 0; j < own->edges; j++)
    if (run->zeno.tail[j] && !run->surfaces.active[j]) run->surfaces.active[j] = 1, here->active++;
  return GOES_ON;
}

/* Bind routines to the mode of transition `back` before the last one; return its edge. */
static int bind_made(hs_run *run, int back) {
  const hs_made *const made = made_before(run, back);
  run->here.table = &run->model->mode[made->mode];
  return made->edge;
}

/* run->z taken round once by the transitions of the last round, each at its guard, or `taken` to it. */
static int around(hs_run *run, hs_taken *taken, hs_time t) {
  const hs_mode *const own = run->here.table;
  int raised = 0;
  for (int back = period(run); back-- > 0 && !raised;) {
    const int k = bind_made(run, back);
    raised = taken(run, k, t) || reset_but_counts(run, k, t, run->z, run->event.after);
    if (!raised) copy(run->z, run->event.after, run->here.dimension);
  }
  run->here.table = own;
  return raised ? RAISED : 0;
}

/* Whether the modes of the last round have the state's own states, and no guard of its edges, none of events, holds a
   state. */
static int rounds_alike(const hs_run *run) {
  const hs_mode *const own = run->here.table;
  for (int back = period(run); back-- > 0;) {
    const hs_made *const made = made_before(run, back);
    const hs_mode *const mode = &run->model->mode[made->mode];
    const hs_edge *const edge = &mode->edge[made->edge];
    if (run->here.dimension != own->dimension || mode->dimension != own->dimension) return 0;
    if (edge->of_event || (edge->contact >= 0 && run->task->settings.contacts)) return 0;
    for (int s = 0; s < own->dimension; s++)
      if (mode->state[s] != own->state[s]) return 0;
  }
  return 1;
}

/* Move run->z once round by the flow: by this `share` of each flight of the last round. To run->near how large the flow
   is at the limit, which run->zeno.turn goes through. */
static int moved_round(hs_run *run, hs_real share) {
  const int n = run->here.dimension;
  const hs_time t = run->here.t;
  hs_real *const q = run->z, *const point = run->zeno.turn, *const slope = run->end, *const far = run->near;
  if (run->here.table->flow(run->here.p, t, run->x, far)) return RAISED;
  for (int s = 0; s < n; s++) far[s] = fabs(far[s]);
  for (int back = period(run); back-- > 0;) {
    const int k = bind_made(run, back);
    const hs_real h = share * (made_before(run, back)->time - made_before(run, back + 1)->time);
    if (run->here.table->flow(run->here.p, t, point, slope)) return RAISED;
    for (int s = 0; s < n; s++) far[s] = hs_max(far[s], fabs(slope[s])), q[s] = q[s] + h * slope[s];
    if (reset_but_counts(run, k, t, q, run->event.after)) return RAISED;
    copy(q, run->event.after, n);
    if (reset_but_counts(run, k, t, point, run->event.after)) return RAISED;
    copy(point, run->event.after, n);
  }
  return 0;
}

/* Whether a round from run->z leads to all of its guards: 1, 0 or RAISED. */
static int on_guards(hs_run *run, hs_time t) {
  hs_real r, noise, *const point = run->zeno.turn;
  copy(point, run->z, run->here.dimension);
  for (int back = period(run); back-- > 0;) {
    const int k = bind_made(run, back);
    if (surface(run, k, t, point, &r) || roundoff_bound(run, k, t, point, 1, &noise)) return RAISED;
    if (!(fabs(r) <= noise)) return 0;
    if (reset_but_counts(run, k, t, point, run->event.after)) return RAISED;
    copy(point, run->event.after, run->here.dimension);
  }
  return 1;
}

/* The point that rounds run to, to run->z: 1 where it is on all guards, and no further than the flow leads within the
   relaxation. What is left of the tail has this `share` of each flight of the last round. */
static int end_of_rounds(hs_run *run, hs_real share, hs_time end) {
  const hs_mode *const own = run->here.table;
  const int n = run->here.dimension;
  copy(run->z, run->x, n);
  if (run_to(run, around, onto_guard, run->here.t)) return RAISED;
  copy(run->zeno.turn, run->z, n);
  const int raised = moved_round(run, share);
  run->here.table = own;
  if (raised || run_to(run, around, onto_guard, end)) return RAISED;
  const int on = on_guards(run, end);
  run->here.table = own;
  if (on != 1) return on;
  for (int s = 0; s < n; s++) {
    const hs_real reach = run->epsilon * run->near[s] + ROUNDOFF_UNITS * HS_UNIT * state_size(run, s);
    if (!(fabs(run->z[s] - run->x[s]) <= reach)) return 0;
  }
  return 1;
}

/* Stop at the limit of a tail of edges that take turns, which is nearly over: no motion is known to go on there. A round
   leads through all of them, through other modes with the same states, too: the limit is on all their guards. */
static int at_limit(hs_run *run) {
  hs_mode_state *const here = &run->here;
  hs_real flight, ratio;
  if (!contraction(run, &flight, &ratio) || period(run) < 2) return GOES_ON;
  const hs_time left = flight * ratio / (1 - ratio), end = here->t + left;
  if (!(left <= run->epsilon) || !(end < segment_end(run)) || end > run->pausing.at) return GOES_ON;
  if (!rounds_alike(run) || end_of_rounds(run, left / flight, end) != 1) return GOES_ON;
  if (end > here->t) {
    secant(run, &run->cubic);
    append(run, end, run->z, &run->cubic);
  }
  swap(&run->x, &run->z);
  const int own = here->mode;
  for (int back = period(run); back-- > 0;) {
    here->mode = made_before(run, back)->mode;
    note(run, HS_TAKES_TURN, made_before(run, back)->edge, 0, end, end);
  }
  here->mode = own;
  return stopped(run, HS_ACCUMULATED, end);
}

/* Stop at the end of a tail of edge k that runs to no limit, where what is left of it is shorter than time can tell.
   Events might not be armed again there: they stop before. The relaxed scheme goes on with all others. */
static int unresolved(hs_run *run, int k) {
  const hs_edge *const edge = &run->here.table->edge[k];
  const hs_time t = run->here.t;
  hs_real flights[LEAST_FLIGHTS], flight, ratio;
  int ends = 0;
  if (run->task->settings.scheme == HS_LOCATED) {
    const int follows = edge->contact >= 0 && run->task->settings.contacts;
    ends = !follows && contraction(run, &flight, &ratio) && flight * ratio <= tie(t) * (1 - ratio);
    if (edge->of_event && !ends && t == made_before(run, 0)->resumed)
      ends = shrinking(run, 1, &flight, &ratio) && flight * ratio <= LAST_TIES * tie(t);
  } else if (edge->of_event && last_flights(run, 1, flights)) {
    ends = 1;
    for (int i = 0; i < LEAST_FLIGHTS; i++) ends &= flights[i] <= tie(t);
  }
  if (!ends || empties(run, k)) return GOES_ON;
  note(run, HS_ACCUMULATES, k, 0, t, t);
  return stopped(run, HS_ACCUMULATED, t);
}
