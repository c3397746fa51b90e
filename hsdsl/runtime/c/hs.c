/* The runtime: one translation unit, each file the twin of one in hsdsl/simulate or hsdsl/integrators. */

#include <stddef.h>
#include <time.h>

#include "run.h"

#include "table.c"
#include "taylor.c"
#include "stepper.c"

#include "control.c"
#include "patience.c"
#include "surfaces.c"
#include "timeline.c"
#include "recorder.c"
#include "run.c"
#include "visited.c"
#include "entry.c"
#include "relaxed.c"

/* What is left of the caller's memory. Counted without memory first, then given out. */
typedef struct {
  double *numbers;
  int64_t used;
} hs_store;

static void *take(hs_store *store, int64_t count, size_t size) {
  double *start = store->numbers ? store->numbers + store->used : 0;
  store->used += (count * (int64_t)size + (int64_t)sizeof(double) - 1) / (int64_t)sizeof(double);
  return start;
}

static double *numbers(hs_store *store, int64_t count) { return take(store, count, sizeof(double)); }

static hs_polynomial polynomial(hs_store *store, const hs_run *run) {
  const int degree = run->method->degree > 3 ? run->method->degree : 3;
  hs_polynomial piece;
  piece.degree = 0;
  piece.c = numbers(store, (int64_t)degree * run->width);
  return piece;
}

/* Give every array of a run its place. */
static void lay_out(hs_run *run, hs_store *store) {
  const int w = run->width, m = run->model->surfaces, e = run->model->edges;
  const int stages = run->method->stages, all = stages + 1 + run->method->extra;
  double **states[] = {&run->x,      &run->slope,   &run->z,     &run->end,    &run->at,   &run->scale,
                       &run->entered, &run->after, &run->landed, &run->error, 0};
  for (double ***state = states; *state; state++) **state = numbers(store, w);
  run->k = take(store, all, sizeof(double *));
  for (int i = 1; i < all; i++) {
    double *stage = numbers(store, w);
    if (store->numbers) run->k[i] = stage;
  }
  if (store->numbers) run->k[0] = run->slope, run->k[stages] = run->end;
  if (run->method->kind == HS_TAYLOR) run->lines = numbers(store, (int64_t)run->model->lines * series_length(run->method));
  run->values = numbers(store, m);
  run->ahead = numbers(store, m);
  run->magnitudes = numbers(store, m);
  run->noise = numbers(store, m);
  run->gradient = numbers(store, w + 1);
  run->both = numbers(store, 2 * (int64_t)w);
  run->stood_on = take(store, m, sizeof(int));
  run->beyond = take(store, m, sizeof(int));
  run->tied = take(store, e, sizeof(int));
  run->alternatives = take(store, e, sizeof(int));
  run->trial.piece = polynomial(store, run);
  run->cubic = polynomial(store, run);
  run->crossings = take(store, e, sizeof(hs_crossing));
  for (int i = 0; i < e; i++) {
    double *state = numbers(store, w);
    const hs_polynomial piece = polynomial(store, run);
    if (store->numbers) run->crossings[i].state = state, run->crossings[i].piece = piece;
  }
}

static hs_run make_run(const hs_model *model, const hs_method *method, hs_store *store) {
  static const hs_run empty;
  hs_run run = empty;
  run.model = model;
  run.method = method;
  run.width = model->width;
  lay_out(&run, store);
  return run;
}

/* How many numbers a run's workspace needs. */
int64_t hs_workspace(const hs_model *model, const hs_method *method) {
  hs_store store = {0, 0};
  make_run(model, method, &store);
  return store.used;
}

void hs_simulate(hs_task *task) {
  hs_store store = {task->workspace, 0};
  hs_run run = make_run(task->model, task->method, &store);
  run.task = task;
  run.epsilon = task->settings.relaxation;
  run.until = task->settings.until;
  run.control.h = task->settings.step;
  run.control.tolerance = task->settings.tolerance;
  run.control.largest = task->settings.largest;
  run.control.order = task->method->order;
  run.steps_to_poll = run.poll_steps = 64;
  run.polled = clock();
  copy(run.x, task->x, task->dimension);
  for (int s = 0; s < run.width; s++) run.scale[s] = 0.0;
  relaxed(&run, enter(&run, task->mode, task->dimension, 0.0, 0));
}

/* Sizes of the structures a caller fills, so that it can check its own idea of them. */
HS_EXPORT const int64_t hs_sizes[] = {
    sizeof(hs_edge),     sizeof(hs_mode),  sizeof(hs_model),   sizeof(hs_row),  sizeof(hs_method), sizeof(hs_timeline),
    sizeof(hs_settings), sizeof(hs_chunk), sizeof(hs_visited), sizeof(hs_stop), sizeof(hs_task)};
