/* The flow along steps of a recorded run: whether it may do there what they do not show. See
   hsdsl/simulate/verdict/flows.py. */

#include "screen_parts.h"

/* How much the derivative of the step's polynomial changes along it, at least: from its start to its middle or end. */
static double shown_change(const hs_view *v, int64_t row, int i) {
  const double *c = recorded_piece(&v->s->run, row) + i;
  const int d = v->s->run.degree, w = v->s->run.width;
  double middle = 0.0, end = 0.0, power = 0.5;
  for (int k = 1; k < d; k++, power /= 2) {
    const double term = (k + 1) * c[k * w];
    end += term;
    middle += term * power;
  }
  return hs_max(fabs(end), fabs(middle));
}

/* How far the enclosed flow lies beyond the derivatives of the states on a part, and how far these vary there. */
static double flow_beyond(const hs_view *v, int level, int i, double width, double *varies) {
  const int d = v->s->run.degree;
  const double *const b = coefficients_at(v, level) + i * (d + 1);
  double below = INFINITY, above = -INFINITY;
  for (int k = 0; k < d; k++) below = hs_min(below, b[k + 1] - b[k]), above = hs_max(above, b[k + 1] - b[k]);
  below *= d / width, above *= d / width;
  const hs_range f = v->range[v->f->flow.result[i]];
  *varies = above - below;
  return hs_max(f.high - above, below - f.low);
}

/* Enclose the flow on a part of a step, without errors. */
static void enclose_flow(hs_view *v, int64_t row, int level, double start, double width) {
  set_part(v, row, level, start, width, 0.0);
  range_operations(v->f, v->f->flow.first, v->f->flow.last, first_register(v), v->range);
}

/* How much a step shows of each state's slope: an eighth of it, or of the enclosure's own width, is no pulse. */
static void look_at_whole(hs_view *v, int64_t row) {
  for (int i = 0; i < v->n; i++) v->cut[i] = 1;
  whole_step(v, row);
  enclose_flow(v, row, 0, 0.0, 1.0);
  for (int i = 0; i < v->n; i++) {
    double varies;
    const double beyond = flow_beyond(v, 0, i, v->s->run.times[row + 1] - v->s->run.times[row], &varies);
    v->enough[i] = hs_max(beyond, varies) / RESOLVED;
    v->unseen[i] = 1;
  }
}

/* Whether the flow may be on a part what the polynomial does not show: halves are looked at until they tell. */
static int flow_open(hs_view *v, int64_t row, int level, double start, double width) {
  const int w = v->s->model->width;
  const double length = width * (v->s->run.times[row + 1] - v->s->run.times[row]);
  int *const before = v->unseen + level * w, *const open = before + w, any = 0;
  if (++v->looks > MOST_LOOKS) return 1;
  if (level) enclose_flow(v, row, level, start, width);
  for (int i = 0; i < v->n; i++) {
    double varies;
    const double beyond = flow_beyond(v, level, i, length, &varies);
    open[i] = before[i] && !(beyond <= v->enough[i] || beyond * length <= v->own[i]);
    any |= open[i];
  }
  if (!any) return 0;
  if (level == LEVELS) return 1;
  for (int half = 0; half < 2; half++) {
    take_half(v, level, half);
    if (flow_open(v, row, level + 1, start + half * width / 2, width / 2)) return 1;
  }
  return 0;
}

/* Enclose the flow over discs that hold what the polynomial p of a step is where |s| <= size. */
static void enclose_in_discs(hs_view *v, int64_t row, double size) {
  const hs_screen *s = v->s;
  const double *x = recorded_row(&s->run, row), *c = recorded_piece(&s->run, row);
  const int d = s->run.degree, w = s->run.width;
  v->disc[0] = disc(s->run.times[row], size * (s->run.times[row + 1] - s->run.times[row]));
  for (int i = 0; i < v->n; i++) {
    double radius = 0.0, power = size;
    for (int k = 0; k < d; k++, power *= size) radius += fabs(c[k * w + i]) * power;
    v->disc[1 + i] = disc(x[i], radius);
  }
  disc_operations(v->f, v->f->flow.first, v->f->flow.last, first_register(v), v->disc);
}

/* Whether the flow may be along a step what its Taylor polynomial p does not show.

   F(s) = f(p(s)) is analytic where |s| < size; its coefficients are at most M/size**k there, M being how far f differs
   from its first value over discs that hold p(s), those last enclosed. The first d are those of the derivative of p. So
   along the step both differ by at most M size**(1 - d)/(size - 1). */
static int disc_hides(hs_view *v, int64_t row, double size) {
  const double length = v->s->run.times[row + 1] - v->s->run.times[row];
  const double less = 1 / size;
  double share = 1 / (size - 1);
  for (int k = 1; k < v->s->run.degree; k++) share *= less;
  for (int i = 0; i < v->n; i++) {
    const double hidden = v->disc[v->f->flow.result[i]].radius * share;
    if (!(hidden <= v->enough[i] || hidden * length <= v->own[i])) return 1;
  }
  return 0;
}

/* Whether the flow is known to be analytic on the discs that it was enclosed over. */
static int all_known(const hs_view *v) {
  for (int i = 0; i < v->n; i++)
    if (!hs_finite(v->disc[v->f->flow.result[i]].radius)) return 0;
  return 1;
}

/* Whether no slope of the flow is without a bound along a step: it is analytic around it. */
static int has_bound(hs_view *v, int64_t row) {
  enclose_in_discs(v, row, LEAST_SIZE);
  return all_known(v);
}

static int flow_hides(hs_view *v, int64_t row) {
  if (v->f->affine && !v->f->steep) return 0;
  const double length = v->s->run.times[row + 1] - v->s->run.times[row];
  const int by_discs = v->s->taylor && v->table->series;
  if (by_discs) { /* where these hide nothing the flow is analytic around the step, and its slopes have a bound */
    enclose_in_discs(v, row, LARGEST_SIZE);
    for (int i = 0; i < v->n; i++) v->enough[i] = shown_change(v, row, i) / (RESOLVED * length);
    if (!disc_hides(v, row, LARGEST_SIZE) && all_known(v)) return 0;
  }
  look_at_whole(v, row);
  if (by_discs && !disc_hides(v, row, LARGEST_SIZE) && all_known(v)) return 0;
  if (v->f->steep && !has_bound(v, row)) return 1;
  for (double size = 1.5; by_discs && size >= LEAST_SIZE; size -= 0.25) {
    enclose_in_discs(v, row, size);
    if (!disc_hides(v, row, size)) return 0;
  }
  return flow_open(v, row, 0, 0.0, 1.0);
}
