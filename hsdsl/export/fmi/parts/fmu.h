/* The exported model as both versions of FMI see it: variables by reference, events, and stretches of a run. */

#ifndef FMU_H
#define FMU_H

#include "instance.h"
#include "variables.h"

typedef enum { FMU_OK, FMU_NO_VALUE, FMU_ERROR } fmu_status;

/* What is given from outside: parameters, inputs, and the segment of the inputs that follow the file. */
typedef struct {
  double parameters[PROBLEM_PARAMETERS + 1];
  double input[FMU_INPUTS + 1];
  int input_set[FMU_INPUTS + 1];
  int32_t segment;
} fmu_given_values;

/* Where a state is as to a surface: inside, or beyond it without having crossed it. One that is on the surface crossed
   it already, and is still beyond since an input moved the surface past it. */
typedef enum { FMU_INSIDE, FMU_OUTSIDE, FMU_ON } fmu_side;

/* All of a unit that changes, as plain data: copied, it is the unit's state. States are those of all modes, by name; one
   that the present mode does not have keeps its value. */
typedef struct {
  double time;
  int started, ended; /* `ended`: the run is over, by a final mode or otherwise */
  int mode, resting;  /* the edge along whose guard the state moves, or -1 */
  double state[PROBLEM_STATES + 1], scale[PROBLEM_STATES + 1];
  int state_set[PROBLEM_STATES + 1];
  fmu_side side[PROBLEM_SURFACES + 1]; /* at the last event */
  double margin[PROBLEM_SURFACES + 1];
  double furthest[PROBLEM_SURFACES + 1]; /* how far beyond a surface the state is that is on it */
  double input_size[FMU_INPUTS + 1];     /* the largest so far */
  double inside_at[PROBLEM_SURFACES + 1]; /* when a state was inside at last */
  double left_at[PROBLEM_SURFACES + 1]; /* when it was off the surface, inside, at first since its last transition */
  int again;                      /* transitions in a row from a surface that the state did not leave */
  fmu_given_values given, earlier; /* now, and before this event; in co-simulation before this step */
  fmu_given_values seen;           /* where indicators were evaluated last between events, at this state: */
  double seen_state[PROBLEM_STATES + 1];
  int at_event;
  int tuned; /* whether what is given has changed since it was put in place */
  /* of co-simulation: what is shown in place of the state while it waits in a strip, or before an event is handled */
  int shows_before, before_mode;
  double before[PROBLEM_STATES + 1];
  int64_t jumps; /* transitions made */
  hs_pause pause;
  double numbers[HS_PAUSE_NUMBERS(PROBLEM_WIDTH, PROBLEM_MODES, PROBLEM_STATES)];
  double data[PROBLEM_DATA + 1];
  int32_t integers[HS_PAUSE_INTEGERS(PROBLEM_SURFACES, PROBLEM_MODES)];
  hs_waiting waiting;
} fmu_data;

typedef struct {
  fmu_data now;
  int co_simulation, event_mode_used, early_return_allowed;
  double p[PROBLEM_DATA + PROBLEM_CONTACTS + 1]; /* what routines are bound to, at `bound` */
  int bound;
  double slopes[PROBLEM_STATES + 1]; /* where the flow had a value last */
  int left_known; /* whether there are values of surfaces before what is given changed at this event, in `left` */
  double left[PROBLEM_SURFACES + 1];
  int made[PROBLEM_SURFACES + 1]; /* edges of the present mode whose transitions were made at this event */
  int64_t jumps_before;
  hs_instance run;
  const char *complaint; /* why the run ended */
  const char *refusal;   /* why the last call was refused, until it is logged */
} fmu;

extern const char fmu_too_many_wait[]; /* why a run ended */

fmu *fmu_new(int co_simulation);
void fmu_free(fmu *unit);
void fmu_reset(fmu *unit);

fmu_status fmu_get(fmu *unit, unsigned reference, double *value);
fmu_status fmu_set(fmu *unit, unsigned reference, double value);
int fmu_mode(const fmu *unit, unsigned reference); /* of a variable of the kind FMU_MODE */

void fmu_set_time(fmu *unit, double time);
void fmu_set_states(fmu *unit, const double *x);
void fmu_get_states(const fmu *unit, double *x);
void fmu_get_nominals(const fmu *unit, double *x);
fmu_status fmu_get_derivatives(fmu *unit, double *slopes);
fmu_status fmu_get_indicators(fmu *unit, double *z);

/* Derive what depends on parameters; then enter the initial mode. */
fmu_status fmu_initialize(fmu *unit);

/* An event begins: what is given now is what was before it. */
void fmu_enter_events(fmu *unit);
void fmu_leave_events(fmu *unit);

/* Handle what is due at the present time; `jumped` says whether states have changed, `next` is the next known event. */
fmu_status fmu_update(fmu *unit, int *jumped, double *next);

/* Go on from the present time by a size, or after the first transition where the caller handles events;
   `reached` is how far. */
fmu_status fmu_step(fmu *unit, double point, double size, double *reached, int *event);

/* The slope of a derivative, output or state by a state or input, both by their references. */
fmu_status fmu_slope(fmu *unit, unsigned unknown, unsigned known, double *slope);

/* The state of a unit as bytes. */
size_t fmu_size(void);
void fmu_save(const fmu *unit, void *bytes);
int fmu_restore(fmu *unit, const void *bytes);

#endif
