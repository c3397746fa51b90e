/* The flow along steps of a recorded run: whether it may do there what they do not show. See
   hsdsl/simulate/verdict/flows.py. */

#include "screen_parts.h"

/* How far the enclosed flow and the derivatives of states lie beyond each other on a part, and how far these vary. */
static double flow_beyond(const hs_view *v, int level, int i, double width, double *varies) {
  const int d = v->degree;
  const double *const b = coefficients_at(v, level) + i * (d + 1);
  double below = INFINITY, above = -INFINITY;
  for (int k = 0; k < d; k++) below = hs_min(below, b[k + 1] - b[k]), above = hs_max(above, b[k + 1] - b[k]);
  below *= d / width, above *= d / width;
  const hs_range f = v->range[v->f->flow.result[i]];
  *varies = above - below;
  return hs_max(fabs(f.high - above), fabs(below - f.low));
}

/* Enclose the flow on a part of a step, without errors. */
static void enclose_flow(hs_view *v, int64_t row, int level, double start, double width) {
  set_part(v, row, level, start, width, 0.0);
  range_operations(v->f, v->f->flow.first, v->f->flow.last, first_register(v), v->range);
}

/* What is between two others. */
static double median(double a, double b, double c) { return hs_max(hs_min(a, b), hs_min(hs_max(a, b), c)); }

/* How much the terms of the flow change by along a step, as a short piece around a place of it shows. */
static void look_at_piece(hs_view *v, int64_t row, double share, double *change) {
  const hs_record *run = &v->s->run;
  const double *x = recorded_row(run, row), *c = recorded_piece(run, row);
  const double length = run->times[row + 1] - run->times[row], t = run->times[row] + share * length;
  v->range[0] = outwards(t - length * SHORT / 2, t + length * SHORT / 2, 0x1p-52);
  for (int i = 0; i < v->n; i++) {
    double at = 0.0, slope = 0.0;
    for (int k = v->degree - 1; k >= 0; k--) {
      slope = slope * share + (k + 1) * c[k * run->width + i];
      at = at * share + c[k * run->width + i];
    }
    const double middle = x[i] + at * share, wide = fabs(slope) * SHORT / 2;
    v->range[1 + i] = outwards(middle - wide, middle + wide, 0x1p-52);
  }
  range_operations(v->f, v->f->flow.first, v->f->flow.last, first_register(v), v->range);
  for (int i = 0; i < v->n; i++) {
    const hs_range f = v->range[v->f->flow.result[i]];
    change[i] = hs_finite(f.high - f.low) ? (f.high - f.low) / SHORT : 0.0;
  }
}

/* How much a step shows of the flow: an eighth of that is no pulse. What varies is the derivative of its polynomial, or
   terms of the flow at two places out of three; the flow is not known to vary more than its enclosure does. */
static void look_at_whole(hs_view *v, int64_t row) {
  double *const at[3] = {v->y, v->z, v->slope};
  for (int k = 0; k < 3; k++) look_at_piece(v, row, k / 2.0, at[k]);
  for (int i = 0; i < v->n; i++) v->cut[i] = 1;
  whole_step(v, row);
  enclose_flow(v, row, 0, 0.0, 1.0);
  for (int i = 0; i < v->n; i++) {
    const hs_range f = v->range[v->f->flow.result[i]];
    double varies;
    flow_beyond(v, 0, i, v->s->run.times[row + 1] - v->s->run.times[row], &varies);
    v->enough[i] = hs_min(hs_max(varies, median(at[0][i], at[1][i], at[2][i])), f.high - f.low) / RESOLVED;
    v->unseen[i] = 1;
  }
}

/* Whether the flow may be on a part what the polynomial does not show: halves are looked at until they tell. */
static int flow_open(hs_view *v, int64_t row, int level, double start, double width) {
  const int w = v->s->model->width;
  const double length = v->s->run.times[row + 1] - v->s->run.times[row];
  int *const before = v->unseen + level * w, *const open = before + w, any = 0;
  if (++v->looks > MOST_LOOKS) return 1;
  if (level) enclose_flow(v, row, level, start, width);
  for (int i = 0; i < v->n; i++) {
    double varies;
    const double beyond = flow_beyond(v, level, i, width * length, &varies);
    open[i] = before[i] && !(beyond <= v->enough[i] || beyond * length <= RESOLVED * hs_max(v->own[i], HS_NOTHING));
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

/* Expand the flow along a step: how far it may be from the slopes of the states there, and what these show. An eighth
   of that is no pulse. */
static void expand_flow(hs_view *v, int64_t row) {
  const double begin = v->s->run.times[row], half = (v->s->run.times[row + 1] - begin) / 2;
  v->around[0] = expansion(begin + half, half, 0.0, 0.0, 0.0, half);
  for (int i = 0; i < v->n; i++) v->around[1 + i] = expand_state(v, row, i, half, &v->slopes[i]);
  v->expanded = 1;
  expand_operations(v->f, v->f->flow.first, v->f->flow.last, first_register(v), v->around);
  for (int i = 0; i < v->n; i++) {
    const hs_expansion flow = v->around[v->f->flow.result[i]], slope = v->slopes[i];
    v->beyond[i] = size_of(expanded_sum(flow, negated(slope)));
    v->enough[i] = hs_max(flow.shown, fabs(slope.second)) / RESOLVED;
  }
}

/* Whether the expanded flow may be along a step what its polynomial does not show. */
static int expansion_hides(const hs_view *v, double length) {
  for (int i = 0; i < v->n; i++)
    if (!(v->beyond[i] <= v->enough[i] || v->beyond[i] * length <= v->own[i])) return 1;
  return 0;
}

/* Whether the flow has a bound along a step, and so have its slopes: no root is taken close to zero. */
static int all_known(const hs_view *v) {
  for (int i = 0; i < v->n; i++)
    if (!hs_finite(v->beyond[i])) return 0;
  return 1;
}

static int flow_hides(hs_view *v, int64_t row) {
  if (v->f->affine && !v->f->steep) return 0;
  const double length = v->s->run.times[row + 1] - v->s->run.times[row];
  expand_flow(v, row);
  if (v->f->steep && !all_known(v)) return 1;
  if (!expansion_hides(v, length)) return 0;
  look_at_whole(v, row);
  return expansion_hides(v, length) && flow_open(v, row, 0, 0.0, 1.0);
}
