/* The flow along steps of a recorded run: whether it may do there what they do not show. See
   hsdsl/engine/simulate/verdict/flows.py. */

#include "screen_parts.h"

#define SEEN 0.5 /* of a step: every method has stages on parts of such a width, and shows what is as smooth */

/* Expand states and the flow along a part of a step. */
static void expand_flow(hs_view *v, int64_t row, double start, double width) {
  const double begin = v->s->run.times[row], length = v->s->run.times[row + 1] - begin, half = width / 2 * length;
  const hs_part part = part_of(v, row, start, width);
  v->expanded = width == 1.0;
  v->around[0] = expansion(begin + (start + width / 2) * length, half, 0.0, 0.0, 0.0, 0.0, 0.0);
  for (int i = 0; i < v->n; i++) v->around[1 + i] = expand_state(v, row, i, part, &v->slopes[i]);
  expand_operations(v->f, v->f->flow.first, v->f->flow.last, first_register(v), v->around);
}

/* How a state is moved along a part by what the step does not show there. */
typedef struct {
  double most, drift, unresolved; /* either way, in all, and by what may have any sign */
} hs_moved;

/* What is not shown is unresolved or, on a part so short that it may have no stage, how the flow differs from the
   slope of the state's polynomial. What errors of states change the flow by is no pulse. */
static hs_moved moved_unseen(const hs_view *v, int64_t row, int i, double width) {
  const double length = width * (v->s->run.times[row + 1] - v->s->run.times[row]);
  const hs_expansion flow = v->around[v->f->flow.result[i]];
  const double allowed = RESOLVED * flow.error;
  if (!(width < SEEN)) {
    const double unresolved = hs_max(flow.unresolved - allowed, 0.0) * length;
    const hs_moved found = {unresolved, 0.0, unresolved};
    return found;
  }
  const hs_expansion differs = expanded_sum(flow, negated(v->slopes[i]));
  const double drift = differs.value + differs.second / 3;
  const double less = hs_max(allowed - fabs(drift), 0.0);
  const hs_moved found = {
    hs_max(flow.unresolved + fabs(differs.value) + variation(differs) - allowed, 0.0) * length,
    copysign(hs_max(fabs(drift) - allowed, 0.0), drift) * length,
    hs_max(flow.unresolved - less, 0.0) * length,
  };
  return found;
}

/* Whether the flow has a bound along a step, and so have its slopes: no root is taken close to zero. */
static int all_known(const hs_view *v) {
  for (int i = 0; i < v->n; i++)
    if (!hs_finite(v->around[v->f->flow.result[i]].remainder)) return 0;
  return 1;
}

/* Whether states may be moved along a part by more than is left of what is allowed for the step, `allowance`, after the
   parts before: parts are halved until no part takes more than half its share, or than a quarter of what is left. */
static int flow_open(hs_view *v, int64_t row, int level, double start, double width) {
  int open = 0;
  if (++v->parts > MOST_PARTS_TRIED) return 1;
  expand_flow(v, row, start, width);
  if (level == 0 && v->f->steep && !all_known(v)) return 1;
  for (int i = 0; i < v->n; i++) {
    const double share = RESOLVED * hs_max(v->mode_error[i], HS_NOTHING) * width / 2;
    const double left = v->allowance[i] - fabs(v->drift[i]);
    open |= !(moved_unseen(v, row, i, width).most <= hs_max(share, left / 4));
  }
  if (open && level < LEVELS)
    return flow_open(v, row, level + 1, start, width / 2) ||
           flow_open(v, row, level + 1, start + width / 2, width / 2);
  for (int i = 0; i < v->n; i++) {
    const hs_moved moved = moved_unseen(v, row, i, width);
    v->allowance[i] -= moved.unresolved, v->drift[i] += moved.drift;
    if (!(fabs(v->drift[i]) <= v->allowance[i])) return 1;
  }
  return 0;
}

static int flow_hides(hs_view *v, int64_t row) {
  if (v->f->affine && !v->f->steep) return 0;
  v->parts = 0;
  for (int i = 0; i < v->n; i++) v->allowance[i] = RESOLVED * hs_max(v->mode_error[i], HS_NOTHING), v->drift[i] = 0.0;
  return flow_open(v, row, 0, 0.0, 1.0);
}
