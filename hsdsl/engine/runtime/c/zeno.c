/* Zeno tails: impacts that follow each other ever faster towards rest on guards are replaced by their limit (M11).
   See hsdsl/engine/simulate/zeno.py. */

#include "functions.h"

#define LEAST_FLIGHTS 3
#define LAST_TIES 4
#define MOST_CORRECTIONS_TO_GUARD 4
#define MOST_ROUNDS 60
#define MOST_LEAP 16

/* Transition `back` before the last one. */
static const hs_made *made_before(const hs_run *run, int back) { return &run->made[(run->jump - 1 - back) % FREE]; }

/* The last few flights between transitions of the last edge, the last one first; 0 where they are not as many. Where
   they are `of_flow`, time in strips does not count. */
static int last_flights(const hs_run *run, int of_flow, hs_real *flight) {
  const hs_made *const last = made_before(run, 0);
  hs_time later = last->time, waited = 0.0;
  int flights = 0;
  if (last->mode != last->target || last->entry) return 0;
  for (int i = 1; i < FREE && i < run->jump && flights < LEAST_FLIGHTS; i++) {
    const hs_made *const made = made_before(run, i);
    if (made->mode != last->mode || made->mode != made->target || (made->entry && made->edge == last->edge)) break;
    if (of_flow && made->resumed == made->resumed) waited = waited + (made->resumed - made->time);
    if (made->edge != last->edge) continue;
    flight[flights++] = later - (made->time + waited);
    later = made->time + waited;
  }
  return flights == LEAST_FLIGHTS;
}

/* Whether the flights of the last edge shrink: the last one, and the largest ratio of the last few. */
static int shrinking(const hs_run *run, int of_flow, hs_real *flight, hs_real *ratio) {
  hs_real flights[LEAST_FLIGHTS];
  if (!last_flights(run, of_flow, flights)) return 0;
  *flight = flights[0], *ratio = 0.0;
  for (int i = 0; i < LEAST_FLIGHTS; i++) {
    if (!(flights[i] > 0)) return 0;
    if (i) *ratio = hs_max(*ratio, flights[i - 1] / flights[i]);
  }
  return *ratio < 1;
}

static int contraction(const hs_run *run, hs_real *flight, hs_real *ratio) { return shrinking(run, 0, flight, ratio); }

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

static hs_real accelerated(hs_real a, hs_real b, hs_real c) {
  const hs_real bend = c - 2 * b + a;
  const int slow = bend != 0 && fabs(c - b) <= fabs(b - a) && fabs(c - b) <= MOST_LEAP * fabs(bend);
  return slow ? a - (b - a) / bend * (b - a) : c;
}

/* Whether each state moves no further from a to b than from c to d. */
static int shorter(const hs_real *a, const hs_real *b, const hs_real *c, const hs_real *d, int n) {
  for (int s = 0; s < n; s++)
    if (!(fabs(b[s] - a[s]) <= fabs(d[s] - c[s]))) return 0;
  return 1;
}

/* Let what has no digits left be zero. */
static void without_nothing(hs_real *x, int n) {
  for (int s = 0; s < n; s++) x[s] = fabs(x[s]) > HS_NOTHING ? x[s] : x[s] - x[s];
}

/* The point that repeated resets of edge k run to from run->z, to run->z. */
static int fixed_point(hs_run *run, int k, hs_time t) {
  const hs_mode_state *here = &run->here;
  const int n = here->dimension;
  hs_real *const x = run->z, *const one = run->after, *const two = run->at, *const after = run->near;
  for (int i = 0; i < MOST_ROUNDS; i++) {
    if (reset_but_counts(run, k, t, x, one)) return RAISED;
    if (same_state(one, x, n)) break;
    if (reset_but_counts(run, k, t, one, two)) return RAISED;
    for (int s = 0; s < n; s++) x[s] = accelerated(x[s], one[s], two[s]);
    if (reset_but_counts(run, k, t, x, after)) return RAISED;
    copy(x, shorter(x, after, one, two, n) ? after : two, n);
    without_nothing(x, n);
  }
  return 0;
}

/* run->z taken to the guard of edge k, which is near, as near as numbers are, each state in proportion to its scale. */
static int onto_guard(hs_run *run, int k, hs_time t) {
  const int n = run->here.dimension;
  hs_real *const x = run->z, *const weights = run->at, *const nearer = run->after;
  hs_real r, left;
  if (surface(run, k, t, x, &r)) return RAISED;
  for (int i = 0; i < MOST_CORRECTIONS_TO_GUARD; i++) {
    if (gradient_of(run, k, t, x)) return RAISED;
    hs_real across = r * 0;
    for (int s = 0; s < n; s++) {
      weights[s] = run->gradient[s + 1] * state_size(run, s) * state_size(run, s);
      across = across + run->gradient[s + 1] * weights[s];
    }
    if (!(across > 0)) break;
    for (int s = 0; s < n; s++) nearer[s] = x[s] - r / across * weights[s];
    if (surface(run, k, t, nearer, &left)) return RAISED;
    if (!(fabs(left) < fabs(r))) break;
    copy(x, nearer, n);
    r = left;
  }
  return 0;
}

/* run->z taken by each edge of the tail, in turn. */
static int by_each(hs_run *run, int (*taken)(hs_run *, int, hs_time), hs_time t) {
  for (int k = 0; k < run->here.table->edges; k++)
    if (run->tail[k] && taken(run, k, t)) return RAISED;
  return 0;
}

/* The point that run->z runs to, to run->z, which the edges of the tail, `count` of them, in turn take to what one of
   them keeps. */
static int in_turn(hs_run *run, int (*taken)(hs_run *, int, hs_time), int count, hs_time t) {
  const int n = run->here.dimension;
  hs_real *const x = run->z, *const first = run->turn, *const one = first + n;
  hs_real *const two = run->nearby;
  if (count == 1) return by_each(run, taken, t);
  for (int i = 0; i < MOST_ROUNDS; i++) {
    copy(first, x, n);
    if (by_each(run, taken, t)) return RAISED;
    if (same_state(first, x, n)) break;
    copy(one, x, n);
    if (by_each(run, taken, t)) return RAISED;
    copy(two, x, n);
    for (int s = 0; s < n; s++) x[s] = first[s] = accelerated(first[s], one[s], two[s]);
    if (by_each(run, taken, t)) return RAISED;
    if (!shorter(first, x, one, two, n)) copy(x, two, n);
    without_nothing(x, n);
  }
  return 0;
}

/* Be in the mode itself again at t, the state x without what steps along its guards were off by: they may hold it
   again. It stays on that of the edge that it has `reached`, -1 for none. It is off them by the round-off of what it has
   ever been computed from. */
static void be_held_exactly(hs_run *run, hs_time t, hs_real *x, int reached) {
  const hs_mode_state *here = &run->here;
  const int edges = run->model->mode[here->mode].edges;
  int count = 0, held = 1;
  run->still = same_state(run->began, x, here->dimension);
  for (int k = 0; k < edges; k++) count += run->kept[k] = in_touch(run, k);
  after_contact(run);
  for (int s = 0; s < here->dimension; s++) run->scale[s] = joined(run->scale[s], run->scales[s]);
  for (int k = 0; k < here->table->surfaces; k++) run->tail[k] = k < edges && run->kept[k];
  copy(run->z, x, here->dimension);
  if (reached >= 0) run->tail[reached] = 1;
  if (in_turn(run, onto_guard, count + (reached >= 0), t)) return;
  if (reached >= 0) run->tail[reached] = 0;
  if (in_turn(run, fixed_point, count, t)) return;
  for (int k = 0; k < edges && held; k++) held = !run->tail[k] || keeps(run, t, run->z, k) == 1;
  if (held) copy(x, run->z, here->dimension);
}

/* Whether what each edge of the tail takes back, of its guard or of the rate of that, is no more than pushes make within
   the relaxation: 1, 0 or RAISED. So near is the limit. */
static int is_near(hs_run *run) {
  const hs_mode *const own = run->here.table;
  const hs_time t = run->here.t;
  bind_contacts(run, 0, run->tail);
  const int raised = magnitudes_at(run, t, run->x, run->magnitudes);
  bind_mode(run);
  if (raised || own->values(run->here.p, t, run->x, run->values)) return RAISED;
  for (int k = 0; k < own->edges; k++) {
    if (!run->tail[k]) continue;
    hs_real last = run->values[k];
    if (own->edge[k].push_order == 2 && own->rates[k](run->here.p, t, run->x, &last)) return RAISED;
    if (!(fabs(last) <= run->epsilon * run->magnitudes[k])) return 0;
  }
  return 1;
}

/* The point that the tail, of `count` edges, runs to at its end, also in contact with run->held, to run->z: 1; 0 where
   it is not on the guards. */
static int limit_of(hs_run *run, int count, hs_time end) {
  const hs_mode_state *here = &run->here;
  const int n = here->dimension;
  int along = 0;
  hs_real r, noise, *const q = run->z;
  for (int k = 0; k < here->table->edges; k++) along |= run->tail[k] && here->table->edge[k].contact >= 0;
  if (along && is_near(run) != 1) return 0;
  copy(q, run->x, n);
  if (in_turn(run, fixed_point, count, here->t)) return RAISED;
  if (along) {
    bind_contacts(run, run->held, run->held);
    const hs_time h = end - here->t;
    int raised = here->table->flow(here->p, here->t, q, run->end);
    for (int s = 0; s < n; s++) run->after[s] = q[s] + h * run->end[s];
    raised = raised || here->table->flow(here->p, end, run->after, run->at);
    bind_mode(run);
    if (raised) return RAISED;
    for (int s = 0; s < n; s++) q[s] = q[s] + h * (run->end[s] + run->at[s]) / 2;
    if (in_turn(run, onto_guard, count, end)) return RAISED;
  }
  if (in_turn(run, fixed_point, count, end)) return RAISED;
  for (int k = 0; k < here->table->edges; k++) {
    if (!run->tail[k]) continue;
    if (surface(run, k, end, q, &r) || roundoff_bound(run, k, end, q, 1, &noise)) return RAISED;
    if (!(fabs(r) <= noise)) return 0;
  }
  return 1;
}

/* Whether a surface other than those of the tail is passed on the way from x to a limit q: 1, 0 or RAISED. */
static int meets_another(hs_run *run, hs_time t, const hs_real *x, hs_time end, const hs_real *q) {
  const hs_mode_state *here = &run->here;
  const int m = here->table->surfaces;
  if (here->table->values(here->p, t, x, run->ahead) || here->table->values(here->p, end, q, run->ends)) return RAISED;
  for (int j = 0; j < m; j++) {
    hs_real noise, before;
    if (roundoff_bound(run, j, end, q, 0, &noise)) return RAISED;
    if (!(run->ends[j] > noise)) continue;
    if (roundoff_bound(run, j, t, x, 0, &before)) return RAISED;
    if (!run->tail[j] && !(run->ahead[j] > before)) return 1;
  }
  return 0;
}

/* The time of flow up to t since the first of the last transitions, without that in strips. */
static hs_time flown(const hs_run *run, hs_time t) {
  hs_time found = t - made_before(run, FREE - 1)->time;
  for (int i = FREE - 1; i >= 0; i--) {
    const hs_made *made = made_before(run, i);
    found = found - (made->resumed == made->resumed ? made->resumed - made->time : 0);
  }
  return found;
}

/* Mark in run->tail the edges of the last transitions, where each leads back to the present mode and its guard can hold a
   state; return how many. */
static int of_contacts(hs_run *run) {
  const hs_mode_state *here = &run->here;
  int count = 0;
  for (int j = 0; j < here->table->surfaces; j++) run->tail[j] = 0;
  if (!run->task->settings.contacts) return 0;
  for (int i = 0; i < FREE; i++) {
    const hs_made *made = made_before(run, i);
    if (made->entry || made->mode != here->mode || made->target != here->mode) return 0;
    if (here->table->edge[made->edge].contact < 0) return 0;
    count += !run->tail[made->edge];
    run->tail[made->edge] = 1;
  }
  return count;
}

/* Mark in run->tail the edges of a tail that ends within the relaxation, and bound what is `left` of it; return how
   many. The last transition was that of edge k. */
static int nearly_over(hs_run *run, int k, hs_time *left) {
  const hs_mode_state *here = &run->here;
  hs_real flight, ratio;
  if (contraction(run, &flight, &ratio)) {
    for (int j = 0; j < here->table->surfaces; j++) run->tail[j] = j == k;
    *left = flight * ratio / (1 - ratio);
    return !(*left > run->epsilon);
  }
  if (run->jump < FREE) return 0;
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
  if (keeping(run, end, q, run->kept) != count) return 0;
  if (instant) return 1;
  for (int j = 0; j < edges; j++) all += run->held[j];
  if (!pressing(run, end, q, run->held, all, run->kept, run->beyond)) return 0;
  for (int j = 0; j < edges; j++) presses |= run->tail[j] && run->kept[j];
  return presses;
}

/* Go to the limit of a tail that is nearly over; stop at one where no motion along the guard goes on. The last
   transition was that of edge k. */
static int close_tail(hs_run *run, int k) {
  hs_mode_state *const here = &run->here;
  hs_time left;
  int touches = 1;
  if (here->dimension != here->table->dimension || !here->dimension || empties(run, k)) return GOES_ON;
  const int count = nearly_over(run, k, &left);
  if (!count) return GOES_ON;
  const hs_time whole = here->t + left;
  hs_time end = earlier(whole, segment_end(run));
  const int instant = count > 1 && end == here->t;
  if (whole > run->pause || !(end > here->t || instant)) return GOES_ON;
  const hs_mode *const own = here->table;
  if (contact_at(run) != GOES_ON) return HS_ACCUMULATED;
  for (int j = 0; j < own->edges; j++) {
    touches &= !run->tail[j] || in_touch(run, j);
    run->held[j] = run->tail[j] || in_touch(run, j), run->kept[j] = run->tail[j];
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
    if (run->tail[j] && keeps(run, end, q, j) != 1) return GOES_ON;
  if (own->edge[k].contact < 0 || !run->task->settings.contacts) {
    if (!is_possible(run, k, end, q, run->held)) return GOES_ON;
    note(run, HS_ACCUMULATES, k, 0, end, here->t);
    return stopped(run, HS_ACCUMULATED, here->t);
  }
  if (!is_held(run, end, q, count, instant) || meets_another(run, here->t, run->x, end, q)) return GOES_ON;
  for (int j = 0; j < own->edges; j++)
    if (run->tail[j]) note(run, HS_REPLACED, j, run->jump - 1, end, left);
  if (end > here->t) {
    secant(run, &run->cubic);
    append(run, end, q, &run->cubic);
  }
  swap(&run->x, &run->z);
  place(run, here->mode, here->dimension, end, 0);
  here->table->values(here->p, end, run->x, run->ahead);
  enter_surfaces(run, end, 0.0, 0, end);
  for (int j = 0; j < own->edges; j++)
    if (run->tail[j] && !run->active_surfaces[j]) run->active_surfaces[j] = 1, here->standing++;
  return GOES_ON;
}

/* Stop at the end of a tail of edge k that runs to no limit, where what is left of it is shorter than time can tell.
   Events might not be armed again there: they stop before. The relaxed scheme goes on with all others. */
static int unresolved(hs_run *run, int k) {
  const hs_edge *const edge = &run->here.table->edge[k];
  const hs_time t = run->here.t;
  hs_real flights[LEAST_FLIGHTS], flight, ratio;
  int ends = 0;
  if (empties(run, k)) return GOES_ON;
  if (run->task->settings.scheme == HS_LOCATED) {
    const int follows = edge->contact >= 0 && run->task->settings.contacts;
    ends = !follows && contraction(run, &flight, &ratio) && flight * ratio <= tie(t) * (1 - ratio);
    if (edge->of_event && !ends && t == made_before(run, 0)->resumed)
      ends = shrinking(run, 1, &flight, &ratio) && flight * ratio <= LAST_TIES * tie(t);
  } else if (edge->of_event && last_flights(run, 1, flights)) {
    ends = 1;
    for (int i = 0; i < LEAST_FLIGHTS; i++) ends &= flights[i] <= tie(t);
  }
  if (!ends) return GOES_ON;
  note(run, HS_ACCUMULATES, k, 0, t, t);
  return stopped(run, HS_ACCUMULATED, t);
}
