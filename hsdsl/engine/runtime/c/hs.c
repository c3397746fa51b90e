/* The runtime: one translation unit, each file the twin of one in hsdsl/engine/simulate or hsdsl/engine/integrators. */

#include "functions.h"

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("tree-pre") /* of what -O2 does beyond -O1 the part that makes it faster, by a tenth */
#endif

#include "primitives.h" /* by hand: what the printed files call */
/* printed from hsdsl/engine/scheme */
#include "control.c"
#include "pace.c"
#include "polynomials.c"
#include "roots.c"

#include "root.h"
#include "span.h"

#include "taylor.c"
#if defined(__GNUC__) && !defined(__clang__) && !defined(__OPTIMIZE_SIZE__)
#pragma GCC push_options
#pragma GCC optimize("O2")
#endif
/* printed as well */
#include "linear.c"
#include "scales.c"
#include "newton.c"
#include "radau.c"
/* by hand again */
#include "implicit.c"
#if defined(__GNUC__) && !defined(__clang__) && !defined(__OPTIMIZE_SIZE__)
#pragma GCC pop_options
#endif
#include "stepper.c"

#include "surfaces.c"
#include "stalls.c"
#include "run.c"
#include "recorder.c"
#include "transitions.c"
#include "contact.c"
#include "zeno.c"
#include "relaxed.c"
#include "located_steps.c"
#include "crossings.c"
#include "located.c"
#if !defined(HS_FLOAT32)
#include "sample.c"
#endif

static void *take(hs_store *store, int64_t count, size_t size) {
  double *start = store->numbers ? store->numbers + store->used : 0;
  store->used += (count * (int64_t)size + (int64_t)sizeof(double) - 1) / (int64_t)sizeof(double);
  return start;
}

static hs_real *numbers(hs_store *store, int64_t count) { return take(store, count, sizeof(hs_real)); }

static hs_polynomial polynomial(hs_store *store, const hs_run *run) {
  const int degree = run->method->degree > 3 ? run->method->degree : 3;
  hs_polynomial piece;
  piece.degree = 0;
  piece.c = numbers(store, (int64_t)degree * run->width);
  return piece;
}

/* Room for so many numbers, or marks, in each of some arrays; the last of them is 0. */
static void take_each(hs_store *store, int64_t count, hs_real **const *each) {
  for (; *each; each++) **each = numbers(store, count);
}

static void take_marks(hs_store *store, int64_t count, int **const *each) {
  for (; *each; each++) **each = take(store, count, sizeof(int));
}

/* Stages of steps; those at the ends are arrays of the caller, where it has any. */
static hs_real **take_stages(hs_store *store, const hs_run *run) {
  const int all = run->method->stages + 1 + run->method->extra;
  hs_real **const k = take(store, all, sizeof(hs_real *));
  for (int i = 1; i < all; i++) {
    hs_real *stage = numbers(store, run->width);
    if (store->numbers) k[i] = stage;
  }
  return k;
}

/* Give every array of a run its place. */
static void lay_out(hs_run *run, hs_store *store) {
  const int w = run->width, m = run->model->surfaces, e = run->model->edges;
  hs_resolved *const by = &run->step.radau.resolved;
  hs_at_surfaces *const at = &run->surfaces;
  hs_real **const states[] = {
      &run->x,           &run->slope,        &run->z,          &run->end,          &run->at,
      &run->sizes.scale, &run->entered,      &run->event.after, &run->sizes.landed, &run->step.error,
      &run->sizes.scales, &by->found,        &by->least,       &by->slope,         &run->near,
      &run->nearby,      &run->contact.flow_sizes, &run->cascade.x, &run->source,   0};
  take_each(store, w, states);
  run->sizes.known = numbers(store, run->model->states);
  by->near = run->near, by->other = run->nearby, run->step.radau.at = run->at, run->step.radau.error = run->step.error;
  by->lifted = take(store, w, sizeof(int));
  run->step.k = take_stages(store, run);
  if (store->numbers) run->step.k[0] = run->slope, run->step.k[run->method->stages] = run->end;
  lay_out_method(run, store);
  hs_real **const values[] = {&at->values, &at->ahead, &at->magnitudes, &at->begun, &at->noise, &at->stood, 0};
  take_each(store, m, values);
  run->gradient = numbers(store, w + 1);
  run->sizes.both = numbers(store, 2 * (int64_t)w);
  int **const marks[] = {&at->active, &at->beyond, &at->emerging, &run->contact.others, 0};
  take_marks(store, m, marks);
  int **const of_edges[] = {&run->event.tied, &run->event.alternatives, 0};
  take_marks(store, e, of_edges);
  run->contact.p = numbers(store, run->model->data + run->model->contacts);
  run->contact.jacobian = numbers(store, run->model->derivatives);
  for (int i = 0; store->numbers && i < m; i++) at->stood[i] = 0.0;
  run->trial.piece = polynomial(store, run);
  run->cubic = polynomial(store, run);
  run->event.crossings = take(store, m, sizeof(hs_crossing));
  for (int i = 0; i < m; i++) {
    hs_real *state = numbers(store, w);
    if (store->numbers) run->event.crossings[i].state = state;
  }
}

/* Degrees of polynomials that surfaces are along steps. */
static int most_degree(const hs_method *method) {
  const int own = method->degree > method->order ? method->degree : method->order;
  return own > LEAST_MOST_DEGREE ? own : LEAST_MOST_DEGREE;
}

static hs_span lay_out_span(const hs_run *run, hs_store *store) {
  hs_span span = {0, 0, 0, 0, 0, 0, {0, 0}};
  span.x = numbers(store, run->width);
  span.largest = numbers(store, run->width);
  span.piece = polynomial(store, run);
  return span;
}

static hs_roots lay_out_roots(hs_store *store, int degree) {
  hs_real *const left = numbers(store, degree + 1), *const own = numbers(store, degree + 1);
  hs_real *const binomials = numbers(store, (int64_t)(degree + 1) * (degree + 2) / 2);
  hs_cut *const cuts = take(store, MOST_CUTS, sizeof(hs_cut));
  const hs_roots roots = {HS_UNIT, binomials, 0, own, left, cuts};
  if (store->numbers) fill_binomials(binomials, degree);
  for (int i = 0; i < MOST_CUTS; i++) {
    hs_real *const b = numbers(store, degree + 1);
    if (store->numbers) cuts[i].b = b;
  }
  return roots;
}

/* The same for the arrays of the located scheme. */
static void lay_out_located(hs_run *run, hs_store *store) {
  const int w = run->width, m = run->model->surfaces > 0 ? run->model->surfaces : 1, most = most_degree(run->method);
  int **const marks[] = {&run->contact.kept, &run->contact.held, &run->zeno.tail, 0};
  take_marks(store, m, marks);
  run->zeno.turn = numbers(store, 2 * (int64_t)w);
  run->span = lay_out_span(run, store);
  run->before = lay_out_span(run, store);
  hs_real **const states[] = {&run->q, &run->step.other_end, &run->contact.began, 0};
  hs_real **const values[] = {&run->surfaces.ends, &run->surfaces.starts, &run->surfaces.middle, &run->surfaces.ended, 0};
  take_each(store, w, states);
  run->step.other_k = take_stages(store, run);
  take_each(store, m, values);
  run->curves.rows = numbers(store, (int64_t)(most + 1 + HS_TESTS) * m);
  run->roots = lay_out_roots(store, most);
  run->event.waiting = take(store, m, sizeof(hs_riser));
  run->written.unsettled = take(store, (int64_t)run->model->modes * m, sizeof(int));
  for (int64_t i = 0; store->numbers && i < (int64_t)run->model->modes * m; i++) run->written.unsettled[i] = 0;
  run->reach.step = numbers(store, run->model->modes);
  run->reach.lost = take(store, run->model->modes, sizeof(int));
  for (int i = 0; store->numbers && i < run->model->modes; i++) run->reach.step[i] = 0.0, run->reach.lost[i] = 0;
  run->curves.room = most + 1;
  run->curves.start = numbers(store, MOST_PARTS);
  run->curves.width = numbers(store, MOST_PARTS);
  run->curves.c = numbers(store, (int64_t)MOST_PARTS * m * run->curves.room);
  run->curves.off = numbers(store, (int64_t)MOST_PARTS * m);
  run->curves.degree = take(store, (int64_t)MOST_PARTS * m, sizeof(int));
  run->curves.certain = take(store, (int64_t)MOST_PARTS * m, sizeof(int));
}

static void make_run(hs_run *run, const hs_model *model, const hs_method *method, hs_scheme scheme, hs_store *store) {
  static const hs_run empty;
  *run = empty;
  run->model = model;
  run->method = method;
  run->width = model->width;
  lay_out(run, store);
  if (scheme == HS_LOCATED) lay_out_located(run, store);
}

/* How many numbers a run's workspace needs. */
int64_t hs_workspace(const hs_model *model, const hs_method *method, hs_scheme scheme) {
  hs_store store = {0, 0};
  hs_run run;
  make_run(&run, model, method, scheme, &store);
  return store.used;
}

/* A run of a task in its workspace, before it enters its first mode. */
static void open_run(hs_run *run, hs_task *task) {
  hs_store store = {task->workspace, 0};
  make_run(run, task->model, task->method, (hs_scheme)task->settings.scheme, &store);
  hs_chunk *const chunk = &task->chunk;
  chunk->rows = chunk->arcs = chunk->transitions = chunk->alternatives_used = chunk->notes = 0;
  task->now = 0.0;
  task->made = task->entries = 0;
  run->task = task;
  run->pausing.at = INFINITY;
  run->epsilon = task->settings.relaxation;
  run->until = task->settings.until;
  run->control.h = task->settings.step;
  run->control.tolerance = task->settings.tolerance;
  run->control.largest = task->settings.largest;
  run->control.least = hs_max(task->settings.tolerance, sqrt((hs_real)HS_UNIT)) * task->settings.largest;
  run->control.order = task->method->order;
  run->control.failed_at = NAN;
  run->control.implicit = is_implicit(task->method);
  begin_implicit(run);
  run->poll.steps_left = run->poll.steps = 32;
  run->written.full_queue = -1;
  copy(run->x, task->x, task->dimension);
  for (int s = 0; s < run->width; s++) run->sizes.scale[s] = 0.0;
  for (int i = 0; i < run->model->states; i++) run->sizes.known[i] = task->settings.scale ? task->settings.scale[i] : 0.0;
}

/* Enter the task's mode. */
static int begin_run(hs_run *run, const hs_task *task, hs_time start) {
  start_sizes(run, task->mode, start);
  return enter(run, task->mode, task->dimension, start, 0, 0.0, 0, start);
}

void hs_simulate(hs_task *task) {
  hs_run run;
  open_run(&run, task);
  const int entered = begin_run(&run, task, 0.0);
  if (task->settings.scheme == HS_LOCATED)
    located(&run, entered);
  else
    relaxed(&run, entered);
}

/* A run that pauses at an instant and goes on later, as if a segment of its inputs ended there: for callers that may
   change inputs, or copy a run, between two stretches of time. */

static hs_real *hand_over(hs_real *memory, hs_real *own, int64_t count, int back) {
  for (int64_t i = 0; i < count; i++)
    if (back)
      own[i] = memory[i];
    else
      memory[i] = own[i];
  return memory + count;
}

static int32_t *hand_over_integers(int32_t *memory, int *own, int64_t count, int back) {
  for (int64_t i = 0; i < count; i++)
    if (back)
      own[i] = memory[i];
    else
      memory[i] = own[i];
  return memory + count;
}

/* Copy what a run remembers from one stretch to the next out of its workspace, or `back`. */
static void exchange(hs_run *run, hs_pause *pause, int back) {
  const int w = run->width, m = run->model->surfaces, located = run->task->settings.scheme == HS_LOCATED;
  const int modes = run->model->modes, all = modes * (m > 0 ? m : 1);
  hs_real *const states[] = {run->x, run->sizes.scales, run->sizes.scale, run->entered, run->cascade.x};
  hs_real *number = pause->numbers;
  int32_t *integer = pause->integers;
  for (int i = 0; i < 5; i++) number = hand_over(number, states[i], w, back);
  number = hand_over(number, run->sizes.known, run->model->states, back);
  if (located) hand_over(number, run->reach.step, modes, back);
  integer = hand_over_integers(integer, run->surfaces.active, m, back);
  integer = hand_over_integers(integer, run->surfaces.emerging, m, back);
  if (!located) return;
  integer = hand_over_integers(integer, run->written.unsettled, all, back);
  hand_over_integers(integer, run->reach.lost, modes, back);
}

static void save(hs_run *run, hs_pause *pause, int outcome) {
  const hs_mode_state *here = &run->here;
  pause->ended = outcome != PAUSED;
  pause->mode = here->mode, pause->dimension = here->dimension;
  pause->active = here->active, pause->emerging = here->emerging;
  pause->time = here->t;
  pause->control = run->control;
  pause->placed = run->written.placed, pause->jump = run->written.jump, pause->row = run->written.row;
  pause->noted_crowded = run->written.noted_crowded;
  pause->cascade_mode = run->cascade.mode;
  pause->cascade_length = run->cascade.length, pause->cascade_room = run->cascade.room;
  for (int i = 0; i < FREE; i++) pause->made[i] = run->written.made[i];
  for (int i = 0; i < run->model->data; i++) pause->data[i] = here->p[i];
  exchange(run, pause, 0);
}

static void restore(hs_run *run, hs_pause *pause) {
  hs_mode_state *here = &run->here;
  exchange(run, pause, 1);
  here->mode = pause->mode, here->dimension = pause->dimension;
  here->table = &run->model->mode[pause->mode];
  here->p = pause->data;
  here->active = pause->active, here->emerging = pause->emerging;
  here->t = pause->time;
  run->control = pause->control;
  run->written.placed = pause->placed, run->written.jump = pause->jump, run->written.row = pause->row;
  run->written.noted_crowded = pause->noted_crowded;
  run->cascade.mode = pause->cascade_mode;
  run->cascade.length = pause->cascade_length, run->cascade.room = pause->cascade_room;
  for (int i = 0; i < FREE; i++) run->written.made[i] = pause->made[i];
}

void hs_begin(hs_task *task, hs_pause *pause, hs_time start) {
  hs_run run;
  open_run(&run, task);
  const int outcome = begin_run(&run, task, start);
  save(&run, pause, outcome == GOES_ON ? PAUSED : outcome);
}

void hs_go_on(hs_task *task, hs_pause *pause, hs_time until, int changed, int after_jump) {
  hs_run run;
  open_run(&run, task);
  restore(&run, pause);
  run.pausing.at = until;
  if (run.until < until + 2 * run.epsilon) run.until = until + 2 * run.epsilon; /* strips end after it */
  run.pausing.after_jump = after_jump;
  run.pausing.jumps_before = run.written.jump;
  const hs_timeline *timeline = task->timeline;
  const int64_t segment = segment_at(timeline, pause->time);
  int outcome = pause->time < until ? GOES_ON : PAUSED;
  if (outcome == GOES_ON)
    outcome = continued(&run, changed || (timeline->start[segment] == pause->time && timeline->jump[segment]));
  if (outcome == GOES_ON && pauses(&run)) outcome = PAUSED;
  outcome = task->settings.scheme == HS_LOCATED ? located(&run, outcome) : relaxed(&run, outcome);
  save(&run, pause, outcome);
}
