/* Many instances of one model, of which little is kept. See hsdsl/engine/simulate/ensemble.py. */

/* Evaluate the samples that fall into the chunk; after its last time another row may
   follow, unless it is the end. */
static void sample_chunk(hs_ensemble *e, int at_end) {
  const hs_chunk *chunk = &e->task.chunk;
  hs_sampling *s = &e->sampling;
  for (int64_t k = 0; e->layout_of && k < chunk->arcs; k++) {
    const int32_t layout = e->layout_of[chunk->arc[k].mode];
    e->layouts[k] = e->layout = layout >= 0 ? layout : e->layout;
  }
  const int64_t instance = e->done, rows = chunk->rows;
  const double *time = e->time + instance * e->samples, last = chunk->times[rows - 1];
  const double reach = at_end ? last + HS_TIE * fabs(last) : last;
  int64_t count = 0;
  while (e->next + count < e->samples &&
         (at_end ? time[e->next + count] <= reach : time[e->next + count] < reach))
    count++;
  if (!count) return;
  for (int64_t k = 0; k < chunk->arcs; k++) chunk->arc[k].first -= e->base;
  s->timeline = e->task.timeline;
  s->rows = rows, s->arcs = chunk->arcs, s->samples = count;
  s->times = chunk->times, s->values = chunk->values, s->recorded = chunk->outputs, s->arc = chunk->arc;
  s->pieces = chunk->pieces + (int64_t)s->degree * s->width;
  s->layout = e->layout_of ? e->layouts : 0;
  s->results = e->results + (instance * e->samples + e->next) * s->outputs;
  copy(s->time, time + e->next, (int)count);
  hs_sample(s);
  for (int k = 0; k < s->columns; k++)
    for (int64_t i = 0; i < count; i++)
      e->states[(instance * s->columns + k) * e->samples + e->next + i] = s->states[k * count + i];
  for (int64_t k = 0; k < chunk->arcs; k++) chunk->arc[k].first += e->base;
  e->next += count;
}

/* Put the transitions of the chunk into the log. */
static void log_transitions(hs_ensemble *e) {
  const hs_chunk *chunk = &e->task.chunk;
  const int64_t w = e->task.model->width;
  for (int64_t i = 0; i < chunk->transitions; i++) {
    if (e->logged == e->log_room) e->drain(e);
    e->log[e->logged] = chunk->transition[i];
    copy(e->before + e->logged * w, chunk->before + i * w, (int)w);
    copy(e->after + e->logged * w, chunk->after + i * w, (int)w);
    e->logged++;
  }
}

static void note_transitions(hs_ensemble *e) {
  const hs_chunk *chunk = &e->task.chunk;
  if (e->log_room) log_transitions(e);
  for (int64_t i = 0; i < chunk->transitions && e->made + i < e->most_transitions; i++)
    e->crossed[e->done * e->most_transitions + e->made + i] = chunk->transition[i].time;
  e->made += chunk->transitions;
}

/* Whether two times are one as people are shown them: see `in_contact` in hsdsl/engine/simulate/stops.py. */
static int shown_alike(hs_time a, hs_time b) {
  char one[32], other[32];
  snprintf(one, sizeof one, "%.10g", (double)a);
  snprintf(other, sizeof other, "%.10g", (double)b);
  return !strcmp(one, other);
}

enum { CAME_BEYOND = 1, CAME_ONTO = 2, PARTS_OF_STEP = 8, BEYOND = 4 };

/* The state at a share of the step from a row of the chunk, and what surfaces are there. */
static int surfaces_at(hs_ensemble *e, const hs_mode *mode, int64_t row, double share, const double *p, double *values) {
  const hs_chunk *chunk = &e->task.chunk;
  const int w = e->task.model->width, degree = e->task.method->degree;
  const double *const x = chunk->values + row * w, *const c = chunk->pieces + (row + 1) * degree * w;
  const double length = row + 1 < chunk->rows ? chunk->times[row + 1] - chunk->times[row] : 0.0;
  double *const at = values + e->task.model->surfaces;
  for (int s = 0; s < mode->dimension; s++) {
    double moved = share > 0 && !degree ? (x[w + s] - x[s]) * share : 0.0;
    for (int m = share > 0 ? degree - 1 : -1; m >= 0; m--) moved = (moved + c[m * w + s]) * share;
    at[s] = share == 1.0 ? x[w + s] : x[s] + moved;
  }
  return mode->values(p, chunk->times[row] + share * length, at, values);
}

/* On which side of surface k states are, by its value there: to round-off, or for a tie, they are on it. Where no input
   jumps, on it is as good as inside. */
static double side_of(hs_ensemble *e, const hs_mode *mode, int k, double t, const double *p, const double *values) {
  const hs_model *const model = e->task.model;
  const double *const x = values + model->surfaces;
  double *const slopes = e->watch.memory + model->surfaces + model->width, *const magnitudes = slopes + model->width + 1;
  double rate, total;
  const hs_sparse *const row = &mode->gradients[k];
  if (values[k] <= 0 && e->task.timeline->segments == 1) return -1;
  if (mode->magnitudes(p, t, x, magnitudes) || hs_call(&mode->rates[k], p, t, x, &rate)) return values[k] > 0 ? 1 : -1;
  total = magnitudes[k];
  if (!hs_call(&row->values, p, t, x, slopes))
    for (int i = 0; i < row->count; i++) {
      const int s = row->place[i] - 1;
      total += fabs(slopes[i]) * (s < 0 ? fabs(t) : hs_max(fabs(x[s]), e->watch.sizes[mode->state[s]]));
    }
  const double noise = hs_max(BEYOND * ROUNDOFF_UNITS * HS_UNIT * total, fabs(rate) * 2 * HS_TIE * e->task.settings.until);
  return values[k] > noise ? 1 : values[k] < -noise ? -1 : 0;
}

/* Begin to watch an arc of flow: see _entered() in hsdsl/engine/simulate/verdict/remarks.py. */
static void begin_watching(hs_ensemble *e, const hs_arc *arc, int64_t row, const int32_t *name) {
  const hs_model *const model = e->task.model;
  const hs_mode *const mode = &model->mode[arc->mode];
  const hs_timeline *const timeline = e->task.timeline;
  hs_watch *const watch = &e->watch;
  double *const values = watch->memory;
  const double t = e->task.chunk.times[row];
  const int64_t segment = segment_at(timeline, t);
  const double *const p = timeline->data + segment * model->data;
  const int jumped = watch->arc && watch->jump == arc->jump && timeline->jump[segment] && timeline->start[segment] == t;
  const int known = !surfaces_at(e, mode, row, 0.0, p, values), same = watch->arc && watch->mode == arc->mode;
  for (int k = 0; k < mode->edges; k++) {
    const int i = name[k];
    if (i < 0 || !known) continue;
    int32_t *const came = &watch->came[i];
    if (*came == CAME_BEYOND && same && values[k] > 0) continue;
    if (*came) e->notices[e->done] |= HS_ENTERED;
    const double side = side_of(e, mode, k, t, p, values);
    *came = side > 0 && !(watch->side[i] > 0) ? CAME_BEYOND : jumped && side == 0 && watch->side[i] < 0 ? CAME_ONTO : 0;
  }
  for (int i = 0; !same && i < watch->names; i++) {
    int here = 0;
    for (int k = 0; k < mode->edges; k++) here |= name[k] == i;
    if (!here && watch->came[i]) e->notices[e->done] |= HS_ENTERED, watch->came[i] = 0;
  }
  watch->arc = arc->first + 1, watch->jump = arc->jump, watch->mode = arc->mode;
}

/* Watch states that have come beyond a surface or onto it along the step from a row: whether they stay there. */
static void watch_step(hs_ensemble *e, const hs_mode *mode, int64_t row, const double *p, const int32_t *name) {
  double *const values = e->watch.memory, *const times = e->task.chunk.times;
  for (int part = 1; part <= PARTS_OF_STEP; part++) {
    if (surfaces_at(e, mode, row, part / (double)PARTS_OF_STEP, p, values)) continue;
    for (int k = 0; k < mode->edges; k++) {
      int32_t *const came = name[k] < 0 ? 0 : &e->watch.came[name[k]];
      if (came && *came == CAME_BEYOND && values[k] <= 0) *came = 0;
      if (came && *came == CAME_ONTO && part == PARTS_OF_STEP && side_of(e, mode, k, times[row + 1], p, values)) *came = 0;
    }
  }
}

/* Watch the steps of an arc of flow from a row to another, and see where states are then. */
static void watch_steps(hs_ensemble *e, const hs_mode *mode, int64_t first, int64_t last, const int32_t *name) {
  const hs_model *const model = e->task.model;
  const hs_timeline *const timeline = e->task.timeline;
  const hs_chunk *const chunk = &e->task.chunk;
  hs_watch *const watch = &e->watch;
  const double *p = 0;
  for (int64_t row = first; row < last; row++) {
    const double *const x = chunk->values + row * model->width;
    int pending = 0;
    for (int s = 0; s < mode->dimension; s++) {
      double *const size = &watch->sizes[mode->state[s]];
      *size = hs_max(*size, hs_max(fabs(x[s]), fabs(x[model->width + s])));
    }
    for (int i = 0; i < watch->names; i++) pending |= watch->came[i];
    if (!pending && row + 1 < last) continue;
    p = timeline->data + segment_at(timeline, chunk->times[row]) * model->data;
    if (pending) watch_step(e, mode, row, p, name);
  }
  for (int i = 0; i < watch->names; i++) watch->side[i] = -1;
  if (surfaces_at(e, mode, last - 1, 1.0, p, watch->memory)) return;
  for (int k = 0; k < mode->edges; k++)
    if (name[k] >= 0) watch->side[name[k]] = side_of(e, mode, k, chunk->times[last], p, watch->memory);
}

/* Watch the chunk's arcs of flow: whether a state comes beyond the surface of an edge with an `if` without flow, as it
   enters a mode or an input jumps, or by such a jump onto it, and stays there while the flow lasts. */
static void watch(hs_ensemble *e, int ended) {
  const hs_chunk *const chunk = &e->task.chunk;
  const hs_model *const model = e->task.model;
  hs_watch *const watch = &e->watch;
  for (int64_t a = 0; a < chunk->arcs; a++) {
    const hs_arc *const arc = &chunk->arc[a];
    const hs_mode *const mode = &model->mode[arc->mode];
    const int32_t *const name = watch->name + (int64_t)arc->mode * model->surfaces;
    const int64_t first = arc->first > e->base ? arc->first - e->base : 0, made = arc->jump - e->made;
    const int64_t last = (a + 1 < chunk->arcs ? chunk->arc[a + 1].first - e->base : chunk->rows) - 1;
    if (arc->kind != HS_FLOW || mode->final) continue;
    if (last > first && chunk->times[last] > chunk->times[first]) {
      if (watch->arc != arc->first + 1) begin_watching(e, arc, first, name);
      watch_steps(e, mode, first, last, name);
    }
    if (watch->arc == arc->first + 1 && made >= 0 && made < chunk->transitions) { /* it is left by its own edge */
      const int i = name[chunk->transition[made].edge];
      if (i >= 0) watch->came[i] = 0;
    }
  }
  for (int i = 0; ended && i < watch->names; i++)
    if (watch->came[i]) e->notices[e->done] |= HS_ENTERED;
}

/* Which kinds of notices the chunk has, and whether it slides; a wall that ends the run was not followed roughly. */
static void keep_notices(hs_ensemble *e, int ended) {
  const hs_chunk *chunk = &e->task.chunk;
  int32_t *notices = &e->notices[e->done];
  if (e->watch.names) watch(e, ended);
  for (int64_t i = 0; i < chunk->notes; i++) {
    const hs_note *note = &chunk->note[i];
    if (note->kind == HS_IN_CONTACT && shown_alike(note->time, note->other)) continue;
    if (note->kind == HS_UNSETTLED &&
        (note->surface < e->task.model->mode[note->mode].edges ||
         (ended && e->task.stop.reason == HS_LEFT && e->task.stop.time == note->time)))
      continue;
    *notices |= 1 << note->kind;
  }
  for (int64_t k = 0; e->slides && k < chunk->arcs; k++) {
    const int64_t first = chunk->arc[k].first - e->base;
    const int64_t end = k + 1 < chunk->arcs ? chunk->arc[k + 1].first - e->base : chunk->rows;
    if (e->slides[chunk->arc[k].mode] && end > first && chunk->times[end - 1] > chunk->times[first > 0 ? first : 0])
      *notices |= HS_SLID;
  }
}

/* Let go of all rows of a full chunk but the last one, which the next piece begins at. */
static int let_go(hs_task *task) {
  hs_ensemble *e = (hs_ensemble *)task;
  hs_chunk *chunk = &task->chunk;
  const int64_t last = chunk->rows - 1, w = task->model->width, m = task->model->outputs;
  keep_notices(e, 0);
  if (last >= 0) {
    int64_t kept = chunk->arcs - 1;
    sample_chunk(e, 0);
    while (kept > 0 && chunk->arc[kept].first > e->base + last) kept--;
    for (int64_t k = kept; k < chunk->arcs; k++) chunk->arc[k - kept] = chunk->arc[k];
    chunk->arcs -= kept;
    chunk->times[0] = chunk->times[last];
    chunk->depth[0] = chunk->depth[last];
    copy(chunk->values, chunk->values + last * w, (int)w);
    copy(chunk->outputs, chunk->outputs + last * m, (int)m);
    chunk->rows = 1;
    e->base += last;
  }
  note_transitions(e);
  chunk->transitions = chunk->alternatives_used = chunk->notes = 0;
  return *e->stop != 0;
}

static int asked_to_stop(hs_task *task) { return *((const hs_ensemble *)task)->stop != 0; }

/* What is kept of a run. */
static void keep(hs_ensemble *e) {
  const hs_chunk *chunk = &e->task.chunk;
  const int64_t i = e->done, last = chunk->rows - 1, w = e->task.model->width, m = e->task.model->outputs;
  int64_t arc = chunk->arcs - 1;
  keep_notices(e, 1);
  sample_chunk(e, 1);
  note_transitions(e);
  while (arc > 0 && chunk->arc[arc].first > e->base + last) arc--;
  e->reason[i] = e->task.stop.reason;
  e->mode[i] = chunk->arc[arc].mode;
  e->kind[i] = e->layout;
  e->transitions[i] = e->made;
  e->ended[i] = chunk->times[last];
  copy(e->final + i * w, chunk->values + last * w, (int)w);
  copy(e->outputs + i * m, chunk->outputs + last * m, (int)m);
}

/* Begin an instance, which is not the one before. */
static void begin_instance(hs_ensemble *e) {
  hs_task *const task = &e->task;
  e->base = e->made = e->next = e->layout = 0;
  e->watch.arc = 0;
  for (int i = 0; i < e->watch.names; i++) e->watch.came[i] = 0, e->watch.side[i] = -1;
  for (int s = 0; e->watch.names && s < task->model->states; s++) e->watch.sizes[s] = 0;
  task->timeline = &e->timeline[e->done];
  task->settings = e->settings[e->done];
  task->x = e->start + e->done * task->dimension;
  hs_forget_waits(task->model, task->tail);
}

/* Keep what is kept of a run that is over; 0 where it was to stop. */
static int end_instance(hs_ensemble *e) {
  if (*e->stop && e->task.stop.reason == HS_INTERRUPTED) return 0;
  if (e->task.chunk.rows) keep(e);
  return 1;
}

static void open_place(hs_ensemble *e) {
  e->task.flush = let_go;
  e->task.poll = asked_to_stop;
}

void hs_run_ensemble(hs_ensemble *e) {
  open_place(e);
  for (; e->done < e->instances && !*e->stop; e->done++) {
    begin_instance(e);
    hs_simulate(&e->task);
    if (!end_instance(e)) return;
  }
}
