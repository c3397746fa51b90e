/* Steps of a recorded run: whether a surface may be reached or passed unseen along them. See
   hsdsl/engine/simulate/verdict/steps.py and transparent.py. */

#include "screen_flow.c"
#include "screen_misses.c"
#include "screen_parts.h"

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
