/* Events of a unit in model exchange, and what they share with the rest of it. */

#ifndef EVENTS_H
#define EVENTS_H

#include "fmu.h"

/* What routines are bound to; 0 where parameters have no finite value. */
const double *fmu_bind(fmu *unit);

/* The present mode, or the motion along one of its guards. */
const hs_mode *fmu_table(const fmu *unit);

/* The states of the present mode. */
void fmu_local(const fmu *unit, double *x);

/* The segment of the inputs that a time is in; at a boundary the later one. */
int32_t fmu_segment_at(double time);

/* Enter the initial mode: what its state is beyond fires at once. */
fmu_status fmu_begin(fmu *unit);

/* Whether other values are given than before. */
int fmu_has_changed(const fmu_data *now);

/* Enter the target of an edge of a mode with these values. */
void fmu_enter(fmu *unit, int mode, int edge, const double *after);

/* Surfaces, of surfaces.c; k is the place of one among those of the present mode. */

/* The rate of a surface of a mode along its flow. */
int fmu_rate_of(const hs_mode *mode, int k, const double *p, double t, const double *x, double *rate);

/* Whether an input that the caller sets moves surface k. */
int fmu_is_driven(const fmu *unit, int k);

/* Sizes of states and inputs, and from them the margins of surfaces, with the values r; not 0 where one has none. */
int fmu_set_margins(fmu *unit, const double *r);

/* Whether surface k ends the motion along the guard that holds the state. */
int fmu_lets_go(const fmu *unit, int k);

/* Whether a state may be beyond surface k without having crossed it. */
int fmu_may_be_beyond(const fmu *unit, int k);

/* Whether the state is still on surface k. */
int fmu_is_on(const fmu *unit, int k);

/* Take a state that is beyond surface k by r back onto it: along the flow, else straight. From a surface that an input
   moves it may be far, and then goes back only as far as it has come since it was inside. */
int fmu_take_back(const fmu *unit, int k, const double *p, double r, double *t, double *x);

#endif
