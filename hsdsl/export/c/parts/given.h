/* A run with other settings, parameters and start than the exported ones: for the languages that call the program. */

#ifndef GIVEN_H
#define GIVEN_H

#include <string.h>

#include "instance.h"

typedef struct {
  double step, tolerance, largest, relaxation, until;
  int64_t max_transitions;
} hs_given;

typedef struct hs_block {
  struct hs_block *before;
  double memory[1];
} hs_block;

/* A run, with all of its memory but that for long chains of transitions, where `HS_GROWS` is defined. */
typedef struct {
  hs_instance run; /* first: the runtime hands its address back */
  hs_time end;
  hs_block *blocks;
} hs_given_run;

#if defined(HS_GROWS)
#include <stdlib.h>

/* More room for the modes of one chain; all of it is given back when the run has ended. */
static int hs_grow(hs_task *task, hs_visited *larger) {
  hs_given_run *own = (hs_given_run *)task;
  const size_t room = 2 * (size_t)task->visited.room, numbers = room * (PROBLEM_WIDTH + 1);
  hs_block *block = calloc(1, sizeof *block + 8 * numbers + room * (2 * sizeof(int64_t) + sizeof(int32_t)));
  if (!block) return 1;
  block->before = own->blocks, own->blocks = block;
  larger->room = (int64_t)room, larger->count = 0;
  larger->state = block->memory;
  larger->slot = (int64_t *)(block->memory + numbers);
  larger->mode = (int32_t *)(larger->slot + 2 * room);
  return 0;
}
#endif

/* Make a run ready: `p` has all parameters, `x` the states of the mode. */
static void hs_open_given(hs_given_run *own, const hs_given *given, const double *p, int mode, const double *x) {
  hs_instance *run = &own->run;
  hs_settings *settings = &run->task.settings;
  hs_open(run);
  settings->step = given->step, settings->tolerance = given->tolerance, settings->largest = given->largest;
  settings->relaxation = given->relaxation, settings->until = given->until;
  settings->max_transitions = given->max_transitions;
  if (PROBLEM_DATA == PROBLEM_PARAMETERS && PROBLEM_SEGMENTS == 1) { /* nothing but time passes */
    own->end = given->until;
    run->timeline.end = &own->end;
  }
  for (int64_t k = 0; k < PROBLEM_SEGMENTS; k++) memcpy(run->data + k * PROBLEM_DATA, p, PROBLEM_PARAMETERS * sizeof *p);
  if (mode != problem_mode) run->task.mode = mode, run->task.dimension = hs_the_model.mode[mode].dimension;
  memcpy(run->x, x, (size_t)run->task.dimension * sizeof *x);
  own->blocks = 0;
#if defined(HS_GROWS)
  run->task.grow = hs_grow;
#endif
}

/* Run to the end; why it ended, as a number of `words`. */
static int hs_run_given(hs_given_run *own) {
  static const char *const words[] = {"until", "final", "left_domain", "zeno", "transition_limit", "waiting_limit",
                                      "not_finite", "step_underflow"};
  const int count = (int)(sizeof words / sizeof *words);
  int reason = 0;
  hs_run_instance(&own->run);
#if defined(HS_GROWS)
  while (own->blocks) {
    hs_block *block = own->blocks;
    own->blocks = block->before;
    free(block);
  }
#endif
  while (reason < count && strcmp(hs_stop_word(&own->run.task.stop), words[reason])) reason++;
  return reason;
}

#endif
