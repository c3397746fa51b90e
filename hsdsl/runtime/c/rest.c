/* Rest on a guard: a state that its own reset keeps in place while the flow pushes it out (M11).
   See hsdsl/simulate/sticking.py. Functions answer 1 or 0, or RAISED where a routine has no value. */

#define SAME_UNITS 4
#define ZERO_UNITS 16

/* For each state the size that its flow has had, to run->flow_sizes; `slope` is the flow. See simulate/scales.py. */
static int flow_sizes(hs_run *run, double t, const double *x, const double *slope) {
  const int n = run->here.dimension;
  if (run->here.table->jacobian(run->here.p, t, x, run->jacobian)) return RAISED;
  for (int i = 0; i < n; i++) {
    double size = fabs(slope[i]);
    for (int j = 0; j < n; j++) size = size + fabs(run->jacobian[i * n + j]) * run->scales[j];
    run->flow_sizes[i] = size;
  }
  return 0;
}

/* A time in which no state moves by more than about half the digits of its scale. */
static double instant(const hs_run *run, const double *slope) {
  double least = run->until;
  for (int s = 0; s < run->here.dimension; s++) {
    const double scale = run->scales[s], speed = fabs(slope[s]);
    if (scale > 0 && least * speed > scale) least = scale / speed;
  }
  return sqrt(HS_UNIT) * least;
}

/* How far a state that rests may be moved. */
static double rest_noise(const hs_run *run, int s) { return SAME_UNITS * HS_UNIT * run->scales[s]; }

/* Whether edge k is possible and its reset leaves the state where it is, on a surface that does not move. */
static int stays(hs_run *run, double t, const double *x, int k) {
  const hs_mode_state *here = &run->here;
  int still = 1;
  if (here->table->edge[k].reset(here->p, t, x, run->after)) return RAISED;
  for (int s = 0; s < here->dimension; s++)
    still &= fabs(run->after[s] - x[s]) <= rest_noise(run, s);
  if (!still) return 0;
  if (here->table->gradients[k](here->p, t, x, run->gradient)) return RAISED;
  return run->gradient[0] == 0 ? condition(run, k, t, x) : 0;
}

/* Which derivative of the surface along the flow decides: 1 or 2; 0 where the first one points inwards. */
static int push_order(hs_run *run, double t, const double *x, int k) {
  const hs_mode_state *here = &run->here;
  double rate, size = 0.0;
  if (here->table->flow(here->p, t, x, run->end) || here->table->gradients[k](here->p, t, x, run->gradient) ||
      here->table->rates[k](here->p, t, x, &rate) || flow_sizes(run, t, x, run->end))
    return RAISED;
  for (int s = 0; s < here->dimension; s++) size = size + fabs(run->gradient[s + 1]) * run->flow_sizes[s];
  if (fabs(rate) <= ZERO_UNITS * HS_UNIT * size) return 2;
  return rate > 0;
}

/* The first or second derivative of surface k along the flow through x, at time t. */
static int push(hs_run *run, double t, const double *x, int k, int order, double *value) {
  const hs_mode_state *here = &run->here;
  const hs_mode *mode = here->table;
  double ahead;
  if (order == 1) return mode->rates[k](here->p, t, x, value);
  if (mode->series) {
    if (mode->series(here->p, 2, t, x, run->second) || mode->surface_series(here->p, 2, run->second)) return RAISED;
    if (mode->surface_line[k] >= 0) return *value = 2 * run->second[4 * mode->surface_line[k] + 2], 0;
  }
  if (mode->flow(here->p, t, x, run->end)) return RAISED;
  const double small = instant(run, run->end);
  for (int s = 0; s < here->dimension; s++) run->at[s] = x[s] + small * run->end[s];
  if (mode->rates[k](here->p, t + small, run->at, &ahead) || mode->rates[k](here->p, t, x, value)) return RAISED;
  *value = (ahead - *value) / small;
  return 0;
}

/* Whether the flow leaves the domain through surface k: by its rate, or where that is zero by the next one. */
static int is_pushed(hs_run *run, double t, const double *x, int k) {
  const int order = push_order(run, t, x, k);
  double value;
  if (order <= 0) return order;
  return push(run, t, x, k, order, &value) ? RAISED : value > 0;
}

/* Whether the flow moves the state only in the direction that the reset takes back. */
static int moves_alone(hs_run *run, double t, const double *x, int k) {
  const hs_mode_state *here = &run->here;
  const int n = here->dimension;
  double *const slope = run->end, *const ahead = run->at, *const back = run->after;
  if (here->table->flow(here->p, t, x, slope)) return RAISED;
  int along = -1;
  for (int s = 0; s < n; s++)
    if (slope[s] != 0) along = along < 0 ? s : along;
  if (along < 0) return 0;
  if (flow_sizes(run, t, x, slope)) return RAISED;
  const double small = instant(run, slope);
  for (int s = 0; s < n; s++) ahead[s] = x[s] + small * slope[s];
  if (here->table->edge[k].reset(here->p, t, ahead, back)) return RAISED;
  for (int s = 0; s < n; s++) back[s] = back[s] - ahead[s], ahead[s] = rest_noise(run, s);
  return takes_back(slope, back, run->flow_sizes, ahead, n);
}

/* The edge on whose guard the state rests; -1 where it moves. */
static int rests(hs_run *run) {
  const hs_mode_state *here = &run->here;
  if (!here->standing || here->dimension != here->table->dimension || !here->dimension) return -1;
  for (int k = 0; k < here->table->edges; k++)
    if (run->active_surfaces[k] && here->table->edge[k].target == here->mode && stays(run, here->t, run->x, k) == 1 &&
        is_pushed(run, here->t, run->x, k) == 1 && moves_alone(run, here->t, run->x, k) == 1)
      return k;
  return -1;
}
