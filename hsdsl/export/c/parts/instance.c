/* An instance: its memory laid out for the runtime, and its output handed to a sink. */

#include "instance.h"

#include <string.h>

#include "hs_math.h"

/* The arc that a row is in, as written: the last one of the chunk that begins not after it. */
static const hs_arc *arc_of(const hs_instance *instance, int64_t row, int64_t *at) {
  const hs_chunk *chunk = &instance->task.chunk;
  while (*at < chunk->arcs && chunk->arc[*at].first <= row) ++*at;
  return *at > 0 ? &chunk->arc[*at - 1] : &instance->last;
}

static int dimension_of(const hs_instance *instance, const hs_real *x) {
  int dimension = instance->task.model->width;
  while (dimension > 0 && x[dimension - 1] != x[dimension - 1]) dimension--; /* not-a-number where a mode has none */
  return dimension;
}

static int hand_over_rows(hs_instance *instance) {
  const hs_chunk *chunk = &instance->task.chunk;
  const int w = instance->task.model->width, m = instance->task.model->outputs, degree = instance->task.method->degree;
  int64_t at = 0;
  int answer = 0;
  for (int64_t i = 0; i < chunk->rows && !answer; i++) {
    const hs_arc *arc = arc_of(instance, instance->rows, &at);
    const hs_row_written row = {instance->rows++,
                                arc->jump,
                                arc->mode,
                                arc->kind,
                                dimension_of(instance, chunk->values + i * w),
                                chunk->times[i],
                                chunk->depth[i],
                                chunk->values + i * w,
                                chunk->outputs + i * m,
                                chunk->pieces + i * degree * w};
    if (instance->sink.row) answer = instance->sink.row(instance->sink.context, &row);
  }
  if (chunk->arcs) instance->last = chunk->arc[chunk->arcs - 1];
  return answer;
}

static int hand_over_transitions(hs_instance *instance) {
  const hs_chunk *chunk = &instance->task.chunk;
  const int w = instance->task.model->width;
  const int32_t *alternatives = chunk->alternatives;
  int answer = 0;
  for (int64_t i = 0; i < chunk->transitions && !answer; i++) {
    const hs_transition *made = &chunk->transition[i];
    const hs_transition_written written = {instance->jumps++, made, chunk->before + i * w,
                                           made->resumed == made->resumed ? chunk->after + i * w : 0, alternatives};
    if (instance->sink.transition) answer = instance->sink.transition(instance->sink.context, &written);
    alternatives += made->alternatives;
  }
  return answer;
}

/* Hand over what is in the chunk and empty it; not 0 where the sink ends the run. */
static int flush(hs_task *task) {
  hs_instance *instance = (hs_instance *)task;
  hs_chunk *chunk = &task->chunk;
  const int rows = hand_over_rows(instance), transitions = hand_over_transitions(instance);
  chunk->rows = chunk->arcs = chunk->transitions = chunk->alternatives_used = chunk->notes = 0;
  return rows || transitions;
}

static int never_stops(hs_task *task) {
  (void)task;
  return 0;
}

static int has_no_more_room(hs_task *task, hs_visited *larger) {
  (void)task, (void)larger;
  return 1;
}

static int cannot_lengthen(hs_task *task, hs_tail *larger) {
  (void)task, (void)larger;
  return 1;
}

void hs_place_waits(hs_waiting *waiting) {
  for (int q = 0; q < PROBLEM_QUEUES; q++) {
    waiting->tail[q].room = PROBLEM_WAITING;
    waiting->tail[q].waits = waiting->numbers + q * PROBLEM_WAITING * PROBLEM_QUEUED;
  }
}

static void lay_out_chunk(hs_instance *instance) {
  const hs_chunk chunk = {PROBLEM_ROWS, 0, PROBLEM_ARCS, 0, PROBLEM_TRANSITIONS, 0, PROBLEM_TRANSITIONS, 0,
                          instance->times, instance->values, instance->outputs, instance->depth, instance->pieces,
                          instance->arc, instance->transition, instance->before, instance->after,
                          instance->alternatives, 0, instance->note, 0};
  const hs_visited visited = {PROBLEM_VISITED, 0, instance->visited_mode, instance->visited, instance->slot};
  instance->task.chunk = chunk;
  instance->task.visited = visited;
}

void hs_open(hs_instance *instance) {
  hs_task *task = &instance->task;
  memset(instance, 0, sizeof *instance);
  lay_out_chunk(instance);
  instance->timeline = problem_timeline;
#if defined(PROBLEM_TUNABLE)
  memcpy(instance->data, problem_timeline.data, PROBLEM_SEGMENTS * PROBLEM_DATA * sizeof *instance->data);
  instance->timeline.data = instance->data;
#endif
  for (int i = 0; i < PROBLEM_PARAMETERS; i++) instance->parameters[i] = problem_timeline.data[i];
  for (int i = 0; i < problem_dimension; i++) instance->x[i] = problem_x[i], instance->given[i] = problem_given[i];
  task->model = &hs_the_model;
  task->method = &problem_method;
  task->timeline = &instance->timeline;
  task->settings = problem_settings;
  task->interpolation = &problem_interpolation;
  task->mode = problem_mode;
  task->dimension = problem_dimension;
  task->x = instance->x;
  task->workspace = instance->workspace;
  task->flush = flush;
  task->poll = never_stops;
  task->grow = has_no_more_room;
  task->tail = instance->waiting.tail;
  task->lengthen = cannot_lengthen;
  hs_place_waits(&instance->waiting);
  task->stop.x = instance->stop_x;
  task->stop.slope = instance->stop_slope;
  task->stop.scales = instance->stop_scales;
  instance->pause.numbers = instance->pause_numbers;
  instance->pause.data = instance->pause_data;
  instance->pause.integers = instance->pause_integers;
}

#if defined(PROBLEM_TUNABLE)
int hs_tune(hs_instance *instance) {
  if (problem_derive(instance->parameters)) return 1;
  for (int i = 0; i < PROBLEM_PARAMETERS; i++) {
    if (!hs_finite(instance->parameters[i])) return 1;
    for (int64_t k = 0; k < PROBLEM_SEGMENTS; k++)
      instance->data[k * PROBLEM_DATA + i] = instance->parameters[i];
  }
  return 0;
}

int hs_start(hs_instance *instance) {
  if (problem_start(instance->parameters, instance->given, instance->x)) return 1;
  for (int i = 0; i < problem_dimension; i++)
    if (!hs_finite(instance->x[i])) return 1;
  return 0;
}
#endif

void hs_run_instance(hs_instance *instance) {
  hs_task *task = &instance->task;
  instance->rows = instance->jumps = 0;
  hs_forget_waits(task->model, task->tail);
  hs_simulate(task);
  flush(task);
}

static int handed_over(hs_instance *instance) {
  flush(&instance->task);
  return instance->pause.ended;
}

int hs_begin_instance(hs_instance *instance, hs_time start) {
  instance->rows = instance->jumps = 0;
  hs_forget_waits(instance->task.model, instance->task.tail);
  hs_begin(&instance->task, &instance->pause, start);
  return handed_over(instance);
}

int hs_advance(hs_instance *instance, hs_time until, int changed, int after_jump) {
  if (!instance->pause.ended) hs_go_on(&instance->task, &instance->pause, until, changed, after_jump);
  return handed_over(instance);
}

const hs_real *hs_state(const hs_instance *instance, int *dimension) {
  *dimension = instance->pause.dimension;
  return instance->pause_numbers;
}

const hs_real *hs_landing(const hs_instance *instance, const hs_transition_written *written, hs_real *x) {
  const hs_transition *made = written->made;
  const hs_edge *edge = &hs_the_model.mode[made->mode].edge[made->edge];
  const hs_timeline *timeline = &instance->timeline;
  int64_t k = timeline->segments - 1;
  if (written->after) return written->after;
  while (k > 0 && made->time < timeline->start[k]) k--;
  const hs_real *p = timeline->data + k * PROBLEM_DATA, *before = written->before;
  return hs_changed(edge, &edge->reset, p, made->time, before, before, x) ? before : x;
}

/* Why no step leads on: where a state changes faster than time can tell, it grows beyond all numbers. */
static const char *stuck_word(const hs_stop *stop) {
  const hs_real instant = sqrt((hs_real)HS_UNIT) * (hs_real)stop->time;
  const int failure = stop->failure;
  int grows = failure == HS_NOT_FINITE;
  if (failure == HS_WALL) return "left_domain";
  for (int s = 0; s < stop->dimension && (failure == HS_ERROR || failure == HS_UNSOLVED || failure == HS_CREEPING); s++)
    grows |= 0 < stop->scales[s] && stop->scales[s] < instant * fabs(stop->slope[s]);
  return grows ? "not_finite" : "step_underflow";
}

const char *hs_stop_word(const hs_stop *stop) {
  static const char *const words[] = {HS_REASONS(HS_REASON_WORD)};
  return stop->reason == HS_STUCK ? stuck_word(stop) : words[stop->reason];
}
