/* What `src/ffi.rs` calls: one run in the caller's memory, with plain numbers for its input and output. */

#include "given.h"
#include "hs_math.h"

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

typedef struct {
  hs_given_run own;
  void *context;
  hybrid_takes_row *row;
  hybrid_takes_transition *transition;
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
                                   written->alternatives, written->before, hs_landing(&memory->own.run, written, x)};
  memory->transition(memory->context, &given);
  return 0;
}

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

/* Run; why it ended. */
int hybrid_simulate(hybrid_memory *memory, const double *p, const hs_given *settings, int mode, const double *x,
                    const double *scales, void *context, hybrid_takes_row *row, hybrid_takes_transition *transition,
                    double *time) {
  const hs_sink sink = {memory, give_row, give_transition};
  hs_instance *run = &memory->own.run;
  hs_open_given(&memory->own, settings, p, mode, x);
  run->sink = sink;
  run->task.settings.scale = 0;
  for (int s = 0; s < PROBLEM_STATES; s++)
    if (scales[s] > 0) run->task.settings.scale = scales;
  memory->context = context, memory->row = row, memory->transition = transition;
  const int reason = hs_run_given(&memory->own);
  *time = run->task.stop.time;
  return reason;
}
