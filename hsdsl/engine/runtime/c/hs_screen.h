/* What a caller gives to have a recorded run screened for its verdict, and what it gets: see screen.c.

   A routine is given as operations on registers: time, the states, the data that routines are bound to, constants, then
   one register for each operation. Those that depend on data alone come first. */

#ifndef HS_SCREEN_H
#define HS_SCREEN_H

#include "hs_simulate.h"

typedef enum {
  HS_ADD,
  HS_SUB,
  HS_MUL,
  HS_DIV,
  HS_NEG,
  HS_SQUARE,
  HS_POWER, /* of a whole exponent: b */
  HS_ABS,
  HS_MIN,
  HS_MAX,
  HS_SQRT,
  HS_EXP,
  HS_LOG,
  HS_SIN,
  HS_COS,
  HS_TANH,
  HS_ATAN,
  HS_SIGN,
  HS_FLOOR,
  HS_ASIN, /* of these only round-off is followed */
  HS_ACOS,
  HS_SINH,
  HS_COSH,
  HS_ASINH,
  HS_ACOSH,
  HS_ATANH,
  HS_ATAN2,
  HS_POW,
  HS_BELOW, /* c where a is below b, else d */
  HS_UNKNOWN /* of which nothing is concluded */
} hs_operator;

typedef struct {
  int32_t kind, a, b, c, d; /* registers */
} hs_operation;

/* Its least and largest value, the nearest number to it, and what that leaves out. */
typedef struct {
  double low, high, value, error;
} hs_constant;

/* Operations from `first` up to `last`, and the registers of the results. */
typedef struct {
  int32_t first, last;
  const int32_t *result;
} hs_formula;

typedef struct {
  int32_t constants, fixed, operations; /* how many; the fixed ones come first */
  int32_t affine; /* whether the flow is a polynomial of degree 1 in time and states */
  int32_t steep;  /* whether the flow has functions whose slope has no bound */
  int32_t jumps;  /* whether it has some that jump */
  const hs_constant *constant;
  const hs_operation *operation;
  hs_formula flow, surfaces;
  const hs_formula *rate;  /* of each surface */
  const hs_formula *reset; /* of each edge */
  const int32_t *keeps;   /* (edge, states): whether a reset to the mode itself leaves a state as it is; else 0 */
  const int32_t *curved;  /* (edge): how many results its reset has, 0 where these are polynomials of time and states */
} hs_formulas;

/* What round-off moves a run by: formulas of its modes, and registers for them. See hsdsl/engine/simulate/moving.py. */
typedef struct {
  const hs_formulas *formulas;
  double *registers;
} hs_moves;

/* Coefficients of corrections: see hsdsl/engine/simulate/verdict/shadow.py. */
typedef struct {
  double node[4], weight[6][4], bulge[4], slope[4], inside, pole;
} hs_correction;

/* Hypotheses of the theorem that a screen may leave undecided, one bit each; HS_PARTED: all of them. */
typedef enum {
  HS_PARTED,
  HS_ACCUMULATION,
  HS_CROSSING,
  HS_CHOICE,
  HS_LANDING,
  HS_TURNING,
  HS_TRANSPARENT,
  HS_NEAREST,
  HS_ENDING,
  HS_FLOW_CHANGE
} hs_hypothesis;

/* What is undecided of a transition. */
enum { HS_CROSSING_UNDECIDED = 1, HS_RESET_UNDECIDED = 2 };

typedef struct {
  const hs_model *model;
  const hs_timeline *timeline;
  const hs_formulas *formulas; /* of each mode */
  hs_record run, finer;
  int32_t order;            /* the most of a shadow run's series; 0 where there is none */
  const hs_correction *correction; /* of a shadow run without series; 0 likewise */
  const double *start, *data;     /* of a shadow run: where it starts, and what its routines are bound to */
  double until, relaxation, tolerance;
  int64_t room;             /* numbers in the workspace, in which what is found begins: */
  double *workspace;
  int32_t *crossing;        /* (transition): HS_..._UNDECIDED */
  int32_t *landing, *ending; /* (arc), likewise */
  int32_t *turning, *changing; /* (row): of the step that begins there */
  double *shadow_errors;    /* (row, width): how far each is from the shadow run; 0 where there is none */
  double *time_errors;      /* (transition): how far times are from the finer or the shadow run's, up to each */
  double *tied_times;       /* when transitions are tied that commute, `commuting` times */
  int64_t commuting;
  int32_t marks;            /* those of `crossing` together */
  int32_t undecided;
  int64_t crossed;          /* transitions that the flow made; of these: */
  double slowest, least;    /* rate, and how often the error fits into what keeps a crossing */
  double margin, missed;    /* the nearest miss: how often the error fits, and when; infinite for none */
  int32_t missed_mode, missed_surface;
} hs_screen;

/* Screen a run, compared with a finer one if there is one: 0 where there is surely nothing to find, -1 where there may
   be. Where that takes more room than there is, nothing was done, and it is so many numbers. */
HS_EXPORT int64_t hs_screen_run(hs_screen *screen, const hs_record *run, const hs_record *finer);

#endif
