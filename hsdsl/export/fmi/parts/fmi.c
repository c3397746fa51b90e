/* The functions that both versions of FMI have, over a unit. */

#include "fmi.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NOTHING_TO_DO(name) \
  FMI(name, void *i) { return (void)i, FMI_OK; }
#define SIZED(name, values, size, call)                 \
  FMI(name, void *i, values, size_t count) {            \
    instance *own = i;                                  \
    if (count != size) return fmi_answer(i, FMU_ERROR); \
    return fmi_answer(own, call);                       \
  }

fmi_status fmi_answer(instance *own, fmu_status status) {
  const char *const refusal = own->unit->refusal;
  own->unit->refusal = 0;
  if (status == FMU_OK) return FMI_OK;
  if (status == FMU_NO_VALUE) return fmi_log(own, FMI_DISCARD, "something has no finite value here");
  if (refusal) return fmi_log(own, FMI_ERROR, refusal);
  return fmi_log(own, FMI_ERROR, own->unit->complaint ? own->unit->complaint : "not allowed here, or without a value");
}

fmi_status fmi_ended(instance *own, fmu_status status) {
  if (own->unit->complaint && own->unit->now.ended) fmi_log(own, FMI_WARNING, own->unit->complaint);
  return fmi_answer(own, status);
}

fmi_status fmi_none(instance *own, size_t count, const char *function) {
  char message[120];
  if (!count) return FMI_OK;
  snprintf(message, sizeof message, "%s: this unit has none of these variables", function);
  return fmi_log(own, FMI_ERROR, message);
}

instance *fmi_new(const char *name, int co_simulation, void *environment, fmi_logger logger) {
  instance *own = calloc(1, sizeof *own);
  fmu *unit = fmu_new(co_simulation);
  char *copy = malloc(name ? strlen(name) + 1 : 1);
  if (!own || !unit || !copy) return free(own), free(copy), fmu_free(unit), (instance *)0;
  strcpy(copy, name ? name : "");
  own->unit = unit;
  own->environment = environment;
  own->logger = logger;
  own->name = copy;
  return own;
}

FMI_TYPED(void, FreeInstance, void *i) {
  instance *own = i;
  if (!own) return;
  fmu_free(own->unit);
  free(own->name);
  free(own);
}

NOTHING_TO_DO(Terminate)

FMI(EnterContinuousTimeMode, void *i) { return fmu_leave_events(((instance *)i)->unit), FMI_OK; }
FMI(EnterEventMode, void *i) { return fmu_enter_events(((instance *)i)->unit), FMI_OK; }
FMI(ExitInitializationMode, void *i) { return fmi_answer(i, fmu_initialize(((instance *)i)->unit)); }
FMI(Reset, void *i) { return fmu_reset(((instance *)i)->unit), FMI_OK; }
FMI(SetTime, void *i, double time) { return fmu_set_time(((instance *)i)->unit, time), FMI_OK; }

FMI(CompletedIntegratorStep, void *i, fmi_boolean no_state_before, fmi_boolean *event, fmi_boolean *terminate) {
  (void)i, (void)no_state_before;
  *event = *terminate = 0;
  return FMI_OK;
}

SIZED(SetContinuousStates, const double x[], FMU_STATES, (fmu_set_states(own->unit, x), FMU_OK))
SIZED(GetContinuousStates, double x[], FMU_STATES, (fmu_get_states(own->unit, x), FMU_OK))
SIZED(GetNominalsOfContinuousStates, double x[], FMU_STATES, (fmu_get_nominals(own->unit, x), FMU_OK))
SIZED(FMI_DERIVATIVES, double slopes[], FMU_STATES, fmu_get_derivatives(own->unit, slopes))
SIZED(GetEventIndicators, double z[], PROBLEM_SURFACES, fmu_get_indicators(own->unit, z))

fmi_status fmi_get(instance *own, const uint32_t references[], size_t count, double values[]) {
  fmu_status status = FMU_OK;
  for (size_t k = 0; k < count && !status; k++) status = fmu_get(own->unit, references[k], &values[k]);
  return fmi_answer(own, status);
}

fmi_status fmi_set(instance *own, const uint32_t references[], size_t count, const double values[]) {
  fmu_status status = FMU_OK;
  for (size_t k = 0; k < count && !status; k++) status = fmu_set(own->unit, references[k], values[k]);
  return fmi_answer(own, status);
}

fmi_status fmi_get_modes(instance *own, const uint32_t references[], size_t count, int32_t values[]) {
  for (size_t k = 0; k < count; k++) {
    if (references[k] >= FMU_VARIABLES || fmu_variables[references[k]].kind != FMU_MODE)
      return fmi_answer(own, FMU_ERROR);
    values[k] = fmu_mode(own->unit, references[k]);
  }
  return FMI_OK;
}

fmi_status fmi_products(instance *own, const uint32_t unknowns[], size_t rows, const uint32_t knowns[], size_t columns,
                        const double seed[], double product[], int transposed) {
  double slope;
  for (size_t k = 0; k < (transposed ? columns : rows); k++) product[k] = 0.0;
  for (size_t r = 0; r < rows; r++)
    for (size_t c = 0; c < columns; c++) {
      const fmu_status status = fmu_slope(own->unit, unknowns[r], knowns[c], &slope);
      if (status) return fmi_answer(own, status);
      product[transposed ? c : r] += slope * seed[transposed ? r : c];
    }
  return FMI_OK;
}

FMI(FMI_STATE(Get, ), void *i, void **state) {
  if (!*state) *state = malloc(fmu_size());
  if (!*state) return fmi_answer(i, FMU_ERROR);
  fmu_save(((instance *)i)->unit, *state);
  return FMI_OK;
}

FMI(FMI_STATE(Set, ), void *i, void *state) {
  fmu_restore(((instance *)i)->unit, state);
  return FMI_OK;
}

FMI(FMI_STATE(Free, ), void *i, void **state) {
  (void)i;
  if (state) free(*state), *state = 0;
  return FMI_OK;
}

/* A sum over the bytes of a state (FNV-1a), by which one that was damaged is known. */
static uint64_t sum_of(const void *state) {
  const unsigned char *bytes = state;
  uint64_t sum = 0xcbf29ce484222325u;
  for (size_t k = 0; k < fmu_size(); k++) sum = (sum ^ bytes[k]) * 0x100000001b3u;
  return sum;
}

static size_t stored_size(void) { return fmu_size() + sizeof(uint64_t); }

FMI(FMI_STATE(Serialized, Size), void *i, void *state, size_t *size) {
  (void)i, (void)state;
  *size = stored_size();
  return FMI_OK;
}

FMI(FMI_STATE(Serialize, ), void *i, void *state, fmi_byte bytes[], size_t size) {
  if (size != stored_size()) return fmi_answer(i, FMU_ERROR);
  const uint64_t sum = sum_of(state);
  memcpy(bytes, state, fmu_size());
  memcpy(bytes + fmu_size(), &sum, sizeof sum);
  return FMI_OK;
}

FMI(FMI_DESERIALIZE, void *i, const fmi_byte bytes[], size_t size, void **state) {
  uint64_t sum;
  if (size == stored_size()) memcpy(&sum, bytes + fmu_size(), sizeof sum);
  if (size != stored_size() || sum != sum_of(bytes))
    return fmi_log(i, FMI_ERROR, "these bytes are no state that this unit has written");
  if (!*state) *state = malloc(fmu_size());
  if (!*state) return fmi_answer(i, FMU_ERROR);
  memcpy(*state, bytes, fmu_size());
  return FMI_OK;
}
