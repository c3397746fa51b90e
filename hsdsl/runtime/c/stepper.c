/* Steps by whichever method the run has: a table, Taylor series, Radau IIA. */

#include "functions.h"

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

/* Forget what a method knows of the place it was at: the mode or the segment of the inputs is another one. */
static void forget_steps(hs_run *run) {
  run->expanded = 0;
  radau_forget(&run->radau);
}
