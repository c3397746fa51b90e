/* Stopping rules of the iterations for an implicit step. See hsdsl/engine/integrators/radau.py. */

#include "functions.h"

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
