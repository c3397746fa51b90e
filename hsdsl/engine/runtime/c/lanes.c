/* Instances of an ensemble whose steps are made together, in lanes of vectors. Each place has one run under way, which
   is that of located.c up to where a flow needs steps; there it parks. Runs of one mode then live in lanes, where code
   that is compiled for the model (lane_step.c) makes their steps, until something happens. Runs on whose last step a
   surface is crossed wait until so many do that their crossings are found together, and their transitions made. What that
   code does not decide is done by the functions for one run, on the same step. So a run has the bits that it has alone. */

#include "lane_rows.c"

#define LOST 4 /* steps that lanes must make for one that they leave, */
#define MOST_LOST 4096 /* but for so many */
#define KEPT_OF_PLACE 64 /* rows, arcs and transitions that it keeps before it lets go: all places fit into a cache */

/* Whether of runs only the last row counts. */
static int is_bare(const hs_ensemble *e) { return !e->samples && !e->slides && !e->watch.names; }

/* Begin the next instance at a place: 0 where none is left. */
static int begin_next(hs_team *team, hs_seat *seat, int *outcome) {
  hs_ensemble *const e = seat->instance;
  if (team->next >= e->instances || *e->stop) return 0;
  e->done = team->next++;
  begin_instance(e);
  open_run(&seat->run, &e->task);
  seat->run.lanes.parks = 1;
  seat->run.lanes.bare = is_bare(e);
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
    if (flows) outcome = after_flow(run, outcome);
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
  *seat->mode = run->here.mode;
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
static int after_crossing_in_lane(const hs_row_of_lanes *row, int lane, hs_seat *seat) {
  hs_run *const run = &seat->run;
  const hs_lanes *const l = &row->l;
  const int landed = l->landed >> lane & 1 && crossings_of_lane(row, lane, run);
  if (!landed && run->lanes.bare) append(run, run->here.t, run->x, 0);
  if (!landed || !run->lanes.bare)
    step_of_lane(row, lane, run);
  else
    begin_span(run, l->h[lane], l->t1[lane]);
  if (!landed) return curves_of_lane(row, lane, run), after_step(run);
  gather(l->sizes, run->span.largest, run->here.dimension, row->lanes, lane);
  run->span.sized = 1;
  return after_event(run, first_event(run));
}

/* The edge that is crossed first in a lane, and when. */
static int first_of_lane(const hs_row_of_lanes *row, int lane, hs_time *t) {
  const int k = (int)row->l.first[lane];
  *t = row->l.time[k * row->lanes + lane];
  return k;
}

/* Whether a run may make the transition that is found in a lane there, and what it leaves aside: see jump() and
   crowded(). */
static int may_jump(const hs_row_of_lanes *row, int lane) {
  hs_run *const run = &row->seat[lane]->run;
  const hs_lanes *const l = &row->l;
  int *const count = &run->event.alternatives_count;
  hs_real flight, ratio;
  hs_time t;
  const int k = first_of_lane(row, lane, &t);
  *count = 0;
  for (int j = 0; j < run->here.table->edges; j++)
    if (j != k && l->open[j * row->lanes + lane] != 0) run->event.alternatives[(*count)++] = j;
  l->within[lane] = *count ? tie(t) : 0.0;
  if (limit_reached(run) || run->model->queues || run->task->settings.arcs) return 0;
  return run->written.jump < FREE || contraction(run, &flight, &ratio) || flown(run, t) > run->epsilon;
}

/* Whether a run may be in a Zeno tail that is to end: see ends_tail(). */
static int may_end(hs_run *run, hs_time t) {
  hs_real flight, ratio;
  if (!contraction(run, &flight, &ratio)) return run->written.jump >= FREE && !(flown(run, t) > run->epsilon);
  return !(flight * ratio / (1 - ratio) > hs_max(run->epsilon, 2 * tie(t)));
}

/* Go on after a transition that was made in a lane. */
static void after_jump_in_lane(hs_team *team, hs_row_of_lanes *row, int lane) {
  hs_seat *const seat = row->seat[lane];
  hs_run *const run = &seat->run;
  hs_crossing *const chosen = &run->event.chosen;
  const hs_lanes *const l = &row->l;
  const int mode = run->here.mode, k = chosen->edge = first_of_lane(row, lane, &chosen->time);
  const hs_edge *const edge = &run->here.table->edge[k];
  const int m = edge->target_dimension;
  chosen->theta = l->theta[k * row->lanes + lane], chosen->state = run->event.crossings[k].state;
  if (!run->lanes.bare) {
    gather(l->q + k * run->here.dimension * row->lanes, chosen->state, run->here.dimension, row->lanes, lane);
    gather(l->x, run->event.after, m, row->lanes, lane);
    step_of_lane(row, lane, run);
    write_crossing(run, chosen);
  }
  record(run, chosen, chosen->time, run->event.after, 0);
  if (run->model->mode[edge->target].final) {
    gather(l->x, run->x, m, row->lanes, lane);
    free_lane(row, lane);
    go_ahead(team, seat, enter(run, edge->target, m, chosen->time, 1, 0.0, 0, chosen->time), 0);
    return;
  }
  run->here = mode_at(run, edge->target, m, chosen->time, 0);
  begin(run, HS_FLOW);
  gather(l->x, run->x, m, row->lanes, lane);
  begin_following(run);
  comes_back(run, 1);
  seat->has_jumped = 1;
  if (run->lanes.bare && !(l->leads >> lane & 1) && !may_end(run, chosen->time) && !steps_alone(team, run)) {
    clear_lane(row, lane);
    return;
  }
  leave_lane(row, lane, seat, 1);
  if (!run->lanes.bare) append(run, run->here.t, run->x, 0);
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
      after_jump_in_lane(team, waiting, lane);
      continue;
    }
    leave_lane(waiting, lane, seat, 0);
    team->located += waiting->l.landed >> lane & 1;
    go_ahead(team, seat, after_crossing_in_lane(waiting, lane, seat), 1);
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

/* Go on after the step of a lane. */
static void after_step_in_lane(hs_team *team, hs_row_of_lanes *row, int lane, hs_row_of_lanes *waiting) {
  const hs_lanes *const l = &row->l;
  hs_seat *const seat = row->seat[lane];
  hs_run *const run = &seat->run;
  const int n = run->here.dimension, failed = l->failed >> lane & 1, crossed = l->crossed >> lane & 1;
  const int doubtful = l->doubtful >> lane & 1, wrong = doubtful && is_wrong_in_lane(row, lane, run);
  int standing = 0, outcome = GOES_ON;
  for (int k = 0; doubtful && k < run->here.table->surfaces; k++) standing |= l->standing[k * row->lanes + lane] != 0;
  if (failed) team->lost[l->mode] += LOST + 1;
  team->failed += failed, team->doubtful += doubtful, team->crossed += crossed;
  if (crossed && !wrong) {
    wait_for_crossing(team, row, lane, waiting);
    return;
  }
  if (!failed && !wrong && !(doubtful && standing)) {
    if (!run->lanes.bare) step_of_lane(row, lane, run), pass(run);
    if (doubtful) pass_lane(row, lane, n);
    if (l->t[lane] < seat->limit) return;
  }
  leave_lane(row, lane, seat, 1);
  if (failed)
    outcome = l->slow >> lane & 1 ? located_stuck(run, HS_SLOW) : one_step(run, n, seat->limit);
  else if (wrong)
    expands(run), outcome = after_try(run, halved_series(run, n, seat->limit, l->h[lane] / 2, 1));
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
    seat->has_own = 0;
    seat->mode = &team->ready[i];
    *seat->mode = -1;
    share(e, team->places[0]);
    open_place(e);
    int64_t *const rooms[] = {&e->task.chunk.row_room, &e->task.chunk.arc_room, &e->task.chunk.transition_room};
    for (int room = 0; room < 3; room++)
      if (*rooms[room] > KEPT_OF_PLACE) *rooms[room] = KEPT_OF_PLACE;
    if (begin_next(team, seat, &outcome)) go_ahead(team, seat, outcome, 0);
  }
  const int bare = is_bare(team->places[0]);
  for (int count; !*stop && (count = fill_lanes(team, &row, &waiting)) > 0;) {
    team->program->step(&row.l);
    team->steps++, team->stepped += count, team->lost[row.l.mode] -= count;
    const int32_t passed = bare ? row.l.passed : 0;
    for (int lane = 0; lane < row.lanes; lane++)
      if (row.seat[lane] && !(passed >> lane & 1)) after_step_in_lane(team, &row, lane, &waiting);
  }
}
