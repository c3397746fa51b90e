/* The types of FMI 2.0 that the functions of a unit need, and how the functions are named. */

#ifndef FMI2_H
#define FMI2_H

#include <stddef.h>
#include <stdint.h>

#ifdef FMI_STANDARD_HEADERS /* the functions are checked against the standard's declarations */
#include "fmi2Functions.h"
#else
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef const char *fmi2String;
typedef void (*fmi2CallbackLogger)(void *environment, fmi2String name, fmi2Status status, fmi2String category,
                                   fmi2String message, ...);

typedef struct {
  fmi2CallbackLogger logger;
  void *(*allocateMemory)(size_t count, size_t size);
  void (*freeMemory)(void *memory);
  void (*stepFinished)(void *environment, fmi2Status status);
  void *componentEnvironment;
} fmi2CallbackFunctions;

typedef struct {
  int newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged, valuesOfContinuousStatesChanged,
      nextEventTimeDefined;
  double nextEventTime;
} fmi2EventInfo;
#endif

#ifdef FMI2_FUNCTION_PREFIX
#define FMI_PREFIX FMI2_FUNCTION_PREFIX
#endif
#define FMI_VERSION fmi2
#define FMI_STATE(before, after) before##FMUstate##after
#define FMI_DESERIALIZE DeSerializeFMUstate
#define FMI_DERIVATIVES GetDerivatives

typedef fmi2Status fmi_status;
typedef fmi2CallbackLogger fmi_logger;
typedef int fmi_boolean;
typedef char fmi_byte;

#endif
