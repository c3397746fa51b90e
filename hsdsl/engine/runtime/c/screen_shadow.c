/* How wrong a recorded run is, by its shadow run. See hsdsl/engine/simulate/verdict/shadow.py. */

#include "screen_correction.c"
#include "screen_series.c"

#define MOST_CHANGES 8     /* of Newton's method */
#define CLOSED_IN 0x1p-10 /* of the tie tolerance: a crossing's time is found */

/* Bound what round-off of the flow and of states that move may do in the run's step, by the flow where that ends, to
   `roundoff`; 0 where it has no bound. Where an arc begins, states are rounded too. */
static int bound_roundoff(hs_view *v, const hs_shadow *c) {
  const double *const start = recorded_row(&v->s->run, c->row), *const x = recorded_row(&v->s->run, c->row + 1);
  const hs_formula *const flow = &v->f->flow;
  rounded_formula(v->f, flow, v->n, v->s->model->data, v->s->run.times[c->row + 1], x, v->rounded, 0);
  for (int i = 0; i < v->n; i++) {
    const hs_rounded f = v->rounded[flow->result[i]];
    const double share = f.value != 0.0 ? ROUNDED : 0.0;
    c->roundoff[i] = c->h * f.off + share * fabs(x[i]);
    if (c->begins) c->x[i] += copysign(share * start[i], c->x[i] - start[i]);
    if (!hs_finite(c->roundoff[i])) return 0;
  }
  return 1;
}

/* Follow the round-off of a formula of the mode at a point of the shadow run. */
static void trace(hs_view *v, const hs_shadow *c, const hs_formula *formula, const double *x) {
  const int n = c->table->dimension, data = v->s->model->data;
  if (v->traced_mode != v->mode) bind_rounded(v->f, n, data, c->p, v->traced, 1), v->traced_mode = v->mode;
  rounded_formula(v->f, formula, n, data, c->t, x, v->traced, 1);
}

/* Move it along a straight line to where it crosses surface k but for the surface's round-off, to y. */
static int shadow_crosses(hs_view *v, hs_shadow *c, int k) {
  const double tie = tie_of(v->s, c->t);
  double change = INFINITY, rate, s = 0.0;
  if (c->table->flow(c->p, c->t, c->x, v->slope)) return 0;
  trace(v, c, &v->f->surfaces, c->x);
  const double beyond = beyond_value(v->traced[v->f->surfaces.result[k]]);
  copy(c->y, c->x, c->table->dimension);
  for (int i = 0; i < MOST_CHANGES && fabs(change) > CLOSED_IN * tie; i++) {
    if (c->table->values(c->p, c->t + s, c->y, v->values) || c->table->rates[k](c->p, c->t + s, c->y, &rate)) return 0;
    if (!(rate > 0)) return 0;
    change = (v->values[k] + beyond) / rate;
    s -= change;
    for (int m = 0; m < c->table->dimension; m++) c->y[m] = c->x[m] + s * v->slope[m];
  }
  c->t += s;
  return fabs(change) <= tie;
}

/* Move what the reset of an edge makes of y by its round-off, to x; 0 where that is not known. */
static int trace_reset(hs_view *v, hs_shadow *c, int k) {
  const hs_formula *const formula = &v->f->reset[k];
  const hs_edge *const edge = &c->table->edge[k];
  copy(c->x, c->y, c->table->dimension);
  trace(v, c, formula, c->y);
  for (int i = 0; i < edge->changes; i++) {
    const hs_rounded found = v->traced[formula->result[i]];
    c->x[edge->change[i]] = moved(found);
    if (!hs_finite(found.value + found.error + found.off)) return 0;
  }
  return 1;
}

/* Make transition j where the shadow run crosses its surface, close to where it is. */
static int shadow_jumps(hs_view *v, hs_shadow *c, int64_t j, double *errors) {
  const hs_screen *const screen = v->s;
  const hs_transition *const made = &screen->run.transition[j];
  const double *const before = screen->run.before + j * screen->model->width;
  if (made->entry || !shadow_crosses(v, c, made->edge)) return 0;
  for (int i = 0; i < c->table->dimension; i++) grow(&errors[i], fabs(before[i] - c->y[i]));
  v->time_errors[j] = hs_max(j ? v->time_errors[j - 1] : tie_of(screen, 0.0),
                      fabs(made->time - c->t));
  if (!trace_reset(v, c, made->edge)) return 0;
  return !screen->model->queues || hs_let_wait(screen->model, v->tail, 0, c->table, c->y,
                                           &screen->model->mode[c->table->edge[made->edge].target], c->x) < 0;
}

/* Twice as many as wait in a run at a time, and room to move them together. */
static int64_t waits_of(const hs_screen *s, int number) {
  double most = 0.0;
  for (int64_t j = 0; j < s->run.transitions; j++) {
    const hs_transition *const made = &s->run.transition[j];
    const hs_mode *const mode = &s->model->mode[made->mode];
    for (int k = 0; k < mode->queues; k++)
      if (mode->queue[k].number == number) grow(&most, (s->run.before + j * s->model->width)[mode->queue[k].waiting]);
  }
  return 2 * (int64_t)(most + FEWEST_WAITS);
}

/* Let nothing wait in the shadow run. */
static void lay_out_waits(hs_view *v) {
  double *waits = v->waits;
  for (int q = 0; q < v->s->model->queues; q++) {
    const hs_tail none = {waits_of(v->s, q), 0, 0, waits};
    v->tail[q] = none;
    waits += none.room * v->s->model->queued;
  }
}

/* Follow the run: how far each row is from the shadow run, to `shadow_errors`, and each transition, to
   `time_errors`; 0 where that cannot be followed. */
static int follow_run(hs_view *v) {
  const hs_screen *const s = v->s;
  const hs_record *const run = &s->run;
  hs_shadow c = {.p = s->data, .x = v->x, .y = v->y, .moved = v->z, .roundoff = v->roundoff};
  c.lines = v->lines;
  int64_t followed = 0;
  lay_out_waits(v);
  c.t = run->times[0];
  c.order = FEWEST < s->order ? FEWEST : s->order;
  copy(c.x, s->start, s->model->mode[run->arc[0].mode].dimension);
  for (int64_t i = 0; i < run->rows * run->width; i++) s->shadow_errors[i] = 0.0;
  for (int64_t a = 0; a < run->arcs; a++) {
    const int64_t last = last_row(run, a), jump = run->arc[a].jump;
    const int leaves = jump < run->transitions && (a + 1 == run->arcs || run->arc[a + 1].jump > jump);
    c.table = &s->model->mode[run->arc[a].mode];
    const double shift = c.t - run->times[run->arc[a].first];
    if (c.table->final) continue;
    bind(v, run->arc[a].mode, 0);
    for (int64_t row = run->arc[a].first; row <= last; row++) {
      double *const errors = s->shadow_errors + row * run->width;
      const double *const x = recorded_row(run, row);
      c.row = row - 1, c.h = row > run->arc[a].first ? run->times[row] - run->times[row - 1] : 0.0;
      c.begins = row == run->arc[a].first + 1;
      if (c.h > 0) {
        if (!bound_roundoff(v, &c) || !(s->correction ? correct_step(v, &c, errors) : expand_step(v, &c))) return 0;
        copy(c.x, c.y, v->n);
        c.t = run->times[row] + shift;
      }
      for (int i = 0; i < v->n; i++) {
        const double apart = fabs(x[i] - c.x[i]);
        if (!hs_finite(apart)) return 0;
        grow(&errors[i], apart);
      }
    }
    if (leaves && (jump != followed++ || !shadow_jumps(v, &c, jump, s->shadow_errors + last * run->width))) return 0;
  }
  return followed == run->transitions;
}
