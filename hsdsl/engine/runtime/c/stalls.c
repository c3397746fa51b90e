/* When no shorter step helps, and steps that go to and fro across a jump of the flow. See
   hsdsl/engine/simulate/stalls.py. */

#define IDLE_UNITS 64
#define MOST_IDLE 64
#define SHORT 1e-6
#define MOST_SHORT 100000

/* Whether the surface in the way did not come nearer: its round-off is larger than what the step adds. */
static int still(hs_run *run, int surface, hs_time t1) {
  const hs_mode_state *here = &run->here;
  if (surface < 0) return 0;
  if (here->table->values(here->p, here->t, run->x, run->values)) return 0;
  const hs_real before = run->values[surface];
  if (here->table->values(here->p, t1, run->z, run->values)) return 0;
  return run->values[surface] == before;
}

static int unmoved(const hs_run *run) {
  for (int s = 0; s < run->here.dimension; s++)
    if (run->z[s] != run->x[s]) return 0;
  return 1;
}

/* Count a step from run->x to run->z that was halved because of `failure`; say what ends the run, if anything. */
static hs_step_failure stall_ends(hs_run *run, int halvings, hs_step_failure failure, int surface, hs_time t1) {
  hs_stall *stall = &run->stall;
  const hs_time t = run->here.t;
  if (t != stall->reached) stall->idle = stall->creeping = 0;
  stall->reached = t1;
  const int small = t1 - t <= IDLE_UNITS * HS_TIME_UNIT * hs_max(t, run->control.h);
  stall->idle = small || still(run, surface, t1) ? stall->idle + 1 : 0;
  stall->creeping = halvings >= CREEPING ? stall->creeping + 1 : 0;
  if (stall->idle > MOST_IDLE || (small && unmoved(run))) return failure;
  return stall->creeping > MOST_CREEPING ? HS_CREEPING : HS_CLEAR;
}

/* Begin to count the steps of a flight within a millionth of the run. */
static void begin_pace(hs_run *run) {
  run->since = run->here.t;
  run->short_steps = 0;
  run->short_time = run->task->settings.until * (run->control.tolerance > 0 ? SHORT : 0.0);
}

/* Count a step from run->here.t; whether there were too many. */
static int is_slow(hs_run *run) {
  run->short_steps++;
  if (run->here.t - run->since > run->short_time) run->since = run->here.t, run->short_steps = 0;
  return run->short_steps > MOST_SHORT;
}

#define MOST_CHATTER 2000
#define JUMP_HALVINGS 40

/* Component k of the flow at the share s of the way from (t, x) to (t1, z). */
static int flow_between(hs_run *run, int k, hs_time t, const hs_real *x, hs_time t1, const hs_real *z, hs_real s,
                        hs_real *f) {
  const hs_mode_state *here = &run->here;
  for (int i = 0; i < here->dimension; i++) run->at[i] = x[i] + s * (z[i] - x[i]);
  if (here->table->flow(here->p, t + s * (t1 - t), run->at, run->source)) return RAISED;
  *f = run->source[k];
  return 0;
}

/* Whether component k of the flow jumps on the way from (t, x) to (t1, z). */
static int jumps(hs_run *run, int k, hs_time t, const hs_real *x, hs_time t1, const hs_real *z) {
  hs_real low = 0.0, high = 1.0, before, behind, value;
  if (flow_between(run, k, t, x, t1, z, low, &before) || flow_between(run, k, t, x, t1, z, high, &behind)) return 0;
  const hs_real size = fabs(behind - before);
  for (int i = 0; i < JUMP_HALVINGS; i++) {
    const hs_real middle = (low + high) / 2;
    if (flow_between(run, k, t, x, t1, z, middle, &value)) return 0;
    if (fabs(value - before) >= fabs(behind - value))
      high = middle, behind = value;
    else
      low = middle, before = value;
  }
  return size > 0 && 2 * fabs(behind - before) >= size;
}

/* Count a step from run->x to run->z, the flow there run->slope and run->end; say whether it is one of very many across
   a jump. */
HS_INLINE int chatters(hs_run *run, const int n, hs_time t1) {
  int turns = 0;
  for (int s = 0; s < n; s++) turns |= run->slope[s] * run->end[s] < 0;
  if (turns)
    run->chatter += 2;
  else if (run->chatter > 0)
    run->chatter--;
  if (run->chatter < MOST_CHATTER) return 0;
  run->chatter = 0;
  for (int s = 0; s < n; s++)
    if (run->slope[s] * run->end[s] < 0 && jumps(run, s, run->here.t, run->x, t1, run->z)) return 1;
  return 0;
}
