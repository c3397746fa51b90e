/* Where generated code meets the hand-written runtime.

   A model is generated as straight-line routines and constant tables of them; this header is all that either side
   knows of the other. A routine has a value (0 is returned and `out` is written) or it has none (anything else is
   returned), exactly where the Python kernel raises. `p` holds parameter values, then (a, b, c) of each sampled input's
   segment; `x` the states, in a spread or terms routine followed by their sizes; `out` must not overlap them. */

#ifndef HS_H
#define HS_H

#if defined(_WIN32)
#define HS_EXPORT __declspec(dllexport)
#else
#define HS_EXPORT __attribute__((visibility("default")))
#endif

/* Numbers of states, parameters and surfaces. Instants are doubles in any case: a sum of steps in 32 bits is none. */
#if defined(HS_FLOAT32)
typedef float hs_real;
#else
typedef double hs_real;
#endif
typedef double hs_time;
typedef hs_real hs_number;

/* Some text is compiled for numbers, and for vectors of them (lane.h), where a number is not one without HS_ALL. */
#define HS_ALL(number) ((hs_real)(number))

#if defined(__GNUC__)
#define HS_APART __attribute__((noinline)) /* a piece of a routine: a compiler takes long for large functions */
#else
#define HS_APART
#endif

typedef int hs_routine(const hs_real *p, hs_real t, const hs_real *x, hs_real *out);

/* A routine of few operands. Parts that are alike have one function, and each says `of` which operands it is. */
typedef int hs_shape(const int *of, const hs_real *p, hs_real t, const hs_real *x, hs_real *out);
typedef struct {
  hs_shape *shape;
  const int *of;
} hs_local;

static inline int hs_call(const hs_local *local, const hs_real *p, hs_real t, const hs_real *x, hs_real *out) {
  return local->shape(local->of, p, t, x, out);
}

/* Taylor coefficients along the flow through (t, x), of all lines that it needs: coefficient m of line l goes to
   lines[l*(order + 2) + m]. Line 0 is time, lines 1 to n are the states, with coefficients 0 to order + 1; the others
   have those from 0 to order, where something reads them. No value where one of them has none. */
#define HS_MOST_ORDER 30 /* round-off is below the terms of any order that is higher */
typedef int hs_series(const hs_real *p, int order, hs_real t, const hs_real *x, hs_real *lines);

/* The same of the further lines, which surfaces need: coefficients 0 to order. */
typedef int hs_surface_series(const hs_real *p, int order, hs_real *lines);

/* Values that are not zero everywhere, and their places. */
typedef struct {
  hs_local values;
  int count;
  const int *place;
} hs_sparse;

/* The pattern of a sparse elimination: see hsdsl/base/graphs.py. */
typedef struct {
  int size; /* entries of the factors */
  const int *order;
  const int *start;
  const int *column;
  const int *diagonal;
  const int *place;
} hs_elimination;

/* States that are derivatives of others: see Variation in hsdsl/base/graphs.py. */
typedef struct {
  int own;
  int count; /* of columns */
  const int *columns;
  const int *rows;
  int entries;
  int links;
  const int *link;
  const int *linked;
  const int *linking;
  const int *groups;
  const hs_elimination *elimination; /* 0 where the matrix of the own states is dense */
} hs_variation;

enum { HS_LOOKED_AT = 1, HS_HELD = 2 };

typedef struct {
  int target;           /* index of the target mode */
  int target_dimension; /* number of states it is entered with */
  int conditional;      /* whether it has an `if` */
  int priority;
  int parts; /* of the condition, which holds where all parts do */
  const hs_local *condition;
  hs_local reset; /* of the states that it changes: the others keep their values, where there are any */
  hs_local spread;
  int changes;
  const int *change;
  int contact;    /* number of the motion along its guard; -1 for none */
  int push_order; /* the derivative of the guard along the flow that presses then */
  int counts;     /* states that it counts with, which motion along its guard leaves as they are */
  const int *count;
  int branched;   /* whether its reset in the mode with motion along guards is a branch of this one, for slow impacts */
  int of_event;   /* whether it is part of an event */
  int strict;     /* whether it is made beyond its surface, not at the end of a run */
  int releases;   /* of a mode with motion along guards: the contact that it ends, or -1 */
} hs_edge;

/* Executions of an event that wait: states of a mode with how many do, and with the time and values of the first. */
typedef struct {
  int number; /* among the queues of all modes */
  int waiting;
  int values; /* the time is the first */
  const int *value;
  double most;
} hs_queue;

typedef struct {
  int dimension;
  int edges;
  int surfaces; /* edges first, then walls */
  int final;
  hs_routine *flow;
  hs_routine *values; /* of the surfaces */
  hs_routine *magnitudes;
  hs_routine *outputs;
  const hs_sparse *gradients; /* by time, place 0, and the states */
  const hs_local *rates;
  const hs_edge *edge;
  hs_series *series; /* 0 where the flow is kinked; then a mode has no other series */
  hs_surface_series *surface_series;
  const int *surface_line; /* for each surface; -1 where it is kinked */
  hs_sparse jacobian;      /* of the flow by the states, row by row */
  const hs_elimination *elimination; /* 0 where implicit steps solve dense systems */
  int affine;              /* whether every surface's gradient is the same everywhere */
  hs_routine *terms;       /* the sizes of the terms of a flow; 0 where last digits tell */
  const int *state;        /* for each state its number among those of all modes */
  int held;                /* index of the mode with motion along its guards, after the modes; -1 for none */
  int measures;            /* states whose slopes at the end of an implicit step go into the states before the last */
  const int *measured;
  const hs_variation *variation; /* 0 where no states are derivatives of others */
  int own;                 /* states but the last ones, which are derivatives of these: surfaces depend on none of them */
  int queues;
  const hs_queue *queue;
  int idle; /* states that decide no transition */
  const int *idles;
} hs_mode;

typedef struct {
  int modes;
  int flows;    /* the modes, then those with motion along their guards, which take `contacts` more numbers in `p` */
  int width;    /* states of the largest mode */
  int surfaces; /* of the mode with most */
  int edges;    /* of the mode with most */
  int outputs;
  int data; /* numbers in `p` */
  int contacts; /* of the mode with most: for each 0 without, HS_LOOKED_AT where its surface is the push, or HS_HELD */
  int lines; /* of series, of the mode with most */
  int states; /* of all modes, by name */
  int derivatives; /* of a flow that are not zero everywhere, of the mode with most */
  int factors; /* entries of a matrix of an implicit step, of the mode with most */
  int varied; /* derivatives of the flow by the states, of the mode with most; 0 where none has a variation */
  int queues; /* of all modes, by name */
  int queued; /* values of the queue with most */
  const hs_mode *mode;
} hs_model;

/* Put the values that `out` begins with in their places among `size` numbers; the others are zero. */
static inline void hs_spread_out(const hs_sparse *sparse, int size, hs_real *out) {
  int i = sparse->count;
  for (int k = size; k-- > 0;) out[k] = i > 0 && sparse->place[i - 1] == k ? out[--i] : (hs_real)0.0;
}

/* What an edge's routine, its reset or its spread, makes of the values `before` of the states, to `out`. */
static inline int hs_changed(const hs_edge *edge, const hs_local *routine, const hs_real *p, hs_real t, const hs_real *x,
                             const hs_real *before, hs_real *out) {
  if (hs_call(routine, p, t, x, out)) return 1;
  int i = edge->changes;
  if (i == edge->target_dimension) return 0;
  for (int k = edge->target_dimension; k-- > 0;)
    out[k] = i > 0 && edge->change[i - 1] == k ? out[--i] : before[k];
  return 0;
}

#endif
