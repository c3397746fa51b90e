/* The functions of FMI 2.0 alone, over a unit; the others are in fmi.c. */

#include <string.h>

#include "fmi.h"

fmi_status fmi_log(instance *own, fmi_status status, const char *message) {
  if (own->logger) own->logger(own->environment, own->name, status, "logStatusError", "%s", message);
  return status;
}

FMI_TYPED(const char *, GetTypesPlatform, void) { return "default"; }
FMI_TYPED(const char *, GetVersion, void) { return "2.0"; }

FMI(SetDebugLogging, void *i, int on, size_t count, const fmi2String categories[]) {
  return (void)i, (void)on, (void)count, (void)categories, fmi2OK;
}

FMI_TYPED(void *, Instantiate, fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
          const fmi2CallbackFunctions *functions, int visible, int logs) {
  (void)resources, (void)visible, (void)logs;
  if (!functions || !guid || strcmp(guid, FMU_TOKEN) != 0) return 0;
  return fmi_new(name, type == fmi2CoSimulation, functions->componentEnvironment, functions->logger);
}

FMI(SetupExperiment, void *i, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
  (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
  fmu_set_time(((instance *)i)->unit, start);
  return fmi2OK;
}

FMI(EnterInitializationMode, void *i) { return (void)i, fmi2OK; }

FMI_VARIABLES(GetReal, double values[]) { return fmi_get(i, references, count, values); }
FMI_VARIABLES(SetReal, const double values[]) { return fmi_set(i, references, count, values); }
FMI_VARIABLES(GetInteger, int values[]) { return fmi_get_modes(i, references, count, values); }
FMI_NONE1(GetBoolean, int *)
FMI_NONE1(GetString, fmi2String *)
FMI_NONE1(SetInteger, const int *)
FMI_NONE1(SetBoolean, const int *)
FMI_NONE1(SetString, const fmi2String *)
FMI_NONE2(SetRealInputDerivatives, const int *, const double *)
FMI_NONE2(GetRealOutputDerivatives, const int *, double *)

FMI(GetDirectionalDerivative, void *i, const uint32_t unknowns[], size_t rows, const uint32_t knowns[], size_t columns,
    const double seed[], double sensitivity[]) {
  return fmi_products(i, unknowns, rows, knowns, columns, seed, sensitivity, 0);
}

FMI(NewDiscreteStates, void *i, fmi2EventInfo *info) {
  instance *own = i;
  int jumped = 0;
  double next = INFINITY;
  const fmu_status status = fmu_update(own->unit, &jumped, &next);
  info->newDiscreteStatesNeeded = info->nominalsOfContinuousStatesChanged = 0;
  info->valuesOfContinuousStatesChanged = jumped != 0;
  info->terminateSimulation = own->unit->now.ended != 0;
  info->nextEventTimeDefined = next - next == 0;
  info->nextEventTime = info->nextEventTimeDefined ? next : 0.0;
  return fmi_ended(own, status);
}

FMI(DoStep, void *i, double point, double size, int no_state_before) {
  instance *own = i;
  int event = 0;
  (void)no_state_before;
  const fmi_status status = fmi_ended(own, fmu_step(own->unit, point, size, &own->reached, &event));
  return status == fmi2OK && own->unit->now.ended ? fmi2Discard : status;
}

FMI(CancelStep, void *i) { return fmi_log(i, fmi2Error, "steps are made at once"); }

FMI(GetStatus, void *i, const fmi2StatusKind kind, fmi2Status *value) {
  (void)i, (void)kind;
  *value = fmi2OK;
  return fmi2Discard;
}

FMI(GetRealStatus, void *i, const fmi2StatusKind kind, double *value) {
  if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
  *value = ((instance *)i)->reached;
  return fmi2OK;
}

FMI(GetIntegerStatus, void *i, const fmi2StatusKind kind, int *value) {
  return (void)i, (void)kind, (void)value, fmi2Discard;
}

FMI(GetBooleanStatus, void *i, const fmi2StatusKind kind, int *value) {
  if (kind != fmi2Terminated) return fmi2Discard;
  *value = ((instance *)i)->unit->now.ended != 0;
  return fmi2OK;
}

FMI(GetStringStatus, void *i, const fmi2StatusKind kind, fmi2String *value) {
  return (void)i, (void)kind, (void)value, fmi2Discard;
}
