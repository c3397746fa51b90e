/* A recorded run while it is screened: the mode of the current arc, its routines, and what is known so far.

   Parts of a recorded step: boxes that hold the states there, from expansions of its polynomial, or from its Bernstein
   coefficients, which are sharper and take longer. */

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
  double *defects, *derivatives, *factors, *inverse; /* of a correction; see screen_errors.c */
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
  expand_operations(v->f, 0, v->f->fixed, v->n, base, v->around);
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

static void set_box(hs_view *v, double low, double high, int i, double more) {
  const double wide = more + CUTTING * hs_max(fabs(low), fabs(high));
  v->range[1 + i] = range_sum(low - wide, high + wide);
}

static void set_times(hs_view *v, double begin, double length, double start, double width) {
  v->range[0] = range_sum(begin + start * length, begin + (start + width) * length);
}

/* Time and states of a row as ranges of one number each. */
static void set_row(hs_view *v, int64_t row) {
  const double *const x = recorded_row(&v->s->run, row);
  v->range[0].low = v->range[0].high = v->s->run.times[row];
  for (int i = 0; i < v->n; i++) v->range[1 + i].low = v->range[1 + i].high = x[i];
}

static double *coefficients_at(const hs_view *v, int level) {
  return v->bernstein + level * (int64_t)(v->s->run.degree + 1) * v->s->model->width;
}

/* From powers to Bernstein coefficients: C(k, l)/C(d, l). */
static void fill_matrix(hs_view *v) {
  const int d = v->filled = v->degree;
  for (int k = 0; k <= d; k++) {
    v->matrix[k * (d + 1)] = 1.0;
    for (int l = 1; l <= d; l++)
      v->matrix[k * (d + 1) + l] = v->matrix[k * (d + 1) + l - 1] * (k - l + 1) / (d - l + 1);
  }
}

/* Bernstein coefficients of the states along a whole step. */
static void whole_step(hs_view *v, int64_t row) {
  const double *x = recorded_row(&v->s->run, row), *c = recorded_piece(&v->s->run, row);
  const int d = v->degree, w = v->s->run.width;
  double *b = coefficients_at(v, 0);
  if (v->filled != d) fill_matrix(v);
  for (int i = 0; i < v->n; i++, b += d + 1)
    for (int k = 0; k <= d && v->cut[i]; k++) {
      b[k] = x[i];
      for (int l = 1; l <= k; l++) b[k] += v->matrix[k * (d + 1) + l] * c[(l - 1) * w + i];
    }
  v->parts = 0;
}

/* Those of the first half of a part, at the next level; those of the second half take its place. Then of that half. */
static void take_half(hs_view *v, int level, int second) {
  const int d = v->degree;
  double *whole = coefficients_at(v, level), *part = coefficients_at(v, level + 1);
  for (int i = 0; i < v->n; i++, whole += d + 1, part += d + 1) {
    if (!v->cut[i]) continue;
    if (second) {
      copy(part, whole, d + 1);
      continue;
    }
    for (int k = 0; k <= d; k++) { /* de Casteljau */
      part[k] = whole[0];
      for (int m = 0; m < d - k; m++) whole[m] = (whole[m] + whole[m + 1]) / 2;
    }
  }
}

/* The box that a part of a step lies in, states moved by so many errors. */
static void set_part(hs_view *v, int64_t row, int level, double start, double width, double errors) {
  const double *times = v->s->run.times, *b = coefficients_at(v, level);
  const int d = v->degree;
  set_times(v, times[row], times[row + 1] - times[row], start, width);
  for (int i = 0; i < v->n; i++, b += d + 1) {
    if (!v->cut[i]) continue;
    double low = b[0], high = b[0];
    for (int k = 1; k <= d; k++) low = hs_min(low, b[k]), high = hs_max(high, b[k]);
    set_box(v, low, high, i, errors * v->mode_error[i]);
  }
}

/* A part of a step around its middle m: half its width by m, 1/m, 1 by m times the step's length, and the powers of m
   and 2 to the step's degree. */
typedef struct {
  double by, less, per, power, further;
} hs_part;

static hs_part part_of(const hs_view *v, int64_t row, double start, double width) {
  const double *const times = v->s->run.times, middle = start + width / 2;
  const double less = 1 / middle, further = ldexp(1.0, v->degree);
  const double power = width < 1.0 ? pow(middle, v->degree) : 1 / further;
  const hs_part part = {width / 2 * less, less, less / (times[row + 1] - times[row]), power, further};
  return part;
}

/* A slope in the shares of a step, and what is left of it; and the state but for that at its start. */
typedef struct {
  double value, first, second, third, remainder, at;
} hs_sums;

/* Expand the slope of a state, and the state itself, around the middle of a part, of these sums. With u from -1 to 1
   along the part, v is u times `by`. */
static hs_expansion expansion_of_sums(const hs_view *v, int64_t row, int i, hs_part part, hs_sums of,
                                      hs_expansion *slope) {
  const double x = recorded_row(&v->s->run, row)[i], by = part.by, per = part.per, value = of.value, at = of.at;
  double first = of.first, second = of.second, third = of.third, remainder = of.remainder;
  first *= by, second *= by * by, third *= by * by * by, remainder *= by * by * by * by;
  remainder += (fabs(value) + fabs(first) + fabs(second) + fabs(third)) * EXPANSION_ROUNDOFF;
  *slope = expansion(value * per, first * per, second * per, third * per, remainder * per, 0.0, 0.0);
  remainder = (fabs(third) / 4 + remainder / 5) * by + fabs(x + at) * EXPANSION_ROUNDOFF;
  return expansion(x + at, value * by, first * by / 2, second * by / 3, remainder, 0.0, v->mode_error[i]);
}

/* Expand states 0 to n - 1, or state `only` if that is not negative. Sums are of powers of 1 + v: what is left of v**4
   and beyond is doubled with each. Two states are summed at once, the last one twice where it has no other. */
static void expand_states(hs_view *v, int64_t row, hs_part part, int only) {
  const hs_record *const run = &v->s->run;
  const int w = run->width, end = only < 0 ? v->n : only + 1;
  for (int i = only < 0 ? 0 : only; i < end; i += 2) {
    const int count = i + 1 < end ? 2 : 1;
    const double *c = recorded_piece(run, row) + (v->degree - 1) * w + i;
    double value[2] = {0.0}, first[2] = {0.0}, second[2] = {0.0}, third[2] = {0.0}, left[2] = {0.0}, at[2] = {0.0};
    double power = part.power, further = part.further;
    for (int k = v->degree; k > 0; k--, power *= part.less, c -= w) {
      const double of[2] = {c[0] * power, c[count - 1] * power}, times = k;
      further *= 0.5;
      HS_SIMD
      for (int j = 0; j < 2; j++) {
        left[j] += further * fabs(third[j]);
        third[j] += second[j];
        second[j] += first[j];
        first[j] += value[j];
        value[j] += times * of[j];
        at[j] += of[j];
      }
    }
    for (int j = 0; j < count; j++) {
      const hs_sums sums = {value[j], first[j], second[j], third[j], left[j], at[j]};
      v->around[1 + i + j] = expansion_of_sums(v, row, i + j, part, sums, &v->slopes[i + j]);
    }
  }
}

/* Expand the states that are cut. */
static void expand_cut(hs_view *v, int64_t row) {
  v->parts = 0;
  if (v->expanded) return;
  const hs_part whole = part_of(v, row, 0.0, 1.0);
  for (int i = 0; i < v->n; i++)
    if (v->cut[i]) expand_states(v, row, whole, i);
}

/* The box of the same, from expansions. */
static void set_expanded_part(hs_view *v, int64_t row, double start, double width, double errors) {
  const double *const times = v->s->run.times, m = 2 * start + width - 1;
  set_times(v, times[row], times[row + 1] - times[row], start, width);
  for (int i = 0; i < v->n; i++) {
    if (!v->cut[i]) continue;
    const hs_expansion a = v->around[1 + i];
    const double bend = (a.second + 3 * m * a.third) * (width * width) / 2;
    const double middle = a.value + m * (a.first + m * (a.second + m * a.third)) + bend;
    const double slope = a.first + m * (2 * a.second + 3 * m * a.third);
    const double wide = width * (fabs(slope) + width * width * fabs(a.third)) + fabs(bend) + a.remainder;
    set_box(v, middle - wide, middle + wide, i, errors * v->mode_error[i] + size_of(a) * EXPANSION_ROUNDOFF);
  }
}

/* The box of one half of a part. */
static void set_half(hs_view *v, int64_t row, int level, int half, double start, double width, double errors) {
  const double from = start + half * width / 2;
  v->parts++;
  if (v->coarse) {
    set_expanded_part(v, row, from, width / 2, errors);
    return;
  }
  take_half(v, level, half);
  set_part(v, row, level + 1, from, width / 2, errors);
}

#endif
