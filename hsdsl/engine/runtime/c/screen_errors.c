/* How wrong a recorded run is, by the finer one or by its shadow run, which steps by Taylor series or by corrections of
   the recorded steps. See hsdsl/engine/simulate/verdict: errors, shadow. */

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
  v->range[0] = range_sum(t - unit * fabs(t), t + unit * fabs(t));
  for (int i = 0; i < v->n; i++) {
    const double wide = unit * fabs(x[i]) + before[v->table->state[i]];
    v->range[1 + i] = range_sum(x[i] - wide, x[i] + wide);
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

/* Where the shadow run is at the start of a step of the run, and how far it is from there on: coefficients 1 to
   order + 1 in shares of the step, and by how much it has moved at the end besides. */
typedef struct {
  const hs_mode *table;
  const double *p;
  double *x, *y, *moved, *roundoff, *lines;
  double t, h;
  int64_t row; /* where the run's step begins */
  int order, begins; /* whether an arc begins there */
} hs_shadow;

enum { NODES = 4, POWERS = 6, SMALL = 3 /* states, kept in registers */ };

/* How much the polynomial of the run's step fails the flow at the share s, begun at x and moved by `bulge` u, its slope
   by `rate` u. */
HS_INLINE int defect_at(hs_view *v, const hs_shadow *c, int n, double s, const double *x, double bulge, double rate,
                        const double *restrict u, double *restrict g) {
  const int d = v->s->run.degree, w = v->s->run.width;
  const double *coefficient = recorded_piece(&v->s->run, c->row) + (d - 1) * w;
  const double *const roundoff = c->roundoff, h = c->h;
  double *restrict const at = v->z, *restrict const slope = v->slope;
  HS_SIMD
  for (int i = 0; i < n; i++) at[i] = s * coefficient[i], slope[i] = d * coefficient[i];
  for (int k = d - 1; k > 0; k--) {
    const double power = k;
    coefficient -= w;
    HS_SIMD
    for (int i = 0; i < n; i++) {
      at[i] = s * (coefficient[i] + at[i]);
      slope[i] = power * coefficient[i] + s * slope[i];
    }
  }
  HS_SIMD
  for (int i = 0; i < n; i++) {
    at[i] = x[i] + at[i] + bulge * u[i];
    slope[i] += rate * u[i];
  }
  if (c->table->flow(c->p, c->t + s * h, at, g)) return 1;
  HS_SIMD
  for (int i = 0; i < n; i++) g[i] = h * g[i] - slope[i] + roundoff[i];
  return 0;
}

/* Factor 1 - a h J, J being the derivatives of the flow where the run's step ends. A dense matrix is inverted:
   products need not wait for each other as the unknowns of a triangle do. */
HS_INLINE int factor_correction(hs_view *v, const hs_shadow *c, int n) {
  const double *const x = recorded_row(&v->s->run, c->row + 1), away = -v->s->correction->pole * c->h;
  const hs_sparse *const rows = &c->table->jacobian;
  const hs_elimination *const of = n > SMALL ? c->table->elimination : 0;
  double *const a = v->factors, *const unit = v->z, *const sizes = v->slope;
  if (hs_call(&rows->values, c->p, c->t + c->h, x, v->derivatives)) return 1;
  const int size = of ? of->size : n * n;
  for (int i = 0; i < size; i++) a[i] = 0.0;
  for (int i = 0; i < rows->count; i++) a[of ? of->place[i] : rows->place[i]] = away * v->derivatives[i];
  for (int i = 0; i < n; i++) a[of ? of->diagonal[i] : i * n + i] += 1.0;
  if (of) return !sparse_factored(n, of, a, v->z);
  for (int i = 0; i < n; i++) sizes[i] = fabs(x[i]), unit[i] = 0.0;
  if (!factored(n, a, v->exchanged, sizes, 0)) return 1;
  for (int i = 0; i < n; i++) {
    unit[i] = 1.0;
    solve(n, a, v->exchanged, unit, v->inverse + i * n);
    unit[i] = 0.0;
  }
  return 0;
}

/* The product of the inverse and a vector. */
HS_INLINE void solve_correction(hs_view *v, const hs_shadow *c, int n, const double *restrict right,
                                double *restrict d) {
  const double *restrict const w = v->inverse;
  if (n > SMALL && c->table->elimination) {
    sparse_solve(n, c->table->elimination, v->factors, right, v->z, d);
    return;
  }
  for (int i = 0; i < n; i++) d[i] = w[i] * right[0];
  for (int j = 1; j < n; j++)
    for (int i = 0; i < n; i++) d[i] += w[j * n + i] * right[j];
}

HS_INLINE void weigh(int n, const double *weight, double *const *g, double *restrict sum) {
  const double *const a = g[0], *const b = g[1], *const c = g[2], *const d = g[3];
  HS_SIMD
  for (int i = 0; i < n; i++) sum[i] = weight[0] * a[i] + weight[1] * b[i] + weight[2] * c[i] + weight[3] * d[i];
}

HS_INLINE int correct_in(hs_view *v, hs_shadow *c, int n, double *restrict apart) {
  const hs_correction *const known = v->s->correction;
  const double *const start = recorded_row(&v->s->run, c->row), *const end = recorded_row(&v->s->run, c->row + 1);
  double *g[NODES], *const u = v->defects + NODES * v->s->run.width, few[2][SMALL];
  double *restrict const right = n > SMALL ? v->slope : few[0], *restrict const d = n > SMALL ? c->y : few[1];
  for (int k = 0; k < NODES; k++) g[k] = v->defects + k * v->s->run.width;
  for (int i = 0; i < n; i++) c->roundoff[i] = copysign(c->roundoff[i], c->x[i] - start[i]), u[i] = 0.0;
  if (factor_correction(v, c, n) || defect_at(v, c, n, known->inside, start, 0.0, 0.0, u, g[0])) return 0;
  solve_correction(v, c, n, g[0], u);
  for (int i = 0; i < n; i++) apart[i] = fabs(c->x[i] - start[i] + known->pole * u[i]);
  for (int k = 0; k < NODES; k++)
    if (defect_at(v, c, n, known->node[k], c->x, known->bulge[k], known->slope[k], u, g[k])) return 0;
  weigh(n, known->weight[POWERS - 1], g, right);
  for (int m = POWERS - 2; m >= 0; m--) {
    solve_correction(v, c, n, right, d);
    weigh(n, known->weight[m], g, right);
    for (int i = 0; i < n; i++) right[i] += d[i];
  }
  solve_correction(v, c, n, right, d);
  for (int i = 0; i < n; i++) c->y[i] = end[i] + ((c->x[i] - start[i]) + d[i]);
  return 1;
}

static int correct_2(hs_view *v, hs_shadow *c, double *apart) {
  return correct_in(v, c, 2, apart);
}

static int correct_3(hs_view *v, hs_shadow *c, double *apart) {
  return correct_in(v, c, 3, apart);
}

static int correct_n(hs_view *v, hs_shadow *c, double *apart) {
  return correct_in(v, c, v->n, apart);
}

/* Find where the shadow run is at the end of the run's step, to y, further away by `roundoff`, which goes on as the
   flow does; and how far it is from the run inside, to `apart`. */
static int correct_step(hs_view *v, hs_shadow *c, double *apart) {
  return (v->n == 2 ? correct_2 : v->n == 3 ? correct_3 : correct_n)(v, c, apart);
}

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
    if (c->table->values(c->p, c->t + s, c->y, v->values)) return 0;
    if (hs_call(&c->table->rates[k], c->p, c->t + s, c->y, &rate)) return 0;
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
