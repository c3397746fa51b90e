/* What a caller gives to have a run's values at many times: plain data, all of it the caller's own memory. */

#ifndef HS_SAMPLE_H
#define HS_SAMPLE_H

#include "hs_simulate.h"

typedef struct {
  const hs_model *model; /* these two for outputs alone */
  const hs_timeline *timeline;
  int64_t rows, arcs, samples;
  int32_t width, degree; /* of values and pieces; pieces of degree 0 are the straight lines between rows */
  int32_t outputs;       /* 0 for none */
  int32_t columns;       /* states to evaluate */
  int32_t left;          /* at a jump take the first value, not the last */
  const double *times, *values, *recorded, *pieces; /* by row; a row's piece leaves it */
  const hs_arc *arc;
  const int32_t *layout;    /* of each arc, by its states; 0 where there is only one */
  const int32_t *dimension; /* of each layout */
  const int32_t *column;    /* (layouts, columns): which of the arc's states it is, -1 for none */
  double *time;             /* (samples), in any order; moved to the run's ends where outside to round-off */
  int64_t *row;             /* (samples): where the piece begins */
  double *states;           /* (columns, samples) */
  double *results;          /* (samples, outputs) */
  double *scratch;          /* 2 width */
} hs_sampling;

/* The number of the first time that is outside the run by more than the tie tolerance, or -1. */
HS_EXPORT int64_t hs_sample(const hs_sampling *sampling);

#endif
