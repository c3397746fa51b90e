/* The relaxed scheme: Burden et al. 2013, Fig. 12; how far a trial step is beyond guards, and where it crossed them.
   See hsdsl/engine/simulate/relaxed.py. A status is 0, or RAISED where a routine has no value. */

#define SCAN 8
#define ROOT_SHARE (1.0 / 16)

static hs_found failure(hs_step_failure kind, int surface) {
  const hs_found found = {kind, surface, 0};
  return found;
}

/* |grad r| in (t, x). */
static int norm_of(hs_run *run, hs_time t, const hs_real *x, int k, hs_real *norm) {
  hs_real total = 0.0;
  const hs_sparse *const row = &run->here.table->gradients[k];
  if (hs_call(&row->values, run->here.p, t, x, run->gradient)) return RAISED;
  for (int i = 0; i < row->count; i++) total = total + run->gradient[i] * run->gradient[i];
  *norm = sqrt(total);
  return 0;
}

/* Ask for the flow at a trial's end once; beyond a guard it need not have a value. */
static int ends(hs_run *run, hs_trial *trial) {
  if (!trial->looked) {
    trial->looked = 1;
    trial->ends = 0;
    if (!run->here.table->flow(run->here.p, trial->t1, run->z, run->end)) {
      const hs_real total = sum_of(run->end, run->here.dimension);
      trial->ends = total - total == 0;
    }
  }
  return trial->ends;
}

/* The step's interpolant, to trial->piece. */
static int piece_of(hs_run *run, hs_trial *trial) {
  if (trial->has_piece) return 0;
  if (!ends(run, trial))
    secant(run, &trial->piece);
  else if (method_piece(run, trial->t, trial->h, &trial->piece))
    return RAISED;
  trial->has_piece = 1;
  return 0;
}

/* Whether a step is beyond surface k on the way: at its eighths, and then ever nearer around the highest point. */
static int beyond_within(hs_run *run, hs_trial *trial, int k) {
  hs_real top, r, noise, place = 0.0, width = 1.0 / SCAN, shares[SCAN];
  if (surface(run, k, trial->t, run->x, &top) || surface(run, k, trial->t1, run->z, &r)) return RAISED;
  if (roundoff_bound(run, k, trial->t, run->x, 0, &noise)) return RAISED;
  if (top > noise) return 0; /* transparent, and beyond already */
  if (roundoff_bound(run, k, trial->t1, run->z, 0, &noise)) return RAISED;
  if (r > noise) return 0; /* crossed */
  int count = SCAN - 1;
  for (int i = 1; i < SCAN; i++) shares[i - 1] = (0.0 + i) / SCAN;
  while (count) {
    const hs_real crest = top;
    hs_real least = top;
    for (int i = 0; i < count; i++) {
      const hs_real s = shares[i];
      const hs_time t = trial->t + s * trial->h;
      if (piece_of(run, trial)) return RAISED;
      at(run, &trial->piece, s, run->at);
      if (surface(run, k, t, run->at, &r)) return RAISED;
      if (r > 0 && roundoff_bound(run, k, t, run->at, 0, &noise)) return RAISED;
      if (r > 0 && r > noise) return 1;
      if (r > top)
        place = s, top = r;
      else
        least = r < least ? r : least;
    }
    const int within = count == 2 && top == crest;
    if (!(width * trial->h > run->epsilon) || (within && top + (top - least) <= 0)) break;
    width = width / 2;
    count = 0;
    if (place - width > 0 && place - width < 1) shares[count++] = place - width;
    if (place + width > 0 && place + width < 1) shares[count++] = place + width;
  }
  return 0;
}

static int rate_along(hs_run *run, int k, hs_time t, const hs_real *x, const hs_real *flow, hs_real *rate) {
  const hs_sparse *const row = &run->here.table->gradients[k];
  if (hs_call(&row->values, run->here.p, t, x, run->gradient)) return RAISED;
  *rate = 0.0;
  for (int i = 0; i < row->count; i++)
    *rate = *rate + run->gradient[i] * (row->place[i] ? flow[row->place[i] - 1] : 1.0);
  return 0;
}

/* Look for a surface that a step went beyond and came back from, on its interpolant: its failure, or what was found. */
static hs_found excursion(hs_run *run, hs_trial *trial, hs_found found) {
  if (!ends(run, trial)) return found;
  for (int k = 0; k < run->here.table->surfaces; k++) {
    hs_real out, back;
    if (rate_along(run, k, trial->t, run->x, run->slope, &out)) continue;
    if (rate_along(run, k, trial->t1, run->z, run->end, &back)) continue;
    const int looked = run->surfaces.active[k] || (out > 0 && 0 >= back);
    if (looked && beyond_within(run, trial, k) == 1) return failure(HS_DEEP, k);
  }
  return found;
}

static int on_piece(hs_run *run, const hs_polynomial *piece, int k, hs_real s, hs_real *r) {
  at(run, piece, s, run->at);
  return surface(run, k, run->trial.t + s * run->trial.h, run->at, r);
}

/* Find the last s in [0, 1] where surface k rises through zero on an interpolant, knowing that it ends above;
   not-a-number if it never does. */
static int last_up_crossing(hs_run *run, const hs_polynomial *piece, int k, hs_real small, hs_real *theta) {
  hs_real a, fa, b = 1.0, fb;
  if (on_piece(run, piece, k, b, &fb)) return RAISED;
  for (int i = SCAN - 1; i >= 0; i--) {
    a = 1.0 * i / SCAN;
    if (on_piece(run, piece, k, a, &fa)) return RAISED;
    if (fa <= 0) return close_bracket(run, on_piece, piece, k, a, fa, b, fb, small, HS_UNIT, theta);
    b = a, fb = fa;
  }
  *theta = NAN;
  return 0;
}

/* Whether a state may be beyond surface k without having crossed it. */
static int is_transparent(const hs_run *run, int k) {
  const hs_mode *mode = run->here.table;
  return run->surfaces.emerging[k] || k >= mode->edges || mode->edge[k].conditional;
}

/* Where surface k was last crossed upwards on an interpolant: 1; 0 if it was beyond all along. */
static int crossed_on(hs_run *run, const hs_polynomial *piece, int k, hs_crossing *crossing) {
  const hs_trial *trial = &run->trial;
  hs_real small, theta, r, noise;
  hs_real *const sizes = run->at; /* it can be located to round-off of the numbers of this step, no older ones */
  for (int s = 0; s < run->here.dimension; s++) sizes[s] = hs_max(fabs(run->x[s]), fabs(run->z[s]));
  if (roundoff_bound(run, k, trial->t1, sizes, 0, &small)) return RAISED;
  if (last_up_crossing(run, piece, k, small * ROOT_SHARE, &theta)) return RAISED;
  if (theta != theta) {
    if (is_transparent(run, k)) {
      at(run, piece, 0.0, run->at);
      if (surface(run, k, trial->t + 0.0 * trial->h, run->at, &r)) return RAISED;
      if (roundoff_bound(run, k, trial->t, run->x, 0, &noise)) return RAISED;
      if (r > noise) return 0;
    }
    theta = 0.0; /* on the surface to round-off: it is crossed as the step begins */
  }
  crossing->theta = theta;
  crossing->time = theta == 0 ? trial->t : trial->t + theta * trial->h;
  if (theta == 0)
    copy(crossing->state, run->x, run->here.dimension);
  else
    at(run, piece, theta, crossing->state);
  return 1;
}

/* How far the flow at a crossing would take surface k back inside over this step. */
static int back_of(hs_run *run, int k, const hs_crossing *crossing, hs_real *back) {
  hs_real rate;
  if (hs_call(&run->here.table->rates[k], run->here.p, crossing->time, crossing->state, &rate)) return RAISED;
  *back = -rate * run->trial.h;
  return 0;
}

/* 1 where the trial's end is too deep beyond surface k, or its depth is not defined (`found` says which). */
static int too_deep(hs_run *run, int k, const hs_real *values, hs_found *found) {
  hs_real norm;
  if (norm_of(run, run->trial.t1, run->z, k, &norm)) return RAISED;
  if (!(norm > 0)) return *found = failure(HS_FLAT, k), 1;
  if (values[k] <= run->epsilon * norm + run->surfaces.noise[k]) return 0;
  return *found = failure(HS_DEEP, k), 1;
}

/* Find the last up-crossing of surface k: 1 with the crossing, 0 where it is transparent there, or with an failure. */
static int crossing_of(hs_run *run, int k, const hs_real *values, hs_crossing *crossing, hs_found *found) {
  hs_trial *trial = &run->trial;
  const hs_polynomial *piece = &trial->piece;
  const hs_real noise = run->surfaces.noise[k];
  hs_real norm, back, r;
  int status = piece_of(run, trial);
  if (status) return status;
  status = crossed_on(run, piece, k, crossing);
  if (status != 1) return status;
  if (norm_of(run, trial->t1, run->z, k, &norm) || back_of(run, k, crossing, &back)) return RAISED;
  if (back > noise && back <= run->epsilon * norm) { /* where the interpolant was off the flow leads back inside */
    if (trial->ends) {
      hermite(run, trial->h, &run->cubic);
      piece = &run->cubic;
    }
    if (crossed_on(run, piece, k, crossing) == RAISED || back_of(run, k, crossing, &back)) return RAISED;
  }
  if (back > noise) return *found = failure(HS_INWARD, k), 0;
  status = condition(run, k, crossing->time, crossing->state);
  if (!status && (crossing->theta == 0 || run->surfaces.active[k])) {
    const hs_real *q = crossing->state;
    hs_time time = crossing->time;
    if (back > 0) { /* where the flow comes back to the surface after a hop that round-off hides */
      const hs_real s = crossing->theta + (1 - crossing->theta) * (back / (back + values[k]));
      at(run, piece, s, run->near);
      time = trial->t + s * trial->h, q = run->near;
    }
    status = holds_next(run, k, time, q);
  }
  if (status != 1) return status;
  status = too_deep(run, k, values, found);
  if (status) return status == RAISED ? RAISED : 0;
  for (int i = 1; i < SCAN; i++) { /* further beyond on the way than at the end: that is on another flank */
    if (on_piece(run, piece, k, crossing->theta + (1 - crossing->theta) * i / SCAN, &r)) return RAISED;
    if (r > values[k] + noise) return *found = failure(HS_DEEP, k), 0;
  }
  crossing->edge = k;
  crossing->depth = hs_min(run->epsilon, values[k] / norm);
  crossing->piece = piece;
  return 1;
}

/* Say whether a trial's end is in the relaxed domain: inside (no crossing), in strips, or neither.
   `values` are those of the surfaces there. */
static int judge(hs_run *run, const hs_real *values, hs_found *found) {
  const hs_mode *mode = run->here.table;
  *found = CLEAR;
  for (int k = 0, looked = 0; k < mode->surfaces; k++) {
    if (values[k] <= 0) continue;
    if (!looked++ && magnitudes_at(run, run->trial.t1, run->z, run->surfaces.magnitudes)) return RAISED;
    run->surfaces.noise[k] = bound_from(run, run->surfaces.magnitudes, k, run->trial.t1, run->z, 0);
  }
  for (int k = 0; k < mode->surfaces; k++) {
    if (values[k] <= 0 || values[k] <= run->surfaces.noise[k]) continue;
    if (k >= mode->edges && !run->surfaces.emerging[k]) return *found = failure(HS_WALL, k), 0;
    if (is_transparent(run, k)) continue;
    const int status = too_deep(run, k, values, found);
    if (status) return status == RAISED ? RAISED : 0;
  }
  int count = 0;
  for (int k = 0; k < mode->edges; k++) {
    if (values[k] <= 0 || values[k] <= run->surfaces.noise[k]) continue;
    const int status = crossing_of(run, k, values, &run->event.crossings[count], found);
    if (status == RAISED) return RAISED;
    if (found->failure != HS_CLEAR) return 0;
    count += status;
  }
  found->crossings = count;
  return 0;
}

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
  if (status || mode->values(here->p, t1, run->z, run->surfaces.ahead)) return NOT_FINITE;
  hs_real largest = m ? run->surfaces.ahead[0] : 0.0;
  for (int k = 1; k < m; k++) largest = hs_max(largest, run->surfaces.ahead[k]);
  if (largest <= 0) {
    if (mode->flow(here->p, t1, run->z, run->end)) return NOT_FINITE;
    trial->looked = trial->ends = 1;
    return hs_finite(sum_of(run->z, n) + sum_of(run->surfaces.ahead, m) + sum_of(run->end, n)) ? CLEAR : NOT_FINITE;
  }
  if (!hs_finite(sum_of(run->z, n) + sum_of(run->surfaces.ahead, m))) return NOT_FINITE;
  if (judge(run, run->surfaces.ahead, &found)) return trial->ends = 0, NOT_FINITE;
  if (found.failure != HS_CLEAR || found.crossings || ends(run, trial)) {
    ends(run, trial);
    return found;
  }
  return trial->ends = 0, NOT_FINITE;
}

/* No step, however short, stays in the relaxed domain: take a guard reached together with a wall, or stop. */
static int stuck(hs_run *run, hs_step_failure kind, int surface) {
  const int may_stand = kind != HS_ERROR && kind != HS_CREEPING && kind != HS_JUMP && kind != HS_SLOW;
  const int count = may_stand ? standing_on(run) : 0;
  if (count) {
    choose(run, count);
    sizes(run, run->x, run->x, run->surfaces.active[run->event.chosen.edge]);
    run->event.landed_at = run->here.t;
    return LANDED;
  }
  run->task->stop.failure = kind;
  run->task->stop.surface = surface;
  copy(run->task->stop.slope, run->slope, run->here.dimension);
  return stopped(run, HS_STUCK, run->here.t);
}

/* Step in the domain until a step ends in a strip, at the segment's end, or nowhere (Fig. 12, lines 3 to 9). */
static int flow(hs_run *run) {
  hs_mode_state *here = &run->here;
  hs_control *control = &run->control;
  const int adaptive = control->tolerance > 0, curved = run->method->degree > 0;
  const int n = here->dimension;
  const hs_time limit = segment_end(run);
  forget_steps(run);
  if (here->table->flow(here->p, here->t, run->x, run->slope)) return stopped(run, HS_HERE_NOT_FINITE, here->t);
  begin_steps(control, run->sizes.scales, run->slope, n);
  begin_pace(run);
  while (here->t < limit && !count_step(&run->pace, here->t)) {
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
        reject(control, h, ratio, found.failure != HS_UNSOLVED);
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
      sizes(run, run->x, run->event.chosen.theta > 0 ? run->z : run->x, run->surfaces.active[run->event.chosen.edge]);
      run->event.landed_at = t1;
      return LANDED;
    }
    if (halvings || !(t1 > here->t)) {
      const hs_step_failure given_up = stall_ends(run, halvings, last.failure, last.surface, t1);
      if (given_up != HS_CLEAR) return stuck(run, given_up, last.surface);
    }
    if (adaptive && across_jump(run, n, t1)) return stuck(run, HS_JUMP, -1);
    if (here->active || here->emerging) leave(run, t1, run->z);
    const hs_polynomial *const piece = curved && !piece_of(run, &run->trial) ? &run->trial.piece : 0;
    HS_MOVE(run, move_along(run, t1, run->z, h));
    append(run, t1, run->z, piece);
    here->t = t1;
    swap(&run->x, &run->z);
    swap(&run->slope, &run->end);
    run->step.k[0] = run->slope;
    run->step.k[run->method->stages] = run->end;
  }
  return here->t < limit ? stuck(run, HS_SLOW, -1) : AT_BOUNDARY;
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
  const hs_crossing *crossing = &run->event.chosen;
  const hs_time t = crossing->time, depth = crossing->depth, until = run->until, t1 = run->event.landed_at;
  const int k = crossing->edge;
  const hs_edge *edge = &run->here.table->edge[k];
  if (crossing->theta > 0) {
    shortened(run, crossing->piece, crossing->theta, &run->cubic);
    append(run, t, crossing->state, &run->cubic);
  }
  if (limit_reached(run)) return stopped(run, HS_LIMIT, t);
  HS_MOVE(run, move_crossing(run));
  hs_time resumed = t1 + (run->epsilon - depth);
  const int without_value = reset(run, run->sizes.landed);
  if (resumed > until + tie(until)) {
    hs_time rows[3][2] = {{t, depth * 0}, {t1, depth}, {until, depth + (until - t1)}};
    strip(run, 3, rows, crossing->state);
    record(run, crossing, NAN, without_value ? 0 : run->event.after, 0);
    return in_strip(run, HS_UNTIL_IN_STRIP, until);
  }
  if (without_value) return in_strip(run, HS_RESET_NOT_FINITE, t);
  resumed = earlier(resumed, until);
  hs_time rows[3][2] = {{t, depth * 0}, {t1, depth}, {resumed, run->epsilon}};
  strip(run, 3, rows, crossing->state);
  const int flowed = has_flowed(run, t);
  record(run, crossing, resumed, run->event.after, 0);
  copy(run->x, run->event.after, edge->target_dimension);
  copy(run->sizes.scale, run->sizes.both, edge->target_dimension);
  const hs_mode_state before = run->here;
  const int unknown = before.table->flow(before.p, t, crossing->state, run->source);
  const int entered = enter(run, edge->target, edge->target_dimension, resumed, 1, 0.0, 0, t);
  if (entered != GOES_ON) return entered;
  if (!comes_back(run, flowed)) return run->here.mode == before.mode ? unresolved(run, k) : GOES_ON;
  return moves_on(run, &before, unknown) ? slides(run, before.mode, k) : GOES_ON;
}

/* Go on after a sample of an input, or end: a jump at the end is made, and a guard reached there fires. */
static int at_boundary(hs_run *run) {
  const hs_time t = run->here.t;
  if (t >= run->pausing.at) return PAUSED;
  if (t < run->until || segment_follows(run)) return go_on(run);
  const int count = standing_on(run);
  if (!count) return stopped(run, HS_UNTIL, t);
  if (limit_reached(run)) return stopped(run, HS_LIMIT, t);
  choose(run, count);
  hs_time rows[1][2] = {{t, 0.0}};
  strip(run, 1, rows, run->x);
  record(run, &run->event.chosen, NAN, 0, 0);
  return in_strip(run, HS_UNTIL_ON_GUARD, t);
}

/* Follow the relaxed execution until it stops or pauses. */
static int relaxed(hs_run *run, int outcome) {
  while (outcome == GOES_ON) {
    outcome = run->poll.interrupted ? (int)stopped(run, HS_INTERRUPTED, run->here.t) : flow(run);
    if (outcome == LANDED)
      outcome = through_strip(run);
    else if (outcome == AT_BOUNDARY)
      outcome = at_boundary(run);
    if (outcome == GOES_ON && pauses(run)) return PAUSED;
  }
  return outcome;
}
