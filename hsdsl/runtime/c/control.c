/* The step size: fixed, or from the embedded error estimate. See hsdsl/simulate/control.py. */

#define SAFETY 0.9
#define LEAST 0.2
#define MOST 5.0
#define MOST_REJECTIONS 2000
#define STRETCH 1e-3
#define BAND_FROM 0.9
#define BAND_TO 1.2
#define LEAST_SEEN 1e-10
#define LEAST_BEFORE 0.3

static double error_ratio(const hs_run *run) {
  double worst = run->control.h * 0;
  for (int s = 0; s < run->here.dimension; s++) {
    const double size = hs_max(fabs(run->x[s]), fabs(run->z[s]));
    worst = hs_max(worst, fabs(run->error[s]) / (run->control.tolerance * (1 + size)));
  }
  return worst;
}

static double factor(const hs_control *control, double ratio) {
  if (ratio == 0) return MOST;
  return hs_min(MOST, hs_max(LEAST, SAFETY * pow(ratio, -1 / (ratio * 0 + control->order))));
}

/* Begin a stretch of flow from run->x; an implicit method's first step must show a decay from there, however fast. */
static void begin_steps(hs_run *run) {
  hs_control *control = &run->control;
  control->before = 0.0;
  if (!control->implicit || !(control->tolerance > 0)) return;
  const double share = pow(control->tolerance, 1 / (control->h * 0 + control->order));
  for (int s = 0; s < run->here.dimension; s++) {
    const double size = 1 + fabs(run->x[s]), slope = fabs(run->slope[s]);
    if (control->h * slope > share * size) control->h = share * size / slope;
  }
}

/* Factor from one step to the next for an implicit method. */
static double predicted(hs_control *control, double taken, double ratio) {
  const double root = pow(hs_max(LEAST_SEEN, ratio), 1 / (ratio * 0 + control->order));
  double found = hs_min(MOST, hs_max(LEAST, SAFETY / root));
  if (control->before > 0) {
    const double ahead = SAFETY * (taken / control->before) * (control->root_before / (root * root));
    found = hs_min(found, hs_max(LEAST, ahead));
  }
  control->before = taken;
  control->root_before = hs_max(LEAST_BEFORE, root);
  return BAND_FROM <= found && found <= BAND_TO ? 1.0 : found;
}

static void accept(hs_control *control, double taken, double ratio) {
  control->accepted++;
  control->stretch = control->stretch + taken;
  if (control->stretch > control->largest * STRETCH) control->accepted = control->rejected = 0, control->stretch = 0.0;
  const double proposed = taken * (control->implicit ? predicted(control, taken, ratio) : factor(control, ratio));
  control->h = hs_min(control->largest, taken < control->h ? hs_max(proposed, control->h) : proposed);
}

/* Shrink after a rejected, unhalved step; without a ratio (not-a-number) it has no end at all. */
static void reject(hs_control *control, double taken, double ratio) {
  control->rejected++;
  control->h = ratio != ratio ? taken / 2 : taken * hs_min(1.0, factor(control, ratio));
}

static int struggles(const hs_control *control) {
  return control->rejected > MOST_REJECTIONS && 4 * control->rejected > control->accepted;
}
