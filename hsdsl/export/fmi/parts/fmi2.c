/* The functions of FMI 2.0 over a unit. */

#include "fmi2Functions.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmu.h"

typedef struct {
  fmu *unit;
  fmi2CallbackFunctions callbacks;
  char *name;
  double reached;
} instance;

static fmi2Status logged(instance *own, fmi2Status status, const char *message) {
  if (own->callbacks.logger)
    own->callbacks.logger(own->callbacks.componentEnvironment, own->name, status, "logStatusError", "%s", message);
  return status;
}

static fmi2Status answer(instance *own, fmu_status status) {
  if (status == FMU_OK) return fmi2OK;
  if (status == FMU_NO_VALUE) return logged(own, fmi2Discard, "something has no finite value here");
  return logged(own, fmi2Error, own->unit->complaint ? own->unit->complaint : "not allowed here, or without a value");
}

static fmi2Status none(fmi2Component i, size_t count) {
  return count ? logged(i, fmi2Error, "this unit has none of these variables") : fmi2OK;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component i, fmi2Boolean on, size_t count, const fmi2String categories[]) {
  (void)i, (void)on, (void)count, (void)categories;
  return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logs) {
  (void)resources, (void)visible, (void)logs;
  if (!functions || !guid || strcmp(guid, FMU_TOKEN) != 0) return 0;
  instance *own = calloc(1, sizeof *own);
  fmu *unit = fmu_new(type == fmi2CoSimulation);
  char *copy = malloc(name ? strlen(name) + 1 : 1);
  if (!own || !unit || !copy) return free(own), free(copy), fmu_free(unit), (instance *)0;
  strcpy(copy, name ? name : "");
  own->unit = unit;
  own->callbacks = *functions;
  own->name = copy;
  return own;
}

void fmi2FreeInstance(fmi2Component i) {
  instance *own = i;
  if (!own) return;
  fmu_free(own->unit);
  free(own->name);
  free(own);
}

fmi2Status fmi2SetupExperiment(fmi2Component i, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop) {
  (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
  fmu_set_time(((instance *)i)->unit, start);
  return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component i) { return (void)i, fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component i) { return answer(i, fmu_initialize(((instance *)i)->unit)); }
fmi2Status fmi2Terminate(fmi2Component i) { return (void)i, fmi2OK; }

fmi2Status fmi2Reset(fmi2Component i) {
  fmu_reset(((instance *)i)->unit);
  return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component i, const fmi2ValueReference references[], size_t count, fmi2Real values[]) {
  instance *own = i;
  for (size_t k = 0; k < count; k++) {
    const fmu_status status = fmu_get(own->unit, references[k], &values[k]);
    if (status) return answer(own, status);
  }
  return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component i, const fmi2ValueReference references[], size_t count, const fmi2Real values[]) {
  instance *own = i;
  for (size_t k = 0; k < count; k++) {
    const fmu_status status = fmu_set(own->unit, references[k], values[k]);
    if (status) return answer(own, status);
  }
  return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component i, const fmi2ValueReference references[], size_t count, fmi2Integer values[]) {
  instance *own = i;
  for (size_t k = 0; k < count; k++) {
    if (references[k] >= FMU_VARIABLES || fmu_variables[references[k]].kind != FMU_MODE) return answer(own, FMU_ERROR);
    values[k] = fmu_mode(own->unit, references[k]);
  }
  return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component i, const fmi2ValueReference references[], size_t count, fmi2Boolean values[]) {
  return (void)references, (void)values, none(i, count);
}

fmi2Status fmi2GetString(fmi2Component i, const fmi2ValueReference references[], size_t count, fmi2String values[]) {
  return (void)references, (void)values, none(i, count);
}

fmi2Status fmi2SetInteger(fmi2Component i, const fmi2ValueReference references[], size_t count,
                          const fmi2Integer values[]) {
  return (void)references, (void)values, none(i, count);
}

fmi2Status fmi2SetBoolean(fmi2Component i, const fmi2ValueReference references[], size_t count,
                          const fmi2Boolean values[]) {
  return (void)references, (void)values, none(i, count);
}

fmi2Status fmi2SetString(fmi2Component i, const fmi2ValueReference references[], size_t count,
                         const fmi2String values[]) {
  return (void)references, (void)values, none(i, count);
}

fmi2Status fmi2GetFMUstate(fmi2Component i, fmi2FMUstate *state) {
  if (!*state) *state = malloc(fmu_size());
  if (!*state) return answer(i, FMU_ERROR);
  fmu_save(((instance *)i)->unit, *state);
  return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component i, fmi2FMUstate state) {
  fmu_restore(((instance *)i)->unit, state);
  return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component i, fmi2FMUstate *state) {
  (void)i;
  if (state) free(*state), *state = 0;
  return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component i, fmi2FMUstate state, size_t *size) {
  (void)i, (void)state;
  *size = fmu_size();
  return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component i, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
  if (size != fmu_size()) return answer(i, FMU_ERROR);
  memcpy(bytes, state, size);
  return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component i, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
  if (size != fmu_size()) return answer(i, FMU_ERROR);
  if (!*state) *state = malloc(size);
  if (!*state) return answer(i, FMU_ERROR);
  memcpy(*state, bytes, size);
  return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component i, const fmi2ValueReference unknowns[], size_t rows,
                                        const fmi2ValueReference knowns[], size_t columns, const fmi2Real seed[],
                                        fmi2Real sensitivity[]) {
  instance *own = i;
  double slope;
  for (size_t r = 0; r < rows; r++) {
    sensitivity[r] = 0.0;
    for (size_t c = 0; c < columns; c++) {
      const fmu_status status = fmu_slope(own->unit, unknowns[r], knowns[c], &slope);
      if (status) return answer(own, status);
      sensitivity[r] += slope * seed[c];
    }
  }
  return fmi2OK;
}

fmi2Status fmi2EnterEventMode(fmi2Component i) { return (void)i, fmi2OK; }
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component i) { return (void)i, fmi2OK; }

fmi2Status fmi2NewDiscreteStates(fmi2Component i, fmi2EventInfo *info) {
  instance *own = i;
  int jumped = 0;
  double next = INFINITY;
  const fmu_status status = fmu_update(own->unit, &jumped, &next);
  info->newDiscreteStatesNeeded = info->nominalsOfContinuousStatesChanged = fmi2False;
  info->valuesOfContinuousStatesChanged = jumped != 0;
  info->terminateSimulation = own->unit->now.ended != 0;
  info->nextEventTimeDefined = next - next == 0;
  info->nextEventTime = info->nextEventTimeDefined ? next : 0.0;
  if (own->unit->complaint && own->unit->now.ended) logged(own, fmi2Warning, own->unit->complaint);
  return answer(own, status);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component i, fmi2Boolean no_state_before, fmi2Boolean *event,
                                       fmi2Boolean *terminate) {
  (void)i, (void)no_state_before;
  *event = *terminate = fmi2False;
  return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component i, fmi2Real time) {
  fmu_set_time(((instance *)i)->unit, time);
  return fmi2OK;
}

fmi2Status fmi2SetContinuousStates(fmi2Component i, const fmi2Real x[], size_t count) {
  if (count != FMU_STATES) return answer(i, FMU_ERROR);
  fmu_set_states(((instance *)i)->unit, x);
  return fmi2OK;
}

fmi2Status fmi2GetContinuousStates(fmi2Component i, fmi2Real x[], size_t count) {
  if (count != FMU_STATES) return answer(i, FMU_ERROR);
  fmu_get_states(((instance *)i)->unit, x);
  return fmi2OK;
}

fmi2Status fmi2GetDerivatives(fmi2Component i, fmi2Real slopes[], size_t count) {
  if (count != FMU_STATES) return answer(i, FMU_ERROR);
  return answer(i, fmu_get_derivatives(((instance *)i)->unit, slopes));
}

fmi2Status fmi2GetEventIndicators(fmi2Component i, fmi2Real z[], size_t count) {
  if (count != PROBLEM_SURFACES) return answer(i, FMU_ERROR);
  return answer(i, fmu_get_indicators(((instance *)i)->unit, z));
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component i, fmi2Real x[], size_t count) {
  if (count != FMU_STATES) return answer(i, FMU_ERROR);
  fmu_get_nominals(((instance *)i)->unit, x);
  return fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component i, const fmi2ValueReference references[], size_t count,
                                       const fmi2Integer orders[], const fmi2Real values[]) {
  return (void)references, (void)orders, (void)values, none(i, count);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component i, const fmi2ValueReference references[], size_t count,
                                        const fmi2Integer orders[], fmi2Real values[]) {
  return (void)references, (void)orders, (void)values, none(i, count);
}

fmi2Status fmi2DoStep(fmi2Component i, fmi2Real point, fmi2Real size, fmi2Boolean no_state_before) {
  instance *own = i;
  int event = 0;
  (void)no_state_before;
  const fmu_status status = fmu_step(own->unit, point + size, &own->reached, &event);
  if (own->unit->complaint && own->unit->now.ended) logged(own, fmi2Warning, own->unit->complaint);
  if (status) return answer(own, status);
  return own->unit->now.ended ? fmi2Discard : fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component i) { return logged(i, fmi2Error, "steps are made at once"); }

fmi2Status fmi2GetStatus(fmi2Component i, const fmi2StatusKind kind, fmi2Status *value) {
  (void)i, (void)kind;
  *value = fmi2OK;
  return fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component i, const fmi2StatusKind kind, fmi2Real *value) {
  if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
  *value = ((instance *)i)->reached;
  return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component i, const fmi2StatusKind kind, fmi2Integer *value) {
  return (void)i, (void)kind, (void)value, fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component i, const fmi2StatusKind kind, fmi2Boolean *value) {
  if (kind != fmi2Terminated) return fmi2Discard;
  *value = ((instance *)i)->unit->now.ended != 0;
  return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component i, const fmi2StatusKind kind, fmi2String *value) {
  return (void)i, (void)kind, (void)value, fmi2Discard;
}
