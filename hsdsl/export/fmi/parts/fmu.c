/* Variables and values of a unit; states and their copies; stretches of a run. */

#include "fmu.h"

#include <stdlib.h>
#include <string.h>

#include "hs_math.h"
#include "events.h"

/* Whether a step ends after its first transition. */
static int pauses(const fmu *unit) { return unit->event_mode_used && unit->early_return_allowed; }

/* Keep what is shown until the caller handles the event, or while the state waits in a strip. */
static void before_transition(fmu *unit, const hs_transition_written *written) {
  const hs_mode *mode = &hs_the_model.mode[written->made->mode];
  memcpy(unit->now.before, unit->now.state, sizeof unit->now.before);
  for (int s = 0; s < mode->dimension; s++) unit->now.before[mode->state[s]] = written->before[s];
  unit->now.before_mode = written->made->mode;
}

static int take_transition(void *context, const hs_transition_written *written) {
  fmu *unit = context;
  if (written->after && !(pauses(unit) && unit->now.jumps > unit->jumps_before)) before_transition(unit, written);
  if (written->after) fmu_enter(unit, written->made->mode, written->made->edge, written->after);
  unit->now.jumps++;
  return 0;
}

fmu *fmu_new(int co_simulation) {
  fmu *unit = calloc(1, sizeof *unit);
  if (!unit) return 0;
  unit->co_simulation = co_simulation;
  fmu_reset(unit);
  return unit;
}

void fmu_free(fmu *unit) { free(unit); }

void fmu_reset(fmu *unit) {
  const hs_sink sink = {unit, 0, take_transition};
  const hs_mode *mode = &hs_the_model.mode[problem_mode];
  memset(&unit->now, 0, sizeof unit->now);
  hs_open(&unit->run);
  unit->run.sink = sink;
  unit->now.mode = problem_mode;
  unit->now.resting = -1;
  for (int i = 0; i < PROBLEM_PARAMETERS; i++) unit->now.given.parameters[i] = unit->run.parameters[i];
  for (int s = 0; s < mode->dimension; s++) unit->now.state[mode->state[s]] = problem_x[s];
  for (int i = 0; i < FMU_INPUTS; i++) unit->now.given.input[i] = fmu_input_start[i];
  unit->now.tuned = 1;
  unit->bound = 0;
}

/* Derive the initial values that were not set from those that were; not 0 where one has no value. */
static int derive_start(fmu *unit) {
  const hs_mode *mode = &hs_the_model.mode[problem_mode];
  double *const state = unit->now.state;
  for (int s = 0; s < problem_dimension && s < mode->dimension; s++) {
    if (!unit->now.state_set[mode->state[s]]) continue;
    unit->run.x[s] = state[mode->state[s]];
    unit->run.given[s] = 1;
  }
  if (hs_start(&unit->run)) return 1;
  for (int s = 0; s < problem_dimension && s < mode->dimension; s++) state[mode->state[s]] = unit->run.x[s];
  return 0;
}

/* Put parameters and the inputs that were set where routines and the run read them; not 0 where one has no value. */
static int put_in_place(fmu *unit) {
  fmu_given_values *const given = &unit->now.given;
  double *const data = unit->run.data;
  memcpy(data, problem_timeline.data, PROBLEM_SEGMENTS * PROBLEM_DATA * sizeof *data);
  for (int i = 0; i < FMU_INPUTS; i++)
    if (fmu_input[i].given >= 0) given->parameters[fmu_input[i].given] = given->input_set[i] ? 0.0 : 1.0;
  for (int i = 0; i < PROBLEM_PARAMETERS; i++) unit->run.parameters[i] = given->parameters[i];
  if (hs_tune(&unit->run) || (!unit->now.started && derive_start(unit))) return 1;
  for (int i = 0; i < PROBLEM_PARAMETERS; i++) given->parameters[i] = unit->run.parameters[i];
  for (int i = 0; i < FMU_INPUTS; i++) {
    if (!given->input_set[i]) continue;
    for (int64_t k = 0; k < PROBLEM_SEGMENTS; k++) {
      double *const line = data + k * PROBLEM_DATA + PROBLEM_PARAMETERS + 3 * fmu_input[i].samples;
      line[0] = given->input[i], line[1] = line[2] = 0.0;
    }
  }
  unit->now.tuned = 0;
  unit->bound = 0;
  return 0;
}

/* Bind routines to the segment of the inputs that was entered last, and to the guard that holds the state. */
const double *fmu_bind(fmu *unit) {
  if (unit->now.tuned && put_in_place(unit)) return 0;
  const double *const data = unit->run.data + unit->now.given.segment * PROBLEM_DATA;
  if (!unit->bound) memcpy(unit->p, data, PROBLEM_DATA * sizeof(double));
  unit->bound = 1;
  const int resting = unit->now.resting;
  for (int i = 0; i < PROBLEM_CONTACTS; i++) unit->p[PROBLEM_DATA + i] = 0.0;
  if (resting >= 0) unit->p[PROBLEM_DATA + hs_the_model.mode[unit->now.mode].edge[resting].contact] = HS_HELD;
  return unit->p;
}

/* The states of a mode, of those of all modes. */
void fmu_local(const fmu *unit, double *x) {
  const hs_mode *mode = &hs_the_model.mode[unit->now.mode];
  for (int s = 0; s < mode->dimension; s++) x[s] = unit->now.state[mode->state[s]];
}

static double interpolated_input(fmu *unit, int i) {
  const double *p = fmu_bind(unit);
  if (!p) return NAN;
  const fmu_given_values *const given = &unit->now.given;
  if (fmu_input[i].given >= 0) return given->input_set[i] ? given->input[i] : fmu_given(i, p, unit->now.time);
  const double *line = p + PROBLEM_PARAMETERS + 3 * fmu_input[i].samples;
  return line[0] + line[1] * (unit->now.time - line[2]);
}

static fmu_status output(fmu *unit, int index, double *value) {
  double x[PROBLEM_WIDTH + 1], out[PROBLEM_OUTPUTS + 1];
  fmu_data *const now = &unit->now;
  const int mode = now->mode;
  const double *p = fmu_bind(unit);
  if (!p) return FMU_NO_VALUE;
  if (now->shows_before) now->mode = now->before_mode;
  const double *const states = now->shows_before ? now->before : now->state;
  const hs_mode *table = &hs_the_model.mode[now->mode];
  for (int s = 0; s < table->dimension; s++) x[s] = states[table->state[s]];
  now->mode = mode;
  *value = table->outputs(p, now->time, x, out) ? NAN : out[index];
  return FMU_OK;
}

fmu_status fmu_get(fmu *unit, unsigned reference, double *value) {
  const fmu_data *now = &unit->now;
  double slopes[PROBLEM_STATES + 1], indicators[PROBLEM_SURFACES + 1];
  if (reference >= FMU_VARIABLES) return FMU_ERROR;
  const fmu_variable *variable = &fmu_variables[reference];
  switch (variable->kind) {
    case FMU_TIME: *value = now->time; return FMU_OK;
    case FMU_STATE:
      if (!now->started && !fmu_bind(unit)) return FMU_NO_VALUE;
      *value = (now->shows_before ? now->before : now->state)[variable->index];
      return FMU_OK;
    case FMU_PARAMETER:
      if (!fmu_bind(unit)) return FMU_NO_VALUE;
      *value = now->given.parameters[variable->index];
      return FMU_OK;
    case FMU_INPUT: *value = interpolated_input(unit, variable->index); return FMU_OK;
    case FMU_OUTPUT: return output(unit, variable->index, value);
    case FMU_DERIVATIVE:
      if (fmu_get_derivatives(unit, slopes)) return FMU_NO_VALUE;
      *value = slopes[variable->index];
      return FMU_OK;
    case FMU_INDICATOR:
      if (fmu_get_indicators(unit, indicators)) return FMU_NO_VALUE;
      *value = indicators[variable->index];
      return FMU_OK;
    default: unit->refusal = "a mode is an integer: --mode local is for tools that read all outputs as reals";
  }
  return FMU_ERROR;
}

/* Whether a parameter may be tuned to a value: those that it decides are within their bounds too. */
static int is_tunable(fmu *unit, int index, double value) {
  double p[PROBLEM_PARAMETERS + 1];
  memcpy(p, unit->now.given.parameters, PROBLEM_PARAMETERS * sizeof *p);
  p[index] = value;
  if (problem_derive(p)) return 0;
  unit->refusal = fmu_beyond(p);
  return !unit->refusal;
}

fmu_status fmu_set(fmu *unit, unsigned reference, double value) {
  fmu_data *now = &unit->now;
  if (reference >= FMU_VARIABLES) return FMU_ERROR;
  const fmu_variable *variable = &fmu_variables[reference];
  switch (variable->kind) {
    case FMU_TIME: now->time = value; return FMU_OK;
    case FMU_STATE:
      now->state[variable->index] = value;
      now->state_set[variable->index] = 1;
      now->tuned |= !now->started;
      return FMU_OK;
    case FMU_PARAMETER:
      if (problem_derived[variable->index] || (now->started && problem_structural[variable->index])) return FMU_ERROR;
      if (problem_structural[variable->index] && value != problem_timeline.data[variable->index]) return FMU_ERROR;
      if (now->started && !is_tunable(unit, variable->index, value)) return FMU_ERROR;
      now->given.parameters[variable->index] = value;
      now->tuned = 1;
      return FMU_OK;
    case FMU_INPUT:
      if (fmu_input[variable->index].fixed) return FMU_ERROR;
      if (now->given.input_set[variable->index] && now->given.input[variable->index] == value) return FMU_OK;
      now->given.input[variable->index] = value;
      now->given.input_set[variable->index] = now->tuned = 1;
      return FMU_OK;
    default: return FMU_ERROR;
  }
}

int fmu_mode(const fmu *unit, unsigned reference) {
  const fmu_data *now = &unit->now;
  if (PROBLEM_PARTS) return (int)(now->shows_before ? now->before : now->state)[fmu_variables[reference].index];
  return now->shows_before ? now->before_mode : now->mode;
}

void fmu_set_time(fmu *unit, double time) { unit->now.time = time; }

void fmu_set_states(fmu *unit, const double *x) { memcpy(unit->now.state, x, FMU_STATES * sizeof *x); }

void fmu_get_states(const fmu *unit, double *x) { memcpy(x, unit->now.state, FMU_STATES * sizeof *x); }

void fmu_get_nominals(const fmu *unit, double *x) {
  (void)unit;
  memcpy(x, fmu_nominal, FMU_STATES * sizeof *x);
}

/* Whether a state is beyond a surface: a flow that has no value there goes on as it was, until the event is found. */
static int is_beyond(const hs_mode *mode, const double *p, double t, const double *x) {
  double r[PROBLEM_SURFACES + 1];
  if (mode->values(p, t, x, r)) return 0;
  for (int k = 0; k < mode->surfaces; k++)
    if (r[k] > 0) return 1;
  return 0;
}

fmu_status fmu_get_derivatives(fmu *unit, double *slopes) {
  double x[PROBLEM_WIDTH + 1], out[PROBLEM_WIDTH + 1];
  const hs_mode *mode = fmu_table(unit);
  const double *p = fmu_bind(unit);
  for (int i = 0; i < FMU_STATES; i++) slopes[i] = 0.0;
  if (!p) return FMU_NO_VALUE;
  if (unit->now.ended || !mode->dimension) return FMU_OK;
  fmu_local(unit, x);
  int none = mode->flow(p, unit->now.time, x, out);
  for (int s = 0; s < mode->dimension && !none; s++) none = !hs_finite(out[s]);
  if (none && !is_beyond(mode, p, unit->now.time, x)) return FMU_NO_VALUE;
  for (int s = 0; s < mode->dimension; s++) {
    const int state = mode->state[s];
    unit->slopes[state] = none ? unit->slopes[state] : out[s];
    if (state < FMU_STATES) slopes[state] = unit->slopes[state];
  }
  return FMU_OK;
}

/* Bring the run's state to that of the unit. */
static void follow_run(fmu *unit) {
  int dimension;
  const double *x = hs_state(&unit->run, &dimension);
  const hs_pause *pause = &unit->run.pause;
  const hs_mode *mode = &hs_the_model.mode[pause->mode];
  unit->now.mode = pause->mode;
  for (int s = 0; s < mode->dimension && s < dimension; s++) unit->now.state[mode->state[s]] = x[s];
  unit->now.given.segment = fmu_segment_at(unit->now.time);
  unit->bound = 0;
}

#define TEXT_NOW(a) #a
#define TEXT(a) TEXT_NOW(a)

const char fmu_too_many_wait[] =
    "waiting_limit: more than " TEXT(PROBLEM_WAITING) " executions of an event wait, or than it may have: compile the "
    "sources of the unit with a larger PROBLEM_WAITING";

/* Why a run ended; nothing but a full table of modes interrupts it. */
static const char *why(const hs_stop *stop) {
  if (stop->reason == HS_WAITING) return fmu_too_many_wait;
  if (stop->reason != HS_INTERRUPTED) return hs_stop_word(stop);
  return "more than " TEXT(PROBLEM_VISITED) " transitions at one instant, for which the unit has no room: "
         "compile its sources with a larger PROBLEM_VISITED";
}

/* Whether a run has ended other than in a final mode; the reason is reported. */
static int has_failed(fmu *unit) {
  if (!unit->now.ended || unit->run.task.stop.reason == HS_FINAL) return 0;
  unit->complaint = why(&unit->run.task.stop);
  return 1;
}

static fmu_status started(fmu *unit) {
  fmu_data *now = &unit->now;
  const hs_mode *mode = &hs_the_model.mode[problem_mode];
  for (int s = 0; s < problem_dimension && s < mode->dimension; s++) unit->run.x[s] = now->state[mode->state[s]];
  now->ended = hs_begin_instance(&unit->run, now->time);
  follow_run(unit);
  return has_failed(unit) ? FMU_ERROR : FMU_OK;
}

fmu_status fmu_initialize(fmu *unit) {
  fmu_data *now = &unit->now;
  if (!fmu_bind(unit) || (unit->refusal = fmu_beyond(now->given.parameters)) != 0) return FMU_ERROR;
  now->given.segment = fmu_segment_at(now->time);
  unit->bound = 0;
  now->started = 1;
  const fmu_status status = unit->co_simulation ? started(unit) : fmu_begin(unit);
  now->earlier = now->seen = now->given;
  return status;
}

/* Why no step of a size begins at a communication point; a point may be off by the round-off of sums. */
static const char *step_refusal(const fmu_data *now, double point, double size) {
  const double off = sqrt(0x1p-53) * hs_max(size, fabs(now->time));
  if (!(size > 0)) return "expected a communication step size above zero";
  if (!hs_finite(point + size) || !(point + size > now->time)) return "expected a step that ends later than the last";
  if (!now->ended && fabs(point - now->time) > off)
    return "expected the communication point that the last step reached";
  return 0;
}

fmu_status fmu_step(fmu *unit, double point, double size, double *reached, int *event) {
  fmu_data *now = &unit->now;
  const double until = point + size;
  *event = 0;
  *reached = now->time;
  if ((unit->refusal = step_refusal(now, point, size)) != 0) return FMU_ERROR;
  *reached = until;
  if (!fmu_bind(unit)) return FMU_ERROR;
  if (now->ended) {
    now->time = until;
    return FMU_OK;
  }
  const int64_t jumps = unit->jumps_before = now->jumps;
  now->shows_before = 0;
  now->ended = hs_advance(&unit->run, until, fmu_has_changed(now), pauses(unit));
  const double time = unit->run.pause.time;
  if (now->ended) *reached = unit->run.task.stop.time < until ? unit->run.task.stop.time : until;
  if (pauses(unit) && now->jumps > jumps && time < until) *reached = time;
  *event = now->jumps > jumps;
  now->time = *reached;
  follow_run(unit);
  now->earlier = now->given;
  now->shows_before = time > until || (*event && pauses(unit));
  has_failed(unit);
  return FMU_OK;
}

size_t fmu_size(void) { return sizeof(fmu_data); }

void fmu_save(const fmu *unit, void *bytes) {
  fmu_data *data = bytes;
  memcpy(data, &unit->now, sizeof *data);
  data->pause = unit->run.pause;
  data->pause.numbers = data->pause.data = 0;
  data->pause.integers = 0;
  memcpy(data->numbers, unit->run.pause_numbers, sizeof unit->run.pause_numbers);
  memcpy(data->data, unit->run.pause_data, sizeof unit->run.pause_data);
  memcpy(data->integers, unit->run.pause_integers, sizeof unit->run.pause_integers);
  data->waiting = unit->run.waiting;
  for (int q = 0; q < PROBLEM_QUEUES; q++) data->waiting.tail[q].waits = 0;
}

int fmu_restore(fmu *unit, const void *bytes) {
  hs_pause *const pause = &unit->run.pause;
  memcpy(&unit->now, bytes, sizeof unit->now);
  *pause = unit->now.pause;
  pause->numbers = unit->run.pause_numbers;
  pause->data = unit->run.pause_data;
  pause->integers = unit->run.pause_integers;
  memcpy(unit->run.pause_numbers, unit->now.numbers, sizeof unit->run.pause_numbers);
  memcpy(unit->run.pause_data, unit->now.data, sizeof unit->run.pause_data);
  memcpy(unit->run.pause_integers, unit->now.integers, sizeof unit->run.pause_integers);
  unit->run.waiting = unit->now.waiting;
  hs_place_waits(&unit->run.waiting);
  unit->now.tuned = 1;
  unit->bound = 0;
  return 0;
}

fmu_status fmu_slope(fmu *unit, unsigned unknown, unsigned known, double *slope) {
  double x[PROBLEM_WIDTH + 1], values[FMU_SLOPES + 1];
  const fmu_slope_table *table = &fmu_slopes[fmu_table(unit) - hs_the_model.mode];
  if (unknown >= FMU_VARIABLES || known >= FMU_VARIABLES) return FMU_ERROR;
  const fmu_variable *row = &fmu_variables[unknown], *column = &fmu_variables[known];
  const int given = column->kind == FMU_STATE || (column->kind == FMU_INPUT && !fmu_input[column->index].fixed);
  if (!given || (row->kind != FMU_DERIVATIVE && row->kind != FMU_OUTPUT && row->kind != FMU_STATE)) {
    unit->refusal = "derivatives are of states, their derivatives and real outputs, by states and inputs";
    return FMU_ERROR;
  }
  const double *p = fmu_bind(unit);
  *slope = row->kind == column->kind && row->index == column->index;
  if (row->kind != FMU_DERIVATIVE && row->kind != FMU_OUTPUT) return FMU_OK;
  if (!p) return FMU_NO_VALUE;
  fmu_local(unit, x);
  if (unit->now.ended) return FMU_OK;
  if (table->values(p, unit->now.time, x, values)) return FMU_NO_VALUE;
  for (int i = 0; i < table->count; i++)
    if (table->row[i] == unknown && table->column[i] == known) *slope = values[i];
  return FMU_OK;
}
