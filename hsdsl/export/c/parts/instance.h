/* One run of the exported model with all of its memory: nothing is allocated. */

#ifndef INSTANCE_H
#define INSTANCE_H

#include "problem.h"
#include "run.h"

#ifndef PROBLEM_ROWS
#define PROBLEM_ROWS 64 /* of a chunk; what is written goes to the sink when a chunk is full */
#endif
#ifndef PROBLEM_VISITED
#define PROBLEM_VISITED 64 /* modes that one chain of transitions at an instant may enter */
#endif

#ifndef PROBLEM_WAITING
#define PROBLEM_WAITING 64 /* executions of an event that can wait after the first */
#endif

typedef struct hs_instance hs_instance;

/* What waits. Copied, its `tail` has the addresses of the numbers that it was copied from. */
typedef struct {
  hs_tail tail[PROBLEM_QUEUES + 1];
  hs_real numbers[PROBLEM_QUEUES * PROBLEM_WAITING * PROBLEM_QUEUED + 1];
} hs_waiting;

/* A row of the run: times and states never wait for more than a chunk. `mode` is that of its arc, `kind` whether it is
   a strip, `piece` the interpolant from the row before to this one. */
typedef struct {
  int64_t number, jump;
  int mode, kind, dimension;
  hs_time time;
  hs_real depth;
  const hs_real *x, *outputs, *piece;
} hs_row_written;

/* A transition; `after` is 0 where the run ended before it was made. */
typedef struct {
  int64_t number;
  const hs_transition *made;
  const hs_real *before, *after;
  const int32_t *alternatives;
} hs_transition_written;

/* What takes the output of a run. Either function may be 0; one that does not return 0 ends the run. */
typedef struct {
  void *context;
  int (*row)(void *context, const hs_row_written *row);
  int (*transition)(void *context, const hs_transition_written *transition);
} hs_sink;

enum { PROBLEM_ARCS = PROBLEM_ROWS / 2 + 8, PROBLEM_TRANSITIONS = PROBLEM_ROWS / 4 + 8 };

struct hs_instance {
  hs_task task; /* first: the runtime hands its address back */
  hs_sink sink;
  hs_timeline timeline;
  int64_t rows, jumps; /* handed to the sink */
  hs_arc last;
  hs_real x[PROBLEM_WIDTH + 1];
  hs_real parameters[PROBLEM_PARAMETERS + 1];
  char given[PROBLEM_WIDTH + 1]; /* of each number in `x`: whether it stays where others are derived */
#if defined(PROBLEM_TUNABLE)
  hs_real data[PROBLEM_SEGMENTS * PROBLEM_DATA + 1];
#endif
  hs_real stop_x[PROBLEM_WIDTH + 1], stop_slope[PROBLEM_WIDTH + 1], stop_scales[PROBLEM_WIDTH + 1];
  double workspace[PROBLEM_WORKSPACE];
  hs_time times[PROBLEM_ROWS];
  hs_real depth[PROBLEM_ROWS], values[PROBLEM_ROWS * PROBLEM_WIDTH + 1];
  hs_real outputs[PROBLEM_ROWS * PROBLEM_OUTPUTS + 1];
  hs_real pieces[(PROBLEM_ROWS + 1) * PROBLEM_DEGREE * PROBLEM_WIDTH + 1];
  hs_arc arc[PROBLEM_ARCS];
  hs_transition transition[PROBLEM_TRANSITIONS];
  hs_real before[PROBLEM_TRANSITIONS * PROBLEM_WIDTH + 1], after[PROBLEM_TRANSITIONS * PROBLEM_WIDTH + 1];
  int32_t alternatives[PROBLEM_TRANSITIONS * PROBLEM_EDGES + 1];
  hs_note note[PROBLEM_TRANSITIONS];
  int32_t visited_mode[PROBLEM_VISITED];
  hs_real visited[PROBLEM_VISITED * PROBLEM_WIDTH + 1];
  int64_t slot[2 * PROBLEM_VISITED];
  hs_waiting waiting;
  hs_pause pause;
  hs_real pause_numbers[HS_PAUSE_NUMBERS(PROBLEM_WIDTH, PROBLEM_MODES, PROBLEM_STATES)];
  hs_real pause_data[PROBLEM_DATA + 1];
  int32_t pause_integers[HS_PAUSE_INTEGERS(PROBLEM_SURFACES, PROBLEM_MODES)];
};

/* Put what waits where it was copied to. */
void hs_place_waits(hs_waiting *waiting);

/* Make an instance ready: the problem as the model's file has it. */
void hs_open(hs_instance *instance);

#if defined(PROBLEM_TUNABLE)
/* Derive the parameters that others decide, and put all of them where the routines read them; not 0 where one has no
   finite value. `instance->parameters` has the values of the others. */
int hs_tune(hs_instance *instance);

/* Derive those initial values in `instance->x` of which `instance->given` has a 0 from the parameters and from others,
   as the file does; not 0 where one has no finite value. */
int hs_start(hs_instance *instance);
#endif

/* Run to the end; everything that is written goes to the sink. */
void hs_run_instance(hs_instance *instance);

/* Run in stretches: begin at `start`, then go on until an instant or, `after_jump`, the next transition; a mode is entered
   anew where inputs or parameters have `changed`. Not 0 where the run has ended. `instance->pause` has where it is: its
   time is later than `until` where it waits in a strip. The end of the experiment does not end it. */
int hs_begin_instance(hs_instance *instance, hs_time start);
int hs_advance(hs_instance *instance, hs_time until, int changed, int after_jump);

/* The state of a run in stretches, and how many numbers it has: those of its mode, or those that a final mode without a
   flow was entered with. */
const hs_real *hs_state(const hs_instance *instance, int *dimension);

/* Where a transition leads, also one whose run ended before it was made; to `x` where it was not written. */
const hs_real *hs_landing(const hs_instance *instance, const hs_transition_written *written, hs_real *x);

/* A word for why the run ended. */
const char *hs_stop_word(const hs_stop *stop);

#endif
