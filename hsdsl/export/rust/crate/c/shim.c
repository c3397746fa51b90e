/* What `src/ffi.rs` calls: one run in the caller's memory, with plain numbers for its input and output. */

#include "instance.h"

#include <string.h>

#include "hs_math.h"

typedef struct {
  double step, tolerance, largest, relaxation, until;
  int64_t max_transitions;
} hybrid_settings;

typedef struct {
  double time, depth;
  int64_t jump;
  int32_t mode, strip, dimension;
  const double *x, *outputs, *piece;
} hybrid_row;

typedef struct {
  double time, resumed;
  int32_t mode, edge, entry, tied;
  const int32_t *tied_with;
  const double *before, *after; /* after: where it leads, also where the run ended before it was made */
} hybrid_transition;

typedef void hybrid_takes_row(void *context, const hybrid_row *row);
typedef void hybrid_takes_transition(void *context, const hybrid_transition *transition);

typedef struct hybrid_block {
  struct hybrid_block *before;
  double memory[1];
} hybrid_block;

typedef struct {
  hs_instance run; /* first: the runtime hands its address back */
  hs_time end;
  void *context;
  hybrid_takes_row *row;
  hybrid_takes_transition *transition;
  hybrid_block *blocks;
} hybrid_memory;

#define DIGIT(power) (char)('0' + (sizeof(hybrid_memory) + 7) / 8 / power % 10)
const char hybrid_words[] = {'h', 'y', 'b', 'r', 'i', 'd', '_', 'w', 'o', 'r', 'd', 's', ':',
                             DIGIT(1000000000), DIGIT(100000000), DIGIT(10000000), DIGIT(1000000), DIGIT(100000),
                             DIGIT(10000), DIGIT(1000), DIGIT(100), DIGIT(10), DIGIT(1)};

static int give_row(void *context, const hs_row_written *row) {
  const hybrid_memory *memory = context;
  const hybrid_row given = {row->time, row->depth, row->jump, row->mode, row->kind == HS_STRIP, row->dimension,
                            row->x, row->outputs, row->piece};
  memory->row(memory->context, &given);
  return 0;
}

static int give_transition(void *context, const hs_transition_written *written) {
  const hybrid_memory *memory = context;
  const hs_transition *made = written->made;
  hs_real x[PROBLEM_WIDTH + 1] = {0};
  const hybrid_transition given = {made->time, made->resumed, made->mode, made->edge, made->entry, made->alternatives,
                                   written->alternatives, written->before, hs_landing(&memory->run, written, x)};
  memory->transition(memory->context, &given);
  return 0;
}

#if defined(HYBRID_STD)
#include <stdlib.h>

/* More room for the modes of one chain; all of it is given back when the run has ended. */
static int grow(hs_task *task, hs_visited *larger) {
  hybrid_memory *memory = (hybrid_memory *)task;
  const size_t room = 2 * (size_t)task->visited.room, numbers = room * (PROBLEM_WIDTH + 1);
  hybrid_block *block = calloc(1, sizeof *block + 8 * numbers + room * (2 * sizeof(int64_t) + sizeof(int32_t)));
  if (!block) return 1;
  block->before = memory->blocks, memory->blocks = block;
  larger->room = (int64_t)room, larger->count = 0;
  larger->state = block->memory;
  larger->slot = (int64_t *)(block->memory + numbers);
  larger->mode = (int32_t *)(larger->slot + 2 * room);
  return 0;
}

static void give_back(hybrid_memory *memory) {
  while (memory->blocks) {
    hybrid_block *block = memory->blocks;
    memory->blocks = block->before;
    free(block);
  }
}
#endif

void hybrid_parameters(double *p) { memcpy(p, problem_timeline.data, PROBLEM_PARAMETERS * sizeof *p); }

/* Parameters that others decide; not-a-number where they have no value. */
void hybrid_follow(double *p) {
  const int bad = problem_derive(p);
  for (int i = 0; bad && i < PROBLEM_PARAMETERS; i++)
    if (problem_derived[i]) p[i] = NAN;
}

/* The initial state; not-a-number where it has no value. */
void hybrid_initial(const double *p, double *x) {
  memcpy(x, problem_x, (size_t)problem_dimension * sizeof *x);
  const int bad = problem_start(p, problem_given, x);
  for (int s = 0; bad && s < problem_dimension; s++)
    if (!problem_given[s]) x[s] = NAN;
}

static void prepare(hybrid_memory *memory, const hybrid_settings *settings, const double *scales) {
  hs_instance *run = &memory->run;
  hs_settings *own = &run->task.settings;
  own->step = settings->step, own->tolerance = settings->tolerance, own->largest = settings->largest;
  own->relaxation = settings->relaxation, own->until = settings->until;
  own->max_transitions = settings->max_transitions;
  own->scale = 0;
  for (int s = 0; s < PROBLEM_STATES; s++)
    if (scales[s] > 0) own->scale = scales;
  if (PROBLEM_DATA == PROBLEM_PARAMETERS && PROBLEM_SEGMENTS == 1) { /* nothing but time passes */
    memory->end = own->until;
    run->timeline.end = &memory->end;
  }
}

/* Run; why it ended, as a number of `words`. */
int hybrid_simulate(hybrid_memory *memory, const double *p, const hybrid_settings *settings, int mode, const double *x,
                    const double *scales, void *context, hybrid_takes_row *row, hybrid_takes_transition *transition,
                    double *time) {
  static const char *const words[] = {"until", "final", "left_domain", "zeno", "transition_limit", "not_finite",
                                      "step_underflow"};
  const hs_sink sink = {memory, give_row, give_transition};
  hs_instance *run = &memory->run;
  int reason = 0;
  hs_open(run);
  run->sink = sink;
  memory->context = context, memory->row = row, memory->transition = transition;
  prepare(memory, settings, scales);
  for (int64_t k = 0; k < PROBLEM_SEGMENTS; k++) memcpy(run->data + k * PROBLEM_DATA, p, PROBLEM_PARAMETERS * sizeof *p);
  if (mode != problem_mode) run->task.mode = mode, run->task.dimension = hs_the_model.mode[mode].dimension;
  memcpy(run->x, x, (size_t)run->task.dimension * sizeof *x);
#if defined(HYBRID_STD)
  memory->blocks = 0;
  run->task.grow = grow;
#endif
  hs_run_instance(run);
#if defined(HYBRID_STD)
  give_back(memory);
#endif
  *time = run->task.stop.time;
  while (reason < 7 && strcmp(hs_stop_word(&run->task.stop), words[reason])) reason++;
  return reason;
}
