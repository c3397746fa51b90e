/* Surfaces in model exchange: on which side of them a state is, their indicators, and the way back onto them.

   Surface k of a mode has the indicator max(margin - r, -length * rate): positive inside the domain, and beyond the
   surface as long as the flow leads back. It falls through zero where the state is beyond by the margin and moves on
   outwards. A state may be beyond an edge with a condition without having crossed it: inside, the indicator is
   margin - r; outside, margin / 4 - r. So an event is on the side that it leads to, even where an indicator is zero.
   The margin is far above what a search for roots leaves, so that nothing stays undecided, and far below any
   state. The state is then taken back along the flow onto the surface, so no reset begins beyond it.

   Where an input that the caller sets moves a surface, no rate along the flow says whether the state crosses it: values
   alone decide. The state is taken back only as far as it may have come since it was inside. Where it stays beyond, and
   a reset leaves it there, it is on the surface, until it is inside again or gets further out: the indicator is positive
   between these two. */

#include "events.h"

#include <string.h>

#include "hs_math.h"

#define MARGIN 0x1p-32 /* relative to the sizes of states */

/* The rate of a surface along the flow. */
int fmu_rate_of(const hs_mode *mode, int k, const double *p, double t, const double *x, double *rate) {
  return hs_call(&mode->rates[k], p, t, x, rate) || !hs_finite(*rate);
}

const hs_mode *fmu_table(const fmu *unit) {
  const hs_mode *mode = &hs_the_model.mode[unit->now.mode];
  return unit->now.resting < 0 ? mode : &hs_the_model.mode[mode->held];
}

/* All slopes of surface k, by time and the states. */
static int gradient_of(const hs_mode *mode, int k, const double *p, double t, const double *x, double *out) {
  if (hs_call(&mode->gradients[k].values, p, t, x, out)) return 1;
  hs_spread_out(&mode->gradients[k], mode->dimension + 1, out);
  return 0;
}

/* Whether an input that the caller sets moves surface k. */
int fmu_is_driven(const fmu *unit, int k) {
  const char *const moves = fmu_moves[fmu_table(unit) - hs_the_model.mode] + k * FMU_INPUTS;
  for (int i = 0; i < FMU_INPUTS; i++)
    if (moves[i] && unit->now.given.input_set[i]) return 1;
  return 0;
}

/* Add to the sizes of surfaces how far each is moved where an input changes by its size. */
static void add_inputs(fmu *unit, const double *x, const double *r, double *sizes) {
  fmu_data *const now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  double p[PROBLEM_DATA + PROBLEM_CONTACTS + 1], moved[PROBLEM_SURFACES + 1];
  for (int i = 0; i < FMU_INPUTS; i++) {
    if (!now->given.input_set[i]) continue;
    now->input_size[i] = hs_max(hs_max(now->input_size[i], fmu_input_nominal[i]), fabs(now->given.input[i]));
    for (int sign = -1; sign <= 1; sign += 2) {
      memcpy(p, unit->p, sizeof p);
      p[PROBLEM_PARAMETERS + 3 * fmu_input[i].samples] += sign * now->input_size[i];
      if (mode->values(p, now->time, x, moved)) continue;
      for (int k = 0; k < mode->surfaces; k++)
        if (hs_finite(moved[k])) sizes[k] = sizes[k] + fabs(moved[k] - r[k]);
    }
  }
}

/* Sizes of states, and from them the margins of the present mode's surfaces, with the values r. */
int fmu_set_margins(fmu *unit, const double *r) {
  fmu_data *const now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  double x[PROBLEM_WIDTH + 1], gradient[PROBLEM_WIDTH + 2], sizes[PROBLEM_SURFACES + 1];
  const double *p = fmu_bind(unit);
  for (int i = 0; i < PROBLEM_STATES; i++)
    now->scale[i] = hs_max(hs_max(now->scale[i], fmu_nominal[i]), fabs(now->state[i]));
  fmu_local(unit, x);
  for (int k = 0; k < mode->surfaces; k++) {
    if (gradient_of(mode, k, p, now->time, x, gradient)) return 1;
    double size = fabs(gradient[0]) * hs_max(10 * problem_settings.largest, fabs(now->time));
    for (int s = 0; s < mode->dimension; s++) size = size + fabs(gradient[s + 1]) * now->scale[mode->state[s]];
    if (!hs_finite(size)) return 1;
    sizes[k] = size;
  }
  add_inputs(unit, x, r, sizes);
  for (int k = 0; k < mode->surfaces; k++) now->margin[k] = MARGIN * sizes[k];
  return 0;
}

/* Whether surface k ends the motion along the guard that holds the state. */
int fmu_lets_go(const fmu *unit, int k) {
  const fmu_data *now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  if (now->resting < 0 || k >= mode->edges) return 0;
  return mode->edge[k].releases == hs_the_model.mode[now->mode].edge[now->resting].contact;
}

/* Whether a state may be beyond surface k without having crossed it. */
int fmu_may_be_beyond(const fmu *unit, int k) {
  const hs_mode *mode = fmu_table(unit);
  return k < mode->edges && mode->edge[k].conditional && !fmu_lets_go(unit, k);
}

/* Whether the state is on surface k: some callers go on from it to the inside without an event. */
int fmu_is_on(const fmu *unit, int k) {
  return unit->now.side[k] == FMU_ON && !(unit->now.left_at[k] <= unit->now.time);
}

/* The indicator of surface k. */
static int indicator(const fmu *unit, int k, const double *p, const double *x, const double *r, double *z) {
  const fmu_data *now = &unit->now;
  const hs_mode *mode = fmu_table(unit);
  const double margin = now->margin[k], back = margin / 4 - r[k];
  double rate;
  if (fmu_is_on(unit, k)) return *z = hs_min(-back, now->furthest[k] + margin - r[k]), !hs_finite(*z);
  *z = now->side[k] == FMU_OUTSIDE ? back : margin - r[k];
  if (!fmu_may_be_beyond(unit, k) && !fmu_is_driven(unit, k) && !fmu_rate_of(mode, k, p, now->time, x, &rate))
    *z = hs_max(*z, -problem_settings.largest * rate); /* the flow may end at the surface */
  return !hs_finite(*z);
}

fmu_status fmu_get_indicators(fmu *unit, double *z) {
  double x[PROBLEM_WIDTH + 1], r[PROBLEM_SURFACES + 1];
  const hs_mode *mode = fmu_table(unit);
  const double *p = fmu_bind(unit);
  for (int k = 0; k < PROBLEM_SURFACES; k++) z[k] = 1.0;
  if (!p) return FMU_NO_VALUE;
  if (unit->now.ended) return FMU_OK;
  if (!unit->now.at_event) {
    unit->now.seen = unit->now.given;
    memcpy(unit->now.seen_state, unit->now.state, sizeof unit->now.state);
  }
  fmu_local(unit, x);
  if (mode->values(p, unit->now.time, x, r)) return FMU_NO_VALUE;
  for (int k = 0; k < mode->surfaces; k++) {
    if (r[k] < -unit->now.margin[k]) unit->now.left_at[k] = hs_min(unit->now.left_at[k], unit->now.time);
    if (indicator(unit, k, p, x, r, &z[k])) return FMU_NO_VALUE;
    if (!(r[k] > unit->now.margin[k])) unit->now.inside_at[k] = unit->now.time;
  }
  return FMU_OK;
}

/* The point of surface k that is nearest to x, relative to the sizes of states. */
static int projected(const fmu *unit, const hs_mode *mode, int k, const double *p, double t, double *x) {
  double g[PROBLEM_WIDTH + 2], r[PROBLEM_SURFACES + 1], total = 0.0;
  if (mode->values(p, t, x, r) || gradient_of(mode, k, p, t, x, g)) return 1;
  for (int s = 0; s < mode->dimension; s++) {
    const double size = unit->now.scale[mode->state[s]];
    total = total + g[s + 1] * size * g[s + 1] * size;
  }
  if (!(total > 0)) return 0;
  for (int s = 0; s < mode->dimension; s++) {
    const double size = unit->now.scale[mode->state[s]];
    x[s] = x[s] - r[k] / total * g[s + 1] * size * size;
  }
  return 0;
}

/* Where the flow through x crossed surface k: time and state, to round-off; 1 where it has no value or turns before. */
static int crossed(const hs_mode *mode, int k, const double *p, double *t, double *x) {
  double f[PROBLEM_WIDTH + 1], r[PROBLEM_SURFACES + 1], rate;
  for (int i = 0; i < 4; i++) {
    if (mode->values(p, *t, x, r) || fmu_rate_of(mode, k, p, *t, x, &rate) || mode->flow(p, *t, x, f)) return 1;
    if (!(rate > 0)) return 1;
    if (r[k] == 0) return 0;
    for (int s = 0; s < mode->dimension; s++) x[s] = x[s] - r[k] / rate * f[s];
    *t = *t - r[k] / rate;
  }
  return fmu_rate_of(mode, k, p, *t, x, &rate) || !(rate > 0);
}

/* Where an input moves surface k, it may have got far beyond the state: by how much of the way that leads back along the
   flow the state has come since it was inside, at most all of it. */
static double share_of(const fmu *unit, int k, double t, double at) {
  const double inside_at = unit->now.inside_at[k];
  if (!fmu_is_driven(unit, k) || at >= inside_at) return 1.0;
  return hs_max(0.0, (t - inside_at) / (t - at));
}

int fmu_take_back(const fmu *unit, int k, const double *p, double r, double *t, double *x) {
  const hs_mode *mode = fmu_table(unit);
  double q[PROBLEM_WIDTH + 1], at = *t;
  memcpy(q, x, sizeof q);
  const int turned = crossed(mode, k, p, &at, q), near = r <= 2 * unit->now.margin[k];
  const double share = turned ? 0.0 : share_of(unit, k, *t, at);
  if (share < 1 && (near || !fmu_is_driven(unit, k))) return projected(unit, mode, k, p, *t, x);
  for (int s = 0; s < mode->dimension; s++) x[s] = share < 1 ? x[s] + share * (q[s] - x[s]) : q[s];
  *t = share < 1 ? *t + share * (at - *t) : at;
  return 0;
}
