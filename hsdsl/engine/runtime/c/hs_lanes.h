/* One step of several runs of a model at once: what the loop of an ensemble (lanes.c) and the code that is compiled for
   a model's lanes (lane_step.c) know of each other. Number i of the run in lane l is number i * lanes + l of an array. */

#ifndef HS_LANES_H
#define HS_LANES_H

#include "hs_simulate.h"

#define HS_MOST_LANES 8

typedef struct {
  int32_t mode;  /* that all runs are in */
  int32_t order; /* of Taylor's method */
  int32_t contacts; /* see hs_settings */
  const hs_mode *modes;
  double tolerance; /* 0 for fixed steps */
  double most; /* steps within `brief` */
  const double *binomials; /* see hs_roots */
  double *inverse;         /* 1 over each of them */
  /* what a run brings along, its columns: */
  double *t, *limit, *longest; /* where the step begins, what it does not pass, how long it may be, or is where it is fixed */
  double *made, *since, *brief; /* see hs_pace */
  double *p;                /* what routines are bound to */
  double *x, *scales, *scale, *entered, *known;
  double *before;           /* for each state: see span_size(), at the end of the step before */
  double *standing;         /* for each surface: 1 where the state stands on it, else 0 */
  /* and its step: */
  double *h, *t1, *z;       /* its length, its end, the state there */
  double *piece;            /* (power, state): its polynomial */
  double *starts, *ends;    /* values of surfaces */
  double *curves;           /* (surface, power): their polynomials over the step */
  double *open;             /* for each surface: 1 where it is not passed by for certain */
  /* scratch: */
  double *lines;            /* coefficients, as hs_series writes them */
  double *end, *error;      /* the flow at the end of the step, and the error there */
  double *values, *weights, *gradient, *shares, *slopes;
  /* what is found on a step: where each surface is crossed that is still open, and the sizes of largest() at the first */
  double *theta, *time, *q, *sizes, *first; /* first: of edges that are crossed together there the one that goes */
  double *stood, *within; /* see stands(), and enter_surfaces(): how long before or after it passes what it counts as stood on */
  /* a bit for each lane; where it passed, or none of the next ones is set, a run brings along what the step ended with */
  int32_t passed;   /* it goes on before its limit */
  int32_t failed;   /* the step is not known to be what the loop for one run would make */
  int32_t slow;     /* no step: there were too many */
  int32_t doubtful; /* of the others: its error is to be looked at */
  int32_t crossed;  /* of the others: a surface may be crossed on it, or reached */
  int32_t landed;   /* the first crossings are found */
  int32_t jumped;   /* of these: it is known which edge goes, so the transition may be made in the lane; and then where it was */
  int32_t leads;    /* of these: the flow may lead out of the mode that is entered at once */
} hs_lanes;

typedef struct {
  int32_t lanes; /* of a vector */
  const int32_t *is_for; /* (flows): whether it makes steps in this one */
  int (*step)(hs_lanes *lanes);   /* these give 0 */
  int (*locate)(hs_lanes *lanes); /* crossings on steps that were made */
  int (*jump)(hs_lanes *lanes);   /* transitions there */
} hs_lane_program;

/* Instances that are run together: those of one ensemble, each place with a task of its own. */
typedef struct {
  hs_ensemble *const *places; /* as many as runs are under way, and only the first with instances */
  int64_t count;
  const hs_lane_program *program;
  double *memory; /* hs_lane_memory() numbers */
  void *seats; /* one for each place, in this memory */
  int64_t *lost; /* for each mode how many more steps lanes have left than one in LOST */
  int32_t *ready; /* for each place the mode in which its run may make a step in a lane, or -1 */
  int64_t next; /* the next instance */
  /* calls of the program, steps of runs that it made, or left, crossings, how many of them it found, and transitions that it made */
  int64_t steps, stepped, failed, doubtful, crossed, located, jumped;
} hs_team;

HS_EXPORT int64_t hs_lane_memory(const hs_model *model, const hs_method *method, int64_t places, int32_t lanes);

/* Run the instances of the first place, whose number the others share. */
HS_EXPORT void hs_run_team(hs_team *team);

#endif
