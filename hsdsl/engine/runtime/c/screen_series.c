/* Steps of a shadow run by Taylor series. See hsdsl/engine/simulate/verdict/shadow_run.py. */

#include "screen_view.h"

#define FEWEST 3     /* the order of the shadow run's first series */
#define MORE_TERMS 2 /* by how much it grows where that is not enough */

/* Turn the shadow run's coefficients into differences from those of the run's step, and find how far it is away at the
   end, to y; whether the last ones are so small that all steps together leave out little. */
static int take_differences(const hs_view *v, const hs_shadow *c) {
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

/* Expand the shadow run along the run's step. */
static int expand_shadow(const hs_view *v, hs_shadow *c) {
  for (;; c->order = c->order + MORE_TERMS < v->s->order ? c->order + MORE_TERMS : v->s->order) {
    if (!c->table->series || c->table->series(c->p, c->order, c->t, c->x, c->lines)) return 0;
    if (take_differences(v, c) || c->order == v->s->order) return 1;
  }
}

/* What the run's polynomial X leaves out by the end of its step, to `moved`, where `rounded` holds the flow there.

   With d = X' - f(X) at the end and J the derivatives of f, e' = J e - d for what is left out, e: it is close to
   -h d/order, and what follows from J e is close to h (J e)/(order + 1). */
static int leave_out(hs_view *v, const hs_shadow *c) {
  const hs_record *const run = &v->s->run;
  const double *const x = recorded_row(run, c->row + 1), *const piece = recorded_piece(run, c->row);
  const int order = run->degree + 1;
  double *const e = c->moved, *const beyond = v->allowance, *const there = v->mode_error;
  for (int i = 0; i < v->n; i++) {
    double slope = 0.0;
    for (int k = v->degree - 1; k >= 0; k--) slope += (k + 1) * piece[k * run->width + i];
    there[i] = v->rounded[v->f->flow.result[i]].value;
    e[i] = (c->h * there[i] - slope) / order;
    beyond[i] = x[i] + e[i];
  }
  if (v->table->flow(v->p, run->times[c->row + 1], beyond, v->slope)) return 0;
  for (int i = 0; i < v->n; i++) e[i] += c->h * (v->slope[i] - there[i]) / (order + 1);
  return 1;
}

/* Find where the shadow run is at the end of the run's step, to y, moved by what the run leaves out, and further away
   by what round-off of the flow may do, `roundoff`. */
static int expand_step(hs_view *v, hs_shadow *c) {
  take_step(v, c->row);
  const double *const x = recorded_row(&v->s->run, c->row + 1);
  if (!expand_shadow(v, c) || !leave_out(v, c)) return 0;
  for (int i = 0; i < v->n; i++) {
    const double away = c->y[i] + c->moved[i];
    c->y[i] = x[i] + (away + copysign(c->roundoff[i], away));
  }
  return 1;
}
