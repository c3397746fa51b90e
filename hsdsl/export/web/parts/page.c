/* A run of the model on a page: its settings are written to `given`, and what is drawn is read from `view`. */

#include "page.h"

#include <time.h>

#include "page_numbers.h"
#include "timeline.c"

#define PAGE_EXPORT(name) __attribute__((export_name(name)))
__attribute__((import_module("page"), import_name("now"))) double page_now(void); /* milliseconds */

/* The runtime asks for the time to know when to poll; there is no other clock here. */
clock_t clock(void) { return (clock_t)(page_now() * (CLOCKS_PER_SEC / 1000)); }

/* Parameters and then states of the start, not-a-number for what the model's own expressions give; then the time in
   milliseconds that a run may take, the most samples over it, and the most transitions. */
enum { PAGE_LEAST_SAMPLES = 1000 };
enum { PAGE_GIVEN = PROBLEM_PARAMETERS + PAGE_STARTS, PAGE_TIME = PAGE_GIVEN, PAGE_SAMPLES, PAGE_TRANSITIONS };
static double given[PAGE_TRANSITIONS + 1];

static struct {
  hs_task task;
  hs_timeline timeline;
  double parameters[PROBLEM_PARAMETERS + 1], x[PAGE_STARTS + 1], scale[PAGE_STATES + 1];
  double stop_x[PROBLEM_WIDTH + 1], stop_slope[PROBLEM_WIDTH + 1], stop_scales[PROBLEM_WIDTH + 1];
  double *workspace, deadline;
  int32_t *layouts;
  double *time, *states, *results, *arc_of;
  int64_t points, room;
} run;

/* Where everything is, as numbers; see `read` in worker.js. */
enum { PAGE_VIEW = 32 };
static double view[PAGE_VIEW];

PAGE_EXPORT("given") double *page_given(void) { return given; }
PAGE_EXPORT("view") double *page_view(void) { return view; }

#include "settings.c"

static int poll(hs_task *task) {
  (void)task;
  return page_now() > run.deadline;
}

/* Give a chunk twice the room; what is written stays, so that in the end it is the whole run. */
static int flush(hs_task *task) {
  hs_chunk *c = &task->chunk;
  const int w = PROBLEM_WIDTH, m = PROBLEM_OUTPUTS, e = PROBLEM_EDGES;
  const int64_t rows = c->row_room < 1024 ? 1024 : 2 * c->row_room, arcs = rows / 2 + 8, made = rows / 4 + 8;
  if (rows * 8 * (2 + w * (1 + PROBLEM_DEGREE) + m) > PAGE_MEMORY) return 2;
  if (PAGE_GROW(c->times, rows) || PAGE_GROW(c->values, rows * w + 1) || PAGE_GROW(c->outputs, rows * m + 1) ||
      PAGE_GROW(c->depth, rows) || PAGE_GROW(c->pieces, (rows + 1) * PROBLEM_DEGREE * w + 1) ||
      PAGE_GROW(c->arc, arcs) || PAGE_GROW(run.layouts, arcs) ||
      PAGE_GROW(c->transition, made) || PAGE_GROW(c->before, made * w + 1) || PAGE_GROW(c->after, made * w + 1) ||
      PAGE_GROW(c->alternatives, made * e + 1) || PAGE_GROW(c->note, made))
    return 2;
  c->row_room = rows, c->arc_room = arcs, c->transition_room = c->note_room = made;
  return 0;
}

static int grow(hs_task *task, hs_visited *larger) {
  const int64_t room = 2 * task->visited.room + 64;
  larger->mode = malloc((size_t)room * sizeof *larger->mode);
  larger->state = malloc((size_t)room * (PROBLEM_WIDTH + 1) * sizeof *larger->state);
  larger->slot = calloc((size_t)(2 * room), sizeof *larger->slot);
  larger->room = room, larger->count = 0;
  return !larger->mode || !larger->state || !larger->slot;
}

static hs_tail tails[PROBLEM_QUEUES + 1];

static int lengthen(hs_task *task, hs_tail *larger) {
  (void)task;
  larger->waits = malloc((size_t)larger->room * (PROBLEM_QUEUED + 1) * sizeof *larger->waits);
  return !larger->waits;
}

static page_refusal set_task(void) {
  hs_task *t = &run.task;
  hs_chunk *c = &t->chunk;
  c->rows = c->arcs = c->transitions = c->notes = c->alternatives_used = 0;
  if (!run.workspace) {
    run.workspace = malloc((size_t)hs_workspace(&hs_the_model, &problem_method, (hs_scheme)problem_settings.scheme) *
                           sizeof(double));
    if (!run.workspace || flush(t) || grow(t, &t->visited)) return PAGE_NO_MEMORY;
  }
  t->model = &hs_the_model, t->method = &problem_method, t->timeline = &run.timeline;
  t->interpolation = &problem_interpolation;
  t->mode = problem_mode, t->dimension = PAGE_STARTS, t->x = run.x;
  t->workspace = run.workspace;
  t->flush = flush, t->poll = poll, t->grow = grow, t->lengthen = lengthen;
  t->tail = tails;
  hs_forget_waits(&hs_the_model, tails);
  t->stop.x = run.stop_x, t->stop.slope = run.stop_slope, t->stop.scales = run.stop_scales;
  t->stop.edge = t->stop.surface = -1;
  return PAGE_RAN;
}

static int64_t last_row(const hs_chunk *c, int64_t arc) {
  return arc + 1 < c->arcs ? c->arc[arc + 1].first - 1 : c->rows - 1;
}

/* Write down the times that are drawn: both ends of each arc, and equal parts of the run between them. */
static page_refusal choose_times(double samples) {
  const hs_chunk *c = &run.task.chunk;
  const int64_t room = (int64_t)samples + 2 * c->arcs + 2;
  const double part = c->times[c->rows - 1] / samples;
  int64_t n = 0;
  if (room > run.room) {
    if (PAGE_GROW(run.time, room) || PAGE_GROW(run.arc_of, room) ||
        PAGE_GROW(run.states, room * PAGE_STATES + 1) || PAGE_GROW(run.results, room * PROBLEM_OUTPUTS + 1))
      return PAGE_NO_MEMORY;
    run.room = room;
  }
  for (int64_t a = 0; a < c->arcs; a++) {
    const double start = c->times[c->arc[a].first], end = c->times[last_row(c, a)];
    run.arc_of[n] = (double)a, run.time[n++] = start;
    for (double k = floor(start / part) + 1; part > 0 && k * part < end && n < room - 2; k++)
      if (k * part > start) run.arc_of[n] = (double)a, run.time[n++] = k * part;
    if (end > start) run.arc_of[n] = (double)a, run.time[n++] = end;
  }
  run.points = n;
  return PAGE_RAN;
}

/* Copy a row of the run to a point. */
static void at_row(int64_t point, int64_t row) {
  const hs_chunk *c = &run.task.chunk;
  const int32_t *columns = page_columns + run.layouts[(int64_t)run.arc_of[point]] * PAGE_STATES;
  for (int s = 0; s < PAGE_STATES; s++)
    run.states[s * run.points + point] = columns[s] < 0 ? NAN : c->values[row * PROBLEM_WIDTH + columns[s]];
  for (int k = 0; k < PROBLEM_OUTPUTS; k++)
    run.results[point * PROBLEM_OUTPUTS + k] = c->outputs[row * PROBLEM_OUTPUTS + k];
}

/* Evaluate the run at the times that are drawn. At both ends of an arc its own rows count. */
static void evaluate(void) {
  hs_chunk *c = &run.task.chunk;
  double scratch[2 * PROBLEM_WIDTH + 1];
  for (int64_t a = 0; a < c->arcs; a++) {
    const int own = page_layout_of_mode[c->arc[a].mode];
    run.layouts[a] = own >= 0 ? own : a ? run.layouts[a - 1] : 0;
  }
  for (int i = 0; i < PROBLEM_DEGREE * PROBLEM_WIDTH; i++) c->pieces[c->rows * PROBLEM_DEGREE * PROBLEM_WIDTH + i] = 0.0;
  const hs_sampling sampling = {&hs_the_model, &run.timeline, c->rows, c->arcs, run.points, PROBLEM_WIDTH,
                                PROBLEM_DEGREE, PROBLEM_OUTPUTS, PAGE_STATES, 0, c->times, c->values, c->outputs,
                                c->pieces + PROBLEM_DEGREE * PROBLEM_WIDTH, c->arc, run.layouts, page_dimensions,
                                page_columns, run.time, run.states, run.results, scratch};
  hs_sample(&sampling);
  for (int64_t i = 0; i < run.points; i++) {
    const int64_t a = (int64_t)run.arc_of[i];
    if (i == 0 || run.arc_of[i - 1] != run.arc_of[i]) at_row(i, c->arc[a].first);
    else if (i + 1 == run.points || run.arc_of[i + 1] != run.arc_of[i]) at_row(i, last_row(c, a));
  }
}

static void show(void) {
  const hs_task *t = &run.task;
  const hs_chunk *c = &t->chunk;
  const hs_stop *s = &t->stop;
  const double numbers[PAGE_VIEW] = {
      refused_at, s->reason, s->mode, s->edge, s->surface, s->failure, s->time, (double)run.points, (double)c->arcs,
      (double)c->transitions, (double)c->notes, (double)t->settings.max_transitions, t->settings.until,
      (double)(size_t)run.parameters, (double)(size_t)run.x, (double)(size_t)run.time, (double)(size_t)run.arc_of,
      (double)(size_t)run.states, (double)(size_t)run.results, (double)(size_t)c->arc, (double)(size_t)c->times,
      (double)(size_t)c->transition, (double)(size_t)c->before, (double)(size_t)c->after,
      (double)(size_t)c->alternatives, (double)(size_t)c->note, (double)c->rows};
  for (int i = 0; i < PAGE_VIEW; i++) view[i] = numbers[i];
}

/* Prepare a run: 0, or why the settings are refused. */
static page_refusal prepare(void) {
  hs_settings *s = &run.task.settings;
  page_refusal refusal;
  refused_at = -1;
  run.deadline = page_now() + given[PAGE_TIME];
  if ((refusal = set_parameters(run.parameters)) || (refusal = set_start(run.parameters, run.x)) ||
      (refusal = set_settings(run.parameters, s)) ||
      (refusal = make_timeline(run.parameters, s->until, &run.timeline)))
    return refusal == PAGE_NO_SAMPLE || refusal == PAGE_UNSORTED ? refuse(refusal, refused_input) : refusal;
  return set_task();
}

PAGE_EXPORT("run") int page_run(void) {
  page_refusal refusal = prepare();
  if (refusal == PAGE_RAN) {
    hs_simulate(&run.task);
    refusal = choose_times(hs_min(given[PAGE_SAMPLES], hs_max(PAGE_LEAST_SAMPLES, 16.0 * run.task.chunk.rows)));
    if (refusal == PAGE_RAN) evaluate();
  }
  show();
  return (int)refusal;
}
