/* A run moved by its round-off, which errors are measured by. See hsdsl/engine/simulate/moving.py. */

#include "roundoff.c"

#define ERROR_UNITS 64 /* units of round-off of a state's size: no error is smaller */

static const hs_moves *moves_of(const hs_run *run) { return run->task->moves; }

/* The registers of the routines of the mode that a run is in, bound. */
static hs_rounded *bound_registers(const hs_run *run, int traced) {
  const hs_formulas *const f = &moves_of(run)->formulas[run->here.mode];
  hs_rounded *const v = (hs_rounded *)moves_of(run)->registers;
  bind_rounded(f, run->here.table->dimension, run->model->data, run->here.p, v, traced);
  return v;
}

/* Move the results of the chosen crossing's reset, run->event.after, by their round-off, where that is known. */
static void move_reset(hs_run *run) {
  const hs_crossing *const crossing = &run->event.chosen;
  const hs_formulas *const f = &moves_of(run)->formulas[run->here.mode];
  const hs_formula *const formula = &f->reset[crossing->edge];
  const hs_edge *const edge = &run->here.table->edge[crossing->edge];
  hs_rounded *const v = bound_registers(run, 1);
  rounded_formula(f, formula, run->here.table->dimension, run->model->data, crossing->time, crossing->state, v, 1);
  for (int i = 0; i < edge->changes; i++)
    if (!hs_finite(moved(v[formula->result[i]]))) return;
  for (int i = 0; i < edge->changes; i++) run->event.after[edge->change[i]] = moved(v[formula->result[i]]);
}

/* Whether a state moves by more than the least error of one. */
static int counts(const hs_run *run, int i, hs_real by, hs_real a) {
  return fabs(by) > ERROR_UNITS * HS_UNIT * hs_max(run->sizes.scales[i], fabs(a));
}

/* Move the state of the chosen crossing along the flow to where it crosses but for the surface's round-off. */
static void move_crossing(hs_run *run) {
  const hs_crossing *const crossing = &run->event.chosen;
  const hs_mode_state *const here = &run->here;
  const hs_formulas *const f = &moves_of(run)->formulas[here->mode];
  const int n = here->table->dimension;
  hs_real rate, *const q = crossing->state, *const slope = run->step.error;
  if (hs_call(&here->table->rates[crossing->edge], here->p, crossing->time, q, &rate) || !(rate > 0)) return;
  if (here->table->flow(here->p, crossing->time, q, slope)) return;
  hs_rounded *const v = bound_registers(run, 1);
  rounded_formula(f, &f->surfaces, n, run->model->data, crossing->time, q, v, 1);
  const hs_real late = -beyond_value(v[f->surfaces.result[crossing->edge]]) / rate;
  for (int i = 0; i < n; i++)
    if (counts(run, i, late * slope[i], q[i])) q[i] += late * slope[i];
}

/* Which way a state is moved along the flow: no two, four, eight, ... states after each other go the same ways. */
static int side(unsigned state) {
  int way = 1;
  for (; state; state &= state - 1) way = -way;
  return way;
}

/* Move a state on its way by what round-off of the flow may do in a time h. */
static void move_along(hs_run *run, hs_time t, hs_real *x, hs_real h) {
  const hs_mode_state *const here = &run->here;
  const hs_formulas *const f = &moves_of(run)->formulas[here->mode];
  if (here->table != &run->model->mode[here->mode] || here->dimension != here->table->dimension) return;
  hs_rounded *const v = bound_registers(run, 0);
  rounded_formula(f, &f->flow, here->dimension, run->model->data, t, x, v, 0);
  for (int i = 0; i < here->dimension; i++)
    if (!hs_finite(v[f->flow.result[i]].off)) return;
  for (int i = 0; i < here->dimension; i++) {
    const hs_real by = h * v[f->flow.result[i]].off;
    if (counts(run, i, by, x[i])) x[i] += side((unsigned)i) * by;
  }
  run->surfaces.has_ends = 0; /* what is known of a step's end */
}

/* The same where an arc begins at run->x: by what its first step may be. */
static void move_start(hs_run *run, hs_time t) {
  const hs_real h = run->task->settings.scheme == HS_LOCATED ? within_reach(run, run->control.h) : run->control.h;
  const hs_real left = segment_end(run) - t;
  for (int s = 0; s < run->here.dimension; s++) run->sizes.scales[s] = hs_max(run->sizes.scales[s], fabs(run->x[s]));
  if (left > 0) move_along(run, t, run->x, hs_min(h, left));
}
