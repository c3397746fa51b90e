/* The functions of FMI 3.0 alone, over a unit; the others are in fmi.c. */

#include <math.h>
#include <string.h>

#include "fmi.h"

#define NOTHING_TO_DO(name) \
  FMI(name, void *i) { return (void)i, fmi3OK; }
#define NO_VARIABLES(name, type)       \
  FMI_NONE2(Get##name, type *, size_t) \
  FMI_NONE2(Set##name, type const *, size_t)

fmi_status fmi_log(instance *own, fmi_status status, const char *message) {
  const char *category = status == fmi3Error ? "logStatusError" : "logEvents";
  if (own->logger) own->logger(own->environment, status, category, message);
  return status;
}

static void *instantiate(const char *token, const char *name, int co_simulation, void *environment, fmi_logger log) {
  if (token && strcmp(token, FMU_TOKEN) == 0) return fmi_new(name, co_simulation, environment, log);
  if (log) log(environment, fmi3Error, "logStatusError", "the instantiation token is another unit's");
  return 0;
}

FMI_TYPED(const char *, GetVersion, void) { return "3.0"; }

FMI(SetDebugLogging, void *i, bool on, size_t count, const fmi3String categories[]) {
  return (void)i, (void)on, (void)count, (void)categories, fmi3OK;
}

FMI_TYPED(void *, InstantiateModelExchange, fmi3String name, fmi3String token, fmi3String path, bool visible, bool logs,
          void *environment, fmi_logger log) {
  (void)path, (void)visible, (void)logs;
  return instantiate(token, name, 0, environment, log);
}

FMI_TYPED(void *, InstantiateCoSimulation, fmi3String name, fmi3String token, fmi3String path, bool visible, bool logs,
          bool event_mode_used, bool early_return_allowed, const uint32_t required[], size_t count, void *environment,
          fmi_logger log, fmi3IntermediateUpdateCallback update) {
  (void)path, (void)visible, (void)logs, (void)required, (void)count, (void)update;
  instance *own = instantiate(token, name, 1, environment, log);
  if (!own) return 0;
  own->unit->event_mode_used = event_mode_used;
  own->unit->early_return_allowed = early_return_allowed;
  return own;
}

FMI_TYPED(void *, InstantiateScheduledExecution, fmi3String name, fmi3String token, fmi3String path, bool visible,
          bool logs, void *environment, fmi_logger log, fmi3ClockUpdateCallback update,
          fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {
  (void)name, (void)token, (void)path, (void)visible, (void)logs, (void)update, (void)lock, (void)unlock;
  if (log) log(environment, fmi3Error, "logStatusError", "this unit has no scheduled execution");
  return 0;
}

FMI(EnterInitializationMode, void *i, bool has_tolerance, double tolerance, double start, bool has_stop, double stop) {
  (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
  fmu_set_time(((instance *)i)->unit, start);
  return fmi3OK;
}

NOTHING_TO_DO(EnterStepMode)
NOTHING_TO_DO(EnterConfigurationMode)
NOTHING_TO_DO(ExitConfigurationMode)
NOTHING_TO_DO(EvaluateDiscreteStates)

FMI_VARIABLES(GetFloat64, double values[], size_t length) {
  return length == count ? fmi_get(i, references, count, values) : fmi_answer(i, FMU_ERROR);
}

FMI_VARIABLES(SetFloat64, const double values[], size_t length) {
  return length == count ? fmi_set(i, references, count, values) : fmi_answer(i, FMU_ERROR);
}

FMI_VARIABLES(GetInt32, int32_t values[], size_t length) {
  return length == count ? fmi_get_modes(i, references, count, values) : fmi_answer(i, FMU_ERROR);
}

FMI_NONE2(SetInt32, const int32_t *, size_t)
NO_VARIABLES(Float32, float)
NO_VARIABLES(Int8, int8_t)
NO_VARIABLES(UInt8, uint8_t)
NO_VARIABLES(Int16, int16_t)
NO_VARIABLES(UInt16, uint16_t)
NO_VARIABLES(UInt32, uint32_t)
NO_VARIABLES(Int64, int64_t)
NO_VARIABLES(UInt64, uint64_t)
NO_VARIABLES(Boolean, bool)
NO_VARIABLES(String, fmi3String)
FMI_NONE3(GetBinary, size_t *, fmi3Binary *, size_t)
FMI_NONE3(SetBinary, const size_t *, const fmi3Binary *, size_t)
FMI_NONE3(GetOutputDerivatives, const int32_t *, double *, size_t)
FMI_NONE1(GetClock, bool *)
FMI_NONE1(SetClock, const bool *)
FMI_NONE2(GetIntervalDecimal, double *, fmi3IntervalQualifier *)
FMI_NONE3(GetIntervalFraction, uint64_t *, uint64_t *, fmi3IntervalQualifier *)
FMI_NONE1(GetShiftDecimal, double *)
FMI_NONE2(GetShiftFraction, uint64_t *, uint64_t *)
FMI_NONE1(SetIntervalDecimal, const double *)
FMI_NONE2(SetIntervalFraction, const uint64_t *, const uint64_t *)
FMI_NONE1(SetShiftDecimal, const double *)
FMI_NONE2(SetShiftFraction, const uint64_t *, const uint64_t *)

FMI(GetNumberOfVariableDependencies, void *i, uint32_t reference, size_t *count) {
  (void)reference, (void)count;
  return fmi_none(i, 1, "fmi3GetNumberOfVariableDependencies");
}

FMI(GetVariableDependencies, void *i, uint32_t dependent, size_t elements[], uint32_t independents[],
    size_t of_independents[], fmi3DependencyKind kinds[], size_t count) {
  (void)dependent, (void)elements, (void)independents, (void)of_independents, (void)kinds, (void)count;
  return fmi_none(i, 1, "fmi3GetVariableDependencies");
}

FMI(ActivateModelPartition, void *i, uint32_t clock, double time) {
  (void)clock, (void)time;
  return fmi_none(i, 1, "fmi3ActivateModelPartition");
}

FMI(GetDirectionalDerivative, void *i, const uint32_t unknowns[], size_t rows, const uint32_t knowns[], size_t columns,
    const double seed[], size_t seeds, double sensitivity[], size_t length) {
  if (seeds != columns || length != rows) return fmi_answer(i, FMU_ERROR);
  return fmi_products(i, unknowns, rows, knowns, columns, seed, sensitivity, 0);
}

FMI(GetAdjointDerivative, void *i, const uint32_t unknowns[], size_t rows, const uint32_t knowns[], size_t columns,
    const double seed[], size_t seeds, double sensitivity[], size_t length) {
  if (seeds != rows || length != columns) return fmi_answer(i, FMU_ERROR);
  return fmi_products(i, unknowns, rows, knowns, columns, seed, sensitivity, 1);
}

FMI(UpdateDiscreteStates, void *i, bool *more, bool *terminate, bool *nominals_changed, bool *values_changed,
    bool *next_defined, double *next) {
  instance *own = i;
  int jumped = 0;
  double time = INFINITY;
  const fmu_status status = fmu_update(own->unit, &jumped, &time);
  *more = *nominals_changed = 0;
  *values_changed = jumped != 0;
  *terminate = own->unit->now.ended != 0;
  *next_defined = time - time == 0;
  *next = *next_defined ? time : 0.0;
  return fmi_ended(own, status);
}

FMI(GetNumberOfEventIndicators, void *i, size_t *count) { return (void)i, *count = PROBLEM_SURFACES, fmi3OK; }
FMI(GetNumberOfContinuousStates, void *i, size_t *count) { return (void)i, *count = FMU_STATES, fmi3OK; }

FMI(DoStep, void *i, double point, double size, bool no_state_before, bool *event, bool *terminate, bool *early,
    double *last) {
  instance *own = i;
  int handled = 0;
  (void)no_state_before;
  const fmu_status status = fmu_step(own->unit, point, size, last, &handled);
  *early = !status && *last < point + size && own->unit->early_return_allowed;
  *event = handled && own->unit->event_mode_used && *early;
  *terminate = own->unit->now.ended != 0;
  return fmi_ended(own, status);
}
