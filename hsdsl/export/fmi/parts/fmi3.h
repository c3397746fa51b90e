/* The types of FMI 3.0 that the functions of a unit need, and how the functions are named. */

#ifndef FMI3_H
#define FMI3_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef FMI_STANDARD_HEADERS /* the functions are checked against the standard's declarations */
#if defined(__clang__)      /* which are without prototypes in part */
#pragma clang diagnostic push
#pragma clang diagnostic ignored "-Wstrict-prototypes"
#endif
#include "fmi3Functions.h"
#if defined(__clang__)
#pragma clang diagnostic pop
#endif
#else
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum {
  fmi3Independent,
  fmi3Constant,
  fmi3Fixed,
  fmi3Tunable,
  fmi3Discrete,
  fmi3Dependent
} fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;
typedef const char *fmi3String;
typedef const uint8_t *fmi3Binary;
typedef void (*fmi3LogMessageCallback)(void *environment, fmi3Status status, fmi3String category, fmi3String message);
typedef void (*fmi3ClockUpdateCallback)(void *environment);
typedef void (*fmi3IntermediateUpdateCallback)(void *environment, double time, bool set_requested, bool get_allowed,
                                               bool step_finished, bool can_return_early, bool *return_requested,
                                               double *return_time);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);
#endif

#if !defined(FMI3_OVERRIDE_FUNCTION_PREFIX) && defined(FMI3_FUNCTION_PREFIX)
#define FMI_PREFIX FMI3_FUNCTION_PREFIX
#elif defined(FMI3_OVERRIDE_FUNCTION_PREFIX) && defined(FMI3_ACTUAL_FUNCTION_PREFIX)
#define FMI_PREFIX FMI3_ACTUAL_FUNCTION_PREFIX
#endif
#define FMI_VERSION fmi3
#define FMI_STATE(before, after) before##FMUState##after
#define FMI_DESERIALIZE DeserializeFMUState
#define FMI_DERIVATIVES GetContinuousStateDerivatives

typedef fmi3Status fmi_status;
typedef fmi3LogMessageCallback fmi_logger;
typedef bool fmi_boolean;
typedef uint8_t fmi_byte;

#endif
