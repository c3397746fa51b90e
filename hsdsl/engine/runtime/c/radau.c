/* Steps by Radau IIA, and the stopping rules of their iterations. See hsdsl/engine/integrators/radau.py. */

#define MOST_ITERATIONS 7
#define MOST_TO_ROUNDOFF (16 + 2 * HS_BITS)
#define RENEWED 1e-3
#define FEW 2
#define LEAST_LEFT 1e-3
#define MOST_LEFT 0.03
#define DIVERGING 0.99
#define SLOW_RATE 0.5
#define NEWTON_NOISE 1024
#define NEWTON_SHARE 1e-2

/* The largest change relative to the scales; of a state that has been zero so far, to where it is now. */
HS_INLINE hs_real scaled(const hs_run *run, int n) {
  const hs_radau *const radau = &run->radau;
  hs_real size = 0.0;
  for (int s = 0; s < n; s++) {
    const hs_real change = radau->largest[s];
    hs_real reach = radau->scales[s];
    if (!(change > 0)) continue;
    for (int i = 0; i < 3 && !(radau->scales[s] > 0); i++) {
      const hs_real at = fabs(run->x[s] + radau->z[i][s]);
      reach = i ? hs_max(reach, at) : at;
    }
    size = hs_max(size, reach > 0 ? change / reach : reach + 1);
  }
  return size;
}

/* How many states that have been zero so far no longer are: each may follow another one, an iteration later. */
HS_INLINE int followers(const hs_run *run, int n) {
  const hs_radau *const radau = &run->radau;
  int count = 0;
  for (int s = 0; s < n; s++) {
    if (radau->scales[s] > 0) continue;
    int moved = 0;
    for (int i = 0; i < 3; i++) moved |= fabs(run->x[s] + radau->z[i][s]) > 0;
    count += moved;
  }
  return count;
}

static int unsettled(hs_convergence *convergence) {
  convergence->rate = 1.0;
  convergence->aged = 1;
  return NO_CONVERGENCE;
}

/* Iterate until what is left is a small share of the tolerance. */
HS_INLINE int to_tolerance(hs_run *run, hs_blocks of, hs_time t, hs_real h) {
  const int n = of.n;
  hs_convergence *const convergence = &run->radau.convergence;
  const hs_real tolerance = run->control.tolerance, noise = NEWTON_NOISE * HS_UNIT / tolerance;
  const hs_real enough = hs_max(10 * HS_UNIT / tolerance, hs_min(MOST_LEFT, hs_max(LEAST_LEFT, sqrt(tolerance))));
  hs_real left = pow(hs_max(convergence->left, HS_UNIT), (hs_real)4 / 5), before = 0.0;
  for (int count = 1;; count++) {
    const int status = iterate(run, of, t, h);
    if (status) return status;
    const int rated = count > 1 && count > 1 + followers(run, n);
    const hs_real size = scaled(run, n) / tolerance;
    if (rated) {
      const hs_real rate = size / before;
      if (rate >= DIVERGING) {
        if (size <= noise) return 0;
        break;
      }
      convergence->rate = rate;
      left = rate / (1 - rate);
    }
    convergence->aged = count > FEW && convergence->rate > RENEWED;
    hs_real ahead = left * size;
    if (size == 0 || ahead <= enough) {
      convergence->left = left;
      return 0;
    }
    if (rated)
      for (int i = count; i < MOST_ITERATIONS; i++) ahead = ahead * convergence->rate;
    if (count == MOST_ITERATIONS || (rated && ahead > enough && size > noise)) break;
    before = size;
  }
  convergence->left = 1.0;
  return unsettled(convergence);
}

/* Whether the next corrections would be below the last digits of x and of all stages. */
HS_INLINE int below_digits(const hs_run *run, int n, hs_real rate) {
  const hs_radau *radau = &run->radau;
  for (int s = 0; s < n; s++) {
    hs_real reach = fabs(run->x[s]);
    for (int i = 0; i < 3; i++) reach = hs_max(reach, fabs(run->x[s] + radau->z[i][s]));
    if (!(rate * radau->largest[s] <= HS_UNIT * reach)) return 0;
  }
  return 1;
}

/* Iterate until the next correction would be below the last digit, or they are all noise. */
HS_INLINE int to_roundoff(hs_run *run, hs_blocks of, hs_time t, hs_real h) {
  const int n = of.n;
  hs_convergence *const convergence = &run->radau.convergence;
  const hs_real allowed = hs_max(NEWTON_NOISE * HS_UNIT, NEWTON_SHARE * run->control.tolerance);
  hs_real before = 0.0;
  for (int count = 1; count <= MOST_TO_ROUNDOFF; count++) {
    const int status = iterate(run, of, t, h);
    if (status) return status;
    const hs_real size = scaled(run, n), rate = before == 0 ? SLOW_RATE : size / before;
    if (size == 0 || (rate < SLOW_RATE && below_digits(run, n, rate))) {
      convergence->rate = rate;
      convergence->aged = rate > RENEWED;
      return 0;
    }
    if (before != 0 && rate >= SLOW_RATE && count > 1 + followers(run, n)) return size <= allowed ? 0 : unsettled(convergence);
    before = size;
  }
  return 0;
}

/* The weighted sum of three vectors. */
HS_INLINE void weighted3(int n, const hs_real *w, hs_real *const v[3], hs_real *out) {
  const hs_real *const a = v[0], *const b = v[1], *const c = v[2], p = w[0], q = w[1], r = w[2];
  HS_SIMD
  for (int s = 0; s < n; s++) out[s] = p * a[s] + q * b[s] + r * c[s];
}

HS_INLINE void plus(int n, const hs_real *a, const hs_real *b, hs_real *sum) {
  HS_SIMD
  for (int s = 0; s < n; s++) sum[s] = a[s] + b[s];
}

HS_INLINE hs_real summed3(const hs_real *w, hs_real a, hs_real b, hs_real c) { return w[0] * a + w[1] * b + w[2] * c; }

/* Make h g - (G, B) u, where g is what takes A apart of the slopes, to `right`. */
HS_INLINE void right_sides(hs_radau *radau, int n, hs_real h, const hs_collocation *known) {
  const hs_real *const a = radau->apart[0], *const b = radau->apart[1], *const c = radau->apart[2];
  const hs_real *const e = radau->slopes[0], *const f = radau->slopes[1], *const g = radau->slopes[2];
  const hs_real gamma = known->gamma, alpha = known->alpha, beta = known->beta;
  hs_real *const p = radau->right[0], *const q = radau->right[1], *const r = radau->right[2];
  HS_SIMD
  for (int s = 0; s < n; s++) {
    p[s] = h * summed3(known->unmix[0], e[s], f[s], g[s]) - gamma * a[s];
    q[s] = h * summed3(known->unmix[1], e[s], f[s], g[s]) - (alpha * b[s] + beta * c[s]);
    r[s] = h * summed3(known->unmix[2], e[s], f[s], g[s]) - (alpha * c[s] - beta * b[s]);
  }
}

/* Add the changes, and make of that the increments; the largest change of each state, and whether all are finite. */
HS_INLINE int corrected(hs_radau *radau, int n, const hs_collocation *known) {
  const hs_real *const a = radau->change[0], *const b = radau->change[1], *const c = radau->change[2];
  hs_real *const u = radau->apart[0], *const v = radau->apart[1], *const w = radau->apart[2];
  hs_real *const x = radau->z[0], *const y = radau->z[1], *const z = radau->z[2], *const largest = radau->largest;
  hs_real *const total = radau->right[0];
  HS_SIMD
  for (int s = 0; s < n; s++) {
    const hs_real e = u[s] + a[s], f = v[s] + b[s], g = w[s] + c[s];
    u[s] = e, v[s] = f, w[s] = g;
    x[s] = summed3(known->mix[0], e, f, g);
    y[s] = summed3(known->mix[1], e, f, g);
    z[s] = summed3(known->mix[2], e, f, g);
    largest[s] = hs_max(hs_max(fabs(a[s]), fabs(b[s])), fabs(c[s]));
    total[s] = fabs(a[s]) + fabs(b[s]) + fabs(c[s]);
  }
  return hs_finite(sum(total, n));
}

/* One iteration of Newton's method on Z = h A f(x + Z), in the coordinates that take A apart: the increments after it
   and the largest change of each state. Not 0 where the flow has no value there, or the change has none. */
HS_INLINE int iterate(hs_run *run, hs_blocks of, hs_time t, hs_real h) {
  const int n = of.n;
  hs_radau *const radau = &run->radau;
  const hs_collocation *const known = run->method->collocation;
  hs_real *const *const d = radau->change;
  for (int i = 0; i < 3; i++) {
    plus(n, run->x, radau->z[i], run->at);
    if (run->here.table->flow(run->here.p, t + known->node[i] * h, run->at, radau->slopes[i])) return NO_VALUE;
  }
  right_sides(radau, n, h, known);
  solve_all(run, of, radau->right[0], d[0]);
  solve_all_complex(run, of, radau->right + 1, d[1], d[2]);
  return corrected(radau, n, known) ? 0 : NO_CONVERGENCE;
}

static void radau_forget(hs_run *run) {
  hs_radau *const radau = &run->radau;
  const hs_variation *const v = columns_of(run->here.table);
  for (int s = v ? v->columns[v->count] : run->width; s < run->width; s++) { /* these do not flow */
    for (int i = 0; i < 3; i++) radau->z[i][s] = radau->last[i][s] = 0.0;
    radau->largest[s] = radau->error[s] = 0.0;
  }
  radau->derived = radau->factored = radau->stepped = 0;
  radau->convergence.rate = radau->convergence.left = 1.0;
  radau->convergence.aged = 0;
  radau->lifted = 0;
}

/* Have the scales of the states over a step of length h; `closer`, with a look at the terms of the flow. */
static void radau_scales(hs_run *run, hs_time t, hs_real h, int closer) {
  hs_radau *const radau = &run->radau;
  if (!closer || resolved(run, t, h, run->x, radau->rows)) return;
  radau->scales = run->resolved;
  radau->lifted = 0;
  for (int s = 0; s < run->here.dimension; s++) {
    radau->lifted |= run->resolved[s] > run->scales[s];
    radau->least[s] = run->resolved[s];
  }
}

/* Which share of an error of a derivative of a state lasts over the step that a run tries first. */
static void see_what_lasts(hs_run *run, const hs_variation *v) {
  hs_radau *const radau = &run->radau;
  for (int s = v->own; s < v->columns[v->count]; s++) {
    const hs_real own = v->itself[s] < 0 ? (hs_real)0.0 : radau->rows[v->itself[s]];
    radau->lasting[s] = 1 / (1 + run->task->settings.step * fabs(own));
  }
}

HS_INLINE int derive(hs_run *run, hs_time t) {
  hs_radau *const radau = &run->radau;
  const hs_sparse *const rows = &run->here.table->jacobian;
  if (rows->values(run->here.p, t, run->x, radau->fresh)) return NO_VALUE;
  if (!run->here.table->elimination && !columns_of(run->here.table))
    hs_spread_out(rows, run->here.dimension * run->here.dimension, radau->fresh);
  swap(&radau->rows, &radau->fresh);
  if (columns_of(run->here.table)) see_what_lasts(run, columns_of(run->here.table));
  radau->derived = 1;
  radau->derived_at = t;
  radau->factored = 0;
  return 0;
}

/* The same matrices in the pattern of a sparse elimination. */
static int sparse_factor(hs_run *run, hs_blocks blocks, hs_real h) {
  const hs_elimination *const of = blocks.of;
  const int n = blocks.own, count = blocks.v ? blocks.v->entries : run->here.table->jacobian.count;
  hs_radau *const radau = &run->radau;
  const hs_collocation *const known = run->method->collocation;
  for (int i = 0; i < of->size; i++) radau->real[i] = radau->re[i] = radau->im[i] = 0.0;
  for (int i = 0; i < count; i++)
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

/* The derivatives of the own states by each other, times -h, to radau->real. */
HS_INLINE void spread_own(hs_run *run, hs_blocks of, hs_real h) {
  hs_radau *const radau = &run->radau;
  const int n = of.own, width = run->here.dimension, *const place = run->here.table->jacobian.place;
  for (int i = 0; i < n * n; i++) radau->real[i] = of.v ? (hs_real)0.0 : -h * radau->rows[i];
  for (int i = 0; of.v && i < of.v->entries; i++)
    radau->real[place[i] / width * n + place[i] % width] = -h * radau->rows[i];
}

/* Factor gamma - h J and alpha - i beta - h J, unless that is done. */
HS_INLINE int factor_for(hs_run *run, hs_blocks of, hs_real h) {
  const int n = of.own;
  hs_radau *const radau = &run->radau;
  const hs_collocation *const known = run->method->collocation;
  if (radau->factored && radau->factored_for == h) return 0;
  if (of.v) link_columns(run, of.v, h);
  if (of.of) {
    radau->factored_for = h;
    radau->factored = !sparse_factor(run, of, h);
    return radau->factored ? 0 : NO_CONVERGENCE;
  }
  spread_own(run, of, h);
  for (int i = 0; i < n * n; i++) {
    radau->re[i] = radau->real[i];
    radau->im[i] = 0.0;
  }
  for (int i = 0; i < n; i++) {
    radau->real[i * n + i] = known->gamma + radau->real[i * n + i];
    radau->re[i * n + i] = known->alpha + radau->re[i * n + i];
    radau->im[i * n + i] = -known->beta;
  }
  radau->factored_for = h;
  const int *const groups = of.v ? of.v->groups : 0;
  radau->factored = !factored(n, radau->real, radau->order, run->scales, groups) &&
                    !factored_complex(n, radau->re, radau->im, radau->turned, run->scales, groups);
  return radau->factored ? 0 : NO_CONVERGENCE;
}

/* Go on with the last step's polynomial: behind its end, or inside it where it was tried from here. To radau->z, and
   apart. */
HS_INLINE void guess(hs_run *run, int n, hs_time t, hs_real h) {
  hs_radau *const radau = &run->radau;
  const hs_collocation *const known = run->method->collocation;
  const int behind = radau->stepped && t == radau->start + radau->length;
  const int known_here = behind || (radau->stepped && t == radau->start);
  const hs_real share = h / radau->length;
  const hs_real base = behind ? 1.0 : 0.0;
  const hs_real *const e = radau->last[0], *const f = radau->last[1], *const g = radau->last[2];
  hs_real *const x = radau->z[0], *const y = radau->z[1], *const z = radau->z[2];
  hs_real *const u = radau->apart[0], *const v = radau->apart[1], *const w = radau->apart[2];
  const hs_real first = base + known->node[0] * share, second = base + known->node[1] * share,
                third = base + known->node[2] * share;
  for (int s = 0; !known_here && s < n; s++) x[s] = y[s] = z[s] = u[s] = v[s] = w[s] = 0.0;
  if (!known_here) return;
  HS_SIMD
  for (int s = 0; s < n; s++) {
    const hs_real end = behind ? g[s] : 0.0, a = summed3(known->power[0], e[s], f[s], g[s]),
                  b = summed3(known->power[1], e[s], f[s], g[s]), c = summed3(known->power[2], e[s], f[s], g[s]);
    x[s] = first * (a + first * (b + first * c)) - end;
    y[s] = second * (a + second * (b + second * c)) - end;
    z[s] = third * (a + third * (b + third * c)) - end;
    u[s] = summed3(known->unmix[0], x[s], y[s], z[s]);
    v[s] = summed3(known->unmix[1], x[s], y[s], z[s]);
    w[s] = summed3(known->unmix[2], x[s], y[s], z[s]);
  }
}

/* Solve for the step with the derivatives that there are. */
HS_INLINE int settle_in(hs_run *run, hs_blocks of, hs_time t, hs_real h, int exactly, int closer) {
  const int n = of.n;
  hs_radau *const radau = &run->radau;
  radau->scales = radau->lifted ? run->resolved : run->scales;
  for (int s = 0; radau->lifted && s < run->here.dimension; s++) run->resolved[s] = hs_max(run->scales[s], radau->least[s]);
  radau_scales(run, t, h, closer);
  guess(run, n, t, h);
  const int status = factor_for(run, of, h);
  if (status) return status;
  return exactly ? to_roundoff(run, of, t, h) : to_tolerance(run, of, t, h);
}

static int settle_2(hs_run *run, hs_time t, hs_real h, int exactly, int closer) {
  const hs_blocks of = {2, 2, 0, 0, 0};
  return settle_in(run, of, t, h, exactly, closer);
}

static int settle_3(hs_run *run, hs_time t, hs_real h, int exactly, int closer) {
  const hs_blocks of = {3, 3, 0, 0, 0};
  return settle_in(run, of, t, h, exactly, closer);
}

static int settle_n(hs_run *run, hs_time t, hs_real h, int exactly, int closer) {
  return settle_in(run, blocks_of(run->here.table), t, h, exactly, closer);
}

/* The same where columns have the derivatives of two or three states; one column of two apart. */
static int settle_column_2(hs_run *run, hs_time t, hs_real h, int exactly, int closer) {
  const hs_blocks of = {4, 2, columns_of(run->here.table), 0, 1};
  return settle_in(run, of, t, h, exactly, closer);
}

static int settle_columns_2(hs_run *run, hs_time t, hs_real h, int exactly, int closer) {
  const hs_variation *const v = columns_of(run->here.table);
  const hs_blocks of = {2 * (1 + v->count), 2, v, 0, 1};
  return settle_in(run, of, t, h, exactly, closer);
}

static int settle_columns_3(hs_run *run, hs_time t, hs_real h, int exactly, int closer) {
  const hs_variation *const v = columns_of(run->here.table);
  const hs_blocks of = {3 * (1 + v->count), 3, v, 0, 1};
  return settle_in(run, of, t, h, exactly, closer);
}

/* Whether there are such columns, and nothing less. */
HS_INLINE int has_columns(const hs_run *run) {
  const hs_variation *const v = columns_of(run->here.table);
  return v && v->columns[v->count] == v->own * (1 + v->count);
}

HS_INLINE int settle(hs_run *run, hs_blocks of, hs_time t, hs_real h, int exactly, int closer) {
  if (!columns_of(run->here.table) && of.n == 2) return settle_2(run, t, h, exactly, closer);
  if (!columns_of(run->here.table) && of.n == 3) return settle_3(run, t, h, exactly, closer);
  if (has_columns(run) && of.own == 2 && of.n == 4) return settle_column_2(run, t, h, exactly, closer);
  if (has_columns(run) && of.own == 2) return settle_columns_2(run, t, h, exactly, closer);
  if (has_columns(run) && of.own == 3) return settle_columns_3(run, t, h, exactly, closer);
  return settle_n(run, t, h, exactly, closer);
}

/* Solve Z = h A f(x + Z), with derivatives from an earlier step if they still do. */
HS_INLINE int solved(hs_run *run, hs_blocks of, hs_time t, hs_real h, int exactly) {
  hs_radau *const radau = &run->radau;
  const int renew = radau->convergence.aged && radau->derived_at != t;
  if ((!radau->derived || renew) && derive(run, t)) return NO_VALUE;
  if (radau->derived_at != t) {
    const int status = settle(run, of, t, h, exactly, 0);
    if (status != NO_CONVERGENCE) return status;
    if (derive(run, t)) return NO_VALUE;
  }
  const int status = settle(run, of, t, h, exactly, 0);
  return status == NO_CONVERGENCE ? settle(run, of, t, h, exactly, 1) : status;
}

HS_INLINE hs_real larger(hs_real a, hs_real b) { return fabs(a) >= fabs(b) ? a : b; }

/* The error of the step's end and of the curve inside it, for each state the larger of the two, to radau->error.
   See Steps._estimate. */
HS_INLINE int estimate(hs_run *run, hs_blocks of, hs_time t, hs_real h) {
  const int n = of.n;
  hs_radau *const radau = &run->radau;
  const hs_collocation *const known = run->method->collocation;
  hs_real *const inside = radau->slopes[0], *const embedded = radau->change[0], *const along = radau->change[1];
  const hs_real *const u = radau->z[0], *const v = radau->z[1], *const w = radau->z[2], *const x = run->x;
  hs_real *const at = run->at, *const error = radau->error;
  HS_SIMD
  for (int s = 0; s < n; s++) at[s] = x[s] + summed3(known->value, u[s], v[s], w[s]);
  if (run->here.table->flow(run->here.p, t + known->share * h, run->at, inside)) return NO_VALUE;
  hs_real *const first = radau->right[0], *const second = radau->right[1];
  const hs_real *const slope = run->slope;
  HS_SIMD
  for (int s = 0; s < n; s++) {
    first[s] = h * slope[s] + summed3(known->estimate, u[s], v[s], w[s]);
    second[s] = h * inside[s] - summed3(known->slope, u[s], v[s], w[s]);
  }
  solve_own(radau, of.own, of.of, first, embedded);
  solve_own(radau, of.own, of.of, second, along);
  for (int s = 0; s < of.own; s++) error[s] = larger(embedded[s], along[s]);
  for (int s = of.own; s < n; s++) first[s] = larger(first[s] * radau->lasting[s], second[s]);
  solve_columns(run, of, first, error);
  return 0;
}

/* The same to round-off, for any number of states. */
static int solved_exactly(hs_run *run, hs_time t, hs_real h) {
  return run->here.dimension ? solved(run, blocks_of(run->here.table), t, h, 1) : 0;
}

HS_INLINE int radau_step_in(hs_run *run, hs_blocks of, hs_time t, hs_real h) {
  hs_radau *const radau = &run->radau;
  const int n = of.n;
  if (!n) return 0;
  const int adaptive = run->control.tolerance > 0;
  const int status = adaptive ? solved(run, of, t, h, 0) : solved_exactly(run, t, h);
  if (status) return status;
  radau->stepped = 1;
  radau->start = t;
  radau->length = h;
  for (int i = 0; i < 3; i++) copy(radau->last[i], radau->z[i], n);
  if (adaptive && estimate(run, of, t, h)) return NO_VALUE;
  plus(of.v ? run->here.dimension : n, run->x, radau->z[2], run->z);
  return 0;
}

/* Try a step, solved to its tolerance; compiled for two and three states apart, a tenth faster, and a third where these
   have columns. */
static int radau_step(hs_run *run, hs_time t, hs_real h) {
  static const hs_blocks two = {2, 2, 0, 0, 0}, three = {3, 3, 0, 0, 0};
  const hs_blocks of = blocks_of(run->here.table);
  if (!columns_of(run->here.table) && of.n == 2) return radau_step_in(run, two, t, h);
  if (!columns_of(run->here.table) && of.n == 3) return radau_step_in(run, three, t, h);
  if (has_columns(run) && (of.own == 2 || of.own == 3)) {
    const hs_blocks pairs = {2 * (1 + of.v->count), 2, of.v, 0, 1}, triples = {3 * (1 + of.v->count), 3, of.v, 0, 1};
    const hs_blocks pair = {4, 2, of.v, 0, 1};
    if (of.n == 4) return radau_step_in(run, pair, t, h);
    return of.own == 2 ? radau_step_in(run, pairs, t, h) : radau_step_in(run, triples, t, h);
  }
  return radau_step_in(run, of, t, h);
}

/* The sum of the absolute terms of a state's derivative at run->z, as the flow's derivatives tell. */
static hs_real terms_of(const hs_run *run, int state) {
  const hs_sparse *const rows = &run->here.table->jacobian;
  const int n = run->here.dimension, packed = run->here.table->elimination || columns_of(run->here.table);
  hs_real total = 0.0;
  for (int i = 0; i < rows->count; i++) {
    const int place = rows->place[i];
    if (place / n == state) total = total + fabs(run->radau.rows[packed ? i : place] * run->z[place % n]);
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
  const int n = blocks_of(run->here.table).n;
  piece->degree = 3;
  for (int m = 0; m < 3; m++) {
    hs_real *const c = piece->c + m * run->width;
    weighted3(n, run->method->collocation->power[m], run->radau.z, c);
    for (int s = n; s < run->here.dimension; s++) c[s] = 0.0;
  }
}
