/* What a caller gives to have many instances of one model run, and what it gets: plain data, the caller's own memory.

   `task` must come first. Its memory serves every instance; of each run only the results below are kept. */

#ifndef HS_ENSEMBLE_H
#define HS_ENSEMBLE_H

#include "hs_sample.h"

typedef struct {
  hs_task task;
  hs_sampling sampling; /* of one chunk, with memory for all samples of an instance */
  int64_t instances, samples, most_transitions;
  const hs_timeline *timeline; /* (instances) */
  const hs_settings *settings; /* (instances) */
  const double *start;         /* (instances, dimension) */
  const double *time;          /* (instances, samples), never decreasing */
  const int32_t *layout_of;    /* of each mode, -1 where it keeps that of the mode before; 0 where there is only one */
  const int32_t *stop;         /* not 0: end as soon as possible */
  int32_t *reason, *mode;      /* (instances) */
  int32_t *kind;               /* (instances): layout of the last arc */
  int64_t *transitions;        /* (instances): how many were made */
  double *ended;               /* (instances): the last time */
  double *final;               /* (instances, width) */
  double *outputs;             /* (instances, outputs) */
  double *crossed;             /* (instances, most_transitions): times of the first transitions */
  double *states;              /* (instances, columns, samples); untouched beyond a run's end */
  double *results;             /* (instances, samples, outputs), likewise */
  int64_t done;
  int64_t base, made, next;    /* of the instance under way: the chunk's first row, transitions, samples */
  int32_t layout;              /* of its last arc, the first one's being 0 */
  int32_t *layouts;            /* (arc_room) */
} hs_ensemble;

/* Run the instances one after the other; those from `done` on were not run to their end. */
HS_EXPORT void hs_run_ensemble(hs_ensemble *ensemble);

#endif
