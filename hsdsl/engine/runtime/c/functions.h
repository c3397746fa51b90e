/* Constants, types and functions that the files of the runtime share, functions by the file that defines them. */

#ifndef HS_FUNCTIONS_H
#define HS_FUNCTIONS_H

#include <stddef.h>
#include <string.h>

#include "run.h"

enum { RAISED = -1 };
enum { GOES_ON = -1 }; /* instead of a reason to stop */
enum { PARKED = -6 }; /* instead of a reason to stop, of a run before steps that are made in lanes */
enum { PAUSED = -5 }; /* instead of a reason to stop, of a run that goes on later */
enum { LANDED = -2, AT_BOUNDARY = -3 }; /* how flow() ends, else GOES_ON or a reason to stop */
enum { WITHOUT_VALUE = -4 }; /* how first_event() ends, else GOES_ON, LANDED or a reason to stop */

#define MOST_HALVINGS (16 + 2 * HS_BITS)
#define ROUNDOFF_UNITS 32
#define SAME_UNITS 4

typedef int hs_functions(hs_run *run, hs_real s, hs_real *values);
typedef int hs_allowed(hs_run *run, int k, hs_real *allowed);

/* Surface k at the share s of a step. */
typedef int hs_value(hs_run *run, const hs_polynomial *piece, int k, hs_real s, hs_real *r);

static const hs_found CLEAR = {HS_CLEAR, -1, 0}, NOT_FINITE = {HS_NOT_FINITE, -1, 0};
static const hs_found TOO_WRONG = {HS_ERROR, -1, 0}, UNSOLVED = {HS_UNSOLVED, -1, 0};

/* What is used before it is defined; the order of files in hs.c is that in which they build on each other. */
static void *take(hs_store *store, int64_t count, size_t size);
static hs_real *numbers(hs_store *store, int64_t count);
HS_INLINE void append(hs_run *run, hs_time t, const hs_real *x, const hs_polynomial *piece);
static void begin(hs_run *run, int kind);
static void note_unsettled(hs_run *run, int k, hs_time time);
static hs_real state_size(const hs_run *run, int s);
static int is_push(const hs_run *run, int j);
static int holds_next(hs_run *run, int k, hs_time t, const hs_real *x);
static int releases(const hs_run *run, int j);

/* moving.c */
#if defined(HS_MOVES)
HS_APART static void move_reset(hs_run *run);
HS_APART static void move_crossing(hs_run *run);
HS_APART static void move_along(hs_run *run, hs_time t, hs_real *x, hs_real h);
HS_APART static void move_start(hs_run *run, hs_time t);
#define HS_MOVE(run, move) \
  if ((run)->task->moves) move
#else
#define HS_MOVE(run, move) (void)0
#endif

#endif
