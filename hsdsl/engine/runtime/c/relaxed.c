/* The relaxed scheme: Burden et al. 2013, Fig. 12. See hsdsl/engine/simulate/relaxed.py. */

#include "functions.h"

#if !defined(HS_NO_CLOCK)
#define POLL_EVERY (CLOCKS_PER_SEC / 50)
#endif

/* Try one step from (here.t, run->x): what it found; its end is run->z, and trial.ends says whether it has a flow. */
HS_INLINE hs_found attempt(hs_run *run, const int n, hs_real h, hs_time t1) {
  const hs_mode_state *here = &run->here;
  const hs_mode *mode = here->table;
  hs_trial *trial = &run->trial;
  const int m = mode->surfaces;
  hs_found found;
  trial->t = here->t, trial->h = h, trial->t1 = t1;
  trial->looked = trial->ends = trial->has_piece = 0;
  const int status = step(run, n, here->t, h);
  if (status == NO_CONVERGENCE) return UNSOLVED;
  if (status || mode->values(here->p, t1, run->z, run->ahead)) return NOT_FINITE;
  hs_real largest = m ? run->ahead[0] : 0.0;
  for (int k = 1; k < m; k++) largest = hs_max(largest, run->ahead[k]);
  if (largest <= 0) {
    if (mode->flow(here->p, t1, run->z, run->end)) return NOT_FINITE;
    trial->looked = trial->ends = 1;
    return hs_finite(sum(run->z, n) + sum(run->ahead, m) + sum(run->end, n)) ? CLEAR : NOT_FINITE;
  }
  if (!hs_finite(sum(run->z, n) + sum(run->ahead, m))) return NOT_FINITE;
  if (judge(run, run->ahead, &found)) return trial->ends = 0, NOT_FINITE;
  if (found.failure != HS_CLEAR || found.crossings || ends(run, trial)) {
    ends(run, trial);
    return found;
  }
  return trial->ends = 0, NOT_FINITE;
}

/* The sizes of the numbers that a point between x and z, which `stays` on a guard or does not, is computed from, to
   run->landed. */
static void sizes(hs_run *run, const hs_real *x, const hs_real *z, int stays) {
  for (int s = 0; s < run->here.dimension; s++) {
    const hs_real kept = stays || z[s] == run->entered[s] ? run->scale[s] : 0.0;
    run->landed[s] = joined(kept, hs_max(fabs(x[s]), fabs(z[s])));
  }
}

/* Guards on which the state is, to round-off or a tie, as crossings. */
static int standing_on(hs_run *run) {
  int count = 0;
  standing(run, run->here.t, run->x, tie(run->here.t), run->tied);
  for (int k = 0; k < run->here.table->edges; k++) {
    if (!run->tied[k]) continue;
    hs_crossing *crossing = &run->crossings[count++];
    crossing->edge = k;
    crossing->theta = crossing->depth = 0.0;
    crossing->time = run->here.t;
    copy(crossing->state, run->x, run->here.dimension);
    crossing->piece = 0;
  }
  return count;
}

/* No step, however short, stays in the relaxed domain: take a guard reached together with a wall, or stop. */
static int stuck(hs_run *run, hs_step_failure kind, int surface) {
  const int may_stand = kind != HS_ERROR && kind != HS_CREEPING && kind != HS_JUMP && kind != HS_SLOW;
  const int count = may_stand ? standing_on(run) : 0;
  if (count) {
    choose(run, count);
    sizes(run, run->x, run->x, run->active_surfaces[run->chosen.edge]);
    run->landed_at = run->here.t;
    return LANDED;
  }
  run->task->stop.failure = kind;
  run->task->stop.surface = surface;
  copy(run->task->stop.slope, run->slope, run->here.dimension);
  return stopped(run, HS_STUCK, run->here.t);
}

#if defined(HS_NO_CLOCK)
/* Ask the caller every so many steps whether to go on. */
static void poll(hs_run *run) {
  run->steps_to_poll = run->poll_steps;
  if (run->task->poll(run->task)) run->interrupted = 1;
}
#else
/* Ask the caller now and then whether to go on, of a run of a few steps never; a clock costs more than many steps, so
   how many lie between is learnt. */
static void poll(hs_run *run) {
  const clock_t now = clock();
  const int first = !run->polled;
  if (first) run->polled = now;
  const int early = now - run->polled < POLL_EVERY;
  if (early && !first) run->poll_steps = run->poll_steps < 1L << 20 ? 2 * run->poll_steps : 1L << 20;
  if (now - run->polled > 4 * POLL_EVERY) run->poll_steps = run->poll_steps / 8 + 1;
  run->steps_to_poll = run->poll_steps;
  if (early) return;
  run->polled = now;
  if (run->task->poll(run->task)) run->interrupted = 1;
}
#endif

/* Whether to stop: polls the caller now and then. */
static int interrupted(hs_run *run) {
  if (--run->steps_to_poll == 0) poll(run);
  return run->interrupted;
}

/* Step in the domain until a step ends in a strip, at the segment's end, or nowhere (Fig. 12, lines 3 to 9). */
static int flow(hs_run *run) {
  hs_mode_state *here = &run->here;
  hs_control *control = &run->control;
  const int adaptive = control->tolerance > 0, curved = run->method->degree > 0;
  const int n = here->dimension;
  const hs_time limit = segment_end(run);
  run->stall.reached = NAN;
  run->stall.idle = run->stall.creeping = run->chatter = 0;
  forget_steps(run);
  if (here->table->flow(here->p, here->t, run->x, run->slope)) return stopped(run, HS_HERE_NOT_FINITE, here->t);
  begin_steps(run);
  begin_pace(run);
  while (here->t < limit && !is_slow(run)) {
    hs_real h = control->h, ratio = NAN;
    hs_time t1;
    int halvings = 0;
    hs_found found, last = TOO_WRONG;
    if (interrupted(run)) return stopped(run, HS_INTERRUPTED, here->t);
    for (;;) {
      t1 = end_of_step(here->t, &h, limit);
      found = attempt(run, n, h, t1);
      if (adaptive && run->trial.ends && found.failure == HS_CLEAR) {
        local_error(run, h);
        ratio = error_ratio(run, h);
        found = ratio > 1 ? TOO_WRONG : excursion(run, &run->trial, found);
      }
      if (found.failure == HS_CLEAR) break;
      last = found;
      const int too_long = found.failure == HS_ERROR || (found.failure == HS_UNSOLVED && adaptive);
      if (too_long && halvings == 0) {
        reject(control, h, found.failure == HS_UNSOLVED ? NAN : ratio);
        h = control->h;
      } else {
        h = h / 2, halvings++;
      }
      if (halvings > MOST_HALVINGS || (too_long && (struggles(control) || !(here->t + h > here->t))))
        return stuck(run, found.failure, found.surface);
    }
    if (ratio == ratio && halvings == 0) accept(control, h, ratio);
    if (found.crossings || !run->trial.ends) {
      choose(run, found.crossings);
      sizes(run, run->x, run->chosen.theta > 0 ? run->z : run->x, run->active_surfaces[run->chosen.edge]);
      run->landed_at = t1;
      return LANDED;
    }
    if (halvings || !(t1 > here->t)) {
      const hs_step_failure given_up = stall_ends(run, halvings, last.failure, last.surface, t1);
      if (given_up != HS_CLEAR) return stuck(run, given_up, last.surface);
    }
    if (adaptive && chatters(run, n, t1)) return stuck(run, HS_JUMP, -1);
    if (here->standing || here->emerging) leave(run, t1, run->z);
    const hs_polynomial *const piece = curved && !piece_of(run, &run->trial) ? &run->trial.piece : 0;
    HS_MOVE(run, move_along(run, t1, run->z, h));
    append(run, t1, run->z, piece);
    here->t = t1;
    swap(&run->x, &run->z);
    swap(&run->slope, &run->end);
    run->k[0] = run->slope;
    run->k[run->method->stages] = run->end;
  }
  return here->t < limit ? stuck(run, HS_SLOW, -1) : AT_BOUNDARY;
}

static int in_strip(hs_run *run, hs_reason reason, hs_time t) {
  run->task->stop.edge = run->chosen.edge;
  return stopped(run, reason, t);
}

/* Whether flows of two modes that lead to and fro do more than undo each other: strips would freeze the rest. */
static int moves_on(hs_run *run, const hs_mode_state *before, int unknown) {
  const hs_mode_state *here = &run->here;
  if (before->mode == here->mode) return 0;
  if (unknown || here->table->flow(here->p, here->t, run->x, run->end)) return 1;
  if (before->dimension != here->dimension) return 1;
  return !takes_back(run->source, run->end, here->dimension);
}

/* Wait in the strip for what is left of epsilon, then reset (Fig. 12, lines 10 to 14). */
static int through_strip(hs_run *run) {
  const hs_crossing *crossing = &run->chosen;
  const hs_time t = crossing->time, depth = crossing->depth, until = run->until, t1 = run->landed_at;
  const int k = crossing->edge;
  const hs_edge *edge = &run->here.table->edge[k];
  if (crossing->theta > 0) {
    shortened(run, crossing->piece, crossing->theta, &run->cubic);
    append(run, t, crossing->state, &run->cubic);
  }
  if (limit_reached(run)) return stopped(run, HS_LIMIT, t);
  HS_MOVE(run, move_crossing(run));
  hs_time resumed = t1 + (run->epsilon - depth);
  const int without_value = reset(run, run->landed);
  if (resumed > until + tie(until)) {
    hs_time rows[3][2] = {{t, depth * 0}, {t1, depth}, {until, depth + (until - t1)}};
    strip(run, 3, rows, crossing->state);
    record(run, crossing, NAN, without_value ? 0 : run->after, 0);
    return in_strip(run, HS_UNTIL_IN_STRIP, until);
  }
  if (without_value) return in_strip(run, HS_RESET_NOT_FINITE, t);
  resumed = earlier(resumed, until);
  hs_time rows[3][2] = {{t, depth * 0}, {t1, depth}, {resumed, run->epsilon}};
  strip(run, 3, rows, crossing->state);
  const int flowed = has_flowed(run, t);
  record(run, crossing, resumed, run->after, 0);
  copy(run->x, run->after, edge->target_dimension);
  copy(run->scale, run->both, edge->target_dimension);
  const hs_mode_state before = run->here;
  const int unknown = before.table->flow(before.p, t, crossing->state, run->source);
  const int entered = enter(run, edge->target, edge->target_dimension, resumed, 1, 0.0, 0, t);
  if (entered != GOES_ON) return entered;
  if (!returns(run, flowed)) return run->here.mode == before.mode ? unresolved(run, k) : GOES_ON;
  return moves_on(run, &before, unknown) ? slides(run, before.mode, k) : GOES_ON;
}

/* Go on in the segment of the inputs that time is in: anew where one of them has jumped. */
static int continued(hs_run *run, int jumped) {
  const hs_time t = run->here.t;
  const hs_mode_state before = run->here;
  if (jumped) {
    if (mark_inside(run, t, run->x, run->beyond)) return stopped(run, HS_HERE_NOT_FINITE, t);
    for (int k = 0; k < run->here.table->surfaces; k++)
      run->stood[k] = run->active_surfaces[k] && !run->emerging[k] ? run->values[k] : 0.0;
    return enter(run, run->here.mode, run->here.dimension, t, 0, 0.0, 1, t);
  }
  place(run, run->here.mode, run->here.dimension, t, 0);
  run->here.standing = before.standing, run->here.emerging = before.emerging;
  return GOES_ON;
}

/* Enter the next segment of the inputs. */
static int go_on(hs_run *run) {
  const hs_timeline *timeline = run->task->timeline;
  return continued(run, timeline->jump[segment_at(timeline, run->here.t)]);
}

/* Go on behind a sample of an input, or end: a jump at the end is made, and a guard reached there fires. */
static int at_boundary(hs_run *run) {
  const hs_time t = run->here.t;
  if (t >= run->pause) return PAUSED;
  if (t < run->until || segment_follows(run)) return go_on(run);
  const int count = standing_on(run);
  if (!count) return stopped(run, HS_UNTIL, t);
  if (limit_reached(run)) return stopped(run, HS_LIMIT, t);
  choose(run, count);
  hs_time rows[1][2] = {{t, 0.0}};
  strip(run, 1, rows, run->x);
  record(run, &run->chosen, NAN, 0, 0);
  return in_strip(run, HS_UNTIL_ON_GUARD, t);
}

/* Whether a run pauses that is to pause behind its next transition. */
static int pauses(const hs_run *run) { return run->after_jump && run->jump > run->jumps_before; }

/* Follow the relaxed execution until it stops or pauses. */
static int relaxed(hs_run *run, int outcome) {
  while (outcome == GOES_ON) {
    outcome = run->interrupted ? (int)stopped(run, HS_INTERRUPTED, run->here.t) : flow(run);
    if (outcome == LANDED)
      outcome = through_strip(run);
    else if (outcome == AT_BOUNDARY)
      outcome = at_boundary(run);
    if (outcome == GOES_ON && pauses(run)) return PAUSED;
  }
  return outcome;
}
