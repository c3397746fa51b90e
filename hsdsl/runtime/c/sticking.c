/* A state at rest over time (M11): how long its guard holds it, and the steps of that time.
   See hsdsl/simulate/sticking.py. run->held is what holds it, on a window of time. */

#define CORRECTIONS 8
#define LOOKS 8
#define LARGEST_SHARE 0.1

/* The longest step over a state at rest. */
static double longest_rest(const hs_run *run) { return run->until * LARGEST_SHARE; }

/* The push of the edge that holds the state, inwards, at the share s of the window. */
static int inward(hs_run *run, double s, double *value) {
  const hs_held *held = &run->held;
  if (push(run, held->start + s * held->width, run->x, held->edge, held->order, value)) return RAISED;
  *value = -*value;
  return 0;
}

static int nothing_more(hs_run *run, int k, double *allowed) {
  (void)run, (void)k;
  *allowed = 0.0;
  return 0;
}

/* When the push falls through zero, isolated on an interpolant over time, then solved on the push itself. */
static int pushed_until(hs_run *run, double start, double end, double *until) {
  run->held.start = start, run->held.width = end - start;
  *until = end;
  if (interpolated(run, inward, 1, &run->task->interpolation[HS_OVER_TIME], nothing_more, 0, MOST_PIECES, 0))
    return RAISED;
  run->bernstein_of = 0;
  hs_walk walk = begin_walk(0, 0.0, 0, 0);
  hs_rise rise;
  if (!next_rise(run, &walk, &rise)) return 0;
  double s = rise.share, value;
  for (int i = 0; i < CORRECTIONS && rise.slope != 0; i++) {
    if (inward(run, s, &value)) return RAISED;
    s = hs_min(1.0, hs_max(0.0, s - value / rise.slope));
  }
  *until = start + s * run->held.width;
  return 0;
}

/* Whether the edge and its reset keep the state in place at time t: 1, 0 or RAISED. */
static int keeps(hs_run *run, double t) {
  const int still = stays(run, t, run->x, run->held.edge);
  return still == 1 ? moves_alone(run, t, run->x, run->held.edge) : still;
}

/* When the edge or its reset no longer keeps the state in place, as where its `if` ends: by looks, then halving. */
static int kept_until(hs_run *run, double start, double end, double *until) {
  double last = start, middle;
  for (int i = 1; i <= LOOKS; i++) {
    double t = start + (end - start) * i / LOOKS;
    int answer = keeps(run, t);
    if (answer == RAISED) return RAISED;
    if (answer) {
      last = t;
      continue;
    }
    while (last < (middle = (last + t) / 2) && middle < t) {
      if ((answer = keeps(run, middle)) == RAISED) return RAISED;
      if (answer)
        last = middle;
      else
        t = middle;
    }
    return *until = t, 0;
  }
  return *until = end, 0;
}

/* Until when the guard of edge k holds the state, at most to the end of the inputs' segment: 1; 0 where it is not held
   for any time, or something has no value later on. */
static int release(hs_run *run, int k, double *until) {
  const double from = run->here.t, end = run->task->timeline->end[run->here.segment];
  double t = from, released;
  run->held.edge = k;
  run->held.order = push_order(run, from, run->x, k);
  if (run->held.order <= 0) return 0;
  while (t < end) {
    const double t1 = hs_min(t + longest_rest(run), end);
    if (pushed_until(run, t, t1, &released) || kept_until(run, t, released, until)) return 0;
    if (*until < t1) return *until > from;
    t = t1;
  }
  return *until = end, 1;
}

/* Make one step over a state at rest, shorter where surfaces vary too fast for one. */
static hs_step_failure next_rest(hs_run *run, int n, double limit) {
  const double t = run->here.t;
  hs_span *const span = &run->span;
  double h = longest_rest(run), t1;
  for (;; h = h / 2) {
    if (h < (limit - t) * ALMOST)
      t1 = t + h;
    else
      h = limit - t, t1 = limit;
    if (!(t1 > t)) return HS_NOT_FINITE;
    begin_span(run, h, t1);
    span->piece.degree = 1;
    for (int s = 0; s < n; s++) span->piece.c[s] = span->largest[s] = 0.0;
    copy(run->z, run->x, n);
    if (!curves_along(run) && !run->here.table->values(run->here.p, t1, run->z, run->ends)) return HS_CLEAR;
  }
}
