/* Zeno tails: impacts that follow each other ever faster towards rest on a guard are replaced by their limit (M11).
   See hsdsl/simulate/zeno.py. */

#include "functions.h"

#define LEAST_FLIGHTS 3
#define MOST_CORRECTIONS_TO_GUARD 4
#define MOST_ROUNDS 60

/* Transition `back` before the last one. */
static const hs_made *made_before(const hs_run *run, int back) { return &run->made[(run->jump - 1 - back) % FREE]; }

/* Whether the flights of the last edge shrink: the last one, and the largest ratio of the last few. */
static int contraction(const hs_run *run, hs_real *flight, hs_real *ratio) {
  const hs_made *const last = made_before(run, 0);
  hs_time later = last->time;
  hs_real after = 0.0;
  int flights = 0;
  for (int i = 1; i < FREE && i < run->jump && flights < LEAST_FLIGHTS; i++) {
    const hs_made *const made = made_before(run, i);
    if (made->mode != last->mode || made->mode != made->target || made->entry) break;
    if (made->edge != last->edge) continue;
    const hs_real one = later - made->time;
    if (!(one > 0)) return 0;
    if (!flights) *flight = one, *ratio = 0.0;
    if (flights) *ratio = hs_max(*ratio, after / one);
    after = one, later = made->time;
    flights++;
  }
  return flights == LEAST_FLIGHTS && last->mode == last->target && !last->entry && *ratio < 1;
}

static hs_real accelerated(hs_real a, hs_real b, hs_real c) {
  const hs_real bend = c - 2 * b + a;
  return bend != 0 ? a - (b - a) * (b - a) / bend : c;
}

/* The point that repeated resets of edge k run to from run->z, to run->z. */
static int fixed_point(hs_run *run, int k, hs_time t) {
  const hs_mode_state *here = &run->here;
  const hs_edge *edge = &here->table->edge[k];
  const int n = here->dimension;
  hs_real *const x = run->z, *const one = run->after, *const two = run->at;
  for (int i = 0; i < MOST_ROUNDS; i++) {
    if (hs_changed(edge, edge->reset, here->p, t, x, x, one)) return RAISED;
    if (same_state(one, x, n)) break;
    if (hs_changed(edge, edge->reset, here->p, t, one, one, two)) return RAISED;
    for (int s = 0; s < n; s++) x[s] = accelerated(x[s], one[s], two[s]);
  }
  return 0;
}

/* A point near the guard of edge k taken to it, each state in proportion to its scale. */
static int onto_guard(hs_run *run, int k, hs_time t, hs_real *x) {
  const int n = run->here.dimension;
  hs_real *const weights = run->at;
  for (int i = 0; i < MOST_CORRECTIONS_TO_GUARD; i++) {
    hs_real r, noise;
    if (surface(run, k, t, x, &r) || roundoff_bound(run, k, t, x, 0, &noise)) return RAISED;
    if (gradient_of(run, k, t, x)) return RAISED;
    if (fabs(r) <= noise) break;
    hs_real across = r * 0;
    for (int s = 0; s < n; s++) {
      weights[s] = run->gradient[s + 1] * run->scales[s] * run->scales[s];
      across = across + run->gradient[s + 1] * weights[s];
    }
    if (across > 0)
      for (int s = 0; s < n; s++) x[s] = x[s] - r / across * weights[s];
  }
  return 0;
}

/* The point that a tail of edge k, also in contact with run->held, runs to at its end, to run->z: 1; 0 where it is not
   on the guard. */
static int limit_of(hs_run *run, int k, hs_time end) {
  const hs_mode_state *here = &run->here;
  const int n = here->dimension;
  hs_real r, noise, *const q = run->z;
  copy(q, run->x, n);
  if (fixed_point(run, k, here->t)) return RAISED;
  if (here->table->edge[k].contact >= 0) {
    bind_contacts(run, run->held, run->held);
    const int raised = here->table->flow(here->p, here->t, q, run->end);
    bind_mode(run);
    if (raised) return RAISED;
    for (int s = 0; s < n; s++) q[s] = q[s] + (end - here->t) * run->end[s];
    if (onto_guard(run, k, end, q)) return RAISED;
  }
  if (fixed_point(run, k, end) || surface(run, k, end, q, &r) || roundoff_bound(run, k, end, q, 1, &noise))
    return RAISED;
  return !(fabs(r) > noise);
}

/* Whether a surface other than k is passed on the way from x to a limit q: 1, 0 or RAISED. */
static int meets_another(hs_run *run, hs_time t, const hs_real *x, hs_time end, const hs_real *q, int k) {
  const hs_mode_state *here = &run->here;
  const int m = here->table->surfaces;
  if (here->table->values(here->p, t, x, run->ahead) || here->table->values(here->p, end, q, run->ends)) return RAISED;
  for (int j = 0; j < m; j++) {
    hs_real noise, before;
    if (roundoff_bound(run, j, end, q, 0, &noise)) return RAISED;
    if (!(run->ends[j] > noise)) continue;
    if (roundoff_bound(run, j, t, x, 0, &before)) return RAISED;
    if (j != k && !(run->ahead[j] > before)) return 1;
  }
  return 0;
}

/* Go to the limit of a tail of edge k that is nearly over; stop at one where no motion along the guard goes on. */
static int close_tail(hs_run *run, int k) {
  hs_mode_state *const here = &run->here;
  hs_real flight, ratio;
  if (!contraction(run, &flight, &ratio) || here->dimension != here->table->dimension || !here->dimension)
    return GOES_ON;
  const hs_real left = flight * ratio / (1 - ratio);
  const hs_time whole = here->t + left, end = earlier(whole, segment_end(run));
  if (left > run->epsilon || whole > run->pause || !(end > here->t)) return GOES_ON;
  const hs_mode *const own = here->table;
  if (contact_at(run) != GOES_ON) return HS_ACCUMULATED;
  const int touches = in_touch(run, k);
  for (int j = 0; j < own->edges; j++) run->held[j] = j == k || in_touch(run, j), run->kept[j] = j == k;
  if (here->table != own) after_contact(run);
  hs_real *const q = run->z;
  if (touches || limit_of(run, k, end) != 1 || keeps(run, end, q, k) != 1) return GOES_ON;
  if (!is_possible(run, k, end, q, run->held, 0)) return GOES_ON;
  if (own->edge[k].contact < 0 || !run->task->settings.contacts) {
    note(run, HS_ACCUMULATES, k, 0, end, here->t);
    return stopped(run, HS_ACCUMULATED, here->t);
  }
  if (!keeping(run, end, q, run->kept, run->held)) return GOES_ON;
  pushes(run, end, q, run->held, run->kept, run->beyond);
  if (!run->beyond[k] || meets_another(run, here->t, run->x, end, q, k)) return GOES_ON;
  note(run, HS_REPLACED, k, run->jump - 1, end, left);
  secant(run, &run->cubic);
  append(run, end, q, &run->cubic);
  swap(&run->x, &run->z);
  place(run, here->mode, here->dimension, end, 0);
  here->table->values(here->p, end, run->x, run->ahead);
  enter_surfaces(run, end, 0.0, 0, end);
  if (!run->active_surfaces[k]) run->active_surfaces[k] = 1, here->standing++;
  return GOES_ON;
}
