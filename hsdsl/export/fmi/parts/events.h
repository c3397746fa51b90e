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

#endif
