/* Whichever method the run has: a table, Taylor series, Radau IIA. Other files tell tables and series apart, at most. */

#include "functions.h"

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("O2")
#endif
#include "blocks.c"
#include "radau.c"
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif

/* One step from (t, run->x) to run->z; NO_VALUE or NO_CONVERGENCE where the method has none. */
HS_INLINE int step(hs_run *run, int n, hs_time t, hs_real h) {
  switch (run->method->kind) {
    case HS_TAYLOR: return taylor_step(run, t, h);
    case HS_RADAU: return radau_step(run, t, h);
    default: return table_step(run, n, t, h);
  }
}

/* A part of the step just made, from (t, run->x) to run->z: by Radau IIA it is solved to round-off. */
HS_INLINE int part_of_step(hs_run *run, int n, hs_time t, hs_real h) {
  return run->method->kind == HS_RADAU ? radau_landing(run, t, h) : step(run, n, t, h);
}

/* The method's own interpolant of the step from (t, run->x) to run->z; not 0 where the flow has no value. */
static int method_piece(hs_run *run, hs_time t, hs_real h, hs_polynomial *piece) {
  switch (run->method->kind) {
    case HS_TAYLOR: return taylor_piece(run, run->here.dimension, h, piece), 0;
    case HS_RADAU: return radau_piece(run, piece), 0;
    default: return table_piece(run, t, h, piece);
  }
}

/* The estimate of the local error, to run->error; the flow at the step's end is run->end. */
static void local_error(hs_run *run, hs_real h) {
  switch (run->method->kind) {
    case HS_TAYLOR: taylor_error(run, run->here.dimension, h); break;
    case HS_RADAU: copy(run->error, run->radau.error, run->here.dimension); break;
    default: table_error(run, h);
  }
}

/* The scales of the states that errors of the step just made are measured by. */
static const hs_real *error_scales(const hs_run *run) {
  return run->method->kind == HS_RADAU ? run->radau.scales : run->scales;
}

/* The same with a look at what the flow is computed from; 0 where it has no value. See hsdsl/engine/simulate/scales.py. */
static const hs_real *closer_scales(hs_run *run, hs_real h) {
  if (run->method->kind == HS_RADAU) return radau_scales(run, run->here.t, h, 1), run->radau.scales;
  return resolved(run, run->here.t, h, run->x, 0) ? 0 : run->resolved;
}

static int is_implicit(const hs_method *method) { return method->kind == HS_RADAU; }

static void lay_out_radau(hs_radau *radau, int w, int factors, int varied, hs_store *store) {
  hs_real **matrices[] = {&radau->rows, &radau->fresh, &radau->real, &radau->re, &radau->im};
  hs_real **threes[] = {radau->z, radau->last, radau->apart, radau->change, radau->slopes, radau->right};
  for (int i = 0; i < 5; i++) *matrices[i] = numbers(store, factors);
  for (int i = 0; i < 18; i++) threes[i / 3][i % 3] = numbers(store, w);
  radau->largest = numbers(store, w);
  radau->error = numbers(store, w);
  radau->least = numbers(store, w);
  radau->scratch[0] = numbers(store, w);
  radau->scratch[1] = numbers(store, w);
  radau->linked = numbers(store, varied);
  for (int i = 0; i < 4; i++) radau->spread[i] = numbers(store, varied ? w : 0);
  radau->lasting = numbers(store, varied ? w : 0);
  radau->order = take(store, w, sizeof(int));
  radau->turned = take(store, w, sizeof(int));
}

/* Give the arrays of the method their places. */
static void lay_out_method(hs_run *run, hs_store *store) {
  if (run->method->kind == HS_TAYLOR)
    run->lines = numbers(store, (int64_t)run->model->lines * series_length(run->method));
  if (run->method->kind == HS_RADAU) lay_out_radau(&run->radau, run->width, run->model->factors, run->model->varied, store);
}

/* Forget what a method knows of the place it was at: the mode or the segment of the inputs is another one. */
static void forget_steps(hs_run *run) {
  run->expanded = 0;
  if (run->method->kind == HS_RADAU) radau_forget(run);
}
