/* Motion along a guard (M11): a state that its own reset keeps while the flow pushes it out. While it lasts,
   run->here.table is the motion's, whose edges are those of the mode and then some that release it.
   See hsdsl/simulate/contact.py. Functions return 1 or 0, or RAISED where a routine has no value. */

#include "functions.h"

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

/* Whether edge k is possible and its reset leaves the state where it is. */
static int keeps(hs_run *run, hs_time t, const hs_real *x, int k) {
  const hs_mode_state *here = &run->here;
  int still = 1;
  if (here->table->edge[k].reset(here->p, t, x, run->after)) return RAISED;
  for (int s = 0; s < here->dimension; s++)
    still &= fabs(run->after[s] - x[s]) <= SAME_UNITS * HS_UNIT * run->scales[s];
  return still ? condition(run, k, t, x) : 0;
}

/* Whether the flow is tangent to surface k, to round-off. */
static int is_tangent(hs_run *run, hs_time t, const hs_real *x, int k) {
  const hs_mode_state *here = &run->here;
  hs_real rate;
  if (here->table->flow(here->p, t, x, run->end) || here->table->gradients[k](here->p, t, x, run->gradient) ||
      here->table->rates[k](here->p, t, x, &rate) || flow_sizes(run, t, x, run->end))
    return RAISED;
  hs_real size = fabs(run->gradient[0]);
  for (int s = 0; s < here->dimension; s++) size = size + fabs(run->gradient[s + 1]) * run->flow_sizes[s];
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

/* Begin the motion along a guard that holds the state, and return its edge; -1 where none does. */
static int contact_at(hs_run *run) {
  hs_mode_state *const here = &run->here;
  const hs_mode *const own = here->table;
  if (!here->standing || here->dimension != own->dimension || !here->dimension) return -1;
  for (int k = 0; k < own->edges; k++)
    if (run->active_surfaces[k] && presses(run, here->t, run->x, k)) {
      here->table = &run->model->mode[own->edge[k].contact];
      run->active_surfaces[k] = 0;
      here->standing--;
      here->emerging = 0;
      move_walls(run->active_surfaces, own, here->table->edges - own->edges);
      return k;
    }
  return -1;
}

/* End the motion along the guard of edge k. */
static void after_contact(hs_run *run, int k) {
  hs_mode_state *const here = &run->here;
  const hs_mode *const held = here->table;
  here->table = &run->model->mode[here->mode];
  move_walls(run->active_surfaces, held, here->table->edges - held->edges);
  run->active_surfaces[k] = 1;
  here->standing = 0;
  for (int j = 0; j < here->table->surfaces; j++) here->standing += run->active_surfaces[j];
}

/* Move t to the first moment from it on, within the tie of times, at which the `if` of edge k does not hold, and the
   state run->x to run->z: 1; 0 where it holds. */
static int condition_ends(hs_run *run, int k, hs_time *t) {
  const hs_mode_state *here = &run->here;
  const hs_mode *const held = here->table, *const own = &run->model->mode[here->mode];
  const hs_time from = *t;
  copy(run->z, run->x, here->dimension);
  if (held->flow(here->p, from, run->x, run->end)) return 1;
  for (hs_real after = HS_UNIT * run->until; after <= tie(run, from); after = after * 2) {
    *t = from + after;
    for (int s = 0; s < here->dimension; s++) run->z[s] = run->x[s] + after * run->end[s];
    run->here.table = own;
    const int holds = condition(run, k, *t, run->z);
    run->here.table = held;
    if (holds != 1) return 1;
  }
  *t = from;
  return 0;
}
