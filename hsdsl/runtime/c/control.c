/* The step size: fixed, or from the embedded error estimate. See hsdsl/simulate/control.py. */

#define SAFETY 0.9
#define LEAST 0.2
#define MOST 5.0
#define MOST_REJECTIONS 10000

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

static void accept(hs_control *control, double taken, double ratio) {
  control->accepted++;
  const double proposed = taken * factor(control, ratio);
  control->h = hs_min(control->largest, taken < control->h ? hs_max(proposed, control->h) : proposed);
}

static void reject(hs_control *control, double taken, double ratio) {
  control->rejected++;
  control->h = taken * hs_min(1.0, factor(control, ratio));
}

static int struggles(const hs_control *control) {
  return control->rejected > MOST_REJECTIONS && 4 * control->rejected > control->accepted;
}
