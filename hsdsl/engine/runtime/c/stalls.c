/* When no shorter step helps, and steps that go to and fro across a jump of the flow. See
   hsdsl/engine/simulate/stalls.py. */

/* Whether the surface in the way did not come nearer: its round-off is larger than what the step adds. */
static int still(hs_run *run, int surface, hs_time t1) {
  const hs_mode_state *here = &run->here;
  if (surface < 0) return 0;
  if (here->table->values(here->p, here->t, run->x, run->surfaces.values)) return 0;
  const hs_real before = run->surfaces.values[surface];
  if (here->table->values(here->p, t1, run->z, run->surfaces.values)) return 0;
  return run->surfaces.values[surface] == before;
}

static int unmoved(const hs_run *run) {
  for (int s = 0; s < run->here.dimension; s++)
    if (run->z[s] != run->x[s]) return 0;
  return 1;
}

/* Count a step from run->x to run->z that was halved because of `failure`; say what ends the run, if anything. */
static hs_step_failure stall_ends(hs_run *run, int halvings, hs_step_failure failure, int surface, hs_time t1) {
  hs_pace *const pace = &run->pace;
  const int small = count_cut_short(pace, run->here.t, t1, run->control.h);
  const int nowhere = count_idle(pace, small || still(run, surface, t1)), creeping = count_creeping(pace, halvings);
  if (nowhere || (small && unmoved(run))) return failure;
  return creeping ? HS_CREEPING : HS_CLEAR;
}

/* Begin to count the steps of a stretch of flow. */
static void begin_pace(hs_run *run) {
  const hs_time brief = run->task->settings.until * (run->control.tolerance > 0 ? SHORT : 0.0);
  const hs_pace pace = {HS_TIME_UNIT, brief, run->here.t, NAN, 0, 0, 0, 0};
  run->pace = pace;
}

/* Count a step from run->x to run->z, the flow there run->slope and run->end; say whether it is one of very many across
   a jump. */
HS_INLINE int across_jump(hs_run *run, const int n, hs_time t1) {
  hs_real share, before, behind;
  if (!count_turns(&run->pace, run->slope, run->end, n)) return 0;
  for (int s = 0; s < n; s++)
    if (run->slope[s] * run->end[s] < 0 &&
        jump_between(run, s, run->here.t, run->x, t1, run->z, &share, &before, &behind))
      return 1;
  return 0;
}
