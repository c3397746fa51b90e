/* All surfaces of a mode along one step, by the interpolant of its states: exactly where they are affine.
   See hsdsl/simulate/surface_polynomials.py. */

#define IN_A_STEP 64
#define SHORTEST 0x1p16
#define LOST_IN_A_STEP 16
#define LOST_SHORTEST 0x1p9

/* The surfaces at the share s of the step, by its interpolant. */
static int surfaces_along(hs_run *run, double s, double *values) {
  at(run, &run->span.piece, s, run->at);
  return run->here.table->values(run->here.p, run->span.t + s * run->span.h, run->at, values);
}

static int noise_at_ends(hs_run *run, int k, double *allowed) {
  const hs_span *span = &run->span;
  double first, last;
  if (roundoff_bound(run, k, span->t, run->x, 0, &first) || roundoff_bound(run, k, span->t + span->h, run->z, 0, &last))
    return RAISED;
  *allowed = hs_max(first, last);
  return 0;
}

/* All surfaces along the step's interpolant where all of them are affine: polynomials of its own degree. Rises below a
   share of their size tell nothing. */
static int affine_curves(hs_run *run, double share) {
  const hs_mode *mode = run->here.table;
  const hs_span *span = &run->span;
  hs_curves *const found = &run->curves;
  if (mode->values(run->here.p, span->t, run->x, run->values)) return RAISED;
  begin_curves(found, mode->surfaces);
  for (int k = 0; k < mode->surfaces; k++) {
    double *const c = coefficients_of(found, 0, k);
    if (mode->gradients[k](run->here.p, span->t, run->x, run->gradient)) return RAISED;
    c[0] = run->values[k];
    const double sizes =
        affine_curve(&span->piece, run->here.dimension, run->width, span->h, run->gradient, c, degree_of(found, 0, k));
    *off_of(found, 0, k) = share * sizes;
    found->certain[k] = 1;
  }
  return 0;
}

/* Give up following a mode's surfaces: visits beyond them may be missed from here on. */
static void lose(hs_run *run) {
  const hs_curves *curves = &run->curves;
  run->lost[run->here.mode] = 1;
  for (int k = 0; k < curves->count; k++) {
    int certain = 1;
    for (int part = 0; part < curves->parts; part++) certain &= curves->certain[part * curves->count + k];
    if (!certain) doubt(run, k, run->span.t);
  }
}

/* All surfaces along the step's interpolant. */
static int curves_along(hs_run *run) {
  const hs_interpolation *by = &run->task->interpolation[HS_ALONG_STEPS];
  if (run->here.table->affine) return affine_curves(run, by->share);
  const int lost = run->lost[run->here.mode], most = lost ? LOST_IN_A_STEP : IN_A_STEP;
  const int refuse = run->span.h * (lost ? LOST_SHORTEST : SHORTEST) > run->until;
  if (interpolated(run, surfaces_along, run->here.table->surfaces, by, noise_at_ends, 1, most, refuse)) return RAISED;
  if (!refuse && run->curves.parts >= most) lose(run);
  return 0;
}
