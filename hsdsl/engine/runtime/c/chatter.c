/* Steps that go to and fro across a jump of the flow. See hsdsl/engine/simulate/chatter.py. */

#include "functions.h"

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
