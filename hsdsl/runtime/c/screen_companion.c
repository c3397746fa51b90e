/* How wrong a recorded run by Taylor series is, by its companion. See hsdsl/simulate/verdict/companion.py. */

#include "screen_view.h"

#define MOST_CHANGES 8     /* of Newton's method */
#define CLOSED_IN 0x1p-10 /* of the tie tolerance: a crossing's time is found */
#define FEWEST 3           /* the order of the companion's first series */
#define FURTHER 2          /* by how much it grows where that is not enough */

/* Where the companion is at the start of a step of the run, and how far it is from there on: coefficients 1 to order + 1
   in shares of the step, and by how much it has moved at the end besides. */
typedef struct {
  const hs_mode *table;
  const double *p;
  double *x, *y, *moved, *lines;
  double t, h;
  int64_t row; /* where the run's step begins; -1: the companion alone, from where it is */
  int order;
} hs_companion;

/* Turn the companion's coefficients into differences from those of the run's step, and find how far it is away at the
   end, to y; whether the last ones are so small that all steps together leave out little. */
static int take_differences(const hs_view *v, const hs_companion *c) {
  const hs_record *const run = &v->s->run;
  const double *const x = recorded_row(run, c->row), *const piece = recorded_piece(run, c->row);
  const int last = c->order + 1, w = run->width;
  int settled = 1;
  for (int i = 0; i < c->table->dimension; i++) {
    double *const line = c->lines + (i + 1) * (c->order + 2), power = 1.0;
    double away = c->x[i] - x[i], all = fabs(away);
    for (int m = 1; m <= last; m++) {
      power *= c->h;
      line[m] = line[m] * power - piece[(m - 1) * w + i];
      away += line[m];
      all += fabs(line[m]);
    }
    c->y[i] = away;
    settled &= (double)run->rows * (fabs(line[last - 1]) + fabs(line[last])) <= all;
  }
  return settled;
}

/* Expand the companion along the run's step from its row; without one from where it is. */
static int expand_companion(const hs_view *v, hs_companion *c) {
  for (;; c->order = c->order + FURTHER < v->s->order ? c->order + FURTHER : v->s->order) {
    if (!c->table->series || c->table->series(c->p, c->order, c->t, c->x, c->lines)) return 0;
    if (c->row < 0 || take_differences(v, c) || c->order == v->s->order) return 1;
  }
}

/* Where the companion is some time after the step began. */
static void companion_at(const hs_view *v, const hs_companion *c, double s, double *to) {
  const hs_record *const run = &v->s->run;
  const int last = c->order + 1, n = c->table->dimension, alone = c->row < 0;
  const double share = alone ? s : s / c->h, *const x = alone ? c->x : recorded_row(run, c->row);
  if (alone) copy(to, x, n);
  else along_step(v, run, c->row, share, to);
  for (int i = 0; i < n; i++) {
    const double *const line = c->lines + (i + 1) * (c->order + 2);
    double z = line[last];
    for (int m = last - 1; m > 0; m--) z = line[m] + share * z;
    to[i] += (c->x[i] - x[i]) + share * z + (alone ? 0.0 : c->moved[i]);
  }
}

/* What the run's polynomial X leaves out by the end of its step, to `moved`, where `rounded` holds the flow there.

   With d = X' - f(X) at the end and J the derivatives of f, e' = J e - d for what is left out, e: it is close to
   -h d/order, and what follows from J e is close to h (J e)/(order + 1). */
static int leave_out(hs_view *v, const hs_companion *c) {
  const hs_record *const run = &v->s->run;
  const double *const x = recorded_row(run, c->row + 1), *const piece = recorded_piece(run, c->row);
  const int order = run->degree + 1;
  double *const e = c->moved, *const beyond = v->enough, *const there = v->own;
  for (int i = 0; i < v->n; i++) {
    double slope = 0.0;
    for (int k = run->degree - 1; k >= 0; k--) slope += (k + 1) * piece[k * run->width + i];
    there[i] = v->rounded[v->f->flow.result[i]].value;
    e[i] = (c->h * there[i] - slope) / order;
    beyond[i] = x[i] + e[i];
  }
  if (v->table->flow(c->p, run->times[c->row + 1], beyond, v->slope)) return 0;
  for (int i = 0; i < v->n; i++) e[i] += c->h * (v->slope[i] - there[i]) / (order + 1);
  return 1;
}

/* Find where the companion is at the end of the run's step, to y, moved by what the run leaves out, and further away by
   what round-off of the flow may do; 0 where that has no bound. */
static int move_companion(hs_view *v, const hs_companion *c) {
  const hs_record *const run = &v->s->run;
  const double *const x = recorded_row(run, c->row + 1);
  const hs_formula *const flow = &v->f->flow;
  v->rounded[0] = rounded(run->times[c->row + 1], 0.0, 0.0);
  for (int i = 0; i < v->n; i++) v->rounded[1 + i] = rounded(x[i], 0.0, 0.0);
  rounded_operations(v->f, flow->first, flow->last, first_register(v), v->rounded);
  if (!leave_out(v, c)) return 0;
  for (int i = 0; i < v->n; i++) {
    const double noise = c->h * v->rounded[flow->result[i]].off;
    if (!hs_finite(noise)) return 0;
    c->moved[i] += c->y[i] + c->moved[i] < 0 ? -noise : noise;
    c->y[i] += x[i] + c->moved[i];
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
    companion_at(v, c, *s, c->y);
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
  hs_companion c = {.p = s->timeline->data, .x = v->x, .y = v->y, .moved = v->z, .lines = v->lines};
  int64_t followed = 0;
  c.t = run->times[0];
  c.order = FEWEST < s->order ? FEWEST : s->order;
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
      c.h = h, c.row = h > 0 ? row - 1 : -1;
      if ((h > 0 || jumps) && !expand_companion(v, &c)) return 0;
      if (!(h > 0)) copy(c.y, c.x, c.table->dimension);
      else if (!move_companion(v, &c)) return 0;
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
