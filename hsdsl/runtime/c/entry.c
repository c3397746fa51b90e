/* Entering a mode: at the start, after a reset, at a jump of an input. See hsdsl/simulate/entry.py. */

#include "functions.h"

static int entered_outside(hs_run *run, int surface, double t) {
  run->task->stop.surface = surface;
  return stopped(run, HS_ENTERED_OUTSIDE, t);
}

/* Choose among edges the state is beyond: the highest priority, then the file's order. */
static void choose_entry(hs_run *run, const int *beyond, double t) {
  const hs_mode *mode = run->here.table;
  int chosen = -1;
  for (int k = 0; k < mode->edges; k++)
    if (beyond[k] && (chosen < 0 || goes_before(mode, k, chosen))) chosen = k;
  run->alternatives_count = 0;
  for (int k = 0; k < mode->edges; k++)
    if (beyond[k] && k != chosen) run->alternatives[run->alternatives_count++] = k;
  run->chosen.edge = chosen;
  run->chosen.theta = run->chosen.depth = 0.0;
  run->chosen.time = t;
  run->chosen.state = run->x;
  run->chosen.piece.degree = 0;
}

/* Enter a mode at (t, run->x), sizes in run->scale, and make the transitions that fire at once.
   A surface that the flow passes within the time `since` counts as stood on: tied transitions share one point. So does
   one that moved past the state while it waited in a strip, where it was reset before t, at `reset_at`. One of an edge
   that run->beyond marks was not reached before an input `jumped`: on it counts as beyond. */
static int enter(hs_run *run, int mode, int dimension, double t, int from_here, double since, int jumped,
                 double reset_at) {
  hs_mode_state before = run->here;
  forget(&run->task->visited);
  for (;; from_here = 1, jumped = 0, reset_at = t) {
    place(run, mode, dimension, t, from_here ? &before : 0);
    before = run->here;
    const hs_mode *table = run->here.table;
    if (table->final) return stopped(run, HS_FINAL, t);
    if (make_room(run)) return stopped(run, HS_INTERRUPTED, t);
    if (visit(&run->task->visited, run->width, mode, run->x, dimension)) return stopped(run, HS_ZENO, t);
    if (table->values(run->here.p, t, run->x, run->ahead) || enter_surfaces(run, t, since, jumped, reset_at))
      return stopped(run, HS_HERE_NOT_FINITE, t);
    if (!all_finite(run->ahead, table->surfaces)) return stopped(run, HS_HERE_NOT_FINITE, t);
    int fires = 0;
    for (int k = 0; k < table->edges; k++) {
      run->beyond[k] = run->beyond[k] && !table->edge[k].conditional;
      fires |= run->beyond[k];
    }
    if (!fires) {
      for (int k = table->edges; k < table->surfaces; k++)
        if (run->beyond[k]) return entered_outside(run, k, t);
      return GOES_ON;
    }
    if (limit_reached(run)) return stopped(run, HS_LIMIT, t);
    if (run->interrupted) return stopped(run, HS_INTERRUPTED, t);
    choose_entry(run, run->beyond, t);
    for (int s = 0; s < dimension; s++) run->landed[s] = hs_max(fabs(run->x[s]), run->scale[s]);
    if (reset(run, run->landed)) {
      run->task->stop.edge = run->chosen.edge;
      return stopped(run, HS_RESET_NOT_FINITE, t);
    }
    record(run, &run->chosen, t, run->after, 1);
    mode = table->edge[run->chosen.edge].target;
    dimension = table->edge[run->chosen.edge].target_dimension;
    copy(run->x, run->after, dimension);
    copy(run->scale, run->both, dimension);
  }
}
