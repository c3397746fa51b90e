/* A recorded run while it is screened: the mode of the current arc, its routines, and what is known so far. */

#ifndef HS_SCREEN_VIEW_H
#define HS_SCREEN_VIEW_H

#include "expansions.c"

#define BIT(at) (1 << (at))
#define SAFE 10             /* margins below so many errors are named */
#define TANGENT_UNITS 64
#define CUTTING 0x1p-48     /* of the largest coefficient: what cutting and changing the basis may add */
#define WIDER 8             /* a box so many times as wide: what jumps changes little more over it */
#define LEVELS 10           /* a step is cut in halves */
#define END_LEVELS 6        /* the part at its end, where a surface is crossed */
#define MOST_PARTS_TRIED 128 /* of one step */
#define COARSE_PARTS_TRIED 16 /* likewise, by expansions of the states */
#define PLACES 64           /* of a mode where the round-off of its flow is bounded */
#define ROUNDOFF_ROUNDS 3   /* from that round-off to what it moves, and what that moves in turn */
#define ROUNDS 48           /* of closing in on a turning point */
#define CLOSE_SHARE 0x1p-50 /* of a step, to which one is found */

typedef struct {
  double margin, start, middle;
  int64_t row, segment;
  int surface;
} hs_near_miss;

typedef struct {
  hs_screen *s;
  const hs_mode *table;
  const hs_formulas *f;
  const double *p;
  int64_t segment, arc, last, fine_row, fine_arc;
  int mode, n, crossed, traced_mode; /* whose data `traced` is bound to */
  int degree, filled; /* of the current step, without coefficients that are zero; and of the matrix */
  double *error, *size, *roundoff_floor, *time_errors; /* of all states; of each transition */
  double *lines; /* series of the shadow run */
  double *roundoff; /* what round-off of the flow may do in a step of the shadow run */
  double *defects, *derivatives, *factors, *inverse; /* of a correction; see screen_correction.c */
  int *exchanged;
  int64_t *tied; /* where the alternatives of each transition begin */
  double *mode_error; /* how wrong the states of the mode are */
  const hs_sparse *row; /* whose values `gradient` holds */
  double *x, *y, *z, *gradient, *slope, *values, *magnitudes, *at_start, *at_end;
  double *matrix, *bernstein;
  double *allowance; /* how far a step may still move states */
  double *miss_error; /* how wrong states were where each mode's nearest miss is */
  int *open;
  int *beyond_at_start; /* whether a step begins beyond each surface of an edge with an `if` */
  int *cut; /* whether a state is, where a step is cut in halves */
  int expanded, coarse; /* whether all states are expanded along the step, and whether parts are of expansions */
  hs_range *range;
  hs_rounded *rounded, *traced;
  hs_expansion *around, *slopes;
  double *drift;  /* how far parts of a step have moved states unseen */
  hs_near_miss *nearest; /* of each mode */
  hs_tail *tail; /* what waits in the shadow run */
  double *waits;
  int parts; /* of the step that were tried */
} hs_view;

typedef struct {
  double value, rate, roundoff, error;
} hs_near_surface;

/* Where the shadow run is at the start of a step of the run, and how far it is from there on: coefficients 1 to
   order + 1 in shares of the step, and by how much it has moved at the end besides. */
typedef struct {
  const hs_mode *table;
  const double *p;
  double *x, *y, *moved, *roundoff, *lines;
  double t, h;
  int64_t row; /* where the run's step begins */
  int order, begins; /* whether an arc begins there */
} hs_shadow;

/* The point at which transitions go, and the time within which other surfaces are reached together with it. */
typedef struct {
  int mode;
  double t;
  const double *x;
  double since;
} hs_tied;

static const double *recorded_piece(const hs_record *run, int64_t row) {
  return run->pieces + row * run->degree * run->width;
}
static const double *recorded_row(const hs_record *run, int64_t row) { return run->values + row * run->width; }

/* Make the step from a row the current one: some states, as those of a fall, need few powers. */
static void take_step(hs_view *v, int64_t row) {
  const double *const c = recorded_piece(&v->s->run, row);
  const int w = v->s->run.width;
  for (v->degree = v->s->run.degree; v->degree > 1; v->degree--)
    for (int i = 0; i < v->n; i++)
      if (c[(v->degree - 1) * w + i] != 0.0) return;
}

/* The polynomial of the step from a row at a share of it. */
static void along_step(const hs_view *v, const hs_record *run, int64_t row, double share, double *to) {
  const double *c = recorded_piece(run, row), *x = recorded_row(run, row);
  const int w = run->width;
  for (int i = 0; i < v->n; i++) {
    double y = c[(run->degree - 1) * w + i];
    for (int k = run->degree - 2; k >= 0; k--) y = c[k * w + i] + share * y;
    to[i] = x[i] + share * y;
  }
}

static int first_register(const hs_view *v) { return 1 + v->n + v->s->model->data + v->f->constants; }

/* Put data and constants into registers, and carry out what depends on them alone. */
static void bind_formulas(hs_view *v) {
  const int base = first_register(v), data = 1 + v->n, constants = data + v->s->model->data;
  for (int i = data; i < base; i++) {
    const hs_constant *const c = v->f->constant + (i - constants);
    const hs_range value = {i < constants ? v->p[i - data] : c->low, i < constants ? v->p[i - data] : c->high};
    v->range[i] = value;
    v->around[i] = constant_expansion((value.low + value.high) / 2);
  }
  range_operations(v->f, 0, v->f->fixed, base, v->range);
  bind_rounded(v->f, v->n, v->s->model->data, v->p, v->rounded, 0);
  expand_operations(v->f, 0, v->f->fixed, base, v->around);
}

static void bind(hs_view *v, int mode, int64_t segment) {
  if (v->mode == mode && v->segment == segment) return;
  v->mode = mode, v->segment = segment;
  v->table = &v->s->model->mode[mode];
  v->f = &v->s->formulas[mode];
  v->n = v->table->dimension;
  v->p = v->s->timeline->data + segment * v->s->model->data;
  bind_formulas(v);
}

static int64_t last_row(const hs_record *run, int64_t arc) {
  return arc + 1 < run->arcs ? run->arc[arc + 1].first - 1 : run->rows - 1;
}

static int takes_time(const hs_record *run, int64_t arc) {
  const int64_t last = last_row(run, arc);
  return run->arc[arc].first <= last && run->times[last] > run->times[run->arc[arc].first];
}

/* Times closer than this are not told apart; none is known better than the end of the run. */
static double tie_of(const hs_screen *s, double t) { return HS_TIE * hs_max(s->run.times[s->run.rows - 1], fabs(t)); }

/* How wrong the time is of what happens at a time. */
static double time_error_at(const hs_view *v, double t) {
  const hs_screen *s = v->s;
  const double tie = tie_of(s, 0.0);
  int64_t low = 0, high = s->run.transitions;
  while (low < high) {
    const int64_t middle = (low + high) / 2;
    if (s->run.transition[middle].time <= t + tie) low = middle + 1;
    else high = middle;
  }
  return low ? v->time_errors[low - 1] : tie;
}

static double resumed(const hs_transition *made) { return made->resumed == made->resumed ? made->resumed : made->time; }

/* Round-off of a surface at a point, of which the gradient is known. */
static double surface_roundoff(const hs_view *v, double magnitude, double t, const double *x) {
  for (int i = 0; i < v->row->count; i++)
    magnitude += fabs(v->gradient[i]) * fabs(v->row->place[i] ? x[v->row->place[i] - 1] : t);
  return ROUNDOFF_UNITS * HS_UNIT * magnitude;
}

/* Whether a shadow run shows the errors of the run. */
static int has_shadow(const hs_screen *s) { return s->order || s->correction; }

/* screen_errors.c */
static void grow(double *error, double by);
static double surface_error(const hs_view *v, double t);

/* screen_ties.c */
static int commute(hs_view *v, const hs_tied *tied, int one, int other);
static int is_alternative(const hs_view *v, int64_t j, int k);

/* screen_places.c */
static int near_surface(hs_view *v, int k, double t, const double *x, hs_near_surface *found);
static int evaluate_surfaces(hs_view *v, double t, const double *x);

#endif
