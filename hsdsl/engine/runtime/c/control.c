/* The step size: fixed, or from the embedded error estimate. See hsdsl/engine/simulate/control.py. */

#define ALMOST (1 - 0x1p-30)
#define SAFETY 0.9
#define LEAST 0.2
#define MOST 5.0
#define MOST_REJECTIONS 2000
#define STRETCH 1e-3
#define BAND_FROM 0.9
#define BAND_TO 1.2
#define LEAST_SEEN 1e-10
#define LEAST_BEFORE 0.3

/* Error ratio of a step of length h to run->z, errors held against these scales. */
HS_INLINE hs_real ratio_to(const hs_run *run, hs_real h, const hs_real *scales) {
  const hs_real tolerance = run->control.tolerance;
  const int tiny = h <= run->control.least;
  hs_real worst = run->control.h * 0;
  for (int s = 0; s < run->here.dimension; s++) {
    const hs_real end = fabs(run->z[s]), size = hs_max(scales[s], end), error = run->error[s];
    if (fabs(error) <= HS_NOTHING || (tiny && run->scales[s] <= tolerance * end)) continue;
    worst = hs_max(worst, size > 0 ? fabs(error) / (tolerance * size) : 1 / tolerance);
  }
  return worst;
}

/* The same with a look at what the flow is computed from; see hsdsl/engine/simulate/control.py. */
static hs_real ratio_closer(hs_run *run, hs_real h, hs_real ratio) {
  hs_control *const control = &run->control;
  const int again = run->here.t == control->failed_at;
  control->failed_at = run->here.t;
  if (!control->closer && !again) return ratio;
  const hs_real *const scales = closer_scales(run, h);
  if (!scales) return ratio;
  ratio = ratio_to(run, h, scales);
  control->closer = ratio <= 1;
  return ratio;
}

/* Error ratio of a step of length h from run->x to run->z; at most 1 is acceptable. */
HS_INLINE hs_real error_ratio(hs_run *run, hs_real h) {
  const hs_real ratio = ratio_to(run, h, error_scales(run));
  return !(ratio > 1) ? ratio : ratio_closer(run, h, ratio);
}

static hs_real factor(const hs_control *control, hs_real ratio) {
  if (ratio == 0) return MOST;
  return hs_min(MOST, hs_max(LEAST, SAFETY * pow(ratio, -1 / (ratio * 0 + control->order))));
}

/* Begin a stretch of flow from run->x; an implicit method's first step must show a decay from there, however fast. */
static void begin_steps(hs_run *run) {
  hs_control *control = &run->control;
  control->before = 0.0;
  if (!control->implicit || !(control->tolerance > 0)) return;
  const hs_real share = pow(control->tolerance, 1 / (control->h * 0 + control->order));
  for (int s = 0; s < run->here.dimension; s++) {
    const hs_real size = run->scales[s], slope = fabs(run->slope[s]);
    if (size > 0 && control->h * slope > share * size)
      control->h = hs_max(hs_min(control->h, control->least), share * size / slope);
  }
}

/* Factor from one step to the next for an implicit method. */
static hs_real predicted(hs_control *control, hs_real taken, hs_real ratio) {
  const hs_real root = pow(hs_max(LEAST_SEEN, ratio), 1 / (ratio * 0 + control->order));
  hs_real found = hs_min(MOST, hs_max(LEAST, SAFETY / root));
  if (control->before > 0) {
    const hs_real ahead = SAFETY * (taken / control->before) * (control->root_before / (root * root));
    found = hs_min(found, hs_max(LEAST, ahead));
  }
  control->before = taken;
  control->root_before = hs_max(LEAST_BEFORE, root);
  return BAND_FROM <= found && found <= BAND_TO ? 1.0 : found;
}

static void accept(hs_control *control, hs_real taken, hs_real ratio) {
  control->accepted++;
  control->stretch = control->stretch + taken;
  if (control->stretch > control->largest * STRETCH) control->accepted = control->rejected = 0, control->stretch = 0.0;
  const hs_real proposed = taken * (control->implicit ? predicted(control, taken, ratio) : factor(control, ratio));
  control->h = hs_min(control->largest, taken < control->h ? hs_max(proposed, control->h) : proposed);
}

/* Shrink after a rejected, unhalved step; without a ratio (not-a-number) it has no end at all. */
static void reject(hs_control *control, hs_real taken, hs_real ratio) {
  control->rejected++;
  control->h = ratio != ratio ? taken / 2 : taken * hs_min(1.0, factor(control, ratio));
}

/* End of a step of length h from t, which is stretched to the limit where it nearly gets there. */
static hs_time end_of_step(hs_time t, hs_real *h, hs_time limit) {
  if (*h < (limit - t) * ALMOST) return t + *h;
  *h = limit - t;
  return limit;
}

/* Cut a step to what the surfaces of the mode allow. */
static hs_real within_reach(const hs_run *run, hs_real h) {
  const hs_real reach = run->reach[run->here.mode];
  return reach > 0 ? hs_min(h, reach) : h;
}

/* Learn that surfaces vary too fast for a step. */
static void too_fast(hs_run *run, hs_real tried) { run->reach[run->here.mode] = tried / 2; }

/* Learn that they do not for another one. */
static void slow_enough(hs_run *run, hs_real taken) {
  hs_real *const reach = &run->reach[run->here.mode];
  if (*reach > 0 && taken >= *reach) *reach = 2 * taken;
}

static int struggles(const hs_control *control) {
  return control->rejected > MOST_REJECTIONS && 4 * control->rejected > control->accepted;
}
