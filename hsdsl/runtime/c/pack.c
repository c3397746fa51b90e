/* What a run has written, taken out of its chunk: column after column in one stretch of memory that is as long as they
   are. See Packed in hsdsl/simulate/columns.py. */

#include "functions.h"

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

static double *put(double *to, const void *from, int64_t count, size_t size) {
  if (count) memcpy(to, from, (size_t)count * size);
  return to + ((size_t)count * size + sizeof(double) - 1) / sizeof(double);
}

/* Rows of `from`, of which the first `width` numbers are kept. */
static double *put_rows(double *to, const double *from, int64_t rows, int width, int there) {
  if (width == there) return put(to, from, rows * there, sizeof(double));
  for (int64_t i = 0; i < rows; i++, to += width) memcpy(to, from + i * there, (size_t)width * sizeof(double));
  return to;
}

/* Returns how many states a row has. While a run is under way a row's piece leads to it, here it leaves it. */
int64_t hs_pack(const hs_task *task, double *to) {
  const hs_chunk *chunk = &task->chunk;
  const hs_model *model = task->model;
  const int there = model->width, width = most_states(task), degree = task->method->degree;
  const int64_t rows = chunk->rows, transitions = chunk->transitions;
  to = put(to, chunk->times, rows, sizeof(double));
  to = put_rows(to, chunk->values, rows, width, there);
  to = put(to, chunk->outputs, rows * model->outputs, sizeof(double));
  to = put(to, chunk->depth, rows, sizeof(double));
  to = put_rows(to, chunk->pieces + (int64_t)degree * there, (rows - 1) * degree, width, there);
  for (int i = 0; i < degree * width; i++) *to++ = 0.0; /* nothing leaves the last row */
  to = put(to, chunk->arc, chunk->arcs, sizeof(hs_arc));
  to = put(to, chunk->transition, transitions, sizeof(hs_transition));
  to = put(to, chunk->before, transitions * there, sizeof(double));
  to = put(to, chunk->after, transitions * there, sizeof(double));
  to = put(to, chunk->note, chunk->notes, sizeof(hs_note));
  put(to, chunk->alternatives, chunk->alternatives_used, sizeof(int32_t));
  return width;
}
