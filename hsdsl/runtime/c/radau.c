/* Steps by Radau IIA. See hsdsl/integrators/radau.py. */

#include "functions.h"

/* The weighted sum of three vectors. */
HS_INLINE void weighted3(int n, const hs_real *w, hs_real *const v[3], hs_real *out) {
  const hs_real *const a = v[0], *const b = v[1], *const c = v[2], p = w[0], q = w[1], r = w[2];
  HS_SIMD
  for (int s = 0; s < n; s++) out[s] = p * a[s] + q * b[s] + r * c[s];
}

/* Solve with the factors of the real matrix. */
HS_INLINE void solved_real(hs_run *run, int n, const hs_real *right, hs_real *found) {
  hs_radau *const radau = &run->radau;
  if (n > 3 && run->here.table->elimination)
    sparse_solve(n, run->here.table->elimination, radau->real, right, radau->scratch[0], found);
  else
    solve(n, radau->real, radau->order, right, found);
}

HS_INLINE void plus(int n, const hs_real *a, const hs_real *b, hs_real *sum) {
  HS_SIMD
  for (int s = 0; s < n; s++) sum[s] = a[s] + b[s];
}

/* Make h g - (G, B) u of the sums g, to `right`. */
HS_INLINE void right_sides(int n, hs_real h, const hs_collocation *known, hs_real *const *u, hs_real *const *right) {
  const hs_real *const a = u[0], *const b = u[1], *const c = u[2];
  const hs_real gamma = known->gamma, alpha = known->alpha, beta = known->beta;
  hs_real *const p = right[0], *const q = right[1], *const r = right[2];
  HS_SIMD
  for (int s = 0; s < n; s++) {
    p[s] = h * p[s] - gamma * a[s];
    q[s] = h * q[s] - (alpha * b[s] + beta * c[s]);
    r[s] = h * r[s] - (alpha * c[s] - beta * b[s]);
  }
}

/* Add the changes d to u: the largest change of each state, and the sum of all. */
HS_INLINE hs_real corrected(int n, hs_real *const *d, hs_real *const *u, hs_real *largest) {
  const hs_real *const a = d[0], *const b = d[1], *const c = d[2];
  for (int i = 0; i < 3; i++) {
    const hs_real *const change = d[i];
    hs_real *const apart = u[i];
    HS_SIMD
    for (int s = 0; s < n; s++) apart[s] = apart[s] + change[s];
  }
  HS_SIMD
  for (int s = 0; s < n; s++) largest[s] = hs_max(hs_max(fabs(a[s]), fabs(b[s])), fabs(c[s]));
  hs_real total = 0.0;
  for (int s = 0; s < n; s++) total = total + (fabs(a[s]) + fabs(b[s]) + fabs(c[s]));
  return total;
}

/* One iteration of Newton's method on Z = h A f(x + Z), in the coordinates that take A apart: the increments after it
   and the largest change of each state. Not 0 where the flow has no value there, or the change has none. */
HS_INLINE int iterate(hs_run *run, int n, hs_time t, hs_real h) {
  hs_radau *const radau = &run->radau;
  const hs_collocation *const known = run->method->collocation;
  hs_real *const *const u = radau->apart, *const *const d = radau->change, *const *const f = radau->slopes;
  for (int i = 0; i < 3; i++) {
    plus(n, run->x, radau->z[i], run->at);
    if (run->here.table->flow(run->here.p, t + known->node[i] * h, run->at, f[i])) return NO_VALUE;
  }
  for (int i = 0; i < 3; i++) weighted3(n, known->unmix[i], f, radau->right[i]);
  right_sides(n, h, known, u, radau->right);
  const hs_real *const pair[2] = {radau->right[1], radau->right[2]};
  solved_real(run, n, radau->right[0], d[0]);
  if (n > 3 && run->here.table->elimination)
    sparse_solve_complex(n, run->here.table->elimination, radau->re, radau->im, pair, radau->scratch[0],
                         radau->scratch[1], d[1], d[2]);
  else
    solve_complex(n, radau->re, radau->im, radau->turned, pair, d[1], d[2]);
  const hs_real total = corrected(n, d, u, radau->largest);
  for (int i = 0; i < 3; i++) weighted3(n, known->mix[i], u, radau->z[i]);
  return hs_finite(total) ? 0 : NO_CONVERGENCE;
}

static void radau_forget(hs_radau *radau) {
  radau->derived = radau->factored = radau->stepped = 0;
  radau->convergence.rate = radau->convergence.left = 1.0;
  radau->convergence.aged = 0;
  radau->lifted = 0;
}

/* Have the scales of the states over a step of length h; `closer`, with a look at the terms of the flow. */
static void radau_scales(hs_run *run, hs_time t, hs_real h, int closer) {
  hs_radau *const radau = &run->radau;
  if (!closer || run->here.table->jumps || resolved(run, t, h, run->x, radau->rows)) return;
  radau->scales = run->resolved;
  radau->lifted = 0;
  for (int s = 0; s < run->here.dimension; s++) {
    radau->lifted |= run->resolved[s] > run->scales[s];
    radau->least[s] = run->resolved[s];
  }
}

HS_INLINE int derive(hs_run *run, hs_time t) {
  hs_radau *const radau = &run->radau;
  const hs_sparse *const rows = &run->here.table->jacobian;
  if (rows->values(run->here.p, t, run->x, radau->fresh)) return NO_VALUE;
  if (!run->here.table->elimination) hs_spread_out(rows, run->here.dimension * run->here.dimension, radau->fresh);
  swap(&radau->rows, &radau->fresh);
  radau->derived = 1;
  radau->derived_at = t;
  radau->factored = 0;
  return 0;
}

/* The same matrices in the pattern of a sparse elimination. */
static int sparse_factor(hs_run *run, int n, hs_real h, const hs_elimination *of) {
  hs_radau *const radau = &run->radau;
  const hs_collocation *const known = run->method->collocation;
  for (int i = 0; i < of->size; i++) radau->real[i] = radau->re[i] = radau->im[i] = 0.0;
  for (int i = 0; i < run->here.table->jacobian.count; i++)
    radau->real[of->place[i]] = radau->re[of->place[i]] = -h * radau->rows[i];
  for (int i = 0; i < n; i++) {
    const int own = of->diagonal[i];
    radau->real[own] = known->gamma + radau->real[own];
    radau->re[own] = known->alpha + radau->re[own];
    radau->im[own] = -known->beta;
  }
  return sparse_factored(n, of, radau->real, radau->scratch[0]) ||
         sparse_factored_complex(n, of, radau->re, radau->im, radau->scratch[0], radau->scratch[1]);
}

/* Factor gamma - h J and alpha - i beta - h J, unless that is done. */
HS_INLINE int factor_for(hs_run *run, int n, hs_real h) {
  hs_radau *const radau = &run->radau;
  const hs_collocation *const known = run->method->collocation;
  if (radau->factored && radau->factored_for == h) return 0;
  if (n > 3 && run->here.table->elimination) {
    radau->factored_for = h;
    radau->factored = !sparse_factor(run, n, h, run->here.table->elimination);
    return radau->factored ? 0 : NO_CONVERGENCE;
  }
  for (int i = 0; i < n * n; i++) {
    radau->real[i] = radau->re[i] = -h * radau->rows[i];
    radau->im[i] = 0.0;
  }
  for (int i = 0; i < n; i++) {
    radau->real[i * n + i] = known->gamma + radau->real[i * n + i];
    radau->re[i * n + i] = known->alpha + radau->re[i * n + i];
    radau->im[i * n + i] = -known->beta;
  }
  radau->factored_for = h;
  radau->factored = !factored(n, radau->real, radau->order, run->scales) &&
                    !factored_complex(n, radau->re, radau->im, radau->turned, run->scales);
  return radau->factored ? 0 : NO_CONVERGENCE;
}

/* Go on with the last step's polynomial: behind its end, or inside it where it was tried from here. To radau->z. */
HS_INLINE void guess(hs_run *run, int n, hs_time t, hs_real h) {
  hs_radau *const radau = &run->radau;
  const hs_collocation *const known = run->method->collocation;
  const int behind = radau->stepped && t == radau->start + radau->length;
  const int known_here = behind || (radau->stepped && t == radau->start);
  const hs_real share = h / radau->length;
  hs_real *const c[3] = {radau->slopes[0], radau->slopes[1], radau->slopes[2]}; /* of the polynomial */
  for (int m = 0; known_here && m < 3; m++) weighted3(n, known->power[m], radau->last, c[m]);
  for (int i = 0; i < 3; i++) {
    const hs_real at = (behind ? 1.0 : 0.0) + known->node[i] * share;
    const hs_real *const end = radau->last[2];
    hs_real *const z = radau->z[i];
    for (int s = 0; !known_here && s < n; s++) z[s] = 0.0;
    if (!known_here) continue;
    HS_SIMD
    for (int s = 0; s < n; s++) z[s] = at * (c[0][s] + at * (c[1][s] + at * c[2][s])) - (behind ? end[s] : 0.0);
  }
}

/* Solve for the step with the derivatives that there are. */
HS_INLINE int settle_in(hs_run *run, int n, hs_time t, hs_real h, int exactly, int closer) {
  hs_radau *const radau = &run->radau;
  radau->scales = radau->lifted ? run->resolved : run->scales;
  for (int s = 0; radau->lifted && s < n; s++) run->resolved[s] = hs_max(run->scales[s], radau->least[s]);
  radau_scales(run, t, h, closer);
  guess(run, n, t, h);
  const int status = factor_for(run, n, h);
  if (status) return status;
  for (int i = 0; i < 3; i++) weighted3(n, run->method->collocation->unmix[i], radau->z, radau->apart[i]);
  return exactly ? to_roundoff(run, n, t, h) : to_tolerance(run, n, t, h);
}

static int settle_2(hs_run *run, hs_time t, hs_real h, int exactly, int closer) {
  return settle_in(run, 2, t, h, exactly, closer);
}

static int settle_3(hs_run *run, hs_time t, hs_real h, int exactly, int closer) {
  return settle_in(run, 3, t, h, exactly, closer);
}

static int settle_n(hs_run *run, hs_time t, hs_real h, int exactly, int closer) {
  return settle_in(run, run->here.dimension, t, h, exactly, closer);
}

HS_INLINE int settle(hs_run *run, int n, hs_time t, hs_real h, int exactly, int closer) {
  return (n == 2 ? settle_2 : n == 3 ? settle_3 : settle_n)(run, t, h, exactly, closer);
}

/* Solve Z = h A f(x + Z), with derivatives from an earlier step if they still do. */
HS_INLINE int solved(hs_run *run, int n, hs_time t, hs_real h, int exactly) {
  hs_radau *const radau = &run->radau;
  const int renew = radau->convergence.aged && radau->derived_at != t;
  if ((!radau->derived || renew) && derive(run, t)) return NO_VALUE;
  if (radau->derived_at != t) {
    const int status = settle(run, n, t, h, exactly, 0);
    if (status != NO_CONVERGENCE) return status;
    if (derive(run, t)) return NO_VALUE;
  }
  const int status = settle(run, n, t, h, exactly, 0);
  return status == NO_CONVERGENCE && !run->here.table->jumps ? settle(run, n, t, h, exactly, 1) : status;
}

/* The error of the step's end and of the curve inside it, for each state the larger of the two, to radau->error. */
HS_INLINE int estimate(hs_run *run, int n, hs_time t, hs_real h) {
  hs_radau *const radau = &run->radau;
  const hs_collocation *const known = run->method->collocation;
  hs_real *const inside = radau->slopes[0], *const embedded = radau->change[0], *const along = radau->change[1];
  weighted3(n, known->value, radau->z, run->at);
  plus(n, run->x, run->at, run->at);
  if (run->here.table->flow(run->here.p, t + known->share * h, run->at, inside)) return NO_VALUE;
  weighted3(n, known->estimate, radau->z, radau->right[0]);
  weighted3(n, known->slope, radau->z, radau->right[1]);
  hs_real *const first = radau->right[0], *const second = radau->right[1];
  const hs_real *const slope = run->slope;
  HS_SIMD
  for (int s = 0; s < n; s++) {
    first[s] = h * slope[s] + first[s];
    second[s] = h * inside[s] - second[s];
  }
  solved_real(run, n, radau->right[0], embedded);
  solved_real(run, n, radau->right[1], along);
  for (int s = 0; s < n; s++) radau->error[s] = fabs(embedded[s]) >= fabs(along[s]) ? embedded[s] : along[s];
  return 0;
}

/* The same to round-off, for any number of states. */
static int solved_exactly(hs_run *run, hs_time t, hs_real h) {
  return run->here.dimension ? solved(run, run->here.dimension, t, h, 1) : 0;
}

HS_INLINE int radau_step_in(hs_run *run, int n, hs_time t, hs_real h) {
  hs_radau *const radau = &run->radau;
  if (!n) return 0;
  const int adaptive = run->control.tolerance > 0;
  const int status = adaptive ? solved(run, n, t, h, 0) : solved_exactly(run, t, h);
  if (status) return status;
  radau->stepped = 1;
  radau->start = t;
  radau->length = h;
  for (int i = 0; i < 3; i++) copy(radau->last[i], radau->z[i], n);
  if (adaptive && estimate(run, n, t, h)) return NO_VALUE;
  for (int s = 0; s < n; s++) run->z[s] = run->x[s] + radau->z[2][s];
  return 0;
}

/* Try a step, solved to its tolerance; compiled for two and three states apart, a tenth faster. */
static int radau_step(hs_run *run, hs_time t, hs_real h) {
  switch (run->here.dimension) {
    case 2: return radau_step_in(run, 2, t, h);
    case 3: return radau_step_in(run, 3, t, h);
    default: return radau_step_in(run, run->here.dimension, t, h);
  }
}

/* The sum of the absolute terms of a state's derivative at run->z, as the flow's derivatives tell. */
static hs_real terms_of(const hs_run *run, int state) {
  const hs_sparse *const rows = &run->here.table->jacobian;
  const int n = run->here.dimension, sparse = run->here.table->elimination != 0;
  hs_real total = 0.0;
  for (int i = 0; i < rows->count; i++) {
    const int place = rows->place[i];
    if (place / n == state) total = total + fabs(run->radau.rows[sparse ? i : place] * run->z[place % n]);
  }
  return total;
}

/* The slopes of measured states at a step's end, run->z, where they belong. See Steps._slopes. */
static int radau_slopes(hs_run *run, hs_time t, hs_real h) {
  const hs_mode *const mode = run->here.table;
  const hs_real *const w = run->method->collocation->end_slope, size = fabs(w[0]) + fabs(w[1]) + fabs(w[2]);
  hs_real *const *const z = run->radau.z, *const found = run->z + run->here.dimension - 1 - mode->measures;
  if (!mode->measures) return 0;
  if (mode->flow(run->here.p, t + h, run->z, run->at)) return NO_VALUE;
  for (int k = 0; k < mode->measures; k++) {
    const int i = mode->measured[k];
    const int cancels = h * terms_of(run, i) > size * hs_max(fabs(run->x[i]), fabs(run->z[i]));
    found[k] = cancels ? (w[0] * z[0][i] + w[1] * z[1][i] + w[2] * z[2][i]) / h : run->at[i];
  }
  found[mode->measures] = 1.0;
  return 0;
}

/* Make a part of the last step, solved to round-off: its end, run->z, is a smooth function of its length. */
static int radau_landing(hs_run *run, hs_time t, hs_real h) {
  const int status = solved_exactly(run, t, h);
  if (status) return status;
  for (int s = 0; s < run->here.dimension; s++) run->z[s] = run->x[s] + run->radau.z[2][s];
  return radau_slopes(run, t, h);
}

/* The polynomial through the increments. */
static void radau_piece(const hs_run *run, hs_polynomial *piece) {
  piece->degree = 3;
  for (int m = 0; m < 3; m++)
    weighted3(run->here.dimension, run->method->collocation->power[m], run->radau.z, piece->c + m * run->width);
}
