/* Rows, arcs and transitions, written to the caller's chunk. See hsdsl/engine/simulate/recorder.py. */

/* Flush a full chunk: whether there is room for one more of each afterwards. */
static int make_chunk(hs_run *run) {
  if (run->written.full) return 0;
  const int answer = run->task->flush(run->task);
  if (answer) run->poll.interrupted = 1;
  if (answer == 2) run->written.full = 1;
  return !run->written.full;
}

HS_INLINE int room(hs_run *run) {
  const hs_chunk *chunk = &run->task->chunk;
  return (chunk->rows < chunk->row_room && chunk->arcs < chunk->arc_room &&
          chunk->transitions < chunk->transition_room && chunk->notes < chunk->note_room) ||
         make_chunk(run);
}

/* Keep a piece, zero where it has nothing: of lower degree, or in a mode with fewer states. */
HS_INLINE void write_piece(const hs_run *run, int n, const hs_polynomial *piece, hs_real *kept) {
  const int w = run->width, degree = run->method->degree, used = piece ? piece->degree : 0;
  if (n == w && used) memcpy(kept, piece->c, (size_t)(used * w) * sizeof *kept);
  for (int m = 0; n < w && m < used; m++) {
    copy(kept + m * w, piece->c + m * w, n);
    for (int s = n; s < w; s++) kept[m * w + s] = 0.0;
  }
  for (int i = used * w; i < degree * w && !run->task->chunk.blank; i++) kept[i] = 0.0;
}

HS_INLINE void write_row(hs_run *run, hs_time t, const hs_real *x, const hs_polynomial *piece, hs_real depth,
                      hs_routine *outputs, const hs_real *p) {
  hs_chunk *chunk = &run->task->chunk;
  const int n = run->here.dimension, w = run->width, m = run->model->outputs;
  if (!room(run)) return;
  if (run->lanes.bare) chunk->rows = run->written.row = 0; /* the last one counts */
  const int64_t row = chunk->rows;
  hs_real *values = chunk->values + row * w;
  chunk->times[row] = t;
  copy(values, x, n);
  for (int s = n; s < w; s++) values[s] = NAN;
  chunk->depth[row] = depth;
  if (m && (!outputs || outputs(p, t, x, chunk->outputs + row * m)))
    for (int i = 0; i < m; i++) chunk->outputs[row * m + i] = NAN;
  const int degree = run->lanes.bare ? 0 : run->method->degree;
  if (degree > 0) write_piece(run, n, piece, chunk->pieces + row * degree * w);
  chunk->rows++;
  run->written.row++;
  run->task->now = t;
}

/* Add the piece that leads to a row, and the row; the scales grow to the state's size. */
HS_INLINE void append(hs_run *run, hs_time t, const hs_real *x, const hs_polynomial *piece) {
  for (int s = 0; s < run->here.dimension; s++) run->sizes.scales[s] = hs_max(run->sizes.scales[s], fabs(x[s]));
  write_row(run, t, x, piece, 0.0, run->here.outputs, run->here.outputs_p);
}

/* Open an arc; its first row is written by the caller. */
static void begin(hs_run *run, int kind) {
  if (!room(run)) return;
  hs_arc *arc = &run->task->chunk.arc[run->task->chunk.arcs++];
  arc->first = run->lanes.bare ? 0 : run->written.row;
  arc->jump = run->written.jump;
  arc->mode = run->here.mode;
  arc->kind = kind;
}

/* Write a strip: the state waits at q while time and depth pass through `rows`; inputs go on. */
static void strip(hs_run *run, int rows, hs_time (*row)[2], const hs_real *q) {
  const hs_mode_state *here = &run->here;
  const hs_time end = row[rows - 1][0];
  const int further = end > run->task->timeline->end[here->segment] || end == run->until;
  begin(run, HS_STRIP);
  for (int i = 0; i < rows; i++) {
    const hs_real *p = here->outputs_p;
    if (further) p = segment_data(run, segment_at(run->task->timeline, row[i][0]));
    write_row(run, row[i][0], q, 0, row[i][1], here->outputs, p);
  }
}

/* Write one transition down; `after` is 0 where its reset has no value. */
static void record(hs_run *run, const hs_crossing *crossing, hs_time resumed, const hs_real *after, int entry) {
  hs_chunk *chunk = &run->task->chunk;
  const int w = run->width;
  const hs_edge *edge = &run->here.table->edge[crossing->edge];
  const hs_mode *const own = &run->model->mode[run->here.mode], *const next = &run->model->mode[edge->target];
  if (resumed == resumed && run->model->queues)
    run->written.full_queue =
        hs_let_wait(run->model, run->task->tail, run->task, own, crossing->state, next, run->event.after);
  const hs_made made = {crossing->time, resumed, run->here.mode, crossing->edge, edge->target, entry};
  run->written.made[run->written.jump % FREE] = made;
  run->written.jump++;
  run->task->made = run->written.jump;
  run->task->entries += entry;
  if (!room(run)) return;
  const int64_t i = chunk->transitions++;
  hs_transition *transition = &chunk->transition[i];
  transition->time = crossing->time;
  transition->resumed = resumed;
  transition->mode = run->here.mode;
  transition->edge = crossing->edge;
  transition->entry = entry;
  transition->alternatives = run->event.alternatives_count;
  for (int a = 0; a < run->event.alternatives_count; a++)
    chunk->alternatives[chunk->alternatives_used++] = run->event.alternatives[a];
  if (run->lanes.bare) return;
  copy(chunk->before + i * w, crossing->state, run->here.dimension);
  for (int s = 0; s < edge->target_dimension; s++) chunk->after[i * w + s] = after ? after[s] : (hs_real)NAN;
}

static void note(hs_run *run, hs_notice kind, int surface, int64_t number, hs_time time, hs_time other) {
  if (!room(run)) return;
  hs_note *note = &run->task->chunk.note[run->task->chunk.notes++];
  note->kind = kind;
  note->mode = run->here.mode;
  note->surface = surface;
  note->number = number;
  note->time = time;
  note->other = other;
}

/* Note that surface k would not settle on a polynomial: once for each. */
static void note_unsettled(hs_run *run, int k, hs_time time) {
  int *const unsettled = &run->written.unsettled[run->here.mode * run->model->surfaces + k];
  if (!*unsettled) note(run, HS_UNSETTLED, k, 0, time, time);
  *unsettled = 1;
}

/* Transition `back` before the last one. */
static const hs_made *made_before(const hs_run *run, int back) {
  return &run->written.made[(uint64_t)(run->written.jump - 1 - back) % FREE];
}
