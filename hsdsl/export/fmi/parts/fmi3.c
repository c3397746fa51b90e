/* The functions of FMI 3.0 over a unit. */

#if defined(__clang__) /* the standard's header has functions without prototypes */
#pragma clang diagnostic push
#pragma clang diagnostic ignored "-Wstrict-prototypes"
#endif
#include "fmi3Functions.h"
#if defined(__clang__)
#pragma clang diagnostic pop
#endif

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmu.h"

typedef struct {
  fmu *unit;
  fmi3InstanceEnvironment environment;
  fmi3LogMessageCallback log;
  fmi3Boolean logs;
} instance;

static fmi3Status logged(instance *own, fmi3Status status, const char *message) {
  if (own->log) own->log(own->environment, status, status == fmi3Error ? "logStatusError" : "logEvents", message);
  return status;
}

static fmi3Status answer(instance *own, fmu_status status) {
  if (status == FMU_OK) return fmi3OK;
  if (status == FMU_NO_VALUE) return logged(own, fmi3Discard, "something has no finite value here");
  return logged(own, fmi3Error, own->unit->complaint ? own->unit->complaint : "not allowed here, or without a value");
}

static fmi3Status refuse(fmi3Instance instance_, const char *function) {
  char message[120];
  snprintf(message, sizeof message, "%s: this unit has none of these variables", function);
  return logged(instance_, fmi3Error, message);
}

static instance *new_instance(fmi3String token, int co_simulation, fmi3Boolean logs, fmi3InstanceEnvironment environment,
                              fmi3LogMessageCallback log) {
  if (!token || strcmp(token, FMU_TOKEN) != 0) {
    if (log) log(environment, fmi3Error, "logStatusError", "the instantiation token is another unit's");
    return 0;
  }
  instance *own = calloc(1, sizeof *own);
  fmu *unit = fmu_new(co_simulation);
  if (!own || !unit) return free(own), fmu_free(unit), (instance *)0;
  own->unit = unit;
  own->environment = environment;
  own->log = log;
  own->logs = logs;
  return own;
}

const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Status fmi3SetDebugLogging(fmi3Instance i, fmi3Boolean on, size_t count, const fmi3String categories[]) {
  (void)count, (void)categories;
  ((instance *)i)->logs = on;
  return fmi3OK;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
                                          fmi3Boolean logs, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
  (void)name, (void)path, (void)visible;
  return new_instance(token, 0, logs, environment, log);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
                                         fmi3Boolean logs, fmi3Boolean event_mode_used,
                                         fmi3Boolean early_return_allowed, const fmi3ValueReference required[],
                                         size_t count, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
  (void)name, (void)path, (void)visible, (void)required, (void)count, (void)update;
  instance *own = new_instance(token, 1, logs, environment, log);
  if (!own) return 0;
  own->unit->event_mode_used = event_mode_used;
  own->unit->early_return_allowed = early_return_allowed;
  return own;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
                                               fmi3Boolean logs, fmi3InstanceEnvironment environment,
                                               fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
                                               fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {
  (void)name, (void)token, (void)path, (void)visible, (void)logs, (void)update, (void)lock, (void)unlock;
  if (log) log(environment, fmi3Error, "logStatusError", "this unit has no scheduled execution");
  return 0;
}

void fmi3FreeInstance(fmi3Instance i) {
  if (i) fmu_free(((instance *)i)->unit);
  free(i);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance i, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop) {
  (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
  fmu_set_time(((instance *)i)->unit, start);
  return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance i) { return answer(i, fmu_initialize(((instance *)i)->unit)); }
fmi3Status fmi3EnterEventMode(fmi3Instance i) { return (void)i, fmi3OK; }
fmi3Status fmi3EnterStepMode(fmi3Instance i) { return (void)i, fmi3OK; }
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance i) { return (void)i, fmi3OK; }
fmi3Status fmi3EnterConfigurationMode(fmi3Instance i) { return (void)i, fmi3OK; }
fmi3Status fmi3ExitConfigurationMode(fmi3Instance i) { return (void)i, fmi3OK; }
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance i) { return (void)i, fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance i) { return (void)i, fmi3OK; }

fmi3Status fmi3Reset(fmi3Instance i) {
  fmu_reset(((instance *)i)->unit);
  return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance i, const fmi3ValueReference references[], size_t count, fmi3Float64 values[],
                          size_t length) {
  instance *own = i;
  if (length != count) return answer(own, FMU_ERROR);
  for (size_t k = 0; k < count; k++) {
    const fmu_status status = fmu_get(own->unit, references[k], &values[k]);
    if (status) return answer(own, status);
  }
  return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance i, const fmi3ValueReference references[], size_t count,
                          const fmi3Float64 values[], size_t length) {
  instance *own = i;
  if (length != count) return answer(own, FMU_ERROR);
  for (size_t k = 0; k < count; k++) {
    const fmu_status status = fmu_set(own->unit, references[k], values[k]);
    if (status) return answer(own, status);
  }
  return fmi3OK;
}

fmi3Status fmi3GetInt32(fmi3Instance i, const fmi3ValueReference references[], size_t count, fmi3Int32 values[],
                        size_t length) {
  instance *own = i;
  for (size_t k = 0; k < count; k++) {
    if (length != count || references[k] >= FMU_VARIABLES || fmu_variables[references[k]].kind != FMU_MODE)
      return answer(own, FMU_ERROR);
    values[k] = fmu_mode(own->unit, references[k]);
  }
  return fmi3OK;
}

#define NONE(name, type)                                                                                             \
  fmi3Status fmi3Get##name(fmi3Instance i, const fmi3ValueReference references[], size_t count, type values[],       \
                           size_t length) {                                                                          \
    (void)references, (void)values, (void)length;                                                                    \
    return count ? refuse(i, "fmi3Get" #name) : fmi3OK;                                                              \
  }                                                                                                                  \
  fmi3Status fmi3Set##name(fmi3Instance i, const fmi3ValueReference references[], size_t count, const type values[], \
                           size_t length) {                                                                          \
    (void)references, (void)values, (void)length;                                                                    \
    return count ? refuse(i, "fmi3Set" #name) : fmi3OK;                                                              \
  }
NONE(Float32, fmi3Float32)
NONE(Int8, fmi3Int8)
NONE(UInt8, fmi3UInt8)
NONE(Int16, fmi3Int16)
NONE(UInt16, fmi3UInt16)
NONE(UInt32, fmi3UInt32)
NONE(Int64, fmi3Int64)
NONE(UInt64, fmi3UInt64)
NONE(Boolean, fmi3Boolean)
NONE(String, fmi3String)

fmi3Status fmi3SetInt32(fmi3Instance i, const fmi3ValueReference references[], size_t count, const fmi3Int32 values[],
                        size_t length) {
  (void)references, (void)values, (void)length;
  return count ? refuse(i, "fmi3SetInt32") : fmi3OK;
}

fmi3Status fmi3GetBinary(fmi3Instance i, const fmi3ValueReference references[], size_t count, size_t sizes[],
                         fmi3Binary values[], size_t length) {
  (void)references, (void)sizes, (void)values, (void)length;
  return count ? refuse(i, "fmi3GetBinary") : fmi3OK;
}

fmi3Status fmi3SetBinary(fmi3Instance i, const fmi3ValueReference references[], size_t count, const size_t sizes[],
                         const fmi3Binary values[], size_t length) {
  (void)references, (void)sizes, (void)values, (void)length;
  return count ? refuse(i, "fmi3SetBinary") : fmi3OK;
}

fmi3Status fmi3GetClock(fmi3Instance i, const fmi3ValueReference references[], size_t count, fmi3Clock values[]) {
  (void)references, (void)values;
  return count ? refuse(i, "fmi3GetClock") : fmi3OK;
}

fmi3Status fmi3SetClock(fmi3Instance i, const fmi3ValueReference references[], size_t count,
                        const fmi3Clock values[]) {
  (void)references, (void)values;
  return count ? refuse(i, "fmi3SetClock") : fmi3OK;
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance i, fmi3ValueReference reference, size_t *count) {
  (void)reference, (void)count;
  return refuse(i, "fmi3GetNumberOfVariableDependencies");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance i, fmi3ValueReference dependent, size_t elements[],
                                       fmi3ValueReference independents[], size_t of_independents[],
                                       fmi3DependencyKind kinds[], size_t count) {
  (void)dependent, (void)elements, (void)independents, (void)of_independents, (void)kinds, (void)count;
  return refuse(i, "fmi3GetVariableDependencies");
}

fmi3Status fmi3GetFMUState(fmi3Instance i, fmi3FMUState *state) {
  if (!*state) *state = malloc(fmu_size());
  if (!*state) return answer(i, FMU_ERROR);
  fmu_save(((instance *)i)->unit, *state);
  return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance i, fmi3FMUState state) {
  fmu_restore(((instance *)i)->unit, state);
  return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance i, fmi3FMUState *state) {
  (void)i;
  if (state) free(*state), *state = 0;
  return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance i, fmi3FMUState state, size_t *size) {
  (void)i, (void)state;
  *size = fmu_size();
  return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance i, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  if (size != fmu_size()) return answer(i, FMU_ERROR);
  memcpy(bytes, state, size);
  return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance i, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
  if (size != fmu_size()) return answer(i, FMU_ERROR);
  if (!*state) *state = malloc(size);
  if (!*state) return answer(i, FMU_ERROR);
  memcpy(*state, bytes, size);
  return fmi3OK;
}

/* Products with the matrix of slopes, or `transposed`. */
static fmi3Status products(fmi3Instance i, const fmi3ValueReference unknowns[], size_t rows,
                           const fmi3ValueReference knowns[], size_t columns, const fmi3Float64 seed[],
                           fmi3Float64 product[], int transposed) {
  instance *own = i;
  double slope;
  for (size_t k = 0; k < (transposed ? columns : rows); k++) product[k] = 0.0;
  for (size_t r = 0; r < rows; r++)
    for (size_t c = 0; c < columns; c++) {
      const fmu_status status = fmu_slope(own->unit, unknowns[r], knowns[c], &slope);
      if (status) return answer(own, status);
      product[transposed ? c : r] += slope * seed[transposed ? r : c];
    }
  return fmi3OK;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance i, const fmi3ValueReference unknowns[], size_t rows,
                                        const fmi3ValueReference knowns[], size_t columns, const fmi3Float64 seed[],
                                        size_t seeds, fmi3Float64 sensitivity[], size_t length) {
  if (seeds != columns || length != rows) return answer(i, FMU_ERROR);
  return products(i, unknowns, rows, knowns, columns, seed, sensitivity, 0);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance i, const fmi3ValueReference unknowns[], size_t rows,
                                    const fmi3ValueReference knowns[], size_t columns, const fmi3Float64 seed[],
                                    size_t seeds, fmi3Float64 sensitivity[], size_t length) {
  if (seeds != rows || length != columns) return answer(i, FMU_ERROR);
  return products(i, unknowns, rows, knowns, columns, seed, sensitivity, 1);
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance i, const fmi3ValueReference references[], size_t count,
                                  fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]) {
  (void)references, (void)intervals, (void)qualifiers;
  return count ? refuse(i, "fmi3GetIntervalDecimal") : fmi3OK;
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance i, const fmi3ValueReference references[], size_t count,
                                   fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                   fmi3IntervalQualifier qualifiers[]) {
  (void)references, (void)counters, (void)resolutions, (void)qualifiers;
  return count ? refuse(i, "fmi3GetIntervalFraction") : fmi3OK;
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance i, const fmi3ValueReference references[], size_t count,
                               fmi3Float64 shifts[]) {
  (void)references, (void)shifts;
  return count ? refuse(i, "fmi3GetShiftDecimal") : fmi3OK;
}

fmi3Status fmi3GetShiftFraction(fmi3Instance i, const fmi3ValueReference references[], size_t count,
                                fmi3UInt64 counters[], fmi3UInt64 resolutions[]) {
  (void)references, (void)counters, (void)resolutions;
  return count ? refuse(i, "fmi3GetShiftFraction") : fmi3OK;
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance i, const fmi3ValueReference references[], size_t count,
                                  const fmi3Float64 intervals[]) {
  (void)references, (void)intervals;
  return count ? refuse(i, "fmi3SetIntervalDecimal") : fmi3OK;
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance i, const fmi3ValueReference references[], size_t count,
                                   const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
  (void)references, (void)counters, (void)resolutions;
  return count ? refuse(i, "fmi3SetIntervalFraction") : fmi3OK;
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance i, const fmi3ValueReference references[], size_t count,
                               const fmi3Float64 shifts[]) {
  (void)references, (void)shifts;
  return count ? refuse(i, "fmi3SetShiftDecimal") : fmi3OK;
}

fmi3Status fmi3SetShiftFraction(fmi3Instance i, const fmi3ValueReference references[], size_t count,
                                const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
  (void)references, (void)counters, (void)resolutions;
  return count ? refuse(i, "fmi3SetShiftFraction") : fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance i, fmi3Boolean *more, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *values_changed,
                                    fmi3Boolean *next_defined, fmi3Float64 *next) {
  instance *own = i;
  int jumped = 0;
  double time = INFINITY;
  const fmu_status status = fmu_update(own->unit, &jumped, &time);
  *more = *nominals_changed = fmi3False;
  *values_changed = jumped != 0;
  *terminate = own->unit->now.ended != 0;
  *next_defined = time - time == 0;
  *next = *next_defined ? time : 0.0;
  if (own->unit->complaint && own->unit->now.ended) logged(own, fmi3Warning, own->unit->complaint);
  return answer(own, status);
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance i, fmi3Boolean no_state_before, fmi3Boolean *event,
                                       fmi3Boolean *terminate) {
  (void)i, (void)no_state_before;
  *event = *terminate = fmi3False;
  return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance i, fmi3Float64 time) {
  fmu_set_time(((instance *)i)->unit, time);
  return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance i, const fmi3Float64 x[], size_t count) {
  if (count != FMU_STATES) return answer(i, FMU_ERROR);
  fmu_set_states(((instance *)i)->unit, x);
  return fmi3OK;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance i, fmi3Float64 x[], size_t count) {
  if (count != FMU_STATES) return answer(i, FMU_ERROR);
  fmu_get_states(((instance *)i)->unit, x);
  return fmi3OK;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance i, fmi3Float64 slopes[], size_t count) {
  if (count != FMU_STATES) return answer(i, FMU_ERROR);
  return answer(i, fmu_get_derivatives(((instance *)i)->unit, slopes));
}

fmi3Status fmi3GetEventIndicators(fmi3Instance i, fmi3Float64 z[], size_t count) {
  if (count != PROBLEM_SURFACES) return answer(i, FMU_ERROR);
  return answer(i, fmu_get_indicators(((instance *)i)->unit, z));
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance i, fmi3Float64 x[], size_t count) {
  if (count != FMU_STATES) return answer(i, FMU_ERROR);
  fmu_get_nominals(((instance *)i)->unit, x);
  return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance i, size_t *count) {
  (void)i;
  *count = PROBLEM_SURFACES;
  return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance i, size_t *count) {
  (void)i;
  *count = FMU_STATES;
  return fmi3OK;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance i, const fmi3ValueReference references[], size_t count,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t length) {
  (void)references, (void)orders, (void)values, (void)length;
  return count ? refuse(i, "fmi3GetOutputDerivatives") : fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance i, fmi3Float64 point, fmi3Float64 size, fmi3Boolean no_state_before,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
  instance *own = i;
  int handled = 0;
  (void)no_state_before;
  const fmu_status status = fmu_step(own->unit, point + size, last, &handled);
  *early = *last < point + size && own->unit->early_return_allowed;
  *event = handled && own->unit->event_mode_used && *early;
  *terminate = own->unit->now.ended != 0;
  if (own->unit->complaint && own->unit->now.ended) logged(own, fmi3Warning, own->unit->complaint);
  return answer(own, status);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance i, fmi3ValueReference clock, fmi3Float64 time) {
  (void)clock, (void)time;
  return refuse(i, "fmi3ActivateModelPartition");
}
