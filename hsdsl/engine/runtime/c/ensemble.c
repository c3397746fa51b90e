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

/* Which kinds of notices the chunk has, and whether it slides; a wall that ends the run was not followed roughly. */
static void keep_notices(hs_ensemble *e, int ended) {
  const hs_chunk *chunk = &e->task.chunk;
  int32_t *notices = &e->notices[e->done];
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
