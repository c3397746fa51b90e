/* One transition: which crossing goes, its reset, executions of events that wait, the mode that is entered, and cascades
   of transitions without flow between them. See hsdsl/engine/simulate/transitions.py.
   The spread of a reset is the sum of the sizes of the terms that each state after it is computed from. */

/* Whether edge `a` goes before edge `b` of those tied: the higher priority, then the file's order. */
static int goes_before(const hs_mode *mode, int a, int b) {
  const int p = mode->edge[a].priority, q = mode->edge[b].priority;
  return p != q ? p > q : a < b;
}

/* Let no edge be marked. */
static void untie(hs_run *run) {
  for (int k = 0; k < run->here.table->edges; k++) run->event.tied[k] = 0;
}

/* Choose which of several crossings goes: the earliest; of tied ones the highest priority, then the file's order.
   Tied are also guards that the earliest crossing's point stands on. The chosen edge goes from that point. */
static void choose(hs_run *run, int count) {
  const hs_mode *mode = run->here.table;
  hs_crossing *first = &run->event.crossings[0];
  for (int i = 1; i < count; i++)
    if (run->event.crossings[i].time < first->time) first = &run->event.crossings[i];
  const hs_real since = tie(first->time);
  hs_real depth = first->depth;
  int chosen = first->edge;
  untie(run);
  for (int i = 0; i < count; i++)
    if (run->event.crossings[i].time - first->time <= since) run->event.tied[run->event.crossings[i].edge] = 2 + i;
  standing(run, first->time, first->state, since);
  for (int k = 0; k < mode->edges; k++)
    if (run->event.tied[k] && goes_before(mode, k, chosen)) chosen = k;
  if (run->event.tied[chosen] >= 2) depth = run->event.crossings[run->event.tied[chosen] - 2].depth;
  run->event.alternatives_count = 0;
  for (int k = 0; k < mode->edges; k++)
    if (run->event.tied[k] && k != chosen) run->event.alternatives[run->event.alternatives_count++] = k;
  run->event.chosen = *first;
  run->event.chosen.edge = chosen;
  run->event.chosen.depth = depth;
}

/* Apply the chosen crossing's reset to the values before the jump, sizes of their numbers in `scale`: the state after it
   to run->event.after, and to run->sizes.both the sizes of the numbers it came from. Not 0 where it has no finite value. */
static int reset(hs_run *run, const hs_real *scale) {
  const hs_crossing *crossing = &run->event.chosen;
  const hs_edge *edge = &run->here.table->edge[crossing->edge];
  const int n = run->here.dimension, to = edge->target_dimension;
  hs_real *const sizes = run->step.error;
  const hs_real *const x = crossing->state;
  if (hs_changed(edge, &edge->reset, run->here.p, crossing->time, x, x, run->event.after)) return 1;
  if (!all_finite(run->event.after, to)) return 1;
  HS_MOVE(run, move_reset(run));
  copy(run->sizes.both, crossing->state, n);
  copy(run->sizes.both + n, scale, n);
  if (hs_changed(edge, &edge->spread, run->here.p, crossing->time, run->sizes.both, scale, sizes) || !all_finite(sizes, to))
    for (int s = 0; s < to; s++) sizes[s] = fabs(run->event.after[s]); /* where it is infinitely steep, no more is known */
  copy(run->sizes.both, sizes, to);
  return 0;
}

void hs_forget_waits(const hs_model *model, hs_tail *tail) {
  for (int q = 0; q < model->queues; q++) tail[q].first = tail[q].count = 0;
}

/* Where the i-th that waits has its time and its values. */
static hs_real *wait_at(const hs_model *model, const hs_tail *tail, int64_t i) {
  return tail->waits + (tail->first + i) * model->queued;
}

/* Room for one more after the last: 0, or not 0 where there is none. */
static int room_for_wait(const hs_model *model, hs_tail *tail, hs_task *task) {
  hs_tail larger = *tail;
  if (tail->first + tail->count < tail->room) return 0;
  if (2 * tail->first <= tail->room) {
    larger.room = 2 * tail->room > FEWEST_WAITS ? 2 * tail->room : FEWEST_WAITS;
    if (!task || task->lengthen(task, &larger)) larger = *tail;
  }
  const size_t size = (size_t)(tail->count * model->queued) * sizeof(hs_real);
  if (size) memmove(larger.waits, wait_at(model, tail, 0), size);
  larger.first = 0;
  *tail = larger;
  return tail->count == tail->room;
}

/* Before when others are made before one that waits until a time. */
static hs_real not_tied(hs_real time) { return time - HS_TIE * fabs(time); }

/* Let one wait, its values in states x, after those of the first `high` that are made before it or tied with it. It is
   not made before the one ahead of it, nor before `earliest`. */
static void insert_wait(const hs_model *model, hs_tail *tail, const hs_queue *queue, const hs_real *x, int64_t high,
                        hs_real earliest) {
  int64_t low = 0;
  while (low < high) {
    const int64_t middle = low + (high - low) / 2;
    if (x[queue->value[0]] < not_tied(*wait_at(model, tail, middle)))
      high = middle;
    else
      low = middle + 1;
  }
  hs_real *const place = wait_at(model, tail, low);
  const hs_real ahead = low ? *wait_at(model, tail, low - 1) : earliest;
  memmove(place + model->queued, place, (size_t)((tail->count - low) * model->queued) * sizeof(hs_real));
  for (int i = 0; i < queue->values; i++) place[i] = x[queue->value[i]];
  if (*place < ahead) *place = ahead;
  tail->count++;
}

/* Take part in a reset from x to z of the same mode; not 0 where more wait than may. */
static int advance_queue(const hs_model *model, hs_tail *tail, hs_task *task, const hs_queue *queue, const hs_real *x,
                         hs_real *z) {
  const hs_real had = x[queue->waiting], has = z[queue->waiting];
  if (has < 1) {
    tail->first = tail->count = 0;
  } else if (has < had && tail->count) {
    for (int i = 0; i < queue->values; i++) z[queue->value[i]] = wait_at(model, tail, 0)[i];
    tail->first++, tail->count--;
  } else if (1 <= had && had < has) {
    if (room_for_wait(model, tail, task)) return 1;
    const int goes_first = z[queue->value[0]] < not_tied(x[queue->value[0]]);
    insert_wait(model, tail, queue, goes_first ? x : z, goes_first ? 0 : tail->count, x[queue->value[0]]);
    for (int i = 0; i < queue->values && !goes_first; i++) z[queue->value[i]] = x[queue->value[i]];
    return has > queue->most;
  }
  return 0;
}

int hs_let_wait(const hs_model *model, hs_tail *tail, hs_task *task, const hs_mode *from, const hs_real *x,
                const hs_mode *to, hs_real *z) {
  int full = -1;
  if (from != to) hs_forget_waits(model, tail);
  for (int k = 0; from == to && k < to->queues; k++)
    if (advance_queue(model, &tail[to->queue[k].number], task, &to->queue[k], x, z)) full = k;
  return full;
}

/* A set of (mode, state): those that a chain of transitions at one instant has been in. */

/* What of the present state decides how the run goes on: the rest is 0. */
static const hs_real *decisive(hs_run *run) {
  const hs_mode *const mode = run->here.table;
  if (!mode->idle) return run->x;
  copy(run->step.error, run->x, run->here.dimension);
  for (int i = 0; i < mode->idle; i++) run->step.error[mode->idles[i]] = 0.0;
  return run->step.error;
}

static uint64_t hash_of(int mode, const hs_real *x, int n) {
  uint64_t hash = 1469598103934665603u ^ (uint64_t)mode;
  for (int s = 0; s < n; s++) {
    union {
      double number;
      uint64_t bits;
    } as;
    as.number = x[s] + 0.0; /* both zeros are the same */
    hash = (hash ^ as.bits) * 1099511628211u;
    hash ^= hash >> 29;
  }
  return hash;
}

static void forget(hs_visited *visited) {
  if (visited->count) memset(visited->slot, 0, 2 * (size_t)visited->room * sizeof *visited->slot);
  visited->count = 0;
}

/* Add a state; 1 where it was there. */
static int visit(hs_visited *visited, int width, int mode, const hs_real *x, int n) {
  const uint64_t slots = 2 * (uint64_t)visited->room;
  uint64_t i = hash_of(mode, x, n) % slots;
  for (; visited->slot[i]; i = (i + 1) % slots) {
    const int64_t place = visited->slot[i] - 1;
    if (visited->mode[place] == mode && same_state(visited->state + place * width, x, n)) return 1;
  }
  copy(visited->state + visited->count * width, x, n);
  visited->mode[visited->count] = mode;
  visited->slot[i] = ++visited->count;
  return 0;
}

/* Ask the caller for twice the room when it is used up; not 0 where there is none. */
static int make_room(hs_run *run) {
  hs_visited *visited = &run->task->visited, larger;
  if (visited->count < visited->room) return 0;
  if (run->task->grow(run->task, &larger)) return 1;
  for (int64_t i = 0; i < visited->count; i++) {
    const int mode = visited->mode[i]; /* none of them final, so each has the states of its mode */
    visit(&larger, run->width, mode, visited->state + i * run->width, run->model->mode[mode].dimension);
  }
  *visited = larger;
  return 0;
}

static int entered_outside(hs_run *run, int surface, hs_time t) {
  run->task->stop.surface = surface;
  return stopped(run, HS_ENTERED_OUTSIDE, t);
}

/* Choose among edges the state is beyond: the highest priority, then the file's order. */
static void choose_entry(hs_run *run, const int *beyond, hs_time t) {
  const hs_mode *mode = run->here.table;
  int chosen = -1;
  for (int k = 0; k < mode->edges; k++)
    if (beyond[k] && (chosen < 0 || goes_before(mode, k, chosen))) chosen = k;
  run->event.alternatives_count = 0;
  for (int k = 0; k < mode->edges; k++)
    if (beyond[k] && k != chosen) run->event.alternatives[run->event.alternatives_count++] = k;
  run->event.chosen.edge = chosen;
  run->event.chosen.theta = run->event.chosen.depth = 0.0;
  run->event.chosen.time = t;
  run->event.chosen.state = run->x;
  run->event.chosen.piece = 0;
}

/* Enter a mode at (t, run->x), sizes in run->sizes.scale, and make the transitions that fire at once.
   A surface that the flow passes within the time `since` counts as stood on: tied transitions share one point. So does
   one that moved past the state while it waited in a strip, where it was reset before t, at `reset_at`. One of an edge
   that run->surfaces.beyond marks was not reached before an input `jumped`: on it counts as beyond. */
static int enter(hs_run *run, int mode, int dimension, hs_time t, int from_here, hs_real since, int jumped,
                 hs_time reset_at) {
  forget(&run->task->visited);
  for (;; from_here = 1, jumped = 0, reset_at = t) {
    const hs_mode_state before = run->here;
    place(run, mode, dimension, t, from_here ? &before : 0);
    const hs_mode *table = run->here.table;
    if (run->written.full_queue >= 0) {
      run->task->stop.edge = run->written.full_queue;
      return stopped(run, HS_WAITING, t);
    }
    if (table->final) return stopped(run, HS_FINAL, t);
    if (make_room(run)) return stopped(run, HS_INTERRUPTED, t);
    if (visit(&run->task->visited, run->width, mode, decisive(run), dimension)) return stopped(run, HS_ZENO, t);
    if (table->values(run->here.p, t, run->x, run->surfaces.ahead) || enter_surfaces(run, t, since, jumped, reset_at))
      return stopped(run, HS_HERE_NOT_FINITE, t);
    if (!all_finite(run->surfaces.ahead, table->surfaces)) return stopped(run, HS_HERE_NOT_FINITE, t);
    int fires = 0;
    for (int k = 0; k < table->edges; k++) {
      run->surfaces.beyond[k] = run->surfaces.beyond[k] && !table->edge[k].conditional;
      fires |= run->surfaces.beyond[k];
    }
    if (!fires) {
      for (int k = table->edges; k < table->surfaces; k++)
        if (run->surfaces.beyond[k]) return entered_outside(run, k, t);
      return GOES_ON;
    }
    if (limit_reached(run)) return stopped(run, HS_LIMIT, t);
    if (run->poll.interrupted) return stopped(run, HS_INTERRUPTED, t);
    choose_entry(run, run->surfaces.beyond, t);
    if (reset(run, run->sizes.scale)) {
      run->task->stop.edge = run->event.chosen.edge;
      return stopped(run, HS_RESET_NOT_FINITE, t);
    }
    record(run, &run->event.chosen, t, run->event.after, 1);
    mode = table->edge[run->event.chosen.edge].target;
    dimension = table->edge[run->event.chosen.edge].target_dimension;
    copy(run->x, run->event.after, dimension);
    copy(run->sizes.scale, run->sizes.both, dimension);
  }
}

/* Whether the run has flowed between its last transition and a time. */
static int has_flowed(const hs_run *run, hs_time t) { return !run->written.jump || t > made_before(run, 0)->resumed; }

/* Count a transition that led to run->x; see the text. */
static int comes_back(hs_run *run, int flowed) {
  return returns(&run->cascade, flowed, run->here.mode, decisive(run), run->here.dimension);
}

/* Stop where a cascade has returned, after edge k of a mode. */
static int slides(hs_run *run, int mode, int k) {
  note(run, HS_SLIDES, k, mode, run->here.t, run->here.t);
  return stopped(run, HS_ACCUMULATED, run->here.t);
}

/* Guards on which the state is, to round-off or a tie, as crossings. */
static int standing_on(hs_run *run) {
  int count = 0;
  untie(run);
  standing(run, run->here.t, run->x, tie(run->here.t));
  for (int k = 0; k < run->here.table->edges; k++) {
    if (!run->event.tied[k]) continue;
    hs_crossing *crossing = &run->event.crossings[count++];
    crossing->edge = k;
    crossing->theta = crossing->depth = 0.0;
    crossing->time = run->here.t;
    copy(crossing->state, run->x, run->here.dimension);
    crossing->piece = 0;
  }
  return count;
}

/* The sizes of the numbers that a point between x and z, which `stays` on a guard or does not, is computed from, to
   run->sizes.landed. */
static void sizes(hs_run *run, const hs_real *x, const hs_real *z, int stays) {
  for (int s = 0; s < run->here.dimension; s++) {
    const hs_real kept = stays || z[s] == run->entered[s] ? run->sizes.scale[s] : 0.0;
    run->sizes.landed[s] = joined(kept, hs_max(fabs(x[s]), fabs(z[s])));
  }
}

static int in_strip(hs_run *run, hs_reason reason, hs_time t) {
  run->task->stop.edge = run->event.chosen.edge;
  return stopped(run, reason, t);
}

/* Go on in the segment of the inputs that time is in: anew where one of them has jumped. */
static int continued(hs_run *run, int jumped) {
  const hs_time t = run->here.t;
  const hs_mode_state before = run->here;
  if (jumped) {
    if (mark_inside(run, t, run->x, run->surfaces.beyond)) return stopped(run, HS_HERE_NOT_FINITE, t);
    for (int k = 0; k < run->here.table->surfaces; k++)
      run->surfaces.stood[k] = run->surfaces.active[k] && !run->surfaces.emerging[k] ? run->surfaces.values[k] : 0.0;
    return enter(run, run->here.mode, run->here.dimension, t, 0, 0.0, 1, t);
  }
  place(run, run->here.mode, run->here.dimension, t, 0);
  run->here.active = before.active, run->here.emerging = before.emerging;
  return GOES_ON;
}

/* Enter the next segment of the inputs. */
static int go_on(hs_run *run) {
  const hs_timeline *timeline = run->task->timeline;
  return continued(run, timeline->jump[segment_at(timeline, run->here.t)]);
}

/* Whether a run pauses that is to pause after its next transition. */
static int pauses(const hs_run *run) { return run->pausing.after_jump && run->written.jump > run->pausing.jumps_before; }
