/* One step of several runs of a model at once: what the loop of an ensemble (lanes.c) and the code that is compiled for
   a model's lanes (lane_step.c) know of each other. Number i of the run in lane l is number i * lanes + l of an array. */

#ifndef HS_LANES_H
#define HS_LANES_H

#include "hs_simulate.h"

#define HS_MOST_LANES 4

typedef struct {
  int32_t mode;  /* that all runs are in */
  int32_t order; /* of Taylor's method */
  double tolerance; /* 0 for fixed steps */
  const double *binomials; /* see hs_roots */
  double *t, *limit, *longest; /* where the step begins, what it does not pass, how long it may be, or is where it is fixed */
  double *p;        /* what routines are bound to */
  double *x, *scales;
  double *standing; /* for each surface: 1 where the state stands on it, else 0 */
  double *lines;    /* scratch: coefficients, as hs_series writes them */
  double *h, *t1, *z, *end, *error; /* the step, its end, the state and the flow there, and the error */
  double *piece, *before;   /* (power, state): the step's polynomial, and that of the step before it */
  double *starts, *ends;    /* values of surfaces */
  double *curves;           /* (surface, power): their polynomials over the step */
  /* of lanes of none of these t, x and scales are those behind the step */
  int32_t failed;  /* a bit for each lane: the step is not known to be what the loop for one run would make */
  int32_t doubtful; /* of the others: its error is to be looked at */
  int32_t crossed; /* of the others: a surface may be crossed on it, or reached */
} hs_lanes;

typedef struct {
  int32_t lanes; /* of a vector */
  const int32_t *is_for; /* (flows): whether it makes steps in this one */
  int (*step)(hs_lanes *lanes); /* 0 */
} hs_lane_program;

/* Instances that are run together: those of one ensemble, each place with a task of its own. */
typedef struct {
  hs_ensemble *const *places; /* as many as runs are under way, and only the first with instances */
  int64_t count;
  const hs_lane_program *program;
  double *memory; /* hs_lane_memory() numbers */
  void *seats; /* one for each place, in this memory */
  int64_t *lost; /* for each mode how many more steps lanes have left than one in LOST */
  int64_t next, turn; /* the next instance, and the place that is the next to make a step */
  int64_t steps, stepped, failed, doubtful, crossed; /* calls of the program, and steps of runs that it made, or left */
} hs_team;

HS_EXPORT int64_t hs_lane_memory(const hs_model *model, const hs_method *method, int64_t places, int32_t lanes);

/* Run the instances of the first place, whose number the others share. */
HS_EXPORT void hs_run_team(hs_team *team);

#endif
