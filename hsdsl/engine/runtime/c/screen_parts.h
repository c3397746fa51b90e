/* Parts of a recorded step: boxes that hold the states there, from expansions of its polynomial, or from its Bernstein
   coefficients, which are sharper and take longer. */

#ifndef HS_SCREEN_PARTS_H
#define HS_SCREEN_PARTS_H

#include "screen_view.h"

static void set_box(hs_view *v, double low, double high, int i, double more) {
  const double wide = more + CUTTING * hs_max(fabs(low), fabs(high));
  v->range[1 + i] = outwards(low - wide, high + wide, 0x1p-52);
}

static void set_times(hs_view *v, double begin, double length, double start, double width) {
  v->range[0] = outwards(begin + start * length, begin + (start + width) * length, 0x1p-52);
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

/* Expand the slope of a state, and the state itself, around the middle of a part. Sums are of powers of 1 + v: what is
   left of v**4 and beyond is doubled with each. With u from -1 to 1 along the part, v is u times `by`. */
static hs_expansion expand_state(const hs_view *v, int64_t row, int i, hs_part part, hs_expansion *slope) {
  const hs_record *const run = &v->s->run;
  const double *const c = recorded_piece(run, row) + i, x = recorded_row(run, row)[i], by = part.by, per = part.per;
  double value = 0.0, first = 0.0, second = 0.0, third = 0.0, remainder = 0.0, at = 0.0;
  double power = part.power, further = part.further;
  for (int k = v->degree; k > 0; k--, power *= part.less) {
    const double term = c[(k - 1) * run->width] * power;
    remainder += (further *= 0.5) * fabs(third);
    third += second, second += first, first += value, value += k * term;
    at += term;
  }
  first *= by, second *= by * by, third *= by * by * by, remainder *= by * by * by * by;
  remainder += (fabs(value) + fabs(first) + fabs(second) + fabs(third)) * EXPANSION_ROUNDOFF;
  *slope = expansion(value * per, first * per, second * per, third * per, remainder * per, 0.0, 0.0);
  remainder = (fabs(third) / 4 + remainder / 5) * by + fabs(x + at) * EXPANSION_ROUNDOFF;
  return expansion(x + at, value * by, first * by / 2, second * by / 3, remainder, 0.0, v->mode_error[i]);
}

/* Expand the states that are cut. */
static void expand_cut(hs_view *v, int64_t row) {
  v->parts = 0;
  if (v->expanded) return;
  const hs_part whole = part_of(v, row, 0.0, 1.0);
  for (int i = 0; i < v->n; i++)
    if (v->cut[i]) v->around[1 + i] = expand_state(v, row, i, whole, &v->slopes[i]);
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
