/* What both versions of FMI share: an instance, answers, and functions for variables that no unit has. */

#ifndef FMI_H
#define FMI_H

#include "fmi_version.h"
#include "fmu.h"

#define FMI_PASTE_NOW(a, b) a##b
#define FMI_PASTE(a, b) FMI_PASTE_NOW(a, b)
#define FMI_TEXT_NOW(a) #a
#define FMI_TEXT(a) FMI_TEXT_NOW(a)
#ifdef FMI_PREFIX
#define FMI_FULL(name) FMI_PASTE(FMI_PREFIX, FMI_PASTE(FMI_VERSION, name))
#define FMI_EXPORT
#else
#define FMI_FULL(name) FMI_PASTE(FMI_VERSION, name)
#if defined _WIN32 || defined __CYGWIN__
#define FMI_EXPORT __declspec(dllexport)
#else
#define FMI_EXPORT __attribute__((visibility("default")))
#endif
#endif

#define FMI_OK FMI_PASTE(FMI_VERSION, OK)
#define FMI_WARNING FMI_PASTE(FMI_VERSION, Warning)
#define FMI_DISCARD FMI_PASTE(FMI_VERSION, Discard)
#define FMI_ERROR FMI_PASTE(FMI_VERSION, Error)

/* The head of a function of the standard: of most of them, and of those that take the references of variables. */
#define FMI_TYPED(type, name, ...)             \
  FMI_EXPORT type FMI_FULL(name)(__VA_ARGS__); \
  FMI_EXPORT type FMI_FULL(name)(__VA_ARGS__)
#define FMI(name, ...) FMI_TYPED(fmi_status, name, __VA_ARGS__)
#define FMI_VARIABLES(name, ...) FMI(name, void *i, const uint32_t references[], size_t count, __VA_ARGS__)

/* Functions for variables that no unit has, by the types of their further arguments. */
#define FMI_NONE1(name, A) \
  FMI_VARIABLES(name, A a) { return (void)references, (void)a, fmi_none(i, count, FMI_TEXT(FMI_VERSION) #name); }
#define FMI_NONE2(name, A, B)                                                                   \
  FMI_VARIABLES(name, A a, B b) {                                                               \
    return (void)references, (void)a, (void)b, fmi_none(i, count, FMI_TEXT(FMI_VERSION) #name); \
  }
#define FMI_NONE3(name, A, B, C)                                                                         \
  FMI_VARIABLES(name, A a, B b, C c) {                                                                   \
    return (void)references, (void)a, (void)b, (void)c, fmi_none(i, count, FMI_TEXT(FMI_VERSION) #name); \
  }

typedef struct {
  fmu *unit;
  void *environment;
  fmi_logger logger;
  char *name;
  double reached;
} instance;

fmi_status fmi_log(instance *own, fmi_status status, const char *message); /* hands `status` on */
fmi_status fmi_answer(instance *own, fmu_status status);
fmi_status fmi_ended(instance *own, fmu_status status); /* with a warning where the run ended early */
fmi_status fmi_none(instance *own, size_t count, const char *function);

/* An instance, or 0 where there is no memory. */
instance *fmi_new(const char *name, int co_simulation, void *environment, fmi_logger logger);

fmi_status fmi_get(instance *own, const uint32_t references[], size_t count, double values[]);
fmi_status fmi_set(instance *own, const uint32_t references[], size_t count, const double values[]);
fmi_status fmi_get_modes(instance *own, const uint32_t references[], size_t count, int32_t values[]);

/* Products with the matrix of slopes, or `transposed`. */
fmi_status fmi_products(instance *own, const uint32_t unknowns[], size_t rows, const uint32_t knowns[], size_t columns,
                        const double seed[], double product[], int transposed);

#endif
