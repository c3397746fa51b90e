/* Instances of an ensemble whose steps are made together, in lanes of vectors. Each place has one run under way, which
   is that of located.c up to where a flow needs steps; there it parks. As many runs of one mode as there are lanes then
   make a step at once, by code that is compiled for the model (lane_step.c). What that code does not decide is done by
   the functions for one run, on the same step. So a run has the bits that it has alone. */

#include "hs_lanes.h"

#define LOST 4 /* steps that lanes must make for one that they leave, */
#define MOST_LOST 4096 /* but for so many */
#define ROWS_OF_PLACE 64 /* that it keeps before it lets go of them: all places together fit into a cache */

typedef struct {
  hs_ensemble *instance;
  hs_run run;
  hs_time limit;
  int mode;    /* of a run that is parked; -1 of none */
  int lane;    /* that has this run as it is; -1 for none */
  int pending; /* whether the last step's polynomial is in the lanes alone */
} hs_seat;

static hs_seat *seat_of(const hs_team *team, int64_t i) { return (hs_seat *)team->seats + i; }

static hs_lanes lay_out_lanes(const hs_model *model, const hs_method *method, int64_t lanes, hs_store *store) {
  const int64_t n = model->width, m = model->surfaces, order = method->order;
  const hs_lanes none = {0};
  hs_lanes l = none;
  double **const one[] = {&l.t, &l.limit, &l.longest, &l.h, &l.t1};
  double **const states[] = {&l.x, &l.scales, &l.z, &l.end, &l.error};
  double **const surfaces[] = {&l.standing, &l.starts, &l.ends};
  for (int i = 0; i < 5; i++) *one[i] = numbers(store, lanes);
  for (int i = 0; i < 5; i++) *states[i] = numbers(store, n * lanes);
  for (int i = 0; i < 3; i++) *surfaces[i] = numbers(store, m * lanes);
  l.p = numbers(store, (int64_t)model->data * lanes);
  l.lines = numbers(store, (int64_t)model->lines * (order + 2) * lanes);
  l.piece = numbers(store, n * order * lanes);
  l.before = numbers(store, n * order * lanes);
  l.curves = numbers(store, m * (order + 1) * lanes);
  l.order = method->order;
  return l;
}

int64_t hs_lane_memory(const hs_model *model, const hs_method *method, int64_t places, int32_t lanes) {
  hs_store store = {0, HS_MOST_LANES};
  take(&store, places, sizeof(hs_seat));
  take(&store, model->flows, sizeof(int64_t));
  lay_out_lanes(model, method, lanes, &store);
  return store.used;
}

static void gather_standing(const hs_run *run, hs_lanes *l, int64_t lanes, int lane) {
  for (int k = 0; k < run->here.table->surfaces; k++) l->standing[k * lanes + lane] = run->active_surfaces[k];
}

/* Put the run of a seat where a lane reads it. */
static void gather(const hs_seat *seat, hs_lanes *l, int64_t lanes, int lane) {
  const hs_run *const run = &seat->run;
  l->t[lane] = run->here.t;
  l->limit[lane] = seat->limit;
  l->longest[lane] = run->control.tolerance > 0 ? run->control.largest : run->control.h;
  for (int i = 0; i < run->model->data; i++) l->p[i * lanes + lane] = run->here.p[i];
  for (int s = 0; s < run->here.dimension; s++)
    l->x[s * lanes + lane] = run->x[s], l->scales[s * lanes + lane] = run->scales[s];
  gather_standing(run, l, lanes, lane);
}

/* Take a step's polynomial out of a lane. */
static void scatter_piece(const hs_run *run, const double *from, int order, int64_t lanes, int lane,
                          hs_polynomial *piece) {
  const int n = run->here.dimension, w = run->width;
  piece->degree = order;
  for (int m = 0; m < order; m++)
    for (int s = 0; s < n; s++) piece->c[m * w + s] = from[(m * n + s) * lanes + lane];
}

/* Put the step of a lane where next_series() writes its own. */
static void scatter(hs_run *run, const hs_lanes *l, int64_t lanes, int lane, int doubtful) {
  begin_span(run, l->h[lane], l->t1[lane]);
  for (int s = 0; s < run->here.dimension; s++) {
    run->z[s] = l->z[s * lanes + lane];
    run->end[s] = l->end[s * lanes + lane];
    if (doubtful) run->error[s] = l->error[s * lanes + lane];
  }
}

/* The same of surfaces along it: see series_curves(). */
static void scatter_curves(hs_run *run, const hs_lanes *l, int64_t lanes, int lane) {
  const int count = run->here.table->surfaces, order = l->order;
  hs_curves *const curves = &run->curves;
  begin_curves(curves, count);
  for (int k = 0; k < count; k++) {
    hs_real *const c = coefficients_of(curves, 0, k);
    run->starts[k] = run->values[k] = l->starts[k * lanes + lane];
    run->ends[k] = l->ends[k * lanes + lane];
    for (int m = 0; m <= order; m++) c[m] = l->curves[(k * (order + 1) + m) * lanes + lane];
    *degree_of(curves, 0, k) = degree_without_zeros(c, order);
    *off_of(curves, 0, k) = 0;
    curves->certain[k] = 1;
  }
}

/* Begin the next instance at a place: 0 where none is left. */
static int begin_next(hs_team *team, hs_seat *seat, int *outcome) {
  hs_ensemble *const e = seat->instance;
  seat->mode = -1;
  if (team->next >= e->instances || *e->stop) return 0;
  e->done = team->next++;
  begin_instance(e);
  *outcome = begin_run(&seat->run, &e->task);
  seat->run.parks = 1;
  seat->run.bare = !e->samples;
  return 1;
}

/* Follow the run of a place to the next steps; where it ends, the next instance. */
static void go_ahead(hs_team *team, hs_seat *seat, int outcome) {
  hs_run *const run = &seat->run;
  while ((outcome = located(run, outcome)) != PARKED)
    if (!end_instance(seat->instance) || !begin_next(team, seat, &outcome)) {
      seat->mode = -1;
      return;
    }
  seat->mode = run->here.mode;
  seat->limit = segment_end(run);
  begin_following(run);
}

/* Make good what a lane has kept of the step before. */
static void settle_piece(hs_seat *seat, const hs_lanes *l, const double *from, int64_t lanes) {
  if (seat->pending) scatter_piece(&seat->run, from, l->order, lanes, seat->lane, &seat->run.before.piece);
  seat->pending = 0;
}

/* What a step comes to that was made in a lane, or is made here. */
static int made_step(hs_team *team, hs_lanes *l, hs_seat *seat, int lane) {
  hs_run *const run = &seat->run;
  const int64_t lanes = team->program->lanes;
  const int n = run->here.dimension, stood = run->here.active;
  const int failed = l->failed >> lane & 1, crossed = l->crossed >> lane & 1, doubtful = l->doubtful >> lane & 1;
  if (failed || crossed || doubtful) settle_piece(seat, l, l->before, lanes), seat->lane = -1;
  team->lost[run->here.mode] += failed ? LOST : -1;
  team->failed += failed, team->crossed += crossed, team->doubtful += doubtful;
  if (failed) return one_step(run, n, seat->limit);
  scatter(run, l, lanes, lane, doubtful);
  if (doubtful && is_too_wrong(run, run->span.h)) {
    expands(run);
    return behind(run, halved_series(run, n, seat->limit, run->span.h / 2, 1));
  }
  seat->pending = run->bare && seat->lane >= 0;
  if (!seat->pending) scatter_piece(run, l->piece, l->order, lanes, lane, &run->span.piece);
  if (crossed) return scatter_curves(run, l, lanes, lane), behind_step(run);
  pass(run);
  if (stood && seat->lane >= 0) gather_standing(run, l, lanes, lane);
  return GOES_ON;
}

/* Give each of the seats that are chosen a lane, that in which it is where it is in one. */
static void take_lanes(hs_team *team, hs_lanes *l, hs_seat **chosen, int count, hs_seat **seats) {
  const int lanes = team->program->lanes;
  int next = 0;
  for (int lane = 0; lane < lanes; lane++) seats[lane] = 0;
  for (int i = 0; i < count; i++)
    if (chosen[i]->lane >= 0) seats[chosen[i]->lane] = chosen[i];
  for (int i = 0; i < count; i++) {
    if (chosen[i]->lane >= 0) continue;
    while (seats[next]) next++;
    seats[next] = chosen[i];
  }
  for (int i = 0; i < team->count; i++) {
    hs_seat *const seat = seat_of(team, i);
    if (seat->lane < 0 || seats[seat->lane] == seat) continue;
    settle_piece(seat, l, l->piece, lanes);
    seat->lane = -1;
  }
  for (int lane = 0; lane < lanes; lane++)
    if (!seats[lane] || seats[lane]->lane < 0) gather(seats[lane] ? seats[lane] : chosen[0], l, lanes, lane);
}

/* One step of all runs that are chosen, which are in one mode. */
static void step_together(hs_team *team, hs_lanes *l, hs_seat **chosen, int count) {
  const int lanes = team->program->lanes;
  const hs_run *const run = &chosen[0]->run;
  hs_seat *seats[HS_MOST_LANES];
  take_lanes(team, l, chosen, count, seats);
  swap(&l->piece, &l->before);
  l->mode = run->here.mode;
  l->tolerance = run->control.tolerance;
  l->binomials = run->roots.binomials;
  team->program->step(l);
  team->steps++;
  team->stepped += count;
  for (int lane = 0; lane < lanes; lane++) {
    hs_seat *const seat = seats[lane];
    if (!seat) continue;
    seat->lane = lane;
    const int outcome = made_step(team, l, seat, lane);
    if (outcome != GOES_ON) seat->lane = -1, go_ahead(team, seat, behind_flow(&seat->run, outcome));
  }
}

/* Steps of a run in a mode that has no lanes, or whose surfaces bound its steps. */
static int steps_alone(const hs_team *team, const hs_seat *seat) {
  return !team->program->is_for[seat->mode] || seat->run.reach[seat->mode] > 0 || team->lost[seat->mode] > MOST_LOST;
}

/* Choose runs of one mode that may make a step, all places in turn; how many. */
static int choose_lanes(hs_team *team, const hs_lanes *l, hs_seat **chosen) {
  int count = 0;
  for (int64_t i = 0, at = team->turn; i < team->count && count < team->program->lanes; i++) {
    hs_seat *const seat = seat_of(team, at);
    at = at + 1 < team->count ? at + 1 : 0;
    while (seat->mode >= 0 && !(count && seat->mode != chosen[0]->mode)) {
      hs_run *const run = &seat->run;
      const int alone = steps_alone(team, seat);
      if (alone) settle_piece(seat, l, l->piece, team->program->lanes);
      const int outcome = alone ? follow_on(run, seat->limit) : before_step(run, seat->limit);
      if (outcome == GOES_ON) {
        chosen[count++] = seat;
        team->turn = at;
        break;
      }
      settle_piece(seat, l, l->piece, team->program->lanes);
      seat->lane = -1;
      go_ahead(team, seat, behind_flow(run, outcome));
    }
  }
  return count;
}

/* Give a place the instances of the first one, and where their results go. */
static void share(hs_ensemble *e, const hs_ensemble *first) {
  const hs_ensemble own = *e;
  if (e == first) return;
  *e = *first;
  e->task = own.task, e->sampling = own.sampling, e->layouts = own.layouts;
}

void hs_run_team(hs_team *team) {
  const hs_task *const task = &team->places[0]->task;
  const int32_t *const stop = team->places[0]->stop;
  hs_store store = {team->memory, 0};
  while ((uintptr_t)(store.numbers + store.used) % (HS_MOST_LANES * sizeof(double))) store.used++;
  hs_lanes lanes = lay_out_lanes(task->model, task->method, team->program->lanes, &store);
  hs_seat *chosen[HS_MOST_LANES];
  team->seats = take(&store, team->count, sizeof(hs_seat));
  team->lost = take(&store, task->model->flows, sizeof(int64_t));
  for (int i = 0; i < task->model->flows; i++) team->lost[i] = 0;
  team->next = team->turn = 0;
  for (int64_t i = 0; i < team->count; i++) {
    int outcome;
    hs_seat *const seat = seat_of(team, i);
    hs_ensemble *const e = seat->instance = team->places[i];
    seat->lane = -1, seat->pending = 0;
    share(e, team->places[0]);
    open_place(e);
    if (e->task.chunk.row_room > ROWS_OF_PLACE) e->task.chunk.row_room = ROWS_OF_PLACE;
    if (begin_next(team, seat, &outcome)) go_ahead(team, seat, outcome);
  }
  for (int count; !*stop && (count = choose_lanes(team, &lanes, chosen)) > 0;)
    step_together(team, &lanes, chosen, count);
}
