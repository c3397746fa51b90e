/* Guards that hold the state, and motion along them.
   See hsdsl/engine/simulate/contact.py, which defines holding and pushes.
   A status is 0, or RAISED where a routine has no value. */

#define ZERO_UNITS 16
#define FURTHER 16
#define MOST_CORRECTIONS_TO_GUARD 4
#define MOST_ROUNDS 60
#define MOST_LEAP 4096

typedef int hs_taken(hs_run *run, int k, hs_time t);
typedef int hs_round(hs_run *run, hs_taken *taken, hs_time t);

/* The size that a state has had, or that of the numbers that it was computed from on entry. */
static hs_real state_size(const hs_run *run, int s) { return hs_max(run->sizes.scales[s], fabs(run->sizes.scale[s])); }

/* For each state the size that its flow has had, to run->contact.flow_sizes; `slope` is the flow. */
static int flow_sizes(hs_run *run, hs_time t, const hs_real *x, const hs_real *slope) {
  const int n = run->here.dimension;
  const hs_sparse *const rows = &run->here.table->jacobian;
  if (hs_call(&rows->values, run->here.p, t, x, run->contact.jacobian)) return RAISED;
  for (int i = 0; i < n; i++) run->contact.flow_sizes[i] = fabs(slope[i]);
  for (int k = 0; k < rows->count; k++) {
    hs_real *const size = &run->contact.flow_sizes[rows->place[k] / n];
    *size = *size + fabs(run->contact.jacobian[k]) * state_size(run, rows->place[k] % n);
  }
  return 0;
}

/* The entry of a sparse matrix, whose places rise, at a place; 0.0 where it has none. */
static hs_real entry_at(const hs_sparse *rows, const hs_real *values, int place) {
  int low = 0, high = rows->count;
  while (low < high) {
    const int middle = (low + high) / 2;
    if (rows->place[middle] < place)
      low = middle + 1;
    else
      high = middle;
  }
  return low < rows->count && rows->place[low] == place ? values[low] : 0.0;
}

/* The sizes that the flow gives the states within the run, from a start in a mode with motion along guards, to
   run->sizes.scale. */
static void start_sizes(hs_run *run, int mode, hs_time t) {
  const hs_mode *const table = &run->model->mode[mode];
  const hs_sparse *const rows = &table->jacobian;
  const int n = table->dimension;
  const hs_real *const p = segment_data(run, segment_at(run->task->timeline, t));
  hs_real back = 0.0, all = 0.0, *const first = run->at, *const moved = run->near;
  if (table->held < 0 || table->flow(p, t, run->x, first)) return;
  if (hs_call(&rows->values, p, t, run->x, run->contact.jacobian)) return;
  for (int i = 0; i < n; i++) moved[i] = 0.0;
  for (int e = 0; e < rows->count; e++) {
    const int i = rows->place[e] / n, k = rows->place[e] % n;
    moved[i] = moved[i] + fabs(run->contact.jacobian[e]) * fabs(entry_at(rows, run->contact.jacobian, k * n + i));
  }
  for (int i = 0; i < n; i++) back = hs_max(back, moved[i]), moved[i] = 0.0;
  const hs_real time = run->until / (1 + run->until * sqrt(back)); /* in which motion turns back */
  for (int i = 0; i < n; i++) first[i] = hs_max(fabs(run->x[i]), time * fabs(first[i]));
  for (int e = 0; e < rows->count; e++) {
    hs_real *const size = &moved[rows->place[e] / n];
    *size = *size + fabs(run->contact.jacobian[e]) * first[rows->place[e] % n];
  }
  for (int i = 0; i < n; i++) all = all + (moved[i] = hs_max(first[i], time * moved[i]));
  for (int i = 0; i < n && hs_finite(all); i++) run->sizes.scale[i] = moved[i];
}

/* What the reset of edge k, its branch for slow impacts, makes of a state, but for states that it counts with, to
   `out`. */
static int reset_but_counts(hs_run *run, int k, hs_time t, const hs_real *x, hs_real *out) {
  const hs_mode *const own = run->here.table;
  const hs_edge *const edge = &own->edge[k];
  const hs_edge *const by = edge->branched ? &run->model->mode[own->held].edge[k] : edge;
  if (hs_changed(by, &by->reset, run->here.p, t, x, x, out)) return RAISED;
  for (int i = 0; i < edge->counts; i++) out[edge->count[i]] = x[edge->count[i]];
  return 0;
}

/* Whether the reset of edge k leaves the state where it is. */
static int keeps(hs_run *run, hs_time t, const hs_real *x, int k) {
  const hs_mode_state *here = &run->here;
  int still = 1;
  if (reset_but_counts(run, k, t, x, run->event.after)) return RAISED;
  for (int s = 0; s < here->dimension; s++)
    still &= fabs(run->event.after[s] - x[s]) <= SAME_UNITS * HS_UNIT * state_size(run, s);
  return still;
}

/* Number the marks of walls anew where a table has `more` edges than the one before. */
static void move_walls(int *marks, const hs_mode *from, int more) {
  if (more > 0)
    for (int j = from->surfaces; j-- > from->edges;) marks[j + more] = marks[j];
  else if (more < 0)
    for (int j = from->edges; j < from->surfaces; j++) marks[j + more] = marks[j];
  for (int j = 0; j < more; j++) marks[from->edges + j] = 0;
}

/* Count the surfaces that the state is on. */
static void count_active(hs_run *run) {
  run->here.active = 0;
  for (int j = 0; j < run->here.table->surfaces; j++) run->here.active += run->surfaces.active[j];
}

/* The number of a contact of the state's mode: 0, HS_LOOKED_AT or HS_HELD. */
static hs_real *level_of(const hs_run *run, int contact) { return &run->contact.p[run->model->data + contact]; }

/* Bind routines to the mode's motions along guards: of those edges `kept`, the pushes are looked at, and those `held`
   hold the state. `held` may be 0 for none. */
static void bind_contacts(hs_run *run, const int *held, const int *kept) {
  hs_mode_state *const here = &run->here;
  const hs_mode *const own = &run->model->mode[here->mode];
  if (here->p != run->contact.p) run->contact.own_p = here->p;
  for (int i = 0; i < run->model->data; i++) run->contact.p[i] = run->contact.own_p[i];
  for (int i = 0; i < run->model->contacts; i++) *level_of(run, i) = 0.0;
  for (int k = 0; k < own->edges; k++)
    if (own->edge[k].contact >= 0)
      *level_of(run, own->edge[k].contact) = held && held[k] ? HS_HELD : kept[k] ? HS_LOOKED_AT : 0.0;
  here->table = &run->model->mode[own->held];
  here->p = run->contact.p;
}

/* Bind them to the mode itself again. */
static void bind_mode(hs_run *run) {
  run->here.table = &run->model->mode[run->here.mode];
  run->here.p = run->contact.own_p;
}

/* The flow at a point that the guards of edges `touched`, 0 for none, without k and with it, leave. */
static int flow_beside(hs_run *run, int k, int with, hs_time t, const hs_real *x, const int *touched, hs_real *flow) {
  const hs_mode *const own = run->here.table;
  int count = 0;
  for (int j = 0; j < own->edges; j++) count += run->contact.others[j] = j == k ? with : touched && touched[j];
  if (count) bind_contacts(run, run->contact.others, run->contact.others);
  const int raised = run->here.table->flow(run->here.p, t, x, flow);
  if (count) bind_mode(run);
  return raised;
}

/* Where the flow presses a state, by what the guard of edge k would take away of the flow that those of `touched`, 0
   for none, leave: off by round-off where the reset of edge k changes it, to run->event.after. */
static int pressed(hs_run *run, int k, hs_time t, const hs_real *x, const int *touched) {
  const hs_edge *const edge = &run->here.table->edge[k];
  const int n = run->here.dimension;
  hs_real after = 0.0, *const slope = run->at, *const left = run->event.after;
  if (flow_beside(run, k, 0, t, x, touched, slope)) return RAISED;
  if (edge->contact >= 0) {
    if (flow_beside(run, k, 1, t, x, touched, left)) return RAISED;
    for (int s = 0; s < n; s++) slope[s] = slope[s] - left[s];
  }
  for (int i = 0; i < edge->changes; i++) {
    const int s = edge->change[i];
    if (slope[s] != 0) after = hs_max(after, ZERO_UNITS * HS_UNIT * state_size(run, s) / fabs(slope[s]));
  }
  if (!(after > 0)) after = HS_UNIT * run->until; /* where these states have been zero only */
  for (int s = 0; s < n; s++) run->event.after[s] = x[s] + after * slope[s];
  return 0;
}

/* Whether the `if` of edge k, of the state's mode, holds at a point, or next along the flow that others leave. */
static int is_possible(hs_run *run, int k, hs_time t, const hs_real *x, const int *touched) {
  const int now = condition(run, k, t, x);
  if (now || !run->here.table->edge[k].conditional) return now == 1;
  return !pressed(run, k, t, x, touched) && condition(run, k, t, run->event.after) == 1;
}

/* Whether the `if` of an edge that leads back, of a surface that the state is on, holds next along the flow. */
static int holds_next(hs_run *run, int k, hs_time t, const hs_real *x) {
  const hs_mode_state *here = &run->here;
  const hs_edge *edge = &here->table->edge[k];
  const int returns = edge->target == here->mode && here->dimension && here->dimension == here->table->dimension;
  return returns && is_possible(run, k, t, x, 0);
}

/* Of the edges marked in `marks`, keep those whose guards hold the state where the flow presses on them; return how
   many. */
static int keeping(hs_run *run, hs_time t, const hs_real *x, int *marks) {
  const hs_mode_state *here = &run->here;
  int count = 0, sized = 0; /* sized: whether the flow's sizes are known, -1 where they have no value */
  for (int k = 0; k < here->table->edges; k++) {
    const hs_edge *edge = &here->table->edge[k];
    const int marked = marks[k];
    marks[k] = 0;
    if (!marked || edge->contact < 0 || !run->task->settings.contacts || keeps(run, t, x, k) != 1) continue;
    if (edge->push_order == 2) {
      if (!sized) sized = here->table->flow(here->p, t, x, run->end) || flow_sizes(run, t, x, run->end) ? -1 : 1;
      const hs_sparse *const row = &here->table->gradients[k];
      hs_real rate, size = 0.0;
      if (sized < 0 || hs_call(&row->values, here->p, t, x, run->gradient)) continue;
      if (hs_call(&here->table->rates[k], here->p, t, x, &rate)) continue;
      for (int i = 0; i < row->count; i++)
        size = size + fabs(run->gradient[i]) * (row->place[i] ? run->contact.flow_sizes[row->place[i] - 1] : 1.0);
      if (!(fabs(rate) <= ZERO_UNITS * HS_UNIT * size)) continue; /* the flow is not tangent to it, to round-off */
    }
    count += marks[k] = 1;
  }
  return count;
}

/* Whether the push on the guard of edge k, which is looked at and zero now, is first negative where the flow makes it
   differ from zero. */
static int lifts_next(hs_run *run, hs_time from, const hs_real *x, int k) {
  hs_real r, noise, *const y = run->event.after;
  hs_time t = from;
  copy(y, x, run->here.dimension);
  for (hs_real after = HS_UNIT * run->until; from + after < segment_end(run); after = after * FURTHER) {
    const hs_time time = from + after;
    if (run->here.table->flow(run->here.p, t, y, run->at)) return 0;
    for (int s = 0; s < run->here.dimension; s++) y[s] = y[s] + (time - t) * run->at[s];
    t = time;
    if (surface(run, k, t, y, &r) || roundoff_bound(run, k, t, y, 0, &noise)) return 0;
    if (fabs(r) > noise) return r > 0;
  }
  return 0;
}

/* Of the edges `kept`, mark those in `pushed` that the flow presses on while those `held` hold the state: 1 where they
   are the same, else 0; RAISED where these have no flow together. */
static int pushes(hs_run *run, hs_time t, const hs_real *x, const int *held, const int *kept, int *pushed) {
  const int edges = run->here.table->edges;
  int same = 1, apart = 0;
  bind_contacts(run, held, kept);
  const hs_mode *const table = run->here.table;
  const int raised =
      table->values(run->here.p, t, x, run->surfaces.values) || magnitudes_at(run, t, x, run->surfaces.magnitudes);
  for (int k = 0; k < edges; k++) {
    const int active = run->surfaces.active[k];
    pushed[k] = 0;
    if (kept[k] && !raised) {
      run->surfaces.active[k] = 0;
      const hs_real r = run->surfaces.values[k], noise = bound_from(run, run->surfaces.magnitudes, k, t, x, 0);
      pushed[k] = r < -noise || (r <= noise && !lifts_next(run, t, x, k));
      run->surfaces.active[k] = active;
      apart |= r != r;
    }
  }
  bind_contacts(run, 0, kept);
  for (int k = 0; k < edges; k++) pushed[k] += pushed[k] && condition(run, k, t, x) == 1; /* 2: surely */
  bind_mode(run);
  for (int k = 0; k < edges; k++) {
    pushed[k] = pushed[k] == 2 || (pushed[k] && is_possible(run, k, t, x, held));
    same &= !pushed[k] == !held[k];
  }
  return apart ? RAISED : same;
}

/* Those of the edges `kept`, `count` of them, that hold the state together, to `held`; 0 where that is not one choice. */
static int pressing(hs_run *run, hs_time t, const hs_real *x, const int *kept, int count, int *held, int *pushed) {
  const int edges = run->here.table->edges;
  for (int k = 0; k < edges; k++) held[k] = kept[k];
  for (int i = 0; i < count + 2; i++) {
    const int same = pushes(run, t, x, held, kept, pushed);
    if (same == RAISED) return 0;
    for (int k = 0; k < edges; k++) held[k] = pushed[k];
    if (same || count == 1) return 1;
  }
  return 0;
}

/* Be in contact with the guards of the edges `held`. */
static void in_contact(hs_run *run, const int *held) {
  const hs_mode *const own = run->here.table;
  bind_contacts(run, held, held);
  for (int k = 0; k < own->edges; k++)
    if (held[k]) run->surfaces.active[k] = 0;
  run->here.emerging = 0;
  move_walls(run->surfaces.active, own, run->here.table->edges - own->edges);
  count_active(run);
}

/* Whether the guards of the edges `held`, which hold the state together, have a flow. */
static int flows(hs_run *run, const int *held) {
  int is = 1;
  bind_contacts(run, held, held);
  if (!run->here.table->flow(run->here.p, run->here.t, run->x, run->at))
    for (int s = 0; s < run->here.dimension; s++) is &= run->at[s] == run->at[s];
  bind_mode(run);
  return is;
}

/* Be in contact with every guard that holds the state: GOES_ON, or a stop where they have no one motion. */
static int contact_at(hs_run *run) {
  hs_mode_state *const here = &run->here;
  const hs_mode *const own = here->table;
  int *const kept = run->contact.kept, *const held = run->contact.held, any = 0, first = -1;
  if (!here->active || own->held < 0 || here->dimension != own->dimension || !here->dimension) return GOES_ON;
  for (int k = 0; k < own->edges; k++) kept[k] = run->surfaces.active[k];
  const int count = keeping(run, here->t, run->x, kept);
  if (!count) return GOES_ON;
  const int one = pressing(run, here->t, run->x, kept, count, held, run->surfaces.beyond);
  for (int k = 0; k < own->edges; k++) any += held[k] != 0;
  if (!one || (any > 1 && !flows(run, held))) {
    for (int k = own->edges; k-- > 0;) first = kept[k] ? k : first;
    note(run, HS_COUPLED, first, 0, here->t, here->t);
    return stopped(run, HS_ACCUMULATED, here->t);
  }
  if (any) in_contact(run, held);
  return GOES_ON;
}

/* Whether surface j of the present table ends a contact that holds the state. */
static int releases(const hs_run *run, int j) {
  const hs_mode *const table = run->here.table;
  return j < table->edges && table->edge[j].releases >= 0 && *level_of(run, table->edge[j].releases) == HS_HELD;
}

/* Whether surface j of the present table is the push on a guard, which is off by the sizes that states have had. */
static int is_push(const hs_run *run, int j) {
  const hs_mode *const table = run->here.table;
  return j < table->edges && table->edge[j].releases >= 0 && *level_of(run, table->edge[j].releases) != 0;
}

/* Whether the state is in contact with the guard of edge k of its mode. */
static int in_touch(const hs_run *run, int k) {
  return k < run->model->mode[run->here.mode].edges && releases(run, k);
}

/* End all contacts. */
static void after_contact(hs_run *run) {
  hs_mode_state *const here = &run->here;
  const hs_mode *const held = here->table, *const own = &run->model->mode[here->mode];
  for (int k = 0; k < own->edges; k++)
    if (releases(run, k)) run->surfaces.active[k] = 1;
  move_walls(run->surfaces.active, held, own->edges - held->edges);
  bind_mode(run);
  count_active(run);
}

/* Move t, where surface j of the contact rises through zero, to after the end of a part of an `if` in contact, and the
   state run->x to run->z: whether an `if` does not hold there. Surface j is above round-off there, if all hold. */
static int past_end(hs_run *run, int j, hs_time *t) {
  const hs_mode_state *here = &run->here;
  const hs_mode *const held = here->table, *const own = &run->model->mode[here->mode];
  const hs_time from = *t;
  const hs_real most = sqrt((hs_real)HS_UNIT) * run->until; /* further on a line is no motion */
  hs_real r, noise;
  int of = 0, raised = held->flow(here->p, from, run->x, run->end);
  while (own->edge[of].contact != held->edge[j].releases) of++;
  for (int k = 0; k < own->edges; k++) run->contact.kept[k] = in_touch(run, k);
  for (hs_real after = HS_UNIT * run->until; !raised; after = after * 2) {
    int holds = 1;
    *t = earlier(from + after, segment_end(run));
    for (int s = 0; s < here->dimension; s++) run->z[s] = run->x[s] + (*t - from) * run->end[s];
    bind_mode(run);
    for (int k = 0; k < own->edges && holds; k++)
      holds = !run->contact.kept[k] || is_possible(run, k, *t, run->z, run->contact.kept);
    raised = holds && pressed(run, of, *t, run->z, run->contact.kept);
    bind_contacts(run, run->contact.kept, run->contact.kept);
    if (!holds) return 1;
    raised = raised || surface(run, j, *t, run->event.after, &r) || roundoff_bound(run, j, *t, run->z, 0, &noise);
    if (!raised && (r > noise || !(after < most && *t < segment_end(run)))) return 0;
  }
  *t = from;
  copy(run->z, run->x, here->dimension);
  return 1;
}

static hs_real accelerated(hs_real a, hs_real b, hs_real c) {
  const hs_real bend = c - 2 * b + a;
  const int slow = bend != 0 && fabs(c - b) <= fabs(b - a) && fabs(c - b) <= MOST_LEAP * fabs(bend);
  return slow ? a - (b - a) / bend * (b - a) : c;
}

/* Whether each state moves no further from a to b than from c to d. */
static int shorter(const hs_real *a, const hs_real *b, const hs_real *c, const hs_real *d, int n) {
  for (int s = 0; s < n; s++)
    if (!(fabs(b[s] - a[s]) <= fabs(d[s] - c[s]))) return 0;
  return 1;
}

/* Let what has no digits left be zero. */
static void without_nothing(hs_real *x, int n) {
  for (int s = 0; s < n; s++) x[s] = fabs(x[s]) > HS_NOTHING ? x[s] : x[s] - x[s];
}

/* The point that repeated resets of edge k run to from run->z, to run->z. */
static int fixed_point(hs_run *run, int k, hs_time t) {
  const hs_mode_state *here = &run->here;
  const int n = here->dimension;
  hs_real *const x = run->z, *const one = run->event.after, *const two = run->at, *const after = run->near;
  for (int i = 0; i < MOST_ROUNDS; i++) {
    if (reset_but_counts(run, k, t, x, one)) return RAISED;
    if (same_state(one, x, n)) break;
    if (reset_but_counts(run, k, t, one, two)) return RAISED;
    for (int s = 0; s < n; s++) x[s] = accelerated(x[s], one[s], two[s]);
    if (reset_but_counts(run, k, t, x, after)) return RAISED;
    copy(x, shorter(x, after, one, two, n) ? after : two, n);
    without_nothing(x, n);
  }
  return 0;
}

/* run->z taken to the guard of edge k, which is near, as near as numbers are, each state in proportion to its scale. */
static int onto_guard(hs_run *run, int k, hs_time t) {
  const int n = run->here.dimension;
  hs_real *const x = run->z, *const weights = run->at, *const nearer = run->event.after;
  hs_real r, left;
  if (surface(run, k, t, x, &r)) return RAISED;
  for (int i = 0; i < MOST_CORRECTIONS_TO_GUARD; i++) {
    if (gradient_of(run, k, t, x)) return RAISED;
    hs_real across = r * 0;
    for (int s = 0; s < n; s++) {
      weights[s] = run->gradient[s + 1] * state_size(run, s) * state_size(run, s);
      across = across + run->gradient[s + 1] * weights[s];
    }
    if (!(across > 0)) break;
    for (int s = 0; s < n; s++) nearer[s] = x[s] - r / across * weights[s];
    if (surface(run, k, t, nearer, &left)) return RAISED;
    if (!(fabs(left) < fabs(r))) break;
    copy(x, nearer, n);
    r = left;
  }
  return 0;
}

/* run->z taken by each edge of the tail, in turn. */
static int by_each(hs_run *run, hs_taken *taken, hs_time t) {
  for (int k = 0; k < run->here.table->edges; k++)
    if (run->zeno.tail[k] && taken(run, k, t)) return RAISED;
  return 0;
}

/* The point that run->z runs to by repeated `rounds`, to run->z. */
static int run_to(hs_run *run, hs_round *rounds, hs_taken *taken, hs_time t) {
  const int n = run->here.dimension;
  hs_real *const x = run->z, *const first = run->zeno.turn, *const one = first + n;
  hs_real *const two = run->nearby;
  for (int i = 0; i < MOST_ROUNDS; i++) {
    copy(first, x, n);
    if (rounds(run, taken, t)) return RAISED;
    if (same_state(first, x, n)) break;
    copy(one, x, n);
    if (rounds(run, taken, t)) return RAISED;
    copy(two, x, n);
    for (int s = 0; s < n; s++) x[s] = first[s] = accelerated(first[s], one[s], two[s]);
    if (rounds(run, taken, t)) return RAISED;
    if (!shorter(first, x, one, two, n)) copy(x, two, n);
    without_nothing(x, n);
  }
  return 0;
}

/* The point that run->z runs to, to run->z, which the edges of the tail, `count` of them, in turn take to what one of
   them keeps. */
static int in_turn(hs_run *run, hs_taken *taken, int count, hs_time t) {
  return count == 1 ? by_each(run, taken, t) : run_to(run, by_each, taken, t);
}

/* Be in the mode itself again at t, the state x without what steps along its guards were off by: they may hold it
   again. It stays on that of the edge that it has `reached`, -1 for none. It is off them by the round-off of what it has
   ever been computed from. */
static void be_held_exactly(hs_run *run, hs_time t, hs_real *x, int reached) {
  const hs_mode_state *here = &run->here;
  const int edges = run->model->mode[here->mode].edges;
  int count = 0, held = 1;
  run->contact.still = same_state(run->contact.began, x, here->dimension);
  for (int k = 0; k < edges; k++) count += run->contact.kept[k] = in_touch(run, k);
  after_contact(run);
  for (int s = 0; s < here->dimension; s++) run->sizes.scale[s] = joined(run->sizes.scale[s], run->sizes.scales[s]);
  for (int k = 0; k < here->table->surfaces; k++) run->zeno.tail[k] = k < edges && run->contact.kept[k];
  copy(run->z, x, here->dimension);
  if (reached >= 0) run->zeno.tail[reached] = 1;
  if (in_turn(run, onto_guard, count + (reached >= 0), t)) return;
  if (reached >= 0) run->zeno.tail[reached] = 0;
  if (in_turn(run, fixed_point, count, t)) return;
  for (int k = 0; k < edges && held; k++) held = !run->zeno.tail[k] || keeps(run, t, run->z, k) == 1;
  if (held) copy(x, run->z, here->dimension);
}
