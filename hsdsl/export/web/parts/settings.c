/* The settings of a run: what is given, and the model's own expressions for the rest.
   See hsdsl/engine/preparation/options.py, hsdsl/engine/preparation/experiment.py, hsdsl/base/defaults.py and make_control in hsdsl/engine/simulate/control.py. */

static int refused_at;

static page_refusal refuse(page_refusal why, int at) {
  refused_at = at;
  return why;
}

/* Parameters in order, those not given computed from the ones before them. */
static page_refusal set_parameters(double *p) {
  double bound;
  for (int i = 0; i < PROBLEM_PARAMETERS; i++) {
    p[i] = given[i];
    if (given[i] != given[i] && page_parameter[i](p, &p[i])) return refuse(PAGE_NO_PARAMETER, i);
    if (!hs_finite(p[i])) return refuse(PAGE_NO_PARAMETER, i);
  }
  for (int i = 0; i < PROBLEM_PARAMETERS; i++) {
    if (page_minimum[i] && (page_minimum[i](p, &bound) || p[i] < bound)) return refuse(PAGE_BELOW, i);
    if (page_maximum[i] && (page_maximum[i](p, &bound) || p[i] > bound)) return refuse(PAGE_ABOVE, i);
  }
  return PAGE_RAN;
}

/* The initial state: numbers that are given, those that the export gave, and others that follow them. */
static page_refusal set_start(const double *p, double *x) {
  char known[PAGE_STARTS + 1] = {0};
  for (int i = 0; i < PAGE_STARTS; i++) {
    const double own = given[PROBLEM_PARAMETERS + i];
    x[i] = own == own ? own : problem_x[i];
    known[i] = own == own || problem_given[i];
  }
  const int bad = problem_start(p, known, x);
  for (int i = 0; i < PAGE_STARTS; i++)
    if ((bad && !known[i]) || !hs_finite(x[i])) return refuse(PAGE_NO_INITIAL, i);
  return PAGE_RAN;
}

/* A setting of the file, which must be a positive number; `until` may be 0. Others stay as they were exported. */
static page_refusal setting(int k, const double *p, double *value) {
  if (page_setting[k]) {
    if (page_setting[k](p, value) || !hs_finite(*value)) return refuse(PAGE_NO_SETTING, k);
    if (!(*value > 0 || (*value == 0 && (k == PAGE_UNTIL || k == PAGE_MAX_TRANSITIONS))))
      return refuse(PAGE_BAD_SETTING, k);
  }
  return PAGE_RAN;
}

static page_refusal set_settings(const double *p, hs_settings *s) {
  double most, scale[PAGE_STATES + 1];
  page_refusal refusal;
  *s = problem_settings;
  most = (double)s->max_transitions;
  if ((refusal = setting(PAGE_UNTIL, p, &s->until)) || (refusal = setting(PAGE_RELAXATION, p, &s->relaxation)) ||
      (refusal = setting(PAGE_MAX_TRANSITIONS, p, &most)))
    return refusal;
  if (PAGE_DEFAULT_RELAXATION > 0)
    s->relaxation = s->until > 0 ? hs_min(PAGE_DEFAULT_RELAXATION, PAGE_DEFAULT_RELAXATION * s->until)
                                 : PAGE_DEFAULT_RELAXATION;
  s->max_transitions = (int64_t)hs_min(most, given[PAGE_TRANSITIONS]);
  if (s->tolerance > 0) {
    s->largest = s->until * PAGE_LARGEST_SHARE;
    s->step = s->largest / 100;
  } else {
    if ((refusal = setting(PAGE_STEP, p, &s->step))) return refusal;
    if (s->until > 0 && s->until + s->step == s->until) return refuse(PAGE_BAD_SETTING, PAGE_STEP);
  }
  if (s->scale && page_setting[PAGE_SCALE]) {
    if (page_setting[PAGE_SCALE](p, scale)) return refuse(PAGE_NO_SETTING, PAGE_SCALE);
    for (int i = 0; i < PAGE_STATES; i++) {
      run.scale[i] = page_scale_place[i] < 0 ? s->scale[i] : scale[page_scale_place[i]];
      if (page_scale_place[i] >= 0 && !(run.scale[i] > 0 && hs_finite(run.scale[i])))
        return refuse(PAGE_BAD_SETTING, PAGE_SCALE);
    }
    s->scale = run.scale;
  }
  return PAGE_RAN;
}
