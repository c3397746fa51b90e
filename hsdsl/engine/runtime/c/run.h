/* A run under way: what stays, and where it is. See hsdsl/engine/simulate/run.py. */

#ifndef HS_RUN_H
#define HS_RUN_H

#if !defined(HS_NO_CLOCK) /* given where there is none */
#include <time.h>
#endif

#include "hs_math.h"
#include "hs_simulate.h"
#include "scheme.h" /* printed from hsdsl/engine/scheme: hs_control, hs_pace, hs_cascade, hs_roots, hs_radau, ... */

#if defined(HS_INLINE) /* given by who compiles: sanitizers take minutes over code that is inlined everywhere */
#elif defined(__GNUC__)
#define HS_INLINE static inline __attribute__((always_inline))
#else
#define HS_INLINE static inline
#endif

#if defined(HS_LANES) /* defined where the compiler follows this pragma */
#define HS_SIMD _Pragma("omp simd")
#else
#define HS_SIMD
#endif

#if defined(HS_FLOAT32)
#define HS_BITS 24
#define HS_TIE 0x1p-20f
#define HS_NOTHING 0x1p-96f
#else
#define HS_BITS 53
#define HS_TIE 1e-12
#define HS_NOTHING 0x1p-960 /* below it numbers have no digits left */
#endif
#define HS_TIME_UNIT 0x1p-53
#define FREE 16 /* transitions within the relaxation that cost no time; so many are remembered */
#define MORE_CUTS 13
#define MOST_CUTS (HS_BITS + MORE_CUTS) /* open at once: widths of 1, 1/2, ... down to a unit of round-off */
#define MOST_SPLITS 30
#ifndef MOST_PIECES
#define MOST_PIECES 1000 /* of a push over time; who lacks memory takes fewer */
#endif
#define MOST_PARTS (MOST_PIECES + MOST_SPLITS + 2)
#define LEAST_MOST_DEGREE 8 /* of interpolation where a method asks for less */

enum { NO_VALUE = 1, NO_CONVERGENCE = 2 }; /* why a step has no end */

/* A step's interpolant: x + c_1 s + c_2 s**2 + ..., power m at c[m*width]. */
typedef struct {
  int degree;
  hs_real *c;
} hs_polynomial;

typedef struct {
  int edge;
  hs_real theta, depth;
  hs_time time;
  hs_real *state;
  const hs_polynomial *piece; /* of the whole step; 0 where the crossing is its start */
} hs_crossing;

/* The mode that a run is in, and the point there. */
typedef struct {
  int mode, dimension;
  const hs_mode *table;
  int64_t segment;
  const hs_real *p;
  hs_routine *outputs;     /* of the arc; 0 where the mode has none of the states they need */
  const hs_real *outputs_p;
  int active, emerging;    /* numbers of surfaces that are active and emerging */
  hs_time t;
} hs_mode_state;

/* One step of the relaxed scheme as tried, from (t, x) to (t1, z). */
typedef struct {
  hs_time t, t1;
  hs_real h;
  int looked, ends; /* whether the flow at the end was evaluated, and has a value */
  int has_piece;
  hs_polynomial piece;
} hs_trial;

/* What a trial step of the relaxed scheme found: crossings, a failure, or nothing. */
typedef struct {
  hs_step_failure failure;
  int surface;
  int crossings;
} hs_found;

/* What is remembered of a transition. */
typedef struct {
  hs_time time, resumed;
  int mode, edge, target, entry;
} hs_made;

/* Surfaces along one step: on part i, from start[i] on, surface k is a polynomial of the share of that part. */
typedef struct {
  int parts, count, room; /* room: numbers for each polynomial */
  hs_real *start, *width, *rows, *c, *off; /* off: how far it may be off; rises that are lower tell nothing */
  int *degree, *certain; /* for each part and surface */
} hs_curves;

/* Where a surface rises above its level: the root before it, its slope there, by the share of the step. */
typedef struct {
  hs_real share, slope;
  int certain;
} hs_rise;

/* A walk along all parts of surface k. */
typedef struct {
  int k, part;
  hs_walk walk;
} hs_path;

/* A surface that rises along the step, first at `rise`, and whether its crossing there is still to be settled. */
typedef struct {
  hs_path path;
  hs_rise rise;
  int open;
} hs_riser;

/* One step of the located scheme. */
typedef struct {
  hs_time t, t1;
  hs_real h;
  hs_real *x, *largest; /* where it began; of a table, the largest of its stages */
  int sized;            /* whether `largest` has the sizes where it ends: see lanes.c */
  hs_polynomial piece;
} hs_span;

/* The sizes of the numbers that a point is computed from. */
typedef struct {
  /* of the state on entry; negative where the terms of a reset gave them: the next reset reads no more than the value
     of such a state, and no size multiplies */
  hs_real *scale;
  hs_real *scales, *known; /* that states here have had, and those of all modes before this one was entered */
  hs_real *landed;         /* of a crossing's state */
  hs_real *both;           /* 2 width: states and sizes */
} hs_sizes;

/* What the method has of a step. */
typedef struct {
  hs_real **k; /* stages, then the flow at the end */
  hs_real **other_k, *other_end, *error; /* of a shorter step: see aside() in located_steps.c; its estimate */
  hs_real *lines; /* of Taylor's method: coefficients, as hs_series writes them */
  hs_real ratio;  /* of the last error estimate */
  int expanded;   /* whether it has written `lines`, in this mode */
  int sloped;     /* whether the flow at the step's start is known */
  hs_radau radau;
} hs_stages;

/* The mode's surfaces: one number or mark for each. */
typedef struct {
  hs_real *values, *starts, *ends, *middle;    /* now, and along the located step */
  hs_real *ahead, *magnitudes, *noise;         /* at the end of a trial and on entry; round-off of a trial */
  hs_real *begun, *ended; /* magnitudes at the ends of the located step: `weighed` says at which */
  int weighed, has_starts, has_ends, has_middle; /* has_...: whether those of the step are known */
  int *active, *beyond, *emerging; /* emerging: entered beyond it, and the flow leads inside */
  hs_real *stood; /* how far off it a state is that stood on it, on entry */
} hs_at_surfaces;

/* Crossings of a step, and the one that goes. */
typedef struct {
  hs_crossing *crossings, chosen; /* one for each surface, those of edges first; the one that goes */
  hs_riser *waiting;              /* one for each surface */
  int *tied;                      /* one for each edge */
  int *alternatives, alternatives_count;
  hs_time landed_at; /* the end of a step into a strip */
  hs_real *after;    /* the state after the reset */
} hs_event;

/* Motion along guards: see contact.c; arrays of the located scheme alone. Marks are one for each edge. */
typedef struct {
  hs_real *p;           /* what routines are bound to: model->data and then model->contacts numbers */
  const hs_real *own_p; /* what they are bound to else */
  int *kept, *held;     /* whether the edge may hold the state, and does */
  int *others;          /* whether it holds the state where the `if` of another is looked at */
  hs_real *flow_sizes, *jacobian; /* jacobian: model->derivatives */
  hs_real *began;                 /* where a motion along a guard began */
  int still;                      /* whether it ended there */
} hs_contacts;

/* Zeno tails: see zeno.c; arrays of the located scheme alone. */
typedef struct {
  int *tail;          /* one for each surface: whether it is that of an edge of the tail */
  hs_real *turn;      /* 2 width: where a tail's edges take a state in turn */
  int64_t contracted; /* after how many transitions contraction() was last asked; what it found */
  hs_real flight, ratio;
  int contracts;
} hs_zeno;

/* The steps that surfaces allow, by modes. */
typedef struct {
  hs_real *step; /* 0 where they allow any */
  int *lost;     /* where no step can follow them */
  int refused;   /* whether they were too fast for the last one */
} hs_reach;

/* What was written, and what is remembered of it. `row`, `jump` and `placed` are counted from the start of the run. */
typedef struct {
  int64_t row, jump, placed; /* placed: arcs of flow that were begun */
  hs_made made[FREE];
  int full;                      /* whether the caller has no more room */
  int full_queue;                /* a queue of the mode in which more wait than may, or -1 */
  int *unsettled, noted_crowded; /* unsettled: for each mode and surface */
} hs_written;

/* How often the caller is asked whether to go on. */
typedef struct {
  int interrupted;
  long steps_left, steps; /* until the clock is read next, and between two readings */
#if !defined(HS_NO_CLOCK)
  clock_t at;
#endif
} hs_polling;

/* When to pause, and whether to do so after a transition: see hs.c. */
typedef struct {
  hs_time at;
  int after_jump;
  int64_t jumps_before;
} hs_pausing;

/* Arrays are in the workspace, of a state's room unless said otherwise. */
typedef struct {
  hs_task *task;
  const hs_model *model;
  const hs_method *method;
  int width;
  hs_real epsilon;
  hs_time until;
  hs_mode_state here;
  hs_trial trial;
  hs_control control;
  hs_pace pace;
  hs_cascade cascade;
  hs_real *x, *slope, *z, *end; /* where the run is, and where its step ends, with the flow there */
  hs_real *at, *near, *nearby, *q, *gradient; /* for a while; gradient: width + 1 */
  hs_real *entered;                           /* the state with which the arc begins */
  hs_real *source; /* the flow that led to a transition, or between two states */
  hs_polynomial cubic;
  hs_sizes sizes;
  hs_stages step;
  hs_at_surfaces surfaces;
  hs_event event;
  hs_contacts contact;
  hs_zeno zeno;
  hs_reach reach;
  hs_written written;
  hs_polling poll;
  hs_pausing pausing;
  /* of the located scheme */
  hs_span span, before;
  int has_before;
  hs_curves curves;
  hs_roots roots;
  struct {
    int parks, bare; /* whether steps are made in lanes, and only the last row counts, without its piece: see lanes.c */
  } lanes;
} hs_run;

/* All that a paused run needs to go on: plain data. `data` has the numbers that routines were bound to; there are
   HS_PAUSE_NUMBERS and HS_PAUSE_INTEGERS of the others. `ended` says that it does not go on: see the
   task's stop. Its time is after the pause where it waits in a strip. */
typedef struct {
  int ended, mode, dimension, active, emerging, noted_crowded, cascade_mode;
  int64_t cascade_length, cascade_room, placed, jump, row;
  hs_time time;
  hs_control control;
  hs_made made[FREE];
  hs_real *numbers, *data;
  int32_t *integers;
} hs_pause;

/* Enter the task's mode at an instant and pause; then go on until an instant or, `after_jump`, the next transition. Where
   inputs or parameters have `changed` since, the mode is entered anew. */
HS_EXPORT void hs_begin(hs_task *task, hs_pause *pause, hs_time start);
HS_EXPORT void hs_go_on(hs_task *task, hs_pause *pause, hs_time until, int changed, int after_jump);

/* The earlier of two instants, the first where they are one. */
static inline hs_time earlier(hs_time a, hs_time b) { return b < a ? b : a; }

static inline hs_real tie(hs_time t) { return HS_TIE * fabs(t); }

static inline int all_finite(const hs_real *v, int n) {
  hs_real none = 0.0; /* not-a-number where one is not finite */
  for (int i = 0; i < n; i++) none += v[i] - v[i];
  return none == 0;
}

static inline void swap(hs_real **a, hs_real **b) {
  hs_real *const kept = *a;
  *a = *b;
  *b = kept;
}

static inline void copy(hs_real *to, const hs_real *from, int n) {
  for (int i = 0; i < n; i++) to[i] = from[i];
}

/* What is left of the caller's memory. Counted without memory first, then given out. */
typedef struct {
  double *numbers;
  int64_t used;
} hs_store;

/* What hs_workspace() gives, as a constant expression: so the memory of a run can be static.
   The terms are those of lay_out() and lay_out_located() in hs.c, array by array. */
#define HS_LARGER(a, b) ((a) > (b) ? (a) : (b))
#define HS_TAKEN(count, type) (((count) * (int)sizeof(type) + (int)sizeof(double) - 1) / (int)sizeof(double))
#define HS_NUMBERS(count) HS_TAKEN(count, hs_real)

/* Numbers that lay_out_method() takes of Radau IIA. */
#define HS_RADAU_SPACE(w, factors)                                                                                \
  (5 * HS_NUMBERS(factors) + 24 * HS_NUMBERS(w) + 2 * HS_TAKEN(w, int) + 6 * HS_TAKEN(3, hs_real *) +             \
   HS_TAKEN(2, hs_real *) + HS_TAKEN(4, hs_real *))
#define HS_IMPLICIT_SPACE(kind, w, factors) ((kind) == HS_RADAU ? HS_RADAU_SPACE(w, factors) : 0)

/* w: states of the largest mode; m, e: surfaces and edges of the mode with most; data: numbers that routines are bound
   to, with those of contacts; modes, lines, states, derivatives, factors: see hs_model.
   kind, stages, extra, order, degree: see hs_method. */
#define HS_PIECE(w, degree) HS_NUMBERS(HS_LARGER(degree, 3) * (w))
#define HS_STAGES(w, all) (HS_TAKEN(all, hs_real *) + ((all)-1) * HS_NUMBERS(w))
#define HS_SPAN(w, degree) (2 * HS_NUMBERS(w) + HS_PIECE(w, degree))
#define HS_SPACE(w, m, e, lines, states, data, derivatives, factors, kind, stages, extra, order, degree)           \
  (19 * HS_NUMBERS(w) + HS_NUMBERS(states) + HS_TAKEN(w, int) + HS_STAGES(w, (stages) + 1 + (extra)) +            \
   ((kind) == HS_TAYLOR ? HS_NUMBERS((lines) * ((order) + 2)) : 0) + HS_IMPLICIT_SPACE(kind, w, factors) +                 \
   6 * HS_NUMBERS(m) + HS_NUMBERS((w) + 1) + HS_NUMBERS(2 * (w)) + 4 * HS_TAKEN(m, int) + 2 * HS_TAKEN(e, int) +   \
   HS_NUMBERS(data) + HS_NUMBERS(derivatives) +                                                                    \
   2 * HS_PIECE(w, degree) + HS_TAKEN(m, hs_crossing) + (m) * HS_NUMBERS(w))

#define HS_MOST_DEGREE(order, degree) HS_LARGER(HS_LARGER(order, degree), LEAST_MOST_DEGREE)
#define HS_LOCATED_SPACE_OF(w, m, modes, stages, extra, degree, most)                                        \
  (3 * HS_TAKEN(m, int) + 2 * HS_SPAN(w, degree) + 3 * HS_NUMBERS(w) + HS_NUMBERS(2 * (w)) +                                 \
   HS_STAGES(w, (stages) + 1 + (extra)) + 4 * HS_NUMBERS(m) + HS_TAKEN(m, hs_riser) +                            \
   HS_NUMBERS(((most) + 1 + HS_TESTS) * (m)) +                                                                    \
   (2 + MOST_CUTS) * HS_NUMBERS((most) + 1) + HS_NUMBERS(((most) + 1) * ((most) + 2) / 2) +                        \
   HS_TAKEN(MOST_CUTS, hs_cut) + HS_TAKEN((modes) * (m), int) + HS_NUMBERS(modes) + HS_TAKEN(modes, int) +         \
   2 * HS_NUMBERS(MOST_PARTS) + HS_NUMBERS(MOST_PARTS * (m) * ((most) + 1)) + HS_NUMBERS(MOST_PARTS * (m)) +       \
   2 * HS_TAKEN(MOST_PARTS * (m), int))
#define HS_LOCATED_SPACE(w, m, modes, stages, extra, order, degree) \
  HS_LOCATED_SPACE_OF(w, HS_LARGER(m, 1), modes, stages, extra, degree, HS_MOST_DEGREE(order, degree))

/* Memory of a paused run. */
#define HS_PAUSE_NUMBERS(w, modes, states) (5 * (w) + (states) + (modes))
#define HS_PAUSE_INTEGERS(m, modes) (2 * (m) + (modes)*HS_LARGER(m, 1) + (modes))

#endif
