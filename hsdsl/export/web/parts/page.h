/* A model on a page: what generated numbers (page_numbers.h) are made of, and why settings are refused. */

#ifndef PAGE_H
#define PAGE_H

#include <stdlib.h>

#include "hs_math.h"
#include "problem.h"

/* An expression of parameters; not 0 where it has no value. */
typedef int page_constant(const double *p, double *out);

/* A sampled input: its samples, or the routine that writes all times and then all values. Where something follows its
   slope it is `sloped`: kinks are jumps. */
typedef struct {
  int count, linear, sloped;
  const double *times, *values;
  page_constant *samples;
} page_input;

/* A switch of time: its argument and the derivative of that at a time, with the data of a segment. Where it is linear in
   time, `line` writes its value at 0, and numerator and denominator of its slope; else the exported run's `cuts`, and
   the number before the first and after each of them. */
typedef struct {
  int is_floor, jumps;
  int (*argument)(const double *p, double t, double *out);
  int (*line)(const double *p, double *out);
  int cuts;
  const double *cut, *number;
} page_switch;

enum { PAGE_UNTIL, PAGE_STEP, PAGE_RELAXATION, PAGE_MAX_TRANSITIONS, PAGE_SCALE, PAGE_SETTINGS };

typedef enum {
  PAGE_RAN,
  PAGE_NO_PARAMETER, /* has no finite value; likewise below */
  PAGE_BELOW,
  PAGE_ABOVE,
  PAGE_NO_INITIAL,
  PAGE_NO_SETTING,
  PAGE_BAD_SETTING,
  PAGE_NO_SAMPLE,
  PAGE_UNSORTED,
  PAGE_SWITCHES,
  PAGE_NO_MEMORY
} page_refusal;

/* The timeline of a run, all of it in memory that grows. */
typedef struct {
  int64_t count, room;
  double *start, *end, *data;
  int32_t *jump;
} page_segments;

/* Give memory that a pointer is to room for so many things: not 0 where there is none. */
static void *page_moved;
#define PAGE_GROW(pointer, count) \
  (!(page_moved = realloc(pointer, (size_t)(count) * sizeof *(pointer))) || ((pointer) = page_moved, 0))

#endif
