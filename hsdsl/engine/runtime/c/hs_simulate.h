/* What a caller gives a run and what it gets: plain data, all of it the caller's own memory.

   A run writes rows, arcs and transitions into the chunk it was given. When one of them is full, `flush`
   has the caller keep its content and make room. Row k's piece is the interpolant that leads to it. */

#ifndef HS_SIMULATE_H
#define HS_SIMULATE_H

#include <stdint.h>

#include "hs.h"

/* One row of a Butcher tableau without its zeros. Stage number `stages` is the flow at the step's end; later ones
   are evaluated for the dense output alone. */
typedef struct {
  int terms;
  const int *stage;
  const hs_real *weight;
} hs_row;

typedef enum { HS_SECANT, HS_HERMITE, HS_DENSE } hs_interpolant;

typedef enum { HS_TABLE, HS_TAYLOR, HS_RADAU } hs_method_kind;

/* The coefficients of Radau IIA: see Coefficients in hsdsl/engine/integrators/radau.py. */
typedef struct {
  hs_real node[3], power[3][3];
  hs_real gamma, alpha, beta, mix[3][3], unmix[3][3];
  hs_real estimate[3];
  hs_real share, value[3], slope[3], end_slope[3];
} hs_collocation;

/* Fields between `degree` and `collocation` are those of tables; `collocation` is that of Radau IIA. */
typedef struct {
  int kind;
  int stages; /* to evaluate in a step */
  int extra;  /* stages of the dense output's own */
  int order;  /* the power of h that the error estimate falls with; of Taylor's method the degree */
  int interpolant;
  int degree; /* of the pieces that are kept; 0 for straight lines */
  const hs_real *c;
  const hs_row *a;
  hs_row b;
  hs_row error;  /* weights less those of the embedded method */
  hs_row coarse; /* and less those of a second one; no terms where there is none */
  const hs_row *dense;
  hs_real gain; /* by how much a step can enlarge the round-off of its stages */
  const hs_collocation *collocation;
} hs_method;

/* Time cut at the samples of inputs; segment i has the numbers data[i*model->data ...] to bind routines to. */
typedef struct {
  int64_t segments;
  const hs_time *start;
  const hs_time *end;
  const int32_t *jump; /* whether an input jumps at its start */
  const hs_real *data;
} hs_timeline;

enum { HS_TESTS = 3 };

/* How functions are interpolated: values at the nodes times the matrix are coefficients of powers, compared with the
   functions at the tests. */
typedef struct {
  int degree;
  const hs_real *nodes, *tests, *matrix;
  hs_real share; /* how far a function may be off, relative to its largest value */
} hs_interpolation;

typedef enum { HS_RELAXED, HS_LOCATED } hs_scheme;

typedef struct {
  hs_real step;      /* the first one, of an adaptive method */
  hs_real tolerance; /* 0 for a fixed step */
  hs_real largest;
  hs_real relaxation;
  hs_time until;
  int64_t max_transitions;
  int64_t scheme;
  int64_t contacts; /* whether states that a guard holds move along it */
  const hs_real *scale; /* a size of each state of all modes, 0 where none is given; 0 where none at all */
  int64_t arcs;              /* that have a bound on their first step */
  const hs_real *first_steps; /* of each arc of flow, 0 where there is no bound */
} hs_settings;

typedef enum { HS_FLOW, HS_STRIP } hs_arc_kind;

typedef struct {
  int64_t first; /* row, counted from the start of the run */
  int64_t jump;
  int32_t mode;
  int32_t kind;
} hs_arc;

typedef struct {
  hs_time time;
  hs_time resumed; /* not-a-number where the run ended first */
  int32_t mode;
  int32_t edge;
  int32_t entry;
  int32_t alternatives; /* how many of the chunk's are its */
} hs_transition;

typedef enum {
  HS_CROWDED,
  HS_IN_CONTACT,
  HS_REPLACED,
  HS_ACCUMULATES,
  HS_UNSETTLED,
  HS_SLIDES,
  HS_COUPLED,
  HS_TAKES_TURN
} hs_notice;

#define HS_SLID (1 << 16) /* beside the bits of notices: the run slid between two modes */
#define HS_ENTERED (1 << 17) /* and came beyond the surface of an edge with an `if` without flow, or an input onto it */

/* A diagnostic: see hsdsl/engine/simulate/stops.py. `surface` is an edge, but for HS_UNSETTLED. */
typedef struct {
  int32_t kind;
  int32_t mode;
  int64_t surface;
  int64_t number;
  hs_time time;
  hs_time other;
} hs_note;

typedef struct {
  int64_t row_room, rows;
  int64_t arc_room, arcs;
  int64_t transition_room, transitions;
  int64_t note_room, notes;
  hs_time *times;   /* (row) */
  hs_real *values;  /* (row, width) */
  hs_real *outputs; /* (row, outputs) */
  hs_real *depth;   /* (row) */
  hs_real *pieces;  /* (row, degree, width) */
  hs_arc *arc;
  hs_transition *transition;
  hs_real *before, *after;  /* (transition, width) */
  int32_t *alternatives;   /* (transition * (model->edges - 1)), edges, one transition's after the other's */
  int64_t alternatives_used;
  hs_note *note;
  int32_t blank; /* the pieces are zero: what has none is not written, and takes no memory */
} hs_chunk;

/* States that one chain of transitions at an instant has been in. */
typedef struct {
  int64_t room, count; /* of states; there are twice as many slots */
  int32_t *mode;
  hs_real *state;
  int64_t *slot; /* one more than the place of a state, or 0 */
} hs_visited;

#define FEWEST_WAITS 16 /* executions that a queue has room for at first */

/* Executions that wait after the first of a queue, in the order in which they are made. */
typedef struct {
  int64_t room, first, count;
  hs_real *waits; /* (room, model->queued): time and values */
} hs_tail;

/* Why a run ends: what the loop calls it, and the word for its users. Where it is stuck only the sentence tells. */
#define HS_REASONS(reason)                \
  reason(UNTIL, until)                    \
  reason(UNTIL_IN_STRIP, until)           \
  reason(UNTIL_ON_GUARD, until)           \
  reason(FINAL, final)                    \
  reason(ZENO, zeno)                      \
  reason(LIMIT, transition_limit)         \
  reason(WAITING, waiting_limit)          \
  reason(RESET_NOT_FINITE, not_finite)    \
  reason(HERE_NOT_FINITE, not_finite)     \
  reason(ENTERED_OUTSIDE, left_domain)    \
  reason(STUCK, stuck)                    \
  reason(INTERRUPTED, interrupted)        \
  reason(LEFT, left_domain)               \
  reason(STEP_NOT_FINITE, not_finite)     \
  reason(ACCUMULATED, zeno)
#define HS_REASON_NAME(name, word) HS_##name,
#define HS_REASON_WORD(name, word) #word,
typedef enum { HS_REASONS(HS_REASON_NAME) HS_REASON_COUNT } hs_reason;

typedef enum {
  HS_CLEAR,
  HS_WALL,
  HS_DEEP,
  HS_FLAT,
  HS_INWARD,
  HS_NOT_FINITE,
  HS_ERROR,
  HS_CREEPING,
  HS_UNSOLVED,
  HS_JUMP,
  HS_SLOW
} hs_step_failure;

/* Why a run ended, and where it was: mode, input segment, state, and (stuck) the flow there and the step's size;
   `slope` and `h` are the state and time at the end of a step along which something has no value; `scales` are those of
   the states. */
typedef struct {
  int32_t reason;
  int32_t mode;
  int32_t dimension;
  int32_t edge;
  int32_t failure;
  int32_t surface; /* -1 for none */
  int64_t segment;
  hs_time time;
  hs_time h;
  hs_real *x, *slope, *scales;
} hs_stop;

typedef struct hs_task {
  const hs_model *model;
  const hs_method *method;
  const hs_timeline *timeline;
  hs_settings settings;
  const hs_interpolation *interpolation; /* of surfaces along steps of the located scheme */
  int32_t mode, dimension; /* the start */
  const hs_real *x;
  double *workspace; /* hs_workspace() numbers */
  const void *moves; /* hs_moves, where round-off moves the run; else 0 */
  hs_chunk chunk;
  hs_visited visited;
  int (*flush)(struct hs_task *);                      /* makes room in chunk: 0; 1: room, but stop; 2: no room */
  int (*poll)(struct hs_task *);                       /* called now and then: not 0 to stop */
  int (*grow)(struct hs_task *, hs_visited *larger);   /* twice the room, slots zero: 0 */
  hs_tail *tail;                                       /* (model->queues): what waits at the start, and at the end */
  int (*lengthen)(struct hs_task *, hs_tail *larger);  /* memory for the room that it has: 0 */
  hs_time now;                                   /* to be looked at while it runs */
  int64_t made;
  int64_t entries; /* of the transitions made, those on entry */
  hs_stop stop;
} hs_task;

/* The columns of a run. A row's piece leaves it. */
typedef struct {
  int64_t rows, arcs, transitions, notes, others; /* others: alternatives of all transitions */
  int32_t width, degree, outputs;
  const double *times, *values, *recorded, *pieces;
  const hs_arc *arc;
  const hs_transition *transition;
  const double *before, *after; /* (transitions, model->width) */
  const int32_t *alternatives;
} hs_record;

/* Take part in a reset from x to z, which gets the first executions that wait then; the number of a queue of the mode in
   which more wait than may, or -1. Let none wait. */
HS_EXPORT int hs_let_wait(const hs_model *model, hs_tail *tail, hs_task *task, const hs_mode *from, const hs_real *x,
                          const hs_mode *to, hs_real *z);
HS_EXPORT void hs_forget_waits(const hs_model *model, hs_tail *tail);

HS_EXPORT int64_t hs_workspace(const hs_model *model, const hs_method *method, hs_scheme scheme);
HS_EXPORT void hs_simulate(hs_task *task);
HS_EXPORT int64_t hs_pack(const hs_task *task, double *to);
HS_EXPORT int64_t hs_run_whole(hs_task *task);

/* A run's values at many times: what a caller gives, all of it the caller's own memory. */
typedef struct {
  const hs_model *model; /* these two for outputs alone */
  const hs_timeline *timeline;
  int64_t rows, arcs, samples;
  int32_t width, degree; /* of values and pieces; pieces of degree 0 are the straight lines between rows */
  int32_t outputs;       /* 0 for none */
  int32_t columns;       /* states to evaluate */
  int32_t left;          /* at a jump take the first value, not the last */
  const double *times, *values, *recorded, *pieces; /* by row; a row's piece leaves it */
  const hs_arc *arc;
  const int32_t *layout;    /* of each arc, by its states; 0 where there is only one */
  const int32_t *dimension; /* of each layout */
  const int32_t *column;    /* (layouts, columns): which of the arc's states it is, -1 for none */
  double *time;             /* (samples), in any order; moved to the run's ends where outside to round-off */
  double *states;           /* (columns, samples) */
  double *results;          /* (samples, outputs) */
  double *scratch;          /* 2 width */
} hs_sampling;

/* The number of the first time that is outside the run by more than the tie tolerance, or -1. */
HS_EXPORT int64_t hs_sample(const hs_sampling *sampling);

/* The same of a packed run and of what `shared` asks for: `memory` has the times, and room after them for states,
   results and scratch. */
HS_EXPORT int64_t hs_sample_record(const hs_sampling *shared, const hs_record *record, const int32_t *layout,
                                   int64_t samples, double *memory);

/* What ensembles watch of edges with an `if`, by the names of these: see watch() in ensemble.c. */
typedef struct {
  int32_t names;         /* 0 where nothing is watched */
  const int32_t *name;   /* (modes, surfaces of the mode with most): -1 where it is not watched */
  double *side;          /* (names): where states were as the last arc of flow ended; beyond is 1, on it 0, inside -1 */
  int32_t *came;         /* (names): whether they have come beyond a surface, or onto it, and stay there */
  double *sizes;         /* (states of all modes): the largest they have had */
  double *memory;        /* 2 surfaces and 2 widths, and one more */
  int64_t arc, jump;     /* of the last arc of flow: its first row, counted from 1, and its number of transitions */
  int32_t mode;
} hs_watch;

/* Many instances of one model: `task` must come first; of each run only the results below are kept. */
typedef struct hs_ensemble {
  hs_task task;
  hs_sampling sampling; /* of one chunk, with memory for all samples of an instance */
  int64_t instances, samples, most_transitions;
  const hs_timeline *timeline; /* (instances) */
  const hs_settings *settings; /* (instances) */
  const double *start;         /* (instances, dimension) */
  const double *time;          /* (instances, samples), never decreasing */
  const int32_t *layout_of;    /* of each mode, -1 where it keeps that of the mode before; 0 where there is only one */
  const int32_t *stop;         /* not 0: end as soon as possible */
  int32_t *reason, *mode;      /* (instances) */
  int32_t *kind;               /* (instances): layout of the last arc */
  const int32_t *slides;       /* (modes): whether one is motion between two modes; 0 where none is */
  int32_t *notices;            /* (instances): kinds of notices, a bit each, HS_SLID and HS_ENTERED */
  hs_watch watch;
  int64_t *transitions;        /* (instances): how many were made */
  double *ended;               /* (instances): the last time */
  double *final;               /* (instances, width) */
  double *outputs;             /* (instances, outputs) */
  double *crossed;             /* (instances, most_transitions): times of the first transitions */
  double *states;              /* (instances, columns, samples); untouched beyond a run's end */
  double *results;             /* (instances, samples, outputs), likewise */
  int64_t done;
  int64_t base, made, next;    /* of the instance under way: the chunk's first row, transitions, samples */
  int32_t layout;              /* of its last arc, the first one's being 0 */
  int32_t *layouts;            /* (arc_room) */
  int64_t log_room, logged;    /* transitions of all instances, one instance's after the other's; no room: none */
  hs_transition *log;
  double *before, *after;      /* (log_room, width): states around a transition */
  int (*drain)(struct hs_ensemble *); /* takes the log where it is full, and makes it empty */
} hs_ensemble;

/* Run the instances one after the other; those from `done` on were not run to their end. */
HS_EXPORT void hs_run_ensemble(hs_ensemble *ensemble);

#endif
