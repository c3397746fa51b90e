/* Motion along a guard (M11): a state that its own reset keeps while the flow pushes it out. While it lasts,
   run->here.table is the motion's, whose edges are those of the mode and then some that release it.
   See hsdsl/simulate/contact.py. Functions return 1 or 0, or RAISED where a routine has no value. */

#include "functions.h"

#define SAME_UNITS 4
#define ZERO_UNITS 16

/* For each state the size that its flow has had, to run->flow_sizes; `slope` is the flow. See simulate/scales.py. */
static int flow_sizes(hs_run *run, hs_time t, const hs_real *x, const hs_real *slope) {
  const int n = run->here.dimension;
  const hs_sparse *const rows = &run->here.table->jacobian;
  if (rows->values(run->here.p, t, x, run->jacobian)) return RAISED;
  for (int i = 0; i < n; i++) run->flow_sizes[i] = fabs(slope[i]);
  for (int k = 0; k < rows->count; k++) {
    hs_real *const size = &run->flow_sizes[rows->place[k] / n];
    *size = *size + fabs(run->jacobian[k]) * run->scales[rows->place[k] % n];
  }
  return 0;
}

/* Whether edge k is possible and its reset leaves the state where it is. */
static int keeps(hs_run *run, hs_time t, const hs_real *x, int k) {
  const hs_mode_state *here = &run->here;
  int still = 1;
  if (hs_changed(&here->table->edge[k], here->table->edge[k].reset, here->p, t, x, x, run->after)) return RAISED;
  for (int s = 0; s < here->dimension; s++)
    still &= fabs(run->after[s] - x[s]) <= SAME_UNITS * HS_UNIT * run->scales[s];
  return still ? condition(run, k, t, x) : 0;
}

/* Whether the flow is tangent to surface k, to round-off. */
static int is_tangent(hs_run *run, hs_time t, const hs_real *x, int k) {
  const hs_mode_state *here = &run->here;
  const hs_sparse *const row = &here->table->gradients[k];
  hs_real rate, size = 0.0;
  if (here->table->flow(here->p, t, x, run->end) || row->values(here->p, t, x, run->gradient) ||
      here->table->rates[k](here->p, t, x, &rate) || flow_sizes(run, t, x, run->end))
    return RAISED;
  for (int i = 0; i < row->count; i++)
    size = size + fabs(run->gradient[i]) * (row->place[i] ? run->flow_sizes[row->place[i] - 1] : 1.0);
  return fabs(rate) <= ZERO_UNITS * HS_UNIT * size;
}

/* Whether the flow presses on the guard of edge k, and its reset keeps the state there. */
static int presses(hs_run *run, hs_time t, const hs_real *x, int k) {
  hs_mode_state *const here = &run->here;
  const hs_mode *const own = here->table;
  const int contact = own->edge[k].contact, active = run->active_surfaces[k];
  if (contact < 0 || !run->task->settings.contacts || keeps(run, t, x, k) != 1) return 0;
  const hs_mode *const held = &run->model->mode[contact];
  hs_real r, noise;
  here->table = held, run->active_surfaces[k] = 0;
  const int raised = surface(run, k, t, x, &r) || roundoff_bound(run, k, t, x, 0, &noise);
  here->table = own, run->active_surfaces[k] = active;
  if (raised || !(r < -noise)) return 0;
  return held->push_order == 1 || is_tangent(run, t, x, k) == 1;
}

/* Number the marks of walls anew where a table has `more` edges than the one before. */
static void move_walls(int *marks, const hs_mode *from, int more) {
  if (more > 0)
    for (int j = from->surfaces; j-- > from->edges;) marks[j + more] = marks[j];
  else if (more < 0)
    for (int j = from->edges; j < from->surfaces; j++) marks[j + more] = marks[j];
  for (int j = 0; j < more; j++) marks[from->edges + j] = 0;
}

/* Count the surfaces that the state is on. */
static void count_active(hs_run *run) {
  run->here.standing = 0;
  for (int j = 0; j < run->here.table->surfaces; j++) run->here.standing += run->active_surfaces[j];
}

/* Be in contact with the guard of edge k as well, by the table of this number. */
static void in_contact(hs_run *run, int k, int contact) {
  const hs_mode *const before = run->here.table;
  run->here.table = &run->model->mode[contact];
  run->active_surfaces[k] = 0;
  run->here.emerging = 0;
  move_walls(run->active_surfaces, before, run->here.table->edges - before->edges);
  count_active(run);
}

/* Be in contact with every guard that holds the state: GOES_ON, or a stop where they hold it together. */
static int contact_at(hs_run *run) {
  hs_mode_state *const here = &run->here;
  const hs_mode *const own = here->table;
  int count = 0;
  if (!here->standing || here->dimension != own->dimension || !here->dimension) return GOES_ON;
  for (int k = 0; k < own->edges; k++) {
    run->beyond[k] = run->active_surfaces[k] && presses(run, here->t, run->x, k);
    count += run->beyond[k];
  }
  for (int k = 0; count && k < own->edges; k++) {
    if (!run->beyond[k]) continue;
    const int contact = here->table->edge[k].contact;
    if (contact < 0) {
      if (here->table != own) after_contact(run);
      note(run, HS_ACCUMULATES, k, 0, here->t, here->t);
      return stopped(run, HS_ACCUMULATED, here->t);
    }
    in_contact(run, k, contact);
  }
  return GOES_ON;
}

/* Whether the state is in contact with the guard of edge k of its mode. */
static int in_touch(const hs_run *run, int k) {
  return k < run->model->mode[run->here.mode].edges && run->here.table->edge[k].releases;
}

/* End all contacts. */
static void after_contact(hs_run *run) {
  hs_mode_state *const here = &run->here;
  const hs_mode *const held = here->table, *const own = &run->model->mode[here->mode];
  for (int k = 0; k < own->edges; k++)
    if (held->edge[k].releases) run->active_surfaces[k] = 1;
  move_walls(run->active_surfaces, held, own->edges - held->edges);
  here->table = own;
  count_active(run);
}

/* Move t to the first moment from it on, within the tie of times, at which an `if` in contact does not hold, and the
   state run->x to run->z: 1; 0 where all hold. */
static int condition_ends(hs_run *run, hs_time *t) {
  const hs_mode_state *here = &run->here;
  const hs_mode *const held = here->table, *const own = &run->model->mode[here->mode];
  const hs_time from = *t;
  copy(run->z, run->x, here->dimension);
  if (held->flow(here->p, from, run->x, run->end)) return 1;
  for (hs_real after = HS_UNIT * run->until; after <= tie(run, from); after = after * 2) {
    int holds = 1;
    *t = from + after;
    for (int s = 0; s < here->dimension; s++) run->z[s] = run->x[s] + after * run->end[s];
    for (int k = 0; k < own->edges && holds == 1; k++) {
      if (!held->edge[k].releases) continue;
      run->here.table = own;
      holds = condition(run, k, *t, run->z);
      run->here.table = held;
    }
    if (holds != 1) return 1;
  }
  *t = from;
  return 0;
}
