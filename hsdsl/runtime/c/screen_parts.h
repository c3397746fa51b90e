/* Parts of a recorded step: boxes that hold the states there, from the Bernstein coefficients of its polynomial. */

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

static double *coefficients_at(const hs_view *v, int level) {
  return v->bernstein + level * (int64_t)(v->s->run.degree + 1) * v->s->model->width;
}

/* Bernstein coefficients of the states along a whole step. */
static void whole_step(hs_view *v, int64_t row) {
  const double *x = recorded_row(&v->s->run, row), *c = recorded_piece(&v->s->run, row);
  const int d = v->s->run.degree, w = v->s->run.width;
  double *b = coefficients_at(v, 0);
  for (int i = 0; i < v->n; i++, b += d + 1)
    for (int k = 0; k <= d && v->cut[i]; k++) {
      b[k] = x[i];
      for (int l = 1; l <= k; l++) b[k] += v->matrix[k * (d + 1) + l] * c[(l - 1) * w + i];
    }
  v->looks = 0;
}

/* Those of the first half of a part, at the next level; those of the second half take its place. Then of that half. */
static void take_half(hs_view *v, int level, int second) {
  const int d = v->s->run.degree;
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
  const int d = v->s->run.degree;
  set_times(v, times[row], times[row + 1] - times[row], start, width);
  for (int i = 0; i < v->n; i++, b += d + 1) {
    if (!v->cut[i]) continue;
    double low = b[0], high = b[0];
    for (int k = 1; k <= d; k++) low = hs_min(low, b[k]), high = hs_max(high, b[k]);
    set_box(v, low, high, i, errors * v->own[i]);
  }
}

#endif
