/* A run that pauses at an instant and goes on later, as if a segment of its inputs ended there: for callers that may
   change inputs, or copy a run, between two stretches of time. */

#include "functions.h"

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
  hs_real *const states[] = {run->x, run->scales, run->scale, run->entered, run->cascade.x};
  hs_real *number = pause->numbers;
  int32_t *integer = pause->integers;
  for (int i = 0; i < 5; i++) number = hand_over(number, states[i], w, back);
  number = hand_over(number, run->known, run->model->states, back);
  if (located) hand_over(number, run->reach, modes, back);
  integer = hand_over_integers(integer, run->active_surfaces, m, back);
  integer = hand_over_integers(integer, run->emerging, m, back);
  if (!located) return;
  integer = hand_over_integers(integer, run->unsettled, all, back);
  hand_over_integers(integer, run->lost, modes, back);
}

static void save(hs_run *run, hs_pause *pause, int outcome) {
  const hs_mode_state *here = &run->here;
  pause->ended = outcome != PAUSED;
  pause->mode = here->mode, pause->dimension = here->dimension;
  pause->standing = here->standing, pause->emerging = here->emerging;
  pause->time = here->t;
  pause->control = run->control;
  pause->placed = run->placed, pause->jump = run->jump, pause->row = run->row;
  pause->noted_crowded = run->noted_crowded;
  pause->cascade_mode = run->cascade.mode;
  pause->cascade_length = run->cascade.length, pause->cascade_room = run->cascade.room;
  for (int i = 0; i < FREE; i++) pause->made[i] = run->made[i];
  for (int i = 0; i < run->model->data; i++) pause->data[i] = here->p[i];
  exchange(run, pause, 0);
}

static void restore(hs_run *run, hs_pause *pause) {
  hs_mode_state *here = &run->here;
  exchange(run, pause, 1);
  here->mode = pause->mode, here->dimension = pause->dimension;
  here->table = &run->model->mode[pause->mode];
  here->p = pause->data;
  here->standing = pause->standing, here->emerging = pause->emerging;
  here->t = pause->time;
  run->control = pause->control;
  run->placed = pause->placed, run->jump = pause->jump, run->row = pause->row;
  run->noted_crowded = pause->noted_crowded;
  run->cascade.mode = pause->cascade_mode;
  run->cascade.length = pause->cascade_length, run->cascade.room = pause->cascade_room;
  for (int i = 0; i < FREE; i++) run->made[i] = pause->made[i];
}

void hs_begin(hs_task *task, hs_pause *pause, hs_time start) {
  hs_run run = open_run(task);
  start_sizes(&run, task->mode, start);
  const int outcome = enter(&run, task->mode, task->dimension, start, 0, 0.0, 0, start);
  save(&run, pause, outcome == GOES_ON ? PAUSED : outcome);
}

void hs_go_on(hs_task *task, hs_pause *pause, hs_time until, int changed, int after_jump) {
  hs_run run = open_run(task);
  restore(&run, pause);
  run.pause = until;
  if (run.until < until + 2 * run.epsilon) run.until = until + 2 * run.epsilon; /* strips end behind it */
  run.after_jump = after_jump;
  run.jumps_before = run.jump;
  const hs_timeline *timeline = task->timeline;
  const int64_t segment = segment_at(timeline, pause->time);
  int outcome = pause->time < until ? GOES_ON : PAUSED;
  if (outcome == GOES_ON)
    outcome = continued(&run, changed || (timeline->start[segment] == pause->time && timeline->jump[segment]));
  if (outcome == GOES_ON && pauses(&run)) outcome = PAUSED;
  outcome = task->settings.scheme == HS_LOCATED ? located(&run, outcome) : relaxed(&run, outcome);
  save(&run, pause, outcome);
}
