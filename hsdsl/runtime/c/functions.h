/* Constants, types and functions that the files of the runtime share, functions by the file that defines them. */

#ifndef HS_FUNCTIONS_H
#define HS_FUNCTIONS_H

#include <stddef.h>
#include <string.h>

#include "run.h"

enum { RAISED = -1 };
enum { GOES_ON = -1 }; /* instead of a reason to stop */
enum { LANDED = -2, AT_BOUNDARY = -3 }; /* how flow() ends, else GOES_ON or a reason to stop */
enum { WITHOUT_VALUE = -4 }; /* how first_event() ends, else GOES_ON, LANDED or a reason to stop */

#define MOST_HALVINGS 122 /* 16 - 2 log2(u) */
#define CREEPING 10
#define MOST_CREEPING 2000
#define ROUNDOFF_UNITS 32
#define ROUNDING 8

typedef int hs_functions(hs_run *run, double s, double *values);
typedef int hs_allowed(hs_run *run, int k, double *allowed);

/* Surface k at the share s of a step. */
typedef int hs_value(hs_run *run, const hs_polynomial *piece, int k, double s, double *r);

/* Where a surface rises above its level: the root before it, its slope there, by the share of the step. */
typedef struct {
  double share, slope;
  int certain;
} hs_rise;

/* A walk along surface k; `outside` says at first whether it begins beyond round-off, `risen` whether it ends there. */
typedef struct {
  int k, risen, outside, part;
  double level, at;
} hs_walk;

static const hs_found CLEAR = {HS_CLEAR, -1, 0}, NOT_FINITE = {HS_NOT_FINITE, -1, 0};
static const hs_found TOO_WRONG = {HS_ERROR, -1, 0}, UNSOLVED = {HS_UNSOLVED, -1, 0};

/* table.c */
HS_INLINE int table_step(hs_run *run, int n, double t, double h);
static void hermite(const hs_run *run, double h, hs_polynomial *piece);
static void secant(const hs_run *run, hs_polynomial *piece);
static int table_piece(hs_run *run, double t, double h, hs_polynomial *piece);
static void table_error(hs_run *run, double h);

/* taylor.c */
static int series_length(const hs_method *method);
static const double *series_of(const hs_run *run, int s);
static int taylor_step(hs_run *run, double t, double h);
HS_INLINE void taylor_piece(const hs_run *run, const int n, double h, hs_polynomial *piece);
HS_INLINE void taylor_error(hs_run *run, const int n, double h);

/* scales.c */
static double root(double x, int m);
static int resolved(hs_run *run, double t, double h, const double *x, const double *rows);

/* linear.c */
HS_INLINE int factored(int n, double *restrict a, int *restrict order, const double *scales);
HS_INLINE void solve(int n, const double *restrict a, const int *restrict order, const double *restrict right,
                     double *restrict found);
HS_INLINE int factored_complex(int n, double *restrict re, double *restrict im, int *restrict order,
                               const double *scales);
HS_INLINE void solve_complex(int n, const double *restrict re, const double *restrict im, const int *restrict order,
                             const double *const right[2], double *restrict a, double *restrict b);

/* radau.c */
HS_INLINE int iterate(hs_run *run, int n, double t, double h);
static void radau_forget(hs_radau *radau);
static void radau_scales(hs_run *run, double t, double h, int closer);
static int radau_step(hs_run *run, double t, double h);
static int radau_landing(hs_run *run, double t, double h);
static void radau_piece(const hs_run *run, hs_polynomial *piece);

/* newton.c */
HS_INLINE int to_tolerance(hs_run *run, int n, double t, double h);
HS_INLINE int to_roundoff(hs_run *run, int n, double t, double h);

/* stepper.c */
HS_INLINE int step(hs_run *run, int n, double t, double h);
HS_INLINE int part_of_step(hs_run *run, int n, double t, double h);
static int method_piece(hs_run *run, double t, double h, hs_polynomial *piece);
static void local_error(hs_run *run, double h);
static void forget_steps(hs_run *run);

/* control.c */
HS_INLINE double error_ratio(hs_run *run, double h);
static void begin_steps(hs_run *run);
static void accept(hs_control *control, double taken, double ratio);
static void reject(hs_control *control, double taken, double ratio);
static double end_of_step(double t, double *h, double limit);
static double within_reach(const hs_run *run, double h);
static void too_fast(hs_run *run, double tried);
static void slow_enough(hs_run *run, double taken);
static int struggles(const hs_control *control);

/* stall_detection.c */
static hs_step_failure stall_ends(hs_run *run, int halvings, hs_step_failure failure, int surface, double t1);

/* surfaces.c */
HS_INLINE void at_end(const hs_run *run, const int n, const hs_polynomial *piece, double *value);
static void at(const hs_run *run, const hs_polynomial *piece, double theta, double *value);
static void shortened(const hs_run *run, const hs_polynomial *piece, double theta, hs_polynomial *part);
static int surface(hs_run *run, int k, double t, const double *x, double *r);
static int roundoff_bound(hs_run *run, int k, double t, const double *x, int entry, double *noise);
static int enter_surfaces(hs_run *run, double t, double since, int jumped, double reset_at);
static int mark_inside(hs_run *run, double t, const double *x, int *inside);
static void leave(hs_run *run, double t, const double *x);
static int condition(hs_run *run, int k, double t, const double *x);
static int standing(hs_run *run, double t, const double *x, double since, int *found);
static int ends(hs_run *run, hs_trial *trial);
static int piece_of(hs_run *run, hs_trial *trial);
static hs_found excursion(hs_run *run, hs_trial *trial);
HS_INLINE int close_bracket(hs_run *run, hs_value *value, const hs_polynomial *piece, int k, double a, double fa,
                            double b, double fb, double small, double unit, double *theta);
static int judge(hs_run *run, const double *values, hs_found *found);

/* input_segments.c */
static int64_t segment_at(const hs_timeline *timeline, double t);
static const double *segment_data(const hs_run *run, int64_t segment);

/* recorder.c */
HS_INLINE void append(hs_run *run, double t, const double *x, const hs_polynomial *piece);
static void begin(hs_run *run, int kind);
static void strip(hs_run *run, int rows, double (*row)[2], const double *q);
static void record(hs_run *run, const hs_crossing *crossing, double resumed, const double *after, int entry);
static void note(hs_run *run, hs_notice kind, int surface, int64_t number, double time, double other);
static void doubt(hs_run *run, int k, double time);

/* run.c */
static hs_reason stopped(hs_run *run, hs_reason reason, double t);
static void place(hs_run *run, int mode, int dimension, double t, const hs_mode_state *before);
static int limit_reached(const hs_run *run);
static int goes_before(const hs_mode *mode, int a, int b);
static void choose(hs_run *run, int count);
static int reset(hs_run *run, double *scale);

/* entry.c */
static int same_state(const double *a, const double *b, int n);
static int enter(hs_run *run, int mode, int dimension, double t, int from_here, double since, int jumped,
                 double reset_at);

/* cascade.c */
static int returns(hs_run *run, int flowed);
static int takes_back(const double *slope, const double *back, const double *size, const double *noise, int n);
static int slides(hs_run *run, int mode, int k);

/* chatter.c */
HS_INLINE int chatters(hs_run *run, const int n, double t1);

/* relaxed.c */
static void sizes(hs_run *run, const double *x, const double *z);
static int standing_on(hs_run *run);
static int interrupted(hs_run *run);
static int in_strip(hs_run *run, hs_reason reason, double t);
static int go_on(hs_run *run);
static void relaxed(hs_run *run, int outcome);

/* root_isolation.c */
static void fill_binomials(double *row, int most);
static int stays_below(hs_run *run, const double *c, int n, double level);
HS_INLINE double value_of(const double *c, int n, double s);
HS_INLINE double value_at_end(const double *c, int n);
static int rises(hs_run *run, const double *c, int n, double sign, double level, double start, double *point);
static int last_root(hs_run *run, const double *c, int n, double start, double end, double *root);

/* surface_polynomials.c */
static double *coefficients_of(const hs_curves *curves, int part, int k);
static double *off_of(const hs_curves *curves, int part, int k);
static int *degree_of(const hs_curves *curves, int part, int k);
static hs_walk begin_walk(int k, double level, int beyond, int risen);
static double slope_of(const double *c, int n, double s);
static int next_rise(hs_run *run, hs_walk *walk, hs_rise *rise);
static int settles(hs_run *run, double off, double enough, hs_allowed *allowed, int k, int *answer);
static void begin_curves(hs_curves *curves, int count);
static int degree_without_zeros(const double *c, int degree);
static int interpolated(hs_run *run, hs_functions *functions, int count, const hs_interpolation *by,
                        hs_allowed *allowed, int far, int most, int may_refuse);
static int surfaces_along(hs_run *run, double s, double *values);
static int curves_along(hs_run *run);

/* dense_steps.c */
static int span_point(hs_run *run, double s, double *time, double **state);
static void span_cut(hs_run *run, double s, hs_polynomial *piece);
HS_INLINE double span_size(const hs_run *run, const hs_span *span, double s, int state);
static void begin_span(hs_run *run, double h, double t1);
HS_INLINE hs_step_failure next_span(hs_run *run, const int n, double limit);

/* sticking.c */
static int stays(hs_run *run, double t, const double *x, int k);
static int is_pushed(hs_run *run, double t, const double *x, int k);
static int moves_alone(hs_run *run, double t, const double *x, int k);
static int rests(hs_run *run);
static int release(hs_run *run, int k, double *until);
static hs_step_failure next_rest(hs_run *run, int n, double limit);

/* zeno.c */
static const hs_made *made_before(const hs_run *run, int back);
static int contraction(const hs_run *run, double *flight, double *ratio);
static int close_tail(hs_run *run, int k);

/* touching.c */
static int touched(hs_run *run, int k, hs_crossing *crossing);

/* located.c */
static void located(hs_run *run, int outcome);

#endif
