/* Where a recorded run crosses surfaces, where its arcs begin and end, and whether simultaneous transitions commute. See
   hsdsl/engine/simulate/verdict: crossings, resets, misses, commutation. */

#include "screen_errors.c"

/* The point at which transitions go, and the time within which other surfaces are reached together with it. */
typedef struct {
  int mode;
  double t;
  const double *x;
  double since;
} hs_tied;

typedef struct {
  double value, rate, roundoff, error;
} hs_near_surface;

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
    if (hs_call(&edge->condition[i], p, t, x, &holds)) answer = -1;
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
    if (hs_call(&v->row->values, p, t, x, v->gradient) || hs_call(&table->rates[k], p, t, x, &rate)) return -2;
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
    if (hs_changed(edge, &edge->reset, p, tied->t, landed->x, landed->x, v->x)) return 0;
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

/* Whether each of two edges, taken first, leads to the same point: the question of
   hsdsl/mathematics/decisions/commutation.py. */
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

/* Surface k at a point, of which `values` and `magnitudes` are known; not 0 where something has no value. */
static int near_surface(hs_view *v, int k, double t, const double *x, hs_near_surface *found) {
  const hs_sparse *const row = v->row = &v->table->gradients[k];
  if (hs_call(&row->values, v->p, t, x, v->gradient)) return 1;
  if (hs_call(&v->table->rates[k], v->p, t, x, &found->rate)) return 1;
  found->value = v->values[k];
  found->roundoff = surface_roundoff(v, v->magnitudes[k], t, x);
  found->error = surface_error(v, t);
  return !hs_finite(found->value + found->roundoff + found->error + found->rate);
}

static int evaluate_surfaces(hs_view *v, double t, const double *x) {
  return v->table->values(v->p, t, x, v->values) || v->table->magnitudes(v->p, t, x, v->magnitudes);
}

/* Below this the rate of a surface counts as zero; its gradient is the one last judged. */
static double rate_roundoff(const hs_view *v) {
  double total = 0.0;
  for (int i = 0; i < v->row->count; i++)
    total += fabs(v->gradient[i] * (v->row->place[i] ? v->slope[v->row->place[i] - 1] : 1.0));
  return TANGENT_UNITS * HS_UNIT * total;
}

/* Whether the reset of edge k leaves its own surface as it is. */
static int untouched(const hs_view *v, int k) {
  const int32_t *const keeps = v->f->keeps + (int64_t)k * v->n;
  for (int i = 0; i < v->row->count; i++)
    if (v->gradient[i] != 0.0 && v->row->place[i] && !keeps[v->row->place[i] - 1]) return 0;
  return v->table->affine;
}

/* Whether a transition follows one at the same instant that others were tied with. */
static int follows_choice(const hs_view *v, int64_t j) {
  const hs_transition *const made = v->s->run.transition + j;
  const double tie = tie_of(v->s, made->time);
  for (int64_t k = 1; k <= j && made->time - made[-k].resumed <= tie; k++)
    if (made[-k].alternatives) return 1;
  return 0;
}

/* Whether an arc begins on, or within the error of, a surface. */
static int lands_close(hs_view *v) {
  const hs_record *run = &v->s->run;
  const hs_arc *arc = &run->arc[v->arc];
  const double t = run->times[arc->first], *x = recorded_row(run, arc->first);
  if (arc->jump && follows_choice(v, arc->jump - 1)) return 0; /* its choice decides */
  if (evaluate_surfaces(v, t, x) || v->table->flow(v->p, t, x, v->slope)) return 1;
  for (int k = 0; k < v->table->surfaces; k++) {
    hs_near_surface found;
    if (near_surface(v, k, t, x, &found)) return 1;
    if (arc->first == 0 && fabs(found.value) <= found.roundoff) return 1;
    if (arc->jump == 0 || fabs(found.value) > SAFE * found.error + found.roundoff) continue;
    const int conditional = k < v->table->edges && v->table->edge[k].conditional;
    if (found.rate > rate_roundoff(v) && !conditional) continue;
    const hs_transition *made = &run->transition[arc->jump - 1];
    if (made->mode != v->mode || made->edge != k || !untouched(v, k)) return 1;
  }
  return 0;
}

/* The edge whose transition ends the arc, or -1: else it ends where an input jumps, or with the run. */
static int crossed_at_end(const hs_view *v) {
  const hs_record *run = &v->s->run;
  const int64_t jump = run->arc[v->arc].jump;
  if (jump >= run->transitions) return -1;
  const hs_transition *made = &run->transition[jump];
  return made->time > run->times[v->last] + tie_of(v->s, made->time) ? -1 : made->edge;
}

/* Whether other surfaces are about to be reached where the arc ends, at a crossing, or at a jump or kink of an input. */
static int ends_close(hs_view *v, int all) {
  const hs_screen *s = v->s;
  const double t = s->run.times[v->last], *x = recorded_row(&s->run, v->last);
  const int64_t step = v->segment, there = segment_at(s->timeline, t);
  if (v->crossed < 0 && !all && t >= s->until && there == step) return 0;
  if (v->crossed >= 0 || all) bind(v, v->mode, there);
  int close = evaluate_surfaces(v, t, x);
  for (int k = 0; k < v->table->surfaces && !close; k++) {
    hs_near_surface found;
    if (k == v->crossed || (v->crossed >= 0 && is_alternative(v, s->run.arc[v->arc].jump, k))) continue;
    close = near_surface(v, k, t, x, &found) ||
            (found.rate > 0 && (all || found.value <= found.roundoff) && fabs(found.value) <= SAFE * found.error);
    if (close && v->crossed >= 0 && k < v->table->edges && found.value <= found.roundoff) {
      const hs_tied tied = {v->mode, t, x, 2 * -found.value / found.rate};
      close = !commute(v, &tied, v->crossed, k) || evaluate_surfaces(v, t, x);
    }
  }
  bind(v, v->mode, step);
  return close;
}

/* Whether a reset may jump within the error of a transition: over a wider box it changes little more. */
static int reset_jumps(hs_view *v, const hs_transition *made, const double *x) {
  const hs_formula *const reset = &v->f->reset[made->edge];
  const double late = SAFE * time_error_at(v, made->time);
  const int w = v->s->model->width, results = v->f->curved[made->edge] < w ? v->f->curved[made->edge] : w;
  double *const narrow = v->y;
  for (int times = 1; times <= WIDER && results; times += WIDER - 1) {
    v->range[0] = range_sum(made->time - times * late, made->time + times * late);
    for (int i = 0; i < v->n; i++) {
      const double wide = times * SAFE * v->mode_error[i];
      v->range[1 + i] = range_sum(x[i] - wide, x[i] + wide);
    }
    range_operations(v->f, reset->first, reset->last, first_register(v), v->range);
    for (int i = 0; i < results; i++) {
      const hs_range value = v->range[reset->result[i]];
      const double width = value.high - value.low, size = fabs(value.high + value.low) / 2;
      if (!hs_finite(width) || (times > 1 && !(width >= narrow[i] * WIDER / 2))) return 1;
      narrow[i] = width > hs_max(ERROR_UNITS * HS_UNIT * size, HS_NOTHING) ? width : 0.0;
    }
  }
  return 0;
}

/* Hold what one result in three is off the line between the others against its error: whether it is beyond that. */
static int off_line(const hs_view *v, int mode, const double *here, const double *one, const double *other) {
  const hs_mode *const table = &v->s->model->mode[mode];
  const double least = hs_max(v->s->tolerance, ERROR_UNITS * HS_UNIT);
  for (int i = 0; i < table->dimension; i++) {
    const int state = table->state[i];
    const double bent = fabs((one[i] - here[i]) + (other[i] - here[i])) / SAFE;
    if (!(bent <= hs_max(v->error[state], least * hs_max(v->size[state], fabs(here[i]))))) return 1;
  }
  return 0;
}

/* Whether a reset may have a kink within the error of a transition, which the difference of two runs does not show. */
static int reset_bends(hs_view *v, const hs_transition *made, const double *x) {
  const hs_edge *const edge = &v->table->edge[made->edge];
  if (!v->f->curved[made->edge] || v->s->model->mode[edge->target].final) return 0;
  if (hs_changed(edge, &edge->reset, v->p, made->time, x, x, v->y)) return 1;
  for (int i = -1; i < v->n; i++) {
    const double wide = SAFE * (i < 0 ? time_error_at(v, made->time) : v->mode_error[i]);
    double *const ends[] = {v->z, v->slope};
    if (wide == 0.0) continue;
    for (int side = 0; side < 2; side++) {
      const double by = side ? wide : -wide;
      copy(v->x, x, v->n);
      if (i >= 0) v->x[i] = x[i] + by;
      if (hs_changed(edge, &edge->reset, v->p, i < 0 ? made->time + by : made->time, v->x, v->x, ends[side])) return 1;
    }
    if (off_line(v, edge->target, v->y, v->z, v->slope)) return 1;
  }
  return 0;
}

/* Whether an input may jump within the error of a transition. */
static int jumps_close(const hs_view *v, const hs_transition *made) {
  const hs_timeline *const timeline = v->s->timeline;
  const double late = SAFE * time_error_at(v, made->time);
  const int64_t here = segment_at(timeline, made->time);
  if (timeline->jump[here] && fabs(timeline->start[here] - made->time) <= late) return 1;
  return here + 1 < timeline->segments && timeline->jump[here + 1] && fabs(timeline->end[here] - made->time) <= late;
}

/* How high a surface rises after a crossing at (t, x), at this rate, until it turns back at a kink of an input;
   infinite above `enough`. Moves v->z and v->slope, and where the mode is bound. */
static double height_behind(hs_view *v, int k, double t, const double *x, double rate, double enough) {
  const hs_timeline *const timeline = v->s->timeline;
  double height = 0.0;
  for (int i = 0; i < v->n; i++) v->z[i] = x[i];
  for (int64_t there = segment_at(timeline, t); there + 1 < timeline->segments; there++) {
    const double end = timeline->end[there], late = end - t;
    height = height + rate * late;
    if (height >= enough) break;
    bind(v, v->mode, there);
    if (v->table->flow(v->p, t, v->z, v->slope)) return 0.0;
    for (int i = 0; i < v->n; i++) v->z[i] = v->z[i] + late * v->slope[i];
    bind(v, v->mode, there + 1);
    t = end;
    if (hs_call(&v->table->rates[k], v->p, t, v->z, &rate)) return 0.0;
    if (!(rate > 0)) return height;
  }
  return INFINITY;
}

/* How often the error fits into what keeps a crossing, at the end of the arc. */
static void screen_crossing(hs_view *v, int64_t j, int flown) {
  hs_screen *const s = v->s;
  const hs_transition *made = &s->run.transition[j];
  const double t = made->time, *x = s->run.before + j * s->model->width;
  const int64_t step = v->segment, row = v->last - 1;
  hs_near_surface found;
  double bend = 0.0, height = INFINITY, rate;
  s->crossed++;
  int bad = evaluate_surfaces(v, t, x) || v->table->flow(v->p, t, x, v->slope) ||
            near_surface(v, made->edge, t, x, &found);
  if (!bad) {
    if (reset_jumps(v, made, x)) s->crossing[j] |= HS_RESET_UNDECIDED, s->undecided |= BIT(HS_LANDING);
    int flat = 1;
    for (int i = 0; i < v->row->count; i++) flat &= v->gradient[i] == 0.0;
    if (flat || !(found.rate > rate_roundoff(v)) || v->table->edge[made->edge].conditional)
      s->crossing[j] |= HS_CROSSING_UNDECIDED;
    if (flown) {
      const double begin = s->run.times[row], middle = begin + (s->run.times[v->last] - begin) / 2;
      bind(v, v->mode, segment_at(s->timeline, middle));
      along_step(v, &s->run, row, 0.5, v->z);
      bad = hs_call(&v->table->rates[made->edge], v->p, middle, v->z, &rate);
      if (!bad && t > middle) bend = fabs(found.rate - rate) / (t - middle);
    }
    if (!bad) height = height_behind(v, made->edge, t, x, found.rate, SAFE * found.error);
  }
  bind(v, v->mode, step);
  if (bad) {
    s->undecided |= BIT(HS_CROSSING);
    return;
  }
  const double depth = hs_min(bend > 0 ? found.rate * found.rate / (2 * bend) : INFINITY, height);
  const double margin = found.error > 0 ? depth / found.error : INFINITY;
  if (!(margin >= SAFE)) s->crossing[j] |= HS_CROSSING_UNDECIDED;
  s->slowest = hs_min(s->slowest, found.rate);
  s->least = hs_min(s->least, margin);
}
