/* Steps of a recorded run: whether the flow may do along them what they do not show, where surfaces turn close to them,
   and whether one may be reached or passed unseen. See hsdsl/engine/simulate/verdict: flows, misses. */

#include "screen_places.c"

#define SEEN 0.5 /* of a step: every method has stages on parts of such a width, and shows what is as smooth */

/* Expand states and the flow along a part of a step. */
static void expand_flow(hs_view *v, int64_t row, double start, double width) {
  const double begin = v->s->run.times[row], length = v->s->run.times[row + 1] - begin, half = width / 2 * length;
  const hs_part part = part_of(v, row, start, width);
  v->expanded = width == 1.0;
  v->around[0] = expansion(begin + (start + width / 2) * length, half, 0.0, 0.0, 0.0, 0.0, 0.0);
  expand_states(v, row, part, -1);
  expand_operations(v->f, v->f->flow.first, v->f->flow.last, v->n, first_register(v), v->around);
}

/* How a state is moved along a part by what the step does not show there. */
typedef struct {
  double most, drift, unresolved; /* either way, in all, and by what may have any sign */
} hs_moved;

/* What is not shown is unresolved or, on a part so short that it may have no stage, how the flow differs from the
   slope of the state's polynomial. What errors of states change the flow by is no pulse. */
static hs_moved moved_unseen(const hs_view *v, int64_t row, int i, double width) {
  const double length = width * (v->s->run.times[row + 1] - v->s->run.times[row]);
  const hs_expansion flow = v->around[v->f->flow.result[i]];
  const double allowed = RESOLVED * flow.error;
  if (!(width < SEEN)) {
    const double unresolved = hs_max(flow.unresolved - allowed, 0.0) * length;
    const hs_moved found = {unresolved, 0.0, unresolved};
    return found;
  }
  const hs_expansion differs = expanded_sum(flow, negated(v->slopes[i]));
  const double drift = differs.value + differs.second / 3;
  const double less = hs_max(allowed - fabs(drift), 0.0);
  const hs_moved found = {
    hs_max(flow.unresolved + fabs(differs.value) + variation(differs) - allowed, 0.0) * length,
    copysign(hs_max(fabs(drift) - allowed, 0.0), drift) * length,
    hs_max(flow.unresolved - less, 0.0) * length,
  };
  return found;
}

/* Whether the flow has a bound along a step, and so have its slopes: no root is taken close to zero. */
static int all_known(const hs_view *v) {
  for (int i = 0; i < v->n; i++)
    if (!hs_finite(v->around[v->f->flow.result[i]].remainder)) return 0;
  return 1;
}

/* Whether states may be moved along a part by more than is left of what is allowed for the step, `allowance`, after the
   parts before: parts are halved until no part takes more than half its share, or than a quarter of what is left. */
static int flow_open(hs_view *v, int64_t row, int level, double start, double width) {
  int open = 0;
  if (++v->parts > MOST_PARTS_TRIED) return 1;
  expand_flow(v, row, start, width);
  if (level == 0 && v->f->steep && !all_known(v)) return 1;
  for (int i = 0; i < v->n; i++) {
    const double share = RESOLVED * hs_max(v->mode_error[i], HS_NOTHING) * width / 2;
    const double left = v->allowance[i] - fabs(v->drift[i]);
    open |= !(moved_unseen(v, row, i, width).most <= hs_max(share, left / 4));
  }
  if (open && level < LEVELS)
    return flow_open(v, row, level + 1, start, width / 2) ||
           flow_open(v, row, level + 1, start + width / 2, width / 2);
  for (int i = 0; i < v->n; i++) {
    const hs_moved moved = moved_unseen(v, row, i, width);
    v->allowance[i] -= moved.unresolved, v->drift[i] += moved.drift;
    if (!(fabs(v->drift[i]) <= v->allowance[i])) return 1;
  }
  return 0;
}

static int flow_hides(hs_view *v, int64_t row) {
  if (v->f->affine && !v->f->steep) return 0;
  v->parts = 0;
  for (int i = 0; i < v->n; i++) v->allowance[i] = RESOLVED * hs_max(v->mode_error[i], HS_NOTHING), v->drift[i] = 0.0;
  return flow_open(v, row, 0, 0.0, 1.0);
}

/* Rates of all surfaces at a point; not-a-number where there is none. */
static void all_rates(hs_view *v, double t, const double *x, double *to) {
  for (int k = 0; k < v->table->surfaces; k++)
    if (hs_call(&v->table->rates[k], v->p, t, x, &to[k])) to[k] = NAN;
}

/* Whether the rate of a surface is not zero for round-off alone where a step begins, and is not above zero at its end. */
static int surely_turns(hs_view *v, int64_t row, int k) {
  const hs_formula *const rate = &v->f->rate[k];
  for (int end = 0; end < 2; end++) {
    set_row(v, row + end);
    range_operations(v->f, rate->first, rate->last, first_register(v), v->range);
    const hs_range found = v->range[rate->result[0]];
    if (end ? !(found.high <= 0) : !(found.low > 0)) return 0;
  }
  return 1;
}

/* Note the turning point that comes closest to its surface, in errors, of each mode. */
static void note_near_miss(hs_view *v, int64_t row) {
  const hs_record *run = &v->s->run;
  const double begin = run->times[row], length = run->times[row + 1] - begin, middle = begin + length / 2;
  const hs_formula *const surfaces = &v->f->surfaces;
  int evaluated = 0;
  for (int k = 0; k < v->table->surfaces; k++) {
    if (!(v->at_start[k] > 0 && v->at_end[k] <= 0 && surely_turns(v, row, k))) continue;
    if (!evaluated) {
      along_step(v, run, row, 0.5, v->z);
      if (v->table->values(v->p, middle, v->z, v->values)) return;
      v->range[0] = range_sum(middle, middle);
      for (int i = 0; i < v->n; i++)
        v->range[1 + i] = range_sum(v->z[i] - v->mode_error[i], v->z[i] + v->mode_error[i]);
      range_operations(v->f, surfaces->first, surfaces->last, first_register(v), v->range);
      evaluated = 1;
    }
    const double below = -v->values[k], moved = v->range[surfaces->result[k]].high;
    const double margin = below > 0 ? below / hs_max(moved + below, HS_NOTHING) : INFINITY;
    hs_near_miss *const best = &v->nearest[v->mode];
    if (margin < best->margin) {
      best->margin = margin, best->row = row, best->surface = k, best->segment = v->segment;
      copy(v->miss_error + v->mode * v->s->model->width, v->mode_error, v->n);
    }
  }
}

/* The rate of a surface at a share of a step; the states there are left in z. */
static int rate_within(hs_view *v, const hs_near_miss *miss, double share, double *rate) {
  const double *const times = v->s->run.times + miss->row;
  along_step(v, &v->s->run, miss->row, share, v->z);
  return hs_call(&v->table->rates[miss->surface], v->p, times[0] + share * (times[1] - times[0]), v->z, rate);
}

/* Close in on a turning point from both ends of its step (Illinois): the share of the step, or not-a-number. */
static double turning_share(hs_view *v, const hs_near_miss *miss) {
  double a = 0.0, b = 1.0, rising, falling, share = 1.0, rate, before;
  int side = 0;
  if (rate_within(v, miss, a, &rising) || rate_within(v, miss, b, &falling)) return NAN;
  for (int i = 0; i < ROUNDS; i++) {
    before = share;
    share = b - falling * (b - a) / (falling - rising);
    if (!(share > a && share < b)) share = (a + b) / 2;
    if (fabs(share - before) <= CLOSE_SHARE) return share;
    if (rate_within(v, miss, share, &rate)) return NAN;
    if (rate >= 0) {
      a = share, rising = rate;
      if (side > 0) falling /= 2;
      side = 1;
    } else {
      b = share, falling = rate;
      if (side < 0) rising /= 2;
      side = -1;
    }
  }
  return b;
}

/* How often the error fits between the surface and the turning point noted in the mode. */
static void measure_miss(hs_view *v) {
  hs_screen *const s = v->s;
  hs_near_miss *const best = &v->nearest[v->mode];
  const double *const times = s->run.times + best->row;
  const double share = turning_share(v, best);
  hs_near_surface found;
  copy(v->mode_error, v->miss_error + v->mode * s->model->width, v->n);
  best->middle = hs_min(times[0] + share * (times[1] - times[0]), times[1]);
  along_step(v, &s->run, best->row, share, v->z);
  if (share != share || evaluate_surfaces(v, best->middle, v->z) ||
      near_surface(v, best->surface, best->middle, v->z, &found)) {
    s->undecided |= BIT(HS_NEAREST);
    return;
  }
  best->start = found.value < 0 ? (found.error > 0 ? -found.value / found.error : INFINITY) : NAN;
}

/* Of the surfaces that are still open for a part of a step, mark those that may turn close to zero on it. */
static int turns_close(hs_view *v, const int *before, int *open) {
  const int base = first_register(v);
  const hs_formula *const surfaces = &v->f->surfaces;
  int any = 0;
  range_operations(v->f, surfaces->first, surfaces->last, base, v->range);
  for (int k = 0; k < v->table->surfaces; k++) {
    const hs_range value = v->range[surfaces->result[k]];
    open[k] = before[k] && !(v->beyond_at_start[k] ? value.low > 0 : value.high < 0);
    if (!open[k]) continue;
    const hs_formula *const rate = &v->f->rate[k];
    range_operations(v->f, rate->first, rate->last, base, v->range);
    const hs_range slope = v->range[rate->result[0]];
    open[k] = !(slope.low > 0 || slope.high < 0);
    any |= open[k];
  }
  return any;
}

/* Whether nothing is open but the surface that is crossed at the end of the arc: `crossings` decides that. */
static int only_crossed(const hs_view *v, const int *open) {
  for (int k = 0; k < v->table->surfaces; k++)
    if (open[k] && k != v->crossed) return 0;
  return 1;
}

/* Cut no states but those that open surfaces and their rates depend on: others keep the box of the whole step. */
static void cut_few(hs_view *v, const int *open) {
  for (int i = 0; i < v->n; i++) v->cut[i] = 0;
  for (int k = 0; k < v->table->surfaces; k++) {
    const hs_sparse *const slopes = &v->table->gradients[k];
    const hs_formula *const rate = &v->f->rate[k];
    if (!open[k]) continue;
    for (int i = 0; i < slopes->count; i++)
      if (slopes->place[i]) v->cut[slopes->place[i] - 1] = 1;
    for (int i = rate->first; i <= rate->last; i++) {
      const hs_operation *const o = &v->f->operation[i];
      const int one = i < rate->last ? o->a : rate->result[0], other = i < rate->last ? o->b : 0;
      if (one > 0 && one <= v->n) v->cut[one - 1] = 1;
      if (other > 0 && other <= v->n) v->cut[other - 1] = 1;
    }
  }
}

/* Whether a surface may turn close to zero on a half of a part, or on halves of that. */
static int halves_close(hs_view *v, int64_t row, int level, double start, double width) {
  const int most = v->s->model->surfaces, ends = row + 1 == v->last && start + width == 1.0;
  if (level >= END_LEVELS && ends && only_crossed(v, v->open + level * most)) return 0;
  if (level == LEVELS) return 1;
  for (int half = 0; half < 2; half++) {
    const double from = start + half * width / 2;
    set_half(v, row, level, half, start, width, SAFE);
    if (v->parts > (v->coarse ? COARSE_PARTS_TRIED : MOST_PARTS_TRIED)) return 1;
    if (turns_close(v, v->open + level * most, v->open + (level + 1) * most) &&
        halves_close(v, row, level + 1, from, width / 2))
      return 1;
  }
  return 0;
}

/* Find the surfaces of edges with an `if` that a step begins beyond: these may be left and reached again. */
static int begins_beyond(hs_view *v, int64_t row) {
  int any = 0;
  for (int k = 0; k < v->table->surfaces; k++)
    any |= v->beyond_at_start[k] = k < v->table->edges && v->table->edge[k].conditional;
  if (any && evaluate_surfaces(v, v->s->run.times[row], recorded_row(&v->s->run, row))) return 0;
  for (int k = 0; k < v->table->surfaces && any; k++) v->beyond_at_start[k] &= v->values[k] > 0;
  return 1;
}

/* Whether a surface may turn close to zero along a step. */
static int turns_along(hs_view *v, int64_t row) {
  const hs_record *run = &v->s->run;
  const double *x = recorded_row(run, row), *c = recorded_piece(run, row);
  const int d = v->degree, w = run->width, m = v->table->surfaces;
  if (!m) return 0;
  if (!begins_beyond(v, row)) return 1;
  for (int i = 0; i < v->n; i++) {
    double total = 0.0, size = 0.0;
    for (int k = 0; k < d; k++) total += c[k * w + i], size += fabs(c[k * w + i]);
    set_box(v, x[i] + (total - size) / 2, x[i] + (total + size) / 2, i, SAFE * v->mode_error[i]);
  }
  set_times(v, run->times[row], run->times[row + 1] - run->times[row], 0.0, 1.0);
  for (int k = 0; k < m; k++) v->open[v->s->model->surfaces + k] = 1;
  if (!turns_close(v, v->open + v->s->model->surfaces, v->open)) return 0;
  cut_few(v, v->open);
  for (v->coarse = 1; v->coarse >= 0; v->coarse--) {
    if (!v->coarse) whole_step(v, row);
    else expand_cut(v, row);
    if (!halves_close(v, row, 0, 0.0, 1.0)) return 0;
  }
  return 1;
}

/* Whether an edge's surface may be passed although its `if` is false, along a step. */
static int passes(hs_view *v, int64_t row) {
  const hs_formula *const surfaces = &v->f->surfaces;
  int any = 0;
  for (int k = 0; k < v->table->edges; k++)
    any |= v->open[k] = v->table->edge[k].conditional && !(row + 1 == v->last && v->crossed == k);
  for (int end = 0; end < 2 && any; end++) {
    set_row(v, row + end);
    range_operations(v->f, surfaces->first, surfaces->last, first_register(v), v->range);
    any = 0;
    for (int k = 0; k < v->table->edges; k++) {
      const hs_range value = v->range[surfaces->result[k]];
      any |= v->open[k] &= end ? value.high > 0.0 : value.low <= 0.0;
    }
  }
  return any;
}

/* Screen the step that begins at a row; errors are those at its end. */
static void screen_step(hs_view *v, int64_t row, int *known) {
  hs_screen *const s = v->s;
  const double end = s->run.times[row + 1];
  const int64_t segment = segment_at(s->timeline, s->run.times[row]);
  if (segment != v->segment) bind(v, v->mode, segment), *known = 0;
  if (!(end > s->run.times[row])) {
    *known = 0;
    return;
  }
  take_step(v, row);
  v->expanded = 0;
  if (flow_hides(v, row)) s->changing[row] = 1, s->undecided |= BIT(HS_FLOW_CHANGE);
  if (turns_along(v, row)) s->turning[row] = 1, s->undecided |= BIT(HS_TURNING);
  if (!(s->undecided & BIT(HS_TRANSPARENT)) && passes(v, row)) s->undecided |= BIT(HS_TRANSPARENT);
  if (!*known) all_rates(v, s->run.times[row], recorded_row(&s->run, row), v->at_start);
  all_rates(v, end, recorded_row(&s->run, row + 1), v->at_end);
  note_near_miss(v, row);
  swap(&v->at_start, &v->at_end);
  *known = 1;
}
