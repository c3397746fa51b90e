/* How wrong a recorded run is, by the finer one. See hsdsl/engine/simulate/verdict/agreement.py and reliability.py. */

#include "screen_view.h"

/* Whether all arcs are of flow in modes. */
static int plain_arcs(const hs_record *run, const hs_model *model) {
  for (int64_t i = 0; i < run->arcs; i++) {
    const hs_arc *arc = &run->arc[i];
    if (arc->kind != HS_FLOW || arc->mode >= model->modes) return 0;
    if (model->mode[arc->mode].final && takes_time(run, i)) return 0;
  }
  return 1;
}

/* Whether both runs make the same transitions; how far their times are apart. */
static int same_transitions(hs_view *v) {
  const hs_record *a = &v->s->run, *b = &v->s->finer;
  if (!plain_arcs(a, v->s->model) || !plain_arcs(b, v->s->model)) return 0;
  double apart = tie_of(v->s, a->times[a->rows - 1]);
  if (a->transitions != b->transitions) return 0;
  for (int64_t k = 0; k < a->transitions; k++) {
    const hs_transition *one = &a->transition[k], *other = &b->transition[k];
    if (one->mode != other->mode || one->edge != other->edge) return 0;
    v->time_errors[k] = apart = hs_max(apart, fabs(one->time - other->time));
  }
  return 1;
}

static void grow(double *error, double by) {
  if (by > *error) *error = by; /* not-a-number shows nothing */
}

/* Hold a row against the finer run at an equal time since the last transition. */
static void compare_row(hs_view *v, int64_t row, int64_t jump, double shift) {
  const hs_record *a = &v->s->run, *b = &v->s->finer;
  const double t = a->times[row] + shift, *x = recorded_row(a, row);
  if (!(t >= b->times[0] && t <= b->times[b->rows - 1])) return;
  while (v->fine_row > 0 && b->times[v->fine_row] > t) v->fine_row--;
  while (v->fine_row + 1 < b->rows && b->times[v->fine_row + 1] <= t) v->fine_row++;
  while (v->fine_arc > 0 && b->arc[v->fine_arc].first > v->fine_row) v->fine_arc--;
  while (v->fine_arc + 1 < b->arcs && b->arc[v->fine_arc + 1].first <= v->fine_row) v->fine_arc++;
  if (b->arc[v->fine_arc].jump != jump || b->arc[v->fine_arc].mode != v->mode) return;
  const double begin = b->times[v->fine_row];
  const double *there = v->y;
  if (t == begin) there = recorded_row(b, v->fine_row);
  else along_step(v, b, v->fine_row, (t - begin) / (b->times[v->fine_row + 1] - begin), v->y);
  for (int i = 0; i < v->n; i++) grow(&v->error[v->table->state[i]], fabs(x[i] - there[i]));
}

static void compare_states(hs_view *v, int mode, const double *one, const double *other) {
  const hs_mode *table = &v->s->model->mode[mode];
  for (int i = 0; i < table->dimension && !table->final; i++) grow(&v->error[table->state[i]], fabs(one[i] - other[i]));
}

/* The errors up to a row, which none but the first is without. */
static void reach_row(hs_view *v, int64_t row, int64_t jump, double shift) {
  const hs_screen *s = v->s;
  const double least = hs_max(s->tolerance, ERROR_UNITS * HS_UNIT), *x = recorded_row(&s->run, row);
  const int w = s->model->width;
  if (has_shadow(s))
    for (int i = 0; i < v->n; i++) grow(&v->error[v->table->state[i]], s->shadow_errors[row * s->run.width + i]);
  else compare_row(v, row, jump, shift);
  if (!has_shadow(s) && row == v->last && (v->arc + 1 == s->run.arcs || s->run.arc[v->arc + 1].jump > jump)) {
    const hs_transition *made = s->run.transition;
    if (jump < s->run.transitions)
      compare_states(v, made[jump].mode, s->run.before + jump * w, s->finer.before + jump * w);
    if (jump > 0 && made[jump - 1].resumed == made[jump - 1].resumed) {
      const int target = s->model->mode[made[jump - 1].mode].edge[made[jump - 1].edge].target;
      compare_states(v, target, s->run.after + (jump - 1) * w, s->finer.after + (jump - 1) * w);
    }
  }
  for (int i = 0; i < v->n; i++) {
    const int state = v->table->state[i];
    grow(&v->size[state], fabs(x[i]));
    v->mode_error[i] = row ? hs_max(v->error[state], least * v->size[state]) : v->error[state];
  }
}

/* How much the error may move a surface of which the gradient is known. */
static double surface_error(const hs_view *v, double t) {
  double shift = 0.0;
  for (int i = 0; i < v->row->count; i++)
    shift += fabs(v->gradient[i]) * (v->row->place[i] ? v->mode_error[v->row->place[i] - 1] : time_error_at(v, t));
  return shift;
}

/* Whether no error of a state exceeds a tenth of its largest size by more than round-off of the flow explains. */
static int explained(const hs_view *v) {
  const double least = hs_max(v->s->tolerance, ERROR_UNITS * HS_UNIT);
  for (int i = 0; i < v->s->model->states; i++) {
    const double error = hs_max(v->error[i], least * v->size[i]);
    if (error > 0 && !(error * SAFE <= v->size[i]) && !(error <= SAFE * v->roundoff_floor[i])) return 0;
  }
  return 1;
}

/* What round-off of the flow at a row moves states by, over the run: to `roundoff_floor`, from what it was found to be
   before; 0 where that has no bound. */
static int round_off_at(hs_view *v, int64_t row, const double *before) {
  const hs_record *const run = &v->s->run;
  const double span = run->times[run->rows - 1] - run->times[0], unit = ERROR_UNITS * HS_UNIT;
  const double t = run->times[row], *x = recorded_row(run, row);
  v->range[0] = outwards(t - unit * fabs(t), t + unit * fabs(t), 0x1p-52);
  for (int i = 0; i < v->n; i++) {
    const double wide = unit * fabs(x[i]) + before[v->table->state[i]];
    v->range[1 + i] = outwards(x[i] - wide, x[i] + wide, 0x1p-52);
  }
  range_operations(v->f, v->f->flow.first, v->f->flow.last, first_register(v), v->range);
  for (int i = 0; i < v->n; i++) {
    const hs_range f = v->range[v->f->flow.result[i]];
    if (!hs_finite(f.high - f.low)) return 0;
    grow(&v->roundoff_floor[v->table->state[i]], span * (f.high - f.low));
  }
  return 1;
}

/* The same at places all along the run, until all errors are explained. */
static int round_off(hs_view *v, const double *before) {
  const hs_screen *s = v->s;
  for (int m = 0; m < s->model->modes; m++) {
    int64_t steps = 0, stride = 1;
    for (int pass = 0; pass < 2; pass++) {
      int64_t number = 0;
      for (int64_t a = 0; a < s->run.arcs; a++) {
        if (s->run.arc[a].mode != m || !takes_time(&s->run, a)) continue;
        for (int64_t row = s->run.arc[a].first; row < last_row(&s->run, a); row++) {
          if (!(s->run.times[row + 1] > s->run.times[row])) continue;
          if (pass == 0 || number++ % stride) {
            steps += pass == 0;
            continue;
          }
          bind(v, m, segment_at(s->timeline, s->run.times[row]));
          if (!round_off_at(v, row, before)) return 0;
          if (explained(v)) return 1;
        }
      }
      stride = steps / PLACES > 1 ? steps / PLACES : 1;
    }
  }
  return 1;
}

/* Whether the error of a state exceeds a tenth of its largest size, and is more than round-off of the flow explains. */
static int outgrown(hs_view *v) {
  const int states = v->s->model->states;
  double *const most = v->roundoff_floor, *const before = v->roundoff_floor + states;
  for (int i = 0; i < states; i++) most[i] = 0.0;
  for (int round = 0; round < ROUNDOFF_ROUNDS; round++) {
    if (explained(v)) return 0;
    copy(before, most, states);
    if (!round_off(v, before)) return 1;
  }
  return !explained(v);
}
