/* Instances of an ensemble whose steps are made together, in lanes of vectors. Each place has one run under way, which
   is that of located.c up to where a flow needs steps; there it parks. Runs of one mode then live in lanes, where code
   that is compiled for the model (lane_step.c) makes their steps, until something happens. Runs on whose last step a
   surface is crossed wait until so many do that their crossings are found together. What that code does not decide is
   done by the functions for one run, on the same step. So a run has the bits that it has alone. */

#include "hs_lanes.h"

#define LOST 4 /* steps that lanes must make for one that they leave, */
#define MOST_LOST 4096 /* but for so many */
#define KEPT_OF_PLACE 64 /* rows, arcs and transitions that it keeps before it lets go: all places fit into a cache */

typedef struct hs_seat hs_seat;

/* Lanes, and who has them: 0 where a lane is free. */
typedef struct {
  hs_lanes l;
  int64_t columns, carried; /* numbers of a run and its step, and of those what a run brings along */
  int lanes, count;
  hs_seat *seat[HS_MOST_LANES];
} hs_row_of_lanes;

struct hs_seat {
  hs_ensemble *instance;
  hs_run run;
  hs_time limit;
  int32_t *mode; /* in which it may make a step in a lane; -1 where it may not, or is there */
  hs_row_of_lanes own; /* of one lane, with what the run brings along to the next one that it gets */
  int unwritten; /* whether a step was made whose end is no row yet */
};

static hs_seat *seat_of(const hs_team *team, int64_t i) { return (hs_seat *)team->seats + i; }

static void take_columns(hs_store *store, int64_t count, double **const *each) {
  for (; *each; each++) **each = numbers(store, count);
}

static void lay_out_lanes(hs_row_of_lanes *row, const hs_model *model, const hs_method *method, int64_t lanes,
                          hs_store *store) {
  const int64_t n = model->width, m = model->surfaces, order = method->order, most = (order + 1) * (order + 2) / 2;
  const hs_row_of_lanes none = {0};
  *row = none;
  hs_lanes *const l = &row->l;
  double **const one[] = {&l->t, &l->limit, &l->longest, &l->made, &l->since, &l->brief, 0};
  double **const states[] = {&l->x, &l->scales, &l->scale, &l->entered, &l->before, 0};
  double **const step[] = {&l->h, &l->t1, &l->first, 0};
  double **const surfaces[] = {&l->starts, &l->ends, &l->open, 0};
  double **const found[] = {&l->values, &l->weights, &l->shares, &l->slopes, &l->theta, &l->time, 0};
  double **const scratch[] = {&l->end, &l->error, &l->sizes, 0};
  const int64_t begun = store->used;
  take_columns(store, lanes, one);
  l->p = numbers(store, (int64_t)model->data * lanes);
  take_columns(store, n * lanes, states);
  l->known = numbers(store, (int64_t)model->states * lanes);
  l->standing = numbers(store, m * lanes);
  row->carried = (store->used - begun) / lanes;
  take_columns(store, lanes, step);
  l->z = numbers(store, n * lanes);
  take_columns(store, m * lanes, surfaces);
  l->piece = numbers(store, n * order * lanes);
  l->curves = numbers(store, m * (order + 1) * lanes);
  row->columns = (store->used - begun) / lanes;
  l->lines = numbers(store, (int64_t)model->lines * (order + 2) * lanes);
  l->gradient = numbers(store, (n + 1) * lanes);
  take_columns(store, n * lanes, scratch);
  take_columns(store, m * lanes, found);
  l->q = numbers(store, m * n * lanes);
  l->inverse = numbers(store, (most + lanes - 1) / lanes * lanes);
  if (store->numbers) fill_binomials(l->inverse, (int)order);
  for (int64_t i = 0; store->numbers && i < most; i++) l->inverse[i] = 1 / l->inverse[i];
  l->modes = model->mode;
  l->order = method->order;
  l->most = MOST_SHORT;
  row->lanes = (int)lanes;
}

int64_t hs_lane_memory(const hs_model *model, const hs_method *method, int64_t places, int32_t lanes) {
  hs_store store = {0, HS_MOST_LANES};
  hs_row_of_lanes row;
  for (int i = 0; i < 2; i++) lay_out_lanes(&row, model, method, lanes, &store);
  for (int64_t i = 0; i < places; i++) lay_out_lanes(&row, model, method, 1, &store);
  take(&store, places, sizeof(hs_seat));
  take(&store, model->flows, sizeof(int64_t));
  take(&store, places, sizeof(int32_t));
  return store.used;
}

/* Copy numbers of a lane. */
static void copy_lane(const hs_row_of_lanes *from, int lane, const hs_row_of_lanes *to, int other, int64_t count) {
  for (int64_t i = 0; i < count; i++) to->l.t[i * to->lanes + other] = from->l.t[i * from->lanes + lane];
}

static void gather(const double *column, hs_real *to, int n, int lanes, int lane) {
  for (int i = 0; i < n; i++) to[i] = column[i * lanes + lane];
}

static void scatter(const hs_real *from, double *column, int n, int lanes, int lane) {
  for (int i = 0; i < n; i++) column[i * lanes + lane] = from[i];
}

/* Lay ready what the run of a seat brings along into a lane. */
static void make_ready(hs_seat *seat) {
  hs_run *const run = &seat->run;
  const hs_lanes *const l = &seat->own.l;
  const int n = run->here.dimension, lane = 0, lanes = 1;
  l->t[lane] = run->here.t;
  l->limit[lane] = seat->limit;
  l->longest[lane] = run->control.tolerance > 0 ? run->control.largest : run->control.h;
  l->made[lane] = run->pace.made, l->since[lane] = run->pace.since, l->brief[lane] = run->pace.brief;
  scatter(run->here.p, l->p, run->model->data, lanes, lane);
  scatter(run->x, l->x, n, lanes, lane);
  scatter(run->sizes.scales, l->scales, n, lanes, lane);
  scatter(run->sizes.scale, l->scale, n, lanes, lane);
  scatter(run->entered, l->entered, n, lanes, lane);
  scatter(run->sizes.known, l->known, run->model->states, lanes, lane);
  for (int s = 0; s < n; s++) l->before[s * lanes + lane] = run->has_before ? span_size(run, &run->before, 1.0, s) : 0.0;
  for (int k = 0; k < run->here.table->surfaces; k++) l->standing[k * lanes + lane] = run->surfaces.active[k];
  *seat->mode = run->here.mode;
}

/* Put it there. */
static void enter_lane(hs_row_of_lanes *row, int lane, hs_seat *seat) {
  copy_lane(&seat->own, 0, row, lane, row->carried);
  row->seat[lane] = seat, row->count++;
  *seat->mode = -1;
}

/* Take it out of a lane, to bring it along into another one that makes steps in its mode. */
static void clear_lane(hs_row_of_lanes *row, int lane) {
  hs_seat *const seat = row->seat[lane];
  copy_lane(row, lane, &seat->own, 0, row->carried);
  row->seat[lane] = 0, row->count--;
  *seat->mode = seat->run.here.mode;
}

/* Have the run of a seat where a lane has taken it; `written`: its last row as well, if it has none. */
static void leave_lane(hs_row_of_lanes *row, int lane, hs_seat *seat, int written) {
  hs_run *const run = &seat->run;
  const hs_lanes *const l = &row->l;
  const int n = run->here.dimension, lanes = row->lanes;
  run->here.t = l->t[lane];
  run->pace.made = (int)l->made[lane], run->pace.since = l->since[lane];
  gather(l->x, run->x, n, lanes, lane);
  gather(l->scales, run->sizes.scales, n, lanes, lane);
  gather(l->scale, run->sizes.scale, n, lanes, lane);
  gather(l->entered, run->entered, n, lanes, lane);
  gather(l->known, run->sizes.known, run->model->states, lanes, lane);
  gather(l->before, run->before.largest, n, lanes, lane);
  run->has_before = run->before.sized = 1;
  run->here.active = run->surfaces.has_starts = 0;
  for (int k = 0; k < run->here.table->surfaces; k++)
    run->here.active += run->surfaces.active[k] = l->standing[k * lanes + lane] != 0;
  if (written && seat->unwritten) append(run, run->here.t, run->x, 0);
  if (written) seat->unwritten = 0;
  row->seat[lane] = 0, row->count--;
}

/* Put the step of a lane where try_series() writes its own. */
static void step_of_lane(const hs_row_of_lanes *row, int lane, hs_run *run) {
  const hs_lanes *const l = &row->l;
  const int n = run->here.dimension, w = run->width, lanes = row->lanes;
  begin_span(run, l->h[lane], l->t1[lane]);
  gather(l->z, run->z, n, lanes, lane);
  run->span.piece.degree = l->order;
  for (int m = 0; m < l->order; m++) gather(l->piece + m * n * lanes, run->span.piece.c + m * w, n, lanes, lane);
}

/* The same of surfaces along it: see series_curves(). */
static void curves_of_lane(const hs_row_of_lanes *row, int lane, hs_run *run) {
  const hs_lanes *const l = &row->l;
  const int count = run->here.table->surfaces, order = l->order, lanes = row->lanes;
  hs_curves *const curves = &run->curves;
  begin_curves(curves, count);
  gather(l->starts, run->surfaces.starts, count, lanes, lane);
  gather(l->ends, run->surfaces.ends, count, lanes, lane);
  for (int k = 0; k < count; k++) {
    hs_real *const c = coefficients_of(curves, 0, k);
    gather(l->curves + k * (order + 1) * lanes, c, order + 1, lanes, lane);
    c[0] = run->surfaces.starts[k];
    *degree_of(curves, 0, k) = degree_without_zeros(c, order);
    *off_of(curves, 0, k) = 0;
    curves->certain[k] = 1;
  }
}

/* Begin the next instance at a place: 0 where none is left. */
static int begin_next(hs_team *team, hs_seat *seat, int *outcome) {
  hs_ensemble *const e = seat->instance;
  if (team->next >= e->instances || *e->stop) return 0;
  e->done = team->next++;
  begin_instance(e);
  open_run(&seat->run, &e->task);
  seat->run.lanes.parks = 1;
  seat->run.lanes.bare = !e->samples && !e->slides && !e->watch.names;
  *outcome = begin_run(&seat->run, &e->task, 0.0);
  return 1;
}

/* Steps of a run in a mode that has no lanes, or whose surfaces bound its steps, or that emerges from them. */
static int steps_alone(const hs_team *team, const hs_run *run) {
  const int mode = run->here.mode;
  return !team->program->is_for[mode] || run->reach.step[mode] > 0 || run->here.emerging || team->lost[mode] > MOST_LOST;
}

/* Follow the run of a place from what a flow has come to until it may make a step in a lane; where it ends, the next
   instance. */
static void go_ahead(hs_team *team, hs_seat *seat, int outcome, int flows) {
  hs_run *const run = &seat->run;
  for (;;) {
    if (flows && outcome == GOES_ON && run->here.t < seat->limit && !steps_alone(team, run)) break;
    if (flows && outcome == GOES_ON) outcome = before_step(run, seat->limit);
    if (flows && outcome == GOES_ON) {
      outcome = one_step(run, run->here.dimension, seat->limit);
      continue;
    }
    if (flows) outcome = behind_flow(run, outcome);
    outcome = located(run, outcome);
    flows = outcome == PARKED;
    if (flows) {
      outcome = GOES_ON;
      seat->limit = segment_end(run);
      begin_following(run);
    } else if (!end_instance(seat->instance) || !begin_next(team, seat, &outcome)) {
      return;
    }
  }
  make_ready(seat);
}

/* Put the crossings that were found in a lane where crossings_along() writes its own; 0 where one may not count. */
static int crossings_of_lane(const hs_row_of_lanes *row, int lane, hs_run *run) {
  const hs_lanes *const l = &row->l;
  const hs_mode *const mode = run->here.table;
  const int n = run->here.dimension, lanes = row->lanes;
  for (int k = 0; k < mode->surfaces; k++) {
    hs_crossing *const crossing = &run->event.crossings[k];
    crossing->edge = -1;
    if (l->open[k * lanes + lane] == 0) continue;
    crossing->edge = k;
    crossing->theta = l->theta[k * lanes + lane], crossing->time = l->time[k * lanes + lane], crossing->depth = 0.0;
    gather(l->q + k * n * lanes, crossing->state, n, lanes, lane);
    if (k >= mode->edges) continue;
    if (mode->edge[k].strict || condition(run, k, crossing->time, crossing->state) != 1) return 0;
  }
  return 1;
}

/* What a crossing comes to that was found in a lane, or is found here. */
static int behind_crossing(const hs_row_of_lanes *row, int lane, hs_seat *seat) {
  hs_run *const run = &seat->run;
  const hs_lanes *const l = &row->l;
  const int landed = l->landed >> lane & 1 && crossings_of_lane(row, lane, run);
  if (!landed && seat->unwritten) append(run, run->here.t, run->x, 0);
  seat->unwritten = 0;
  if (!landed || !run->lanes.bare)
    step_of_lane(row, lane, run);
  else
    begin_span(run, l->h[lane], l->t1[lane]);
  if (!landed) return curves_of_lane(row, lane, run), behind_step(run);
  gather(l->sizes, run->span.largest, run->here.dimension, row->lanes, lane);
  run->span.sized = 1;
  return behind_event(run, first_event(run));
}

/* The edge that is crossed first in a lane, and when. */
static int first_of_lane(const hs_row_of_lanes *row, int lane, hs_time *t) {
  const int k = (int)row->l.first[lane];
  *t = row->l.time[k * row->lanes + lane];
  return k;
}

/* Whether a run may make the transition that is found in a lane there: see jump() and crowded(). */
static int may_jump(const hs_row_of_lanes *row, int lane) {
  hs_run *const run = &row->seat[lane]->run;
  hs_real flight, ratio;
  hs_time t;
  first_of_lane(row, lane, &t);
  if (limit_reached(run) || run->model->queues || run->task->settings.arcs) return 0;
  return run->written.jump < FREE || contraction(run, &flight, &ratio) || flown(run, t) > run->epsilon;
}

/* Whether a run may be in a Zeno tail that is to end: see ends_tail(). */
static int may_end(hs_run *run, hs_time t) {
  hs_real flight, ratio;
  if (!contraction(run, &flight, &ratio)) return run->written.jump >= FREE && !(flown(run, t) > run->epsilon);
  return !(flight * ratio / (1 - ratio) > hs_max(run->epsilon, 2 * tie(t)));
}

/* Go on behind a transition that was made in a lane. */
static void behind_jump(hs_team *team, hs_row_of_lanes *row, int lane) {
  hs_seat *const seat = row->seat[lane];
  hs_run *const run = &seat->run;
  hs_crossing *const chosen = &run->event.chosen;
  const hs_lanes *const l = &row->l;
  const int mode = run->here.mode, k = chosen->edge = first_of_lane(row, lane, &chosen->time);
  const hs_edge *const edge = &run->here.table->edge[k];
  chosen->theta = l->theta[k * row->lanes + lane], chosen->state = run->event.crossings[k].state;
  run->event.alternatives_count = 0;
  if (!run->lanes.bare) {
    gather(l->q + k * run->here.dimension * row->lanes, chosen->state, run->here.dimension, row->lanes, lane);
    gather(l->x, run->event.after, edge->target_dimension, row->lanes, lane);
    step_of_lane(row, lane, run);
    write_crossing(run, chosen);
  }
  record(run, chosen, chosen->time, run->event.after, 0);
  run->here = mode_at(run, edge->target, edge->target_dimension, chosen->time, 0);
  begin(run, HS_FLOW);
  gather(l->x, run->x, edge->target_dimension, row->lanes, lane);
  begin_following(run);
  comes_back(run, 1);
  seat->unwritten = 1;
  if (run->lanes.bare && !may_end(run, chosen->time) && !steps_alone(team, run)) {
    clear_lane(row, lane);
    return;
  }
  leave_lane(row, lane, seat, 1);
  go_ahead(team, seat, ends_tail(run, mode, k), 0);
}

/* Find the crossings of the runs that wait for it, make the transitions there, and follow these on. */
static void locate_together(hs_team *team, hs_row_of_lanes *waiting) {
  const int count = waiting->count;
  for (int lane = count; count && lane < waiting->lanes; lane++) copy_lane(waiting, 0, waiting, lane, waiting->columns);
  if (count) team->program->locate(&waiting->l);
  waiting->l.jumped &= (1 << count) - 1;
  for (int lane = 0; lane < count; lane++)
    if (waiting->l.jumped >> lane & 1 && !may_jump(waiting, lane)) waiting->l.jumped ^= 1 << lane;
  if (count && waiting->l.jumped) team->program->jump(&waiting->l);
  for (int lane = 0; lane < count; lane++) {
    hs_seat *const seat = waiting->seat[lane];
    if (waiting->l.jumped >> lane & 1) {
      team->located++, team->jumped++;
      behind_jump(team, waiting, lane);
      continue;
    }
    leave_lane(waiting, lane, seat, 0);
    team->located += waiting->l.landed >> lane & 1;
    go_ahead(team, seat, behind_crossing(waiting, lane, seat), 1);
  }
}

/* Let the run of a lane wait for its crossing. */
static void wait_for_crossing(hs_team *team, hs_row_of_lanes *row, int lane, hs_row_of_lanes *waiting) {
  if (waiting->count && waiting->l.mode != row->l.mode) locate_together(team, waiting);
  waiting->l.mode = row->l.mode, waiting->l.tolerance = row->l.tolerance, waiting->l.binomials = row->l.binomials;
  copy_lane(row, lane, waiting, waiting->count, row->columns);
  waiting->seat[waiting->count++] = row->seat[lane];
  row->seat[lane] = 0, row->count--;
  if (waiting->count == waiting->lanes) locate_together(team, waiting);
}

/* Whether the error of a lane's step, which is looked at here, forbids it. */
static int is_wrong_in_lane(const hs_row_of_lanes *row, int lane, hs_run *run) {
  const hs_lanes *const l = &row->l;
  const int n = run->here.dimension;
  run->here.t = l->t[lane];
  gather(l->x, run->x, n, row->lanes, lane);
  gather(l->z, run->z, n, row->lanes, lane);
  gather(l->error, run->step.error, n, row->lanes, lane);
  gather(l->scales, run->sizes.scales, n, row->lanes, lane);
  return is_too_wrong(run, l->h[lane]);
}

/* Go on at the end of a step in one lane, which stands on no surface: see go_to_ends(). */
static void pass_lane(const hs_row_of_lanes *row, int lane, int n) {
  const hs_lanes *const l = &row->l;
  const int lanes = row->lanes;
  l->t[lane] = l->t1[lane];
  for (int64_t i = lane; i < n * lanes; i += lanes) {
    double size = 0.0;
    for (int m = l->order - 1; m >= 0; m--) size = fabs(l->piece[m * n * lanes + i]) + size;
    l->before[i] = fabs(l->x[i]) + size;
    l->x[i] = l->z[i];
    l->scales[i] = hs_max(l->scales[i], fabs(l->z[i]));
  }
}

/* Go on behind the step of a lane. */
static void behind_lane(hs_team *team, hs_row_of_lanes *row, int lane, hs_row_of_lanes *waiting) {
  const hs_lanes *const l = &row->l;
  hs_seat *const seat = row->seat[lane];
  hs_run *const run = &seat->run;
  const int n = run->here.dimension, failed = l->failed >> lane & 1, crossed = l->crossed >> lane & 1;
  const int doubtful = l->doubtful >> lane & 1, wrong = doubtful && is_wrong_in_lane(row, lane, run);
  int standing = 0, outcome = GOES_ON;
  for (int k = 0; doubtful && k < run->here.table->surfaces; k++) standing |= l->standing[k * row->lanes + lane] != 0;
  team->lost[l->mode] += failed ? LOST : -1;
  team->failed += failed, team->doubtful += doubtful, team->crossed += crossed;
  if (crossed && !wrong) {
    wait_for_crossing(team, row, lane, waiting);
    return;
  }
  if (!failed && !wrong && !(doubtful && standing)) {
    seat->unwritten = run->lanes.bare;
    if (!run->lanes.bare) step_of_lane(row, lane, run), pass(run);
    if (doubtful) pass_lane(row, lane, n);
    if (l->t[lane] < seat->limit) return;
  }
  leave_lane(row, lane, seat, 1);
  if (failed)
    outcome = l->slow >> lane & 1 ? located_stuck(run, HS_SLOW) : one_step(run, n, seat->limit);
  else if (wrong)
    expands(run), outcome = behind(run, halved_series(run, n, seat->limit, l->h[lane] / 2, 1));
  else if (doubtful && run->here.t < l->t1[lane])
    step_of_lane(row, lane, run), outcome = pass(run);
  go_ahead(team, seat, outcome, 1);
}

/* How many runs may make a step in a mode. */
static int count_in(const hs_team *team, const hs_row_of_lanes *row, int mode) {
  int count = row->l.mode == mode ? row->count : 0;
  for (int64_t i = 0; i < team->count; i++) count += team->ready[i] == mode;
  return count;
}

/* Take the mode in which most runs may make a step; how many. */
static int choose_mode(const hs_team *team, hs_row_of_lanes *row) {
  int most = count_in(team, row, row->l.mode), mode = row->l.mode;
  for (int64_t i = 0; i < team->count && most < row->lanes; i++) {
    const int other = team->ready[i], count = other < 0 || other == mode ? 0 : count_in(team, row, other);
    if (count > most) most = count, mode = other;
  }
  for (int lane = 0; mode != row->l.mode && lane < row->lanes; lane++)
    if (row->seat[lane]) clear_lane(row, lane);
  row->l.mode = mode;
  return most;
}

/* Fill the lanes: how many runs are in them. */
static int fill_lanes(hs_team *team, hs_row_of_lanes *row, hs_row_of_lanes *waiting) {
  int first = 0;
  if (row->count == row->lanes) return row->count;
  const int most = choose_mode(team, row);
  if (most < row->lanes && most <= waiting->count) locate_together(team, waiting), choose_mode(team, row);
  for (int64_t i = 0, lane = 0; i < team->count && row->count < row->lanes; i++) {
    if (team->ready[i] != row->l.mode) continue;
    while (row->seat[lane]) lane++;
    enter_lane(row, (int)lane, seat_of(team, i));
    row->l.tolerance = row->seat[lane]->run.control.tolerance;
    row->l.binomials = row->seat[lane]->run.roots.binomials;
  }
  while (row->count && !row->seat[first]) first++;
  for (int lane = 0; row->count && lane < row->lanes; lane++)
    if (!row->seat[lane]) copy_lane(row, first, row, lane, row->carried);
  return row->count;
}

/* Give a place the instances of the first one, and where their results go. */
static void share(hs_ensemble *e, const hs_ensemble *first) {
  const hs_ensemble own = *e;
  if (e == first) return;
  *e = *first;
  e->task = own.task, e->sampling = own.sampling, e->layouts = own.layouts, e->watch = own.watch;
}

void hs_run_team(hs_team *team) {
  const hs_task *const task = &team->places[0]->task;
  const int32_t *const stop = team->places[0]->stop;
  hs_store store = {team->memory, 0};
  hs_row_of_lanes row, waiting;
  while ((uintptr_t)(store.numbers + store.used) % (HS_MOST_LANES * sizeof(double))) store.used++;
  lay_out_lanes(&row, task->model, task->method, team->program->lanes, &store);
  lay_out_lanes(&waiting, task->model, task->method, team->program->lanes, &store);
  waiting.l.contacts = (int32_t)task->settings.contacts;
  team->seats = take(&store, team->count, sizeof(hs_seat));
  team->lost = take(&store, task->model->flows, sizeof(int64_t));
  team->ready = take(&store, team->count, sizeof(int32_t));
  for (int i = 0; i < task->model->flows; i++) team->lost[i] = 0;
  team->next = 0;
  for (int64_t i = 0; i < team->count; i++) {
    int outcome;
    hs_seat *const seat = seat_of(team, i);
    hs_ensemble *const e = seat->instance = team->places[i];
    lay_out_lanes(&seat->own, task->model, task->method, 1, &store);
    seat->unwritten = 0;
    seat->mode = &team->ready[i];
    *seat->mode = -1;
    share(e, team->places[0]);
    open_place(e);
    int64_t *const rooms[] = {&e->task.chunk.row_room, &e->task.chunk.arc_room, &e->task.chunk.transition_room};
    for (int room = 0; room < 3; room++)
      if (*rooms[room] > KEPT_OF_PLACE) *rooms[room] = KEPT_OF_PLACE;
    if (begin_next(team, seat, &outcome)) go_ahead(team, seat, outcome, 0);
  }
  for (int count; !*stop && (count = fill_lanes(team, &row, &waiting)) > 0;) {
    team->program->step(&row.l);
    team->steps++, team->stepped += count;
    for (int lane = 0; lane < row.lanes; lane++)
      if (row.seat[lane]) behind_lane(team, &row, lane, &waiting);
  }
}
