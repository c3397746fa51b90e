/* Entering a mode, choosing among crossings, resets. See hsdsl/engine/simulate/run.py. */

#include "functions.h"

static hs_reason stopped(hs_run *run, hs_reason reason, hs_time t) {
  hs_stop *stop = &run->task->stop;
  stop->reason = reason;
  stop->time = t;
  stop->mode = run->here.mode;
  stop->dimension = run->here.dimension;
  stop->segment = run->here.segment;
  stop->h = run->control.h;
  copy(stop->x, run->x, run->here.dimension);
  copy(stop->scales, run->scales, run->here.dimension);
  return reason;
}

/* Keep the scales of a mode's states, and have those of the next one's. */
static void hand_on_scales(hs_run *run, const hs_mode *from, const hs_mode *to) {
  for (int s = 0; from && s < from->dimension; s++) run->known[from->state[s]] = run->scales[s];
  for (int s = 0; s < run->width; s++) run->scales[s] = s < to->dimension ? run->known[to->state[s]] : 0.0;
}

/* Bound the first step of an arc of flow that begins in a mode; further ones may be twice as long each. */
static void bound_first_step(hs_run *run, int mode) {
  const hs_settings *settings = &run->task->settings;
  const hs_real bound = run->placed < settings->arcs ? settings->first_steps[run->placed] : 0.0;
  hs_real *const reach = &run->reach[mode];
  run->placed++;
  if (bound > 0) *reach = *reach > 0 ? hs_min(*reach, bound) : bound;
}

/* Enter a mode at (t, run->x): bind its routines to the input segment of this time and open an arc.
   A final mode without a flow has the states, and so the outputs, of the mode before it. */
static void place(hs_run *run, int mode, int dimension, hs_time t, const hs_mode_state *before) {
  hs_mode_state here;
  here.mode = mode;
  here.dimension = dimension;
  here.table = &run->model->mode[mode];
  here.segment = segment_at(run->task->timeline, t);
  here.p = segment_data(run, here.segment);
  here.outputs = here.table->dimension == dimension ? here.table->outputs : 0;
  here.outputs_p = here.p;
  if (!here.outputs && before && before->table->dimension == dimension) {
    here.outputs = before->table->outputs;
    here.outputs_p = before->p;
  }
  here.standing = here.emerging = 0;
  here.t = t;
  hand_on_scales(run, run->here.table, here.table);
  run->here = here;
  if (run->task->settings.arcs) bound_first_step(run, mode);
  HS_MOVE(run, move_start(run, t));
  begin(run, HS_FLOW);
  append(run, t, run->x, 0);
  copy(run->entered, run->x, dimension);
}

static int limit_reached(const hs_run *run) { return run->jump >= run->task->settings.max_transitions; }

/* Whether edge `a` goes before edge `b` of those tied: the higher priority, then the file's order. */
static int goes_before(const hs_mode *mode, int a, int b) {
  const int p = mode->edge[a].priority, q = mode->edge[b].priority;
  return p != q ? p > q : a < b;
}

/* Choose which of several crossings goes: the earliest; of tied ones the highest priority, then the file's order.
   Tied are also guards that the earliest crossing's point stands on. The chosen edge goes from that point. */
static void choose(hs_run *run, int count) {
  const hs_mode *mode = run->here.table;
  hs_crossing *first = &run->crossings[0];
  for (int i = 1; i < count; i++)
    if (run->crossings[i].time < first->time) first = &run->crossings[i];
  const hs_real since = tie(first->time);
  hs_real depth = first->depth;
  int chosen = first->edge;
  standing(run, first->time, first->state, since, run->tied);
  for (int i = 0; i < count; i++)
    if (run->crossings[i].time - first->time <= since) run->tied[run->crossings[i].edge] = 2 + i;
  for (int k = 0; k < mode->edges; k++)
    if (run->tied[k] && goes_before(mode, k, chosen)) chosen = k;
  if (run->tied[chosen] >= 2) depth = run->crossings[run->tied[chosen] - 2].depth;
  run->alternatives_count = 0;
  for (int k = 0; k < mode->edges; k++)
    if (run->tied[k] && k != chosen) run->alternatives[run->alternatives_count++] = k;
  run->chosen = *first;
  run->chosen.edge = chosen;
  run->chosen.depth = depth;
}

/* Apply the chosen crossing's reset to the values before the jump, sizes of their numbers in `scale`: the state behind
   it to run->after, and to run->both the sizes of the numbers it came from. Not 0 where it has no finite value. */
static int reset(hs_run *run, const hs_real *scale) {
  const hs_crossing *crossing = &run->chosen;
  const hs_edge *edge = &run->here.table->edge[crossing->edge];
  const int n = run->here.dimension, to = edge->target_dimension;
  hs_real *const sizes = run->error;
  if (hs_changed(edge, edge->reset, run->here.p, crossing->time, crossing->state, crossing->state, run->after)) return 1;
  if (!all_finite(run->after, to)) return 1;
  HS_MOVE(run, move_reset(run));
  copy(run->both, crossing->state, n);
  copy(run->both + n, scale, n);
  if (hs_changed(edge, edge->spread, run->here.p, crossing->time, run->both, scale, sizes) || !all_finite(sizes, to))
    for (int s = 0; s < to; s++) sizes[s] = fabs(run->after[s]); /* where it is infinitely steep, no more is known */
  copy(run->both, sizes, to);
  return 0;
}
