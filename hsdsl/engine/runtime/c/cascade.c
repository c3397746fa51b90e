/* Transitions that follow each other without any flow between them. See hsdsl/engine/simulate/cascade.py. */

#include "functions.h"

#define PARALLEL 1e-6

/* Whether the run has flowed between its last transition and a time. */
static int has_flowed(const hs_run *run, hs_time t) { return !run->jump || t > made_before(run, 0)->resumed; }

/* Count a transition that led to run->x of the present mode, after some flow or none; say whether one of the same
   cascade has led there before (Brent's algorithm). */
static int returns(hs_run *run, int flowed) {
  hs_cascade *const cascade = &run->cascade;
  const int n = run->here.dimension, mode = run->here.mode;
  const hs_real *const x = decisive(run);
  if (!flowed && cascade->room) {
    if (mode == cascade->mode && same_state(x, cascade->x, n)) return 1;
    if (++cascade->length != cascade->room) return 0;
  }
  cascade->room = flowed || !cascade->room ? 1 : 2 * cascade->room;
  cascade->length = 0;
  cascade->mode = mode;
  copy(cascade->x, x, n);
  return 0;
}

/* Whether one direction is opposite to another that is not zero, in each component. */
static int takes_back(const hs_real *slope, const hs_real *back, int n) {
  int first = 0;
  while (first < n && slope[first] == 0) first++;
  const hs_real share = first < n ? back[first] / slope[first] : 0;
  for (int s = 0; s < n; s++)
    if (!(fabs(back[s] - share * slope[s]) <= PARALLEL * fabs(share) * fabs(slope[s]))) return 0;
  return share < 0;
}

/* Stop where a cascade has returned, after edge k of a mode. */
static int slides(hs_run *run, int mode, int k) {
  note(run, HS_SLIDES, k, mode, run->here.t, run->here.t);
  return stopped(run, HS_ACCUMULATED, run->here.t);
}
