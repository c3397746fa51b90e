/* Entering a mode: at the start, after a reset, at a jump of an input. See hsdsl/engine/simulate/entry.py. */

#include "functions.h"

/* A set of (mode, state): those that a chain of transitions at one instant has been in. */

static int same_state(const hs_real *a, const hs_real *b, int n) {
  for (int s = 0; s < n; s++)
    if (a[s] != b[s]) return 0;
  return 1;
}

/* What of the present state decides how the run goes on: the rest is 0. */
static const hs_real *decisive(hs_run *run) {
  const hs_mode *const mode = run->here.table;
  if (!mode->idle) return run->x;
  copy(run->error, run->x, run->here.dimension);
  for (int i = 0; i < mode->idle; i++) run->error[mode->idles[i]] = 0.0;
  return run->error;
}

static uint64_t hash_of(int mode, const hs_real *x, int n) {
  uint64_t hash = 1469598103934665603u ^ (uint64_t)mode;
  for (int s = 0; s < n; s++) {
    union {
      double number;
      uint64_t bits;
    } as;
    as.number = x[s] + 0.0; /* both zeros are the same */
    hash = (hash ^ as.bits) * 1099511628211u;
    hash ^= hash >> 29;
  }
  return hash;
}

static void forget(hs_visited *visited) {
  if (visited->count) memset(visited->slot, 0, 2 * (size_t)visited->room * sizeof *visited->slot);
  visited->count = 0;
}

/* Add a state; 1 where it was there. */
static int visit(hs_visited *visited, int width, int mode, const hs_real *x, int n) {
  const uint64_t slots = 2 * (uint64_t)visited->room;
  uint64_t i = hash_of(mode, x, n) % slots;
  for (; visited->slot[i]; i = (i + 1) % slots) {
    const int64_t place = visited->slot[i] - 1;
    if (visited->mode[place] == mode && same_state(visited->state + place * width, x, n)) return 1;
  }
  copy(visited->state + visited->count * width, x, n);
  visited->mode[visited->count] = mode;
  visited->slot[i] = ++visited->count;
  return 0;
}

/* Ask the caller for twice the room when it is used up; not 0 where there is none. */
static int make_room(hs_run *run) {
  hs_visited *visited = &run->task->visited, larger;
  if (visited->count < visited->room) return 0;
  if (run->task->grow(run->task, &larger)) return 1;
  for (int64_t i = 0; i < visited->count; i++) {
    const int mode = visited->mode[i]; /* none of them final, so each has the states of its mode */
    visit(&larger, run->width, mode, visited->state + i * run->width, run->model->mode[mode].dimension);
  }
  *visited = larger;
  return 0;
}

static int entered_outside(hs_run *run, int surface, hs_time t) {
  run->task->stop.surface = surface;
  return stopped(run, HS_ENTERED_OUTSIDE, t);
}

/* Choose among edges the state is beyond: the highest priority, then the file's order. */
static void choose_entry(hs_run *run, const int *beyond, hs_time t) {
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
  run->chosen.piece = 0;
}

/* Enter a mode at (t, run->x), sizes in run->scale, and make the transitions that fire at once.
   A surface that the flow passes within the time `since` counts as stood on: tied transitions share one point. So does
   one that moved past the state while it waited in a strip, where it was reset before t, at `reset_at`. One of an edge
   that run->beyond marks was not reached before an input `jumped`: on it counts as beyond. */
static int enter(hs_run *run, int mode, int dimension, hs_time t, int from_here, hs_real since, int jumped,
                 hs_time reset_at) {
  hs_mode_state before = run->here;
  forget(&run->task->visited);
  for (;; from_here = 1, jumped = 0, reset_at = t) {
    place(run, mode, dimension, t, from_here ? &before : 0);
    before = run->here;
    const hs_mode *table = run->here.table;
    if (run->full_queue >= 0) {
      run->task->stop.edge = run->full_queue;
      return stopped(run, HS_WAITING, t);
    }
    if (table->final) return stopped(run, HS_FINAL, t);
    if (make_room(run)) return stopped(run, HS_INTERRUPTED, t);
    if (visit(&run->task->visited, run->width, mode, decisive(run), dimension)) return stopped(run, HS_ZENO, t);
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
    if (reset(run, run->scale)) {
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
