/* Whether transitions that are reached together commute. See hsdsl/engine/simulate/verdict/commutation.py. */

#include "screen_view.h"

#define SAME 0x1p-44 /* round-off, relative to the largest size that a state has in the run: one point */
#define LONGEST 64 /* transitions at one instant */

/* Where a transition leads, with those that follow at once. */
typedef struct {
  int mode, dimension;
  double *x;
} hs_landed;

/* Whether the `if` of an edge holds: 1, 0, or -1 where it has no value. */
static int condition_of(const hs_edge *edge, const double *p, double t, const double *x) {
  int answer = 1;
  for (int i = 0; i < edge->parts; i++) {
    double holds;
    if (edge->condition[i](p, t, x, &holds)) answer = -1;
    else if (holds == 0.0) return 0;
  }
  return answer;
}

static int is_first(const hs_mode *table, int k, int chosen) {
  return chosen < 0 || table->edge[k].priority > table->edge[chosen].priority;
}

/* The edge that goes at once from a state; -1 where none does, -2 where that is not known. */
static int goes_at_once(hs_view *v, const hs_mode *table, const double *p, double t, const double *x, double since) {
  int beyond = -1, standing = -1;
  if (table->values(p, t, x, v->values) || table->magnitudes(p, t, x, v->magnitudes)) return -2;
  for (int k = 0; k < table->edges; k++) {
    const hs_edge *const edge = &table->edge[k];
    double rate;
    v->row = &table->gradients[k];
    if (v->row->values(p, t, x, v->gradient) || table->rates[k](p, t, x, &rate)) return -2;
    const double r = v->values[k], near = hs_max(surface_roundoff(v, v->magnitudes[k], t, x), fabs(rate) * since);
    if (!hs_finite(near)) return -2;
    if (r > near && !edge->conditional && is_first(table, k, beyond)) beyond = k;
    if (!(fabs(r) <= near && rate > 0) || edge->releases >= 0) continue;
    const int holds = condition_of(edge, p, t, x);
    if (holds < 0) return -2;
    if (holds && is_first(table, k, standing)) standing = k;
  }
  return beyond >= 0 ? beyond : standing;
}

/* Whether others than the first of a queue take part in a reset from x to z: what waits then is not known here. */
static int needs_tail(const hs_mode *from, const hs_mode *to, const double *x, const double *z) {
  int needed = 0;
  for (int q = 0; from == to && q < to->queues; q++) {
    const double had = x[to->queue[q].waiting], has = z[to->queue[q].waiting];
    needed |= had != has && had >= 1 && has >= 1;
  }
  return needed;
}

/* Take edge k, then what goes at the same instant: 1, or 0 where that has no end or is not known. */
static int land_after(hs_view *v, const hs_tied *tied, int k, hs_landed *landed) {
  const hs_model *const model = v->s->model;
  const double *const p = v->s->timeline->data + segment_at(v->s->timeline, tied->t) * model->data;
  const hs_mode *table = &model->mode[tied->mode];
  copy(landed->x, tied->x, table->dimension);
  for (int i = 0; i < LONGEST; i++) {
    const hs_edge *const edge = &table->edge[k];
    if (hs_changed(edge, edge->reset, p, tied->t, landed->x, landed->x, v->x)) return 0;
    if (needs_tail(table, &model->mode[edge->target], landed->x, v->x)) return 0;
    copy(landed->x, v->x, edge->target_dimension);
    landed->mode = edge->target, landed->dimension = edge->target_dimension;
    table = &model->mode[edge->target];
    k = table->final ? -1 : goes_at_once(v, table, p, tied->t, landed->x, tied->since);
    if (k < 0) return k == -1;
  }
  return 0;
}

static int same_point(const hs_view *v, const hs_landed *one, const hs_landed *other) {
  const hs_mode *const table = &v->s->model->mode[one->mode];
  if (one->mode != other->mode || one->dimension != other->dimension) return 0;
  for (int i = 0; i < one->dimension; i++) {
    const double a = one->x[i], b = other->x[i], size = table->final ? 0.0 : v->size[table->state[i]];
    if (!(fabs(a - b) <= SAME * hs_max(hs_max(fabs(a), fabs(b)), size))) return 0;
  }
  return 1;
}

/* Whether each of two edges, taken first, leads to the same point. */
static int commute(hs_view *v, const hs_tied *tied, int one, int other) {
  hs_landed first = {0, 0, v->y}, second = {0, 0, v->z};
  hs_tied wider = *tied;
  wider.since = hs_max(tied->since, 2 * tie_of(v->s, tied->t)); /* what is tied may be that far apart */
  return land_after(v, &wider, one, &first) && land_after(v, &wider, other, &second) && same_point(v, &first, &second);
}

/* Whether an edge was tied with that of a transition. */
static int is_alternative(const hs_view *v, int64_t j, int k) {
  for (int64_t i = v->tied[j]; i < v->tied[j + 1]; i++)
    if (v->s->run.alternatives[i] == k) return 1;
  return 0;
}

/* Whether a transition and those tied with it lead to the same point in any order. */
static int ties_commute(hs_view *v, int64_t j) {
  const hs_transition *const made = &v->s->run.transition[j];
  const hs_edge *const edge = v->s->model->mode[made->mode].edge;
  const hs_tied tied = {made->mode, made->time, v->s->run.before + j * v->s->model->width, 0.0};
  for (int64_t i = v->tied[j]; i < v->tied[j + 1]; i++) {
    const int other = v->s->run.alternatives[i];
    if (edge[made->edge].priority > edge[other].priority || !commute(v, &tied, made->edge, other)) return 0;
  }
  return 1;
}
