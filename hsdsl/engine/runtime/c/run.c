/* A run under way: the segment of its inputs, its mode and arc, and its stop. See hsdsl/engine/simulate/run.py. */

#if !defined(HS_NO_CLOCK)
#define POLL_EVERY (CLOCKS_PER_SEC / 50)
#endif

/* The segment that time is in; at a boundary the later one. */
static int64_t segment_at(const hs_timeline *timeline, hs_time t) {
  int64_t low = 0, high = timeline->segments;
  while (low < high) {
    const int64_t middle = (low + high) / 2;
    if (t < timeline->start[middle])
      high = middle;
    else
      low = middle + 1;
  }
  return low > 0 ? low - 1 : 0;
}

/* Where the segment that the run is in ends, at the latest where it pauses; the last one lasts until then. */
static hs_time segment_end(const hs_run *run) {
  const hs_timeline *timeline = run->task->timeline;
  const int64_t segment = run->here.segment;
  const int open = segment == timeline->segments - 1 && hs_finite(run->pausing.at);
  return open ? run->pausing.at : earlier(timeline->end[segment], run->pausing.at);
}

/* Whether another segment follows the one that the run is in. */
static int segment_follows(const hs_run *run) { return run->here.segment + 1 < run->task->timeline->segments; }

static const hs_real *segment_data(const hs_run *run, int64_t segment) {
  return run->task->timeline->data + segment * run->model->data;
}

static hs_reason stopped(hs_run *run, hs_reason reason, hs_time t) {
  hs_stop *stop = &run->task->stop;
  stop->reason = reason;
  stop->time = t;
  stop->mode = run->here.mode;
  stop->dimension = run->here.dimension;
  stop->segment = run->here.segment;
  stop->h = run->control.h;
  copy(stop->x, run->x, run->here.dimension);
  copy(stop->scales, run->sizes.scales, run->here.dimension);
  return reason;
}

/* Keep the scales of a mode's states, and have those of the next one's. */
static void hand_on_scales(hs_run *run, const hs_mode *from, const hs_mode *to) {
  for (int s = 0; from && s < from->dimension; s++) run->sizes.known[from->state[s]] = run->sizes.scales[s];
  for (int s = 0; s < run->width; s++) run->sizes.scales[s] = s < to->dimension ? run->sizes.known[to->state[s]] : 0.0;
}

/* Bound the first step of an arc of flow that begins in a mode; further ones may be twice as long each. */
static void bound_first_step(hs_run *run, int mode) {
  const hs_settings *settings = &run->task->settings;
  const hs_real bound = run->written.placed < settings->arcs ? settings->first_steps[run->written.placed] : 0.0;
  hs_real *const reach = &run->reach.step[mode];
  run->written.placed++;
  if (bound > 0) *reach = *reach > 0 ? hs_min(*reach, bound) : bound;
}

/* A mode at a time, its routines bound to the input segment there. A final mode without a flow has the states, and so the
   outputs, of the mode before it. */
static hs_mode_state mode_at(const hs_run *run, int mode, int dimension, hs_time t, const hs_mode_state *before) {
  hs_mode_state here;
  here.mode = mode;
  here.dimension = dimension;
  here.table = &run->model->mode[mode];
  here.segment = segment_at(run->task->timeline, t);
  here.p = segment_data(run, here.segment);
  here.outputs = here.table->dimension == dimension ? here.table->outputs : 0;
  here.outputs_p = here.p;
  if (!here.outputs && before && before->table->dimension == dimension) {
    here.outputs = before->table->outputs;
    here.outputs_p = before->p;
  }
  here.active = here.emerging = 0;
  here.t = t;
  return here;
}

/* Enter a mode at (t, run->x) and open an arc. */
static void place(hs_run *run, int mode, int dimension, hs_time t, const hs_mode_state *before) {
  const hs_mode_state here = mode_at(run, mode, dimension, t, before);
  hand_on_scales(run, run->here.table, here.table);
  run->here = here;
  if (run->task->settings.arcs) bound_first_step(run, mode);
  HS_MOVE(run, move_start(run, t));
  begin(run, HS_FLOW);
  append(run, t, run->x, 0);
  copy(run->entered, run->x, dimension);
}

static int limit_reached(const hs_run *run) { return run->written.jump >= run->task->settings.max_transitions; }

#if defined(HS_NO_CLOCK)
/* Ask the caller every so many steps whether to go on. */
static void poll(hs_run *run) {
  run->poll.steps_left = run->poll.steps;
  if (run->task->poll(run->task)) run->poll.interrupted = 1;
}
#else
/* Ask the caller now and then whether to go on, of a run of a few steps never; a clock costs more than many steps, so
   how many lie between is learnt. */
static void poll(hs_run *run) {
  const clock_t now = clock();
  const int first = !run->poll.at;
  if (first) run->poll.at = now;
  const int early = now - run->poll.at < POLL_EVERY;
  if (early && !first) run->poll.steps = run->poll.steps < 1L << 20 ? 2 * run->poll.steps : 1L << 20;
  if (now - run->poll.at > 4 * POLL_EVERY) run->poll.steps = run->poll.steps / 8 + 1;
  run->poll.steps_left = run->poll.steps;
  if (early) return;
  run->poll.at = now;
  if (run->task->poll(run->task)) run->poll.interrupted = 1;
}
#endif

/* Whether to stop: polls the caller now and then. */
static int interrupted(hs_run *run) {
  if (--run->poll.steps_left == 0) poll(run);
  return run->poll.interrupted;
}
