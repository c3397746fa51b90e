/* The scale of a state: the largest size it has had in a run, and what round-off in its flow makes of that.
   See hsdsl/engine/integrators/stepper.py. */

#include "functions.h"

#define SHARE 32
#define NOISE_UNITS 64
#define ITERATED 1024
#define BLUR_UNITS 4 /* BLUR there */

#if !defined(HS_FLOAT32)
/* 2**k, where that is a normal number. */
static double power_of_two(int k) {
  const uint64_t bits = (uint64_t)(k + 1023) << 52;
  double power;
  memcpy(&power, &bits, sizeof power);
  return power;
}
#endif

/* exponent / m, rounded down, of exponents of numbers; this division need not wait for the exponent. */
static int rounded_down(int exponent, int m) {
  const int64_t inverse = (1 << 30) / m + 1;
  return (int)(((exponent + 2048 * m) * inverse) >> 30) - 2048;
}

/* x**(-1/m); of x 2**(k m) it is exactly 2**-k times as much. */
static hs_real root(hs_real x, int m) {
#if !defined(HS_FLOAT32)
  if (x >= 0x1p-900 && x <= 0x1p900) { /* frexp and ldexp cost as much as pow */
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    const int shift = rounded_down((int)(bits >> 52) - 1022, m);
    return pow(x * power_of_two(-shift * m), -1.0 / m) * power_of_two(-shift);
  }
#endif
  int exponent;
  const hs_real fraction = frexp(x, &exponent);
  const int shift = rounded_down(exponent, m);
  return ldexp(pow(ldexp(fraction, exponent - shift * m), (hs_real)-1 / m), -shift);
}

/* The sizes of the terms of a flow, by what the last digits of the states `moved` change in it, to `found`;
   its value is `slope`. Not 0 where it has none nearby. */
static int flow_terms(hs_run *run, hs_time t, const hs_real *x, const hs_real *slope, const hs_real *moved,
                      hs_real *found) {
  static const hs_real moves[4] = {2, -2, 6, -6};
  const int n = run->here.dimension;
  hs_real *const near = run->near, *const other = run->nearby;
  for (int s = 0; s < n; s++) found[s] = 0.0;
  for (int probe = 0, every = 1; probe < 4; probe++, every *= 4) {
    for (int s = 0; s < n; s++) near[s] = x[s] + moves[(s / every + probe) % 4] * HS_UNIT * moved[s];
    const hs_time later = t + moves[(n / every + probe) % 4] * HS_UNIT * t;
    if (run->here.table->flow(run->here.p, later, near, other)) return 1;
    for (int s = 0; s < n; s++) found[s] = hs_max(found[s], fabs(other[s] - slope[s]));
  }
  for (int s = 0; s < n; s++) found[s] = found[s] / (BLUR_UNITS * HS_UNIT);
  return 0;
}

/* The same by a bound on them, of a flow whose terms jump or may hide. */
static int bounded_terms(const hs_run *run, hs_time t, const hs_real *x, const hs_real *moved, hs_real *found) {
  const int n = run->here.dimension;
  copy(run->both, x, n);
  copy(run->both + n, moved, n);
  return run->here.table->terms(run->here.p, t, run->both, found);
}

/* The derivative of a state's flow by itself. */
static hs_real own_derivative(const hs_run *run, const hs_real *rows, int s) {
  const hs_elimination *of = run->here.table->elimination;
  const hs_variation *v = columns_of(run->here.table);
  if (!of && !v) return rows[s * run->here.dimension + s];
  const int entry = v ? v->itself[s] : of->own[s];
  return entry < 0 ? (hs_real)0.0 : rows[entry];
}

/* The scales over a step of length h from (t, x), none below a share of what the terms of its flow could move the state
   by, to run->resolved. `rows` are the derivatives of the flow, or 0. Not 0 where the flow has no value nearby. */
static int resolved(hs_run *run, hs_time t, hs_real h, const hs_real *x, const hs_real *rows) {
  const int n = run->here.dimension;
  const hs_real share = hs_max(SHARE, hs_max(run->control.tolerance, 0) / ((rows ? ITERATED : NOISE_UNITS) * HS_UNIT));
  hs_real *const moved = run->resolved, *const least = run->least;
  if (run->here.table->flow(run->here.p, t, x, run->unmoved)) return 1;
  for (int s = 0; s < n; s++) moved[s] = run->scales[s], run->lifted[s] = 0;
  for (int round = 0; round < n; round++) {
    int further = 0;
    if (run->here.table->terms ? bounded_terms(run, t, x, moved, least)
                               : flow_terms(run, t, x, run->unmoved, moved, least))
      return 1;
    for (int s = 0; s < n; s++) {
      hs_real size = h * least[s];
      if (rows) size = size / (1 + h * fabs(own_derivative(run, rows, s)));
      if (!(hs_finite(size) && size > share * run->scales[s])) continue;
      moved[s] = hs_max(moved[s], size);
      further |= !run->lifted[s];
      run->lifted[s] = 1;
    }
    if (!further) break;
  }
  for (int s = 0; s < n; s++) moved[s] = hs_max(run->scales[s], moved[s] / share);
  return 0;
}
