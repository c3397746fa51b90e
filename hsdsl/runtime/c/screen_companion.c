/* How wrong a recorded run by Taylor series is, by its companion. See hsdsl/simulate/verdict/companion.py. */

#include "screen_view.h"

#define MOST_CHANGES 8     /* of Newton's method */
#define CLOSED_IN 0x1p-10 /* of the tie tolerance: a crossing's time is found */

/* Where the companion is, and its series from there: of coefficients 1 to order + 1. */
typedef struct {
  const hs_mode *table;
  const double *p;
  double *x, *y, *lines;
  double t;
  int order;
} hs_companion;

static int expand_companion(hs_companion *c) {
  return !c->table->series || c->table->series(c->p, c->order, c->t, c->x, c->lines);
}

static void companion_at(const hs_companion *c, double s, double *to) {
  const int last = c->order + 1;
  for (int i = 0; i < c->table->dimension; i++) {
    const double *const line = c->lines + (i + 1) * (c->order + 2);
    double z = line[last];
    for (int m = last - 1; m > 0; m--) z = line[m] + s * z;
    to[i] = c->x[i] + s * z;
  }
}

/* Move the companion further away from the run by what round-off of the flow may do in a step from a row; 0 where that
   has no bound. */
static int round_companion(hs_view *v, hs_companion *c, int64_t row, double h) {
  const double *const x = recorded_row(&v->s->run, row);
  const hs_formula *const flow = &v->f->flow;
  v->range[0] = (hs_range){c->t, c->t};
  for (int i = 0; i < v->n; i++) v->range[1 + i] = (hs_range){c->x[i], c->x[i]};
  range_operations(v->f, flow->first, flow->last, first_register(v), v->range);
  for (int i = 0; i < v->n; i++) {
    const hs_range f = v->range[flow->result[i]];
    const double moved = h * (f.high - f.low) / 2;
    if (!hs_finite(moved)) return 0;
    c->x[i] += c->x[i] < x[i] ? -moved : moved;
  }
  return 1;
}

/* Find where it crosses surface k, from the time s on or back: 1 with the state there, to y. */
static int companion_crosses(hs_view *v, hs_companion *c, int k, double *s) {
  const double tie = tie_of(v->s, c->t);
  double change = INFINITY, rate;
  for (int i = 0; i < MOST_CHANGES && fabs(change) > CLOSED_IN * tie; i++) {
    if (c->table->values(c->p, c->t + *s, c->y, v->values) || c->table->rates[k](c->p, c->t + *s, c->y, &rate)) return 0;
    if (!(rate > 0)) return 0;
    change = v->values[k] / rate;
    *s -= change;
    companion_at(c, *s, c->y);
  }
  return fabs(change) <= tie;
}

/* Make transition j where the companion crosses its surface, close to the time s from where its series begin. */
static int companion_jumps(hs_view *v, hs_companion *c, int64_t j, double s, double *measured) {
  const hs_screen *const screen = v->s;
  const hs_transition *const made = &screen->run.transition[j];
  const hs_edge *const edge = &c->table->edge[made->edge];
  const double *const before = screen->run.before + j * screen->model->width;
  if (made->entry || !companion_crosses(v, c, made->edge, &s)) return 0;
  for (int i = 0; i < c->table->dimension; i++) grow(&measured[i], fabs(before[i] - c->y[i]));
  c->t += s;
  v->late[j] = hs_max(j ? v->late[j - 1] : tie_of(screen, screen->run.times[screen->run.rows - 1]),
                      fabs(made->time - c->t));
  return !hs_changed(edge, edge->reset, c->p, c->t, c->y, c->y, c->x);
}

/* Follow the run: how far each row is from the companion, to `measured`, and each transition, to `late`; 0 where that
   cannot be followed. */
static int accompany(hs_view *v) {
  const hs_screen *const s = v->s;
  const hs_record *const run = &s->run;
  hs_companion c = {.p = s->timeline->data, .x = v->x, .y = v->y, .lines = v->lines, .order = s->order};
  int64_t followed = 0;
  c.t = run->times[0];
  copy(c.x, recorded_row(run, 0), run->width);
  for (int64_t a = 0; a < run->arcs; a++) {
    const int64_t last = last_row(run, a), jump = run->arc[a].jump;
    const int leaves = jump < run->transitions && (a + 1 == run->arcs || run->arc[a + 1].jump > jump);
    c.table = &s->model->mode[run->arc[a].mode];
    const double shift = c.t - run->times[run->arc[a].first];
    if (!c.table->final) bind(v, run->arc[a].mode, 0);
    for (int64_t row = run->arc[a].first; row <= last; row++) {
      double *const measured = s->measured + row * run->width;
      const double *const x = recorded_row(run, row);
      const double h = row > run->arc[a].first ? run->times[row] - run->times[row - 1] : 0.0;
      const int jumps = leaves && row == last;
      if (c.table->final) {
        for (int i = 0; i < run->width; i++) measured[i] = 0.0;
        continue;
      }
      if (h > 0 && !round_companion(v, &c, row - 1, h)) return 0;
      if ((h > 0 || jumps) && expand_companion(&c)) return 0;
      if (h > 0) companion_at(&c, h, c.y);
      else copy(c.y, c.x, c.table->dimension);
      for (int i = 0; i < c.table->dimension; i++) {
        measured[i] = fabs(x[i] - c.y[i]);
        if (!hs_finite(measured[i])) return 0;
      }
      if (jumps && (jump != followed++ || !companion_jumps(v, &c, jump, h, measured))) return 0;
      if (jumps || !(h > 0)) continue;
      copy(c.x, c.y, c.table->dimension);
      c.t = run->times[row] + shift;
    }
  }
  return followed == run->transitions;
}
