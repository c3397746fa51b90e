/* The runtime as this package loads it: also whole runs as one array, many runs at once, and the screen of verdicts. */

#include <stdio.h>

#define HS_MOVES /* exported programs have no verdict, so none of their runs is moved */
#include "hs.c"
#include "ensemble.c"
#include "lanes.c"

/* What a run has written, taken out of its chunk: its record, then column after column in one stretch of memory that is
   as long as they are. See Packed in hsdsl/engine/simulate/columns.py. */

/* The most states of any mode the run was in. */
static int most_states(const hs_task *task) {
  const hs_chunk *chunk = &task->chunk;
  int most = task->dimension;
  for (int64_t i = 0; i < chunk->arcs; i++) {
    const int dimension = task->model->mode[chunk->arc[i].mode].dimension;
    most = dimension > most ? dimension : most;
  }
  return most;
}

/* Append so many things to what is there, where there is memory. */
static void *put(hs_store *store, const void *from, int64_t count, size_t size) {
  void *const to = take(store, count, size);
  if (count && to) memcpy(to, from, (size_t)count * size);
  return to;
}

/* Rows of `from`, of which the first `width` numbers are kept. */
static double *put_rows(hs_store *store, const double *from, int64_t rows, int width, int there) {
  if (width == there) return put(store, from, rows * there, sizeof(double));
  double *const to = numbers(store, rows * width);
  for (int64_t i = 0; to && i < rows; i++) memcpy(to + i * width, from + i * there, (size_t)width * sizeof(double));
  return to;
}

/* Returns how many numbers all take, also where there is no memory for them. While a run is under way a row's piece
   leads to it, here it leaves it. */
int64_t hs_pack(const hs_task *task, double *to) {
  const hs_chunk *chunk = &task->chunk;
  const int there = task->model->width, degree = task->method->degree, outputs = task->model->outputs;
  const int64_t rows = chunk->rows, transitions = chunk->transitions;
  hs_store store = {to, 0};
  hs_record counted, *const found = take(&store, 1, sizeof(hs_record)), *const record = found ? found : &counted;
  const int width = most_states(task);
  record->rows = rows, record->arcs = chunk->arcs, record->transitions = transitions;
  record->notes = chunk->notes, record->others = chunk->alternatives_used;
  record->width = width, record->degree = degree, record->outputs = outputs;
  record->times = put(&store, chunk->times, rows, sizeof(double));
  record->values = put_rows(&store, chunk->values, rows, width, there);
  record->recorded = put(&store, chunk->outputs, rows * outputs, sizeof(double));
  put(&store, chunk->depth, rows, sizeof(double));
  record->pieces = put_rows(&store, chunk->pieces + (int64_t)degree * there, (rows - 1) * degree, width, there);
  double *const last = numbers(&store, degree * width);
  for (int i = 0; last && i < degree * width; i++) last[i] = 0.0; /* nothing leaves the last row */
  record->arc = put(&store, chunk->arc, chunk->arcs, sizeof(hs_arc));
  record->transition = put(&store, chunk->transition, transitions, sizeof(hs_transition));
  record->before = put(&store, chunk->before, transitions * there, sizeof(double));
  record->after = put(&store, chunk->after, transitions * there, sizeof(double));
  put(&store, chunk->note, chunk->notes, sizeof(hs_note));
  record->alternatives = put(&store, chunk->alternatives, chunk->alternatives_used, sizeof(int32_t));
  return store.used;
}

/* Run a task to its end; returns how many numbers its columns take. */
int64_t hs_run_whole(hs_task *task) {
  hs_simulate(task);
  return hs_pack(task, 0);
}

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("O2")
#endif
#include "screen.c"
