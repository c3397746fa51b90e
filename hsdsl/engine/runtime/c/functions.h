/* Constants, types and functions that the files of the runtime share, functions by the file that defines them. */

#ifndef HS_FUNCTIONS_H
#define HS_FUNCTIONS_H

#include <stddef.h>
#include <string.h>

#include "run.h"

enum { RAISED = -1 };
enum { GOES_ON = -1 }; /* instead of a reason to stop */
enum { PAUSED = -5 }; /* instead of a reason to stop, of a run that goes on later */
enum { LANDED = -2, AT_BOUNDARY = -3 }; /* how flow() ends, else GOES_ON or a reason to stop */
enum { WITHOUT_VALUE = -4 }; /* how first_event() ends, else GOES_ON, LANDED or a reason to stop */

#define MOST_HALVINGS (16 + 2 * HS_BITS)
#define CREEPING 10
#define MOST_CREEPING 2000
#define ROUNDOFF_UNITS 32
#define ROUNDING 8

typedef int hs_functions(hs_run *run, hs_real s, hs_real *values);
typedef int hs_allowed(hs_run *run, int k, hs_real *allowed);

/* Surface k at the share s of a step. */
typedef int hs_value(hs_run *run, const hs_polynomial *piece, int k, hs_real s, hs_real *r);

/* Where a surface rises above its level: the root before it, its slope there, by the share of the step. */
typedef struct {
  hs_real share, slope;
  int certain;
} hs_rise;

/* A walk along surface k; `outside` says at first whether it begins beyond round-off, `risen` whether it ends there. */
typedef struct {
  int k, risen, outside, part;
  hs_real level, at;
} hs_walk;

static const hs_found CLEAR = {HS_CLEAR, -1, 0}, NOT_FINITE = {HS_NOT_FINITE, -1, 0};
static const hs_found TOO_WRONG = {HS_ERROR, -1, 0}, UNSOLVED = {HS_UNSOLVED, -1, 0};

/* table.c */
HS_INLINE int table_step(hs_run *run, int n, hs_time t, hs_real h);
static void hermite(const hs_run *run, hs_real h, hs_polynomial *piece);
static void secant(const hs_run *run, hs_polynomial *piece);
static int table_piece(hs_run *run, hs_time t, hs_real h, hs_polynomial *piece);
static void table_error(hs_run *run, hs_real h);

/* taylor.c */
static int series_length(const hs_method *method);
static const hs_real *series_of(const hs_run *run, int s);
static int taylor_step(hs_run *run, hs_time t, hs_real h);
HS_INLINE void taylor_piece(const hs_run *run, const int n, hs_real h, hs_polynomial *piece);
HS_INLINE void taylor_error(hs_run *run, const int n, hs_real h);
HS_INLINE void taylor_span(hs_run *run, const int n, hs_real h, hs_polynomial *piece);
HS_INLINE void left_of(hs_run *run, const int n, hs_real h);

/* scales.c */
static hs_real root(hs_real x, int m);
static int resolved(hs_run *run, hs_time t, hs_real h, const hs_real *x, const hs_real *rows);

/* linear.c */
HS_INLINE int factored(int n, hs_real *restrict a, int *restrict order, const hs_real *scales, const int *groups);
HS_INLINE void solve(int n, const hs_real *restrict a, const int *restrict order, const hs_real *restrict right,
                     hs_real *restrict found);
HS_INLINE int factored_complex(int n, hs_real *restrict re, hs_real *restrict im, int *restrict order,
                               const hs_real *scales, const int *groups);
HS_INLINE void solve_complex(int n, const hs_real *restrict re, const hs_real *restrict im, const int *restrict order,
                             const hs_real *const right[2], hs_real *restrict a, hs_real *restrict b);

/* sparse.c */
static int sparse_factored(int n, const hs_elimination *of, hs_real *restrict a, hs_real *restrict row);
static void sparse_solve(int n, const hs_elimination *of, const hs_real *restrict values, const hs_real *restrict right,
                         hs_real *restrict y, hs_real *restrict found);
static int sparse_factored_complex(int n, const hs_elimination *of, hs_real *restrict re, hs_real *restrict im,
                                   hs_real *restrict c, hs_real *restrict d);
static void sparse_solve_complex(int n, const hs_elimination *of, const hs_real *restrict re, const hs_real *restrict im,
                                 const hs_real *const right[2], hs_real *restrict a, hs_real *restrict b,
                                 hs_real *restrict one, hs_real *restrict two);

/* blocks.c */
HS_INLINE hs_blocks blocks_of(const hs_mode *mode);
HS_INLINE void solve_own(hs_radau *radau, int own, const hs_elimination *of, const hs_real *right, hs_real *found);
HS_INLINE void solve_columns(hs_run *run, hs_blocks blocks, hs_real *right, hs_real *found);
HS_INLINE void solve_all(hs_run *run, hs_blocks blocks, hs_real *right, hs_real *found);
HS_INLINE void solve_all_complex(hs_run *run, hs_blocks blocks, hs_real *const *right, hs_real *a, hs_real *b);
static void link_columns(hs_run *run, const hs_variation *v, hs_real h);

/* newton.c, and what it calls of the implicit method */
HS_INLINE int iterate(hs_run *run, hs_blocks of, hs_time t, hs_real h);
HS_INLINE int to_tolerance(hs_run *run, hs_blocks of, hs_time t, hs_real h);
HS_INLINE int to_roundoff(hs_run *run, hs_blocks of, hs_time t, hs_real h);

/* stepper.c */
HS_INLINE int step(hs_run *run, int n, hs_time t, hs_real h);
HS_INLINE int part_of_step(hs_run *run, int n, hs_time t, hs_real h);
static int method_piece(hs_run *run, hs_time t, hs_real h, hs_polynomial *piece);
static void local_error(hs_run *run, hs_real h);
static const hs_real *error_scales(const hs_run *run);
static const hs_real *closer_scales(hs_run *run, hs_real h);
static int is_implicit(const hs_method *method);
static void lay_out_method(hs_run *run, hs_store *store);
static void forget_steps(hs_run *run);

/* control.c */
HS_INLINE hs_real error_ratio(hs_run *run, hs_real h);
static void begin_steps(hs_run *run);
static void accept(hs_control *control, hs_real taken, hs_real ratio);
static void reject(hs_control *control, hs_real taken, hs_real ratio);
static hs_time end_of_step(hs_time t, hs_real *h, hs_time limit);
static hs_real within_reach(const hs_run *run, hs_real h);
static void too_fast(hs_run *run, hs_real tried);
static void slow_enough(hs_run *run, hs_real taken);
static int struggles(const hs_control *control);

/* stall_detection.c */
static hs_step_failure stall_ends(hs_run *run, int halvings, hs_step_failure failure, int surface, hs_time t1);
static void begin_pace(hs_run *run);
static int is_slow(hs_run *run);

/* hs.c */
static void *take(hs_store *store, int64_t count, size_t size);
static hs_real *numbers(hs_store *store, int64_t count);

/* surfaces.c */
HS_INLINE hs_real joined(hs_real scale, hs_real size);
static void at(const hs_run *run, const hs_polynomial *piece, hs_real theta, hs_real *value);
static void shortened(const hs_run *run, const hs_polynomial *piece, hs_real theta, hs_polynomial *part);
static int surface(hs_run *run, int k, hs_time t, const hs_real *x, hs_real *r);
static int gradient_of(hs_run *run, int k, hs_time t, const hs_real *x);
static int magnitudes_at(hs_run *run, hs_time t, const hs_real *x, hs_real *magnitudes);
static hs_real bound_from(hs_run *run, const hs_real *magnitudes, int k, hs_time t, const hs_real *x, int entry);
static int roundoff_bound(hs_run *run, int k, hs_time t, const hs_real *x, int entry, hs_real *noise);
static int enter_surfaces(hs_run *run, hs_time t, hs_real since, int jumped, hs_time reset_at);
static int mark_inside(hs_run *run, hs_time t, const hs_real *x, int *inside);
static void leave(hs_run *run, hs_time t, const hs_real *x);
static int condition(hs_run *run, int k, hs_time t, const hs_real *x);
static int standing(hs_run *run, hs_time t, const hs_real *x, hs_real since, int *found);
static int ends(hs_run *run, hs_trial *trial);
static int piece_of(hs_run *run, hs_trial *trial);
static hs_found excursion(hs_run *run, hs_trial *trial, hs_found found);
HS_INLINE int close_bracket(hs_run *run, hs_value *value, const hs_polynomial *piece, int k, hs_real a, hs_real fa,
                            hs_real b, hs_real fb, hs_real small, hs_real unit, hs_real *theta);
static int judge(hs_run *run, const hs_real *values, hs_found *found);

/* input_segments.c */
static int64_t segment_at(const hs_timeline *timeline, hs_time t);
static hs_time segment_end(const hs_run *run);
static int segment_follows(const hs_run *run);
static const hs_real *segment_data(const hs_run *run, int64_t segment);

/* recorder.c */
HS_INLINE void append(hs_run *run, hs_time t, const hs_real *x, const hs_polynomial *piece);
static void begin(hs_run *run, int kind);
static void strip(hs_run *run, int rows, hs_time (*row)[2], const hs_real *q);
static void record(hs_run *run, const hs_crossing *crossing, hs_time resumed, const hs_real *after, int entry);
static void note(hs_run *run, hs_notice kind, int surface, int64_t number, hs_time time, hs_time other);
static void note_unsettled(hs_run *run, int k, hs_time time);

/* hs.c */
static hs_run open_run(hs_task *task);

/* run.c */
static hs_reason stopped(hs_run *run, hs_reason reason, hs_time t);
static void place(hs_run *run, int mode, int dimension, hs_time t, const hs_mode_state *before);
static int limit_reached(const hs_run *run);
static int goes_before(const hs_mode *mode, int a, int b);
static void choose(hs_run *run, int count);
static int reset(hs_run *run, const hs_real *scale);

/* entry.c */
static const hs_real *decisive(hs_run *run);
static int same_state(const hs_real *a, const hs_real *b, int n);
static int enter(hs_run *run, int mode, int dimension, hs_time t, int from_here, hs_real since, int jumped,
                 hs_time reset_at);

/* cascade.c */
static int has_flowed(const hs_run *run, hs_time t);
static int returns(hs_run *run, int flowed);
static int takes_back(const hs_real *slope, const hs_real *back, int n);
static int slides(hs_run *run, int mode, int k);

/* chatter.c */
HS_INLINE int chatters(hs_run *run, const int n, hs_time t1);

/* relaxed.c */
static void sizes(hs_run *run, const hs_real *x, const hs_real *z, int stays);
static int standing_on(hs_run *run);
static int interrupted(hs_run *run);
static int in_strip(hs_run *run, hs_reason reason, hs_time t);
static int go_on(hs_run *run);
static int continued(hs_run *run, int jumped);
static int pauses(const hs_run *run);
static int relaxed(hs_run *run, int outcome);

/* root_isolation.c */
static void fill_binomials(hs_real *row, int most);
static int stays_below(hs_run *run, const hs_real *c, int n, hs_real level);
HS_INLINE hs_real value_of(const hs_real *c, int n, hs_real s);
HS_INLINE hs_real value_at_end(const hs_real *c, int n);
static int rises(hs_run *run, const hs_real *c, int n, hs_real sign, hs_real level, hs_real start, hs_real *point);
static int last_root(hs_run *run, const hs_real *c, int n, int reduced, hs_real start, hs_real end, hs_real *root);

/* surface_polynomials.c */
static hs_real *coefficients_of(const hs_curves *curves, int part, int k);
static hs_real *off_of(const hs_curves *curves, int part, int k);
static int *degree_of(const hs_curves *curves, int part, int k);
static hs_walk begin_walk(int k, hs_real level, int beyond, int risen);
static hs_real slope_of(const hs_real *c, int n, hs_real s);
static hs_real slope_at_end(const hs_real *c, int n);
static int next_rise(hs_run *run, hs_walk *walk, hs_rise *rise);
static int settles(hs_run *run, hs_real off, hs_real enough, hs_allowed *allowed, int k, int *answer);
static void begin_curves(hs_curves *curves, int count);
static int degree_without_zeros(const hs_real *c, int degree);
static int interpolated(hs_run *run, hs_functions *functions, int count, const hs_interpolation *by,
                        hs_allowed *allowed, int far, int most, int may_refuse);
static int surfaces_along(hs_run *run, hs_real s, hs_real *values);
static int curves_along(hs_run *run);

/* dense_steps.c */
static int span_point(hs_run *run, hs_real s, hs_time *time, hs_real **state);
HS_INLINE void part_at(const hs_run *run, const hs_polynomial *piece, hs_real theta, int from, int to, hs_real *value);
static void span_cut(hs_run *run, hs_real s, hs_polynomial *piece);
static int span_place(hs_run *run, hs_real s, hs_time *time, hs_real **state);
static void span_rest(hs_run *run, hs_real s, hs_real *state);
HS_INLINE hs_real span_size(const hs_run *run, const hs_span *span, hs_real s, int state);
static void begin_span(hs_run *run, hs_real h, hs_time t1);
HS_INLINE hs_step_failure next_span(hs_run *run, const int n, hs_time limit);

/* contact.c */
static int flow_sizes(hs_run *run, hs_time t, const hs_real *x, const hs_real *slope);
static hs_real state_size(const hs_run *run, int s);
static int is_push(const hs_run *run, int j);
static void start_sizes(hs_run *run, int mode, hs_time t);
static int reset_but_counts(hs_run *run, int k, hs_time t, const hs_real *x, hs_real *out);
static int keeps(hs_run *run, hs_time t, const hs_real *x, int k);
static int keeping(hs_run *run, hs_time t, const hs_real *x, int *marks);
static int is_possible(hs_run *run, int k, hs_time t, const hs_real *x, const int *touched);
static int holds_next(hs_run *run, int k, hs_time t, const hs_real *x);
static void bind_contacts(hs_run *run, const int *held, const int *kept);
static void bind_mode(hs_run *run);
static int pushes(hs_run *run, hs_time t, const hs_real *x, const int *held, const int *kept, int *pushed);
static int pressing(hs_run *run, hs_time t, const hs_real *x, const int *kept, int count, int *held, int *pushed);
static int contact_at(hs_run *run);
static int releases(const hs_run *run, int j);
static int in_touch(const hs_run *run, int k);
static void after_contact(hs_run *run);
static int behind_end(hs_run *run, int j, hs_time *t);

/* zeno.c */
static const hs_made *made_before(const hs_run *run, int back);
static int contraction(const hs_run *run, hs_real *flight, hs_real *ratio);
static hs_time flown(const hs_run *run, hs_time t);
static int of_contacts(hs_run *run);
static void be_held_exactly(hs_run *run, hs_time t, hs_real *x, int reached);
static int close_tail(hs_run *run, int k);
static int unresolved(hs_run *run, int k);

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

/* touching.c */
static int touched(hs_run *run, int k, hs_crossing *crossing);

/* located.c */
static int located(hs_run *run, int outcome);

#endif
