/* Where polynomials change sign on [0, 1], certified by the Bernstein form. See hsdsl/engine/simulate/root_isolation.py.
   A polynomial of degree n is c[0] + c[1] s + ... + c[n] s**n. */

#include "functions.h"

#define MOST_REFINEMENTS 300

/* C(n, 0) to C(n, n). */
static const hs_real *binomials(const hs_run *run, int n) { return run->binomials + n * (n + 1) / 2; }

static void fill_binomials(hs_real *row, int most) {
  for (int n = 0; n <= most; n++, row += n)
    for (int k = 0; k <= n; k++) row[k] = k == 0 || k == n ? 1.0 : (row - n)[k - 1] + (row - n)[k];
}

/* Bernstein coefficients on [0, 1] of a polynomial: n times each has the one before added to it, of which the first
   more stay each time. Two such passes are made in one. */
HS_INLINE void fill_bernstein(const hs_run *run, const hs_real *c, int n, hs_real *b) {
  const hs_real *choose = binomials(run, n);
  HS_SIMD for (int k = 0; k <= n; k++) b[k] = c[k] / choose[k];
  for (int k = 1; k <= n; k += 2) {
    hs_real before = b[k], once = before + b[k - 1];
    b[k] = once;
    for (int i = k + 1; i <= n; i++) {
      const hs_real own = b[i], sum = own + before;
      b[i] = sum + once;
      before = own, once = sum;
    }
  }
}

/* Those of a polynomial of the step's curves, made once for each. */
HS_INLINE const hs_real *bernstein_of(hs_run *run, const hs_real *c, int n) {
  if (run->bernstein_of != c) fill_bernstein(run, c, n, run->bernstein);
  run->bernstein_of = c;
  return run->bernstein;
}

HS_INLINE hs_real largest_of(const hs_real *b, int n) {
  hs_real most = b[0];
  for (int i = 1; i <= n; i++) most = hs_max(most, b[i]);
  return most;
}

/* Whether the polynomial is nowhere above `level` on [0, 1], by bounds that may not see it. */
static int stays_below(hs_run *run, const hs_real *c, int n, hs_real level) {
  hs_real bound = c[0];
  for (int k = 1; k <= n; k++)
    if (c[k] > 0) bound = bound + c[k];
  if (bound <= level) return 1;
  return largest_of(bernstein_of(run, c, n), n) <= level;
}

/* Cut an interval at the share s: `left` gets the coefficients before it, `b` those behind it (de Casteljau). */
static void split(hs_real *b, int n, hs_real s, hs_real *left) {
  const hs_real rest = 1 - s;
  left[0] = b[0];
  for (int j = 1; j <= n; j++) {
    for (int i = 0; i <= n - j; i++) b[i] = rest * b[i] + s * b[i + 1];
    left[j] = b[0];
  }
}

HS_INLINE hs_real value_of(const hs_real *c, int n, hs_real s) {
  hs_real total = c[n];
  for (int k = n - 1; k >= 0; k--) total = c[k] + s * total;
  return total;
}

/* The same at 1. */
HS_INLINE hs_real value_at_end(const hs_real *c, int n) {
  hs_real total = c[n];
  for (int k = n - 1; k >= 0; k--) total = c[k] + total;
  return total;
}

/* Changes of sign, zeros left out. */
static int changes(const hs_real *b, int n) {
  int count = 0, before = 0;
  for (int i = 0; i <= n; i++) {
    const int sign = (b[i] > 0) - !(b[i] >= 0);
    count += sign * before < 0;
    before = sign ? sign : before;
  }
  return count;
}

/* Find a point from `start` on where `sign` times the polynomial is above `level`, not having come back down before
   it: 1; 0 where it is nowhere above, up to intervals shorter than a unit of round-off. */
static int rises(hs_run *run, const hs_real *c, int n, hs_real sign, hs_real level, hs_real start, hs_real *point) {
  hs_cut *const cuts = run->cuts;
  int open = 1;
  const hs_real *const own = bernstein_of(run, c, n);
  for (int i = 0; i <= n; i++) cuts[0].b[i] = sign * own[i] - level;
  if (start > 0) split(cuts[0].b, n, start, run->left);
  cuts[0].low = start, cuts[0].high = 1.0;
  while (open) {
    hs_cut *const cut = &cuts[--open];
    hs_real *const b = cut->b;
    const hs_real low = cut->low, high = cut->high;
    if (largest_of(b, n) <= 0) continue;
    if (b[0] > 0) return *point = low, 1;
    if (b[n] > 0 && (changes(b, n) == 1 || high - low <= HS_UNIT)) return *point = high, 1;
    if (high - low > HS_UNIT) {
      const hs_real middle = (low + high) / 2;
      split(b, n, 0.5, cuts[open + 1].b);
      cut->low = middle, cut->high = high;
      cuts[open + 1].low = low, cuts[open + 1].high = middle;
      open += 2;
    }
  }
  return 0;
}

/* A polynomial and its derivative (Horner). */
HS_INLINE hs_real value_and_slope(const hs_real *c, int n, hs_real s, hs_real *slope) {
  hs_real total = c[n];
  *slope = total * 0;
  for (int k = n - 1; k >= 0; k--) {
    *slope = total + s * *slope;
    total = c[k] + s * total;
  }
  return total;
}

/* Halve the way to an end of a bracket until the polynomial has the sign; the end itself where it has not. */
static void towards(const hs_real *c, int n, hs_real *end, hs_real *other, hs_real sign) {
  for (;;) {
    const hs_real middle = (*end + *other) / 2;
    if (middle == *end || middle == *other || fabs(*end - *other) <= HS_UNIT * HS_UNIT) {
      *other = *end;
      return;
    }
    if (sign * value_of(c, n, middle) > 0) {
      *end = middle;
      return;
    }
    *other = middle;
  }
}

/* Solve for the one root in a bracket P(a) <= 0 < P(b) (Newton's method, a bisection where it leaves the bracket). */
static hs_real refined(const hs_real *c, int n, hs_real a, hs_real b) {
  hs_real fa = a == 0 ? c[0] : value_of(c, n, a), fb = b == 1 ? value_at_end(c, n) : value_of(c, n, b);
  hs_real noise = 0.0;
  for (int k = 0; k <= n; k++) noise = noise + fabs(c[k]);
  noise = ROUNDING * HS_UNIT * noise;
  const int falls = !(fa < -noise), stays = !(fb > noise);
  if (falls) towards(c, n, &a, &b, -1.0);
  if (stays) towards(c, n, &b, &a, 1.0);
  if (falls || stays) fa = value_of(c, n, a), fb = value_of(c, n, b);
  if (a == b || !(fa < 0)) return a;
  hs_real s = a - fa * (b - a) / (fb - fa);
  for (int count = 0; count < MOST_REFINEMENTS; count++) {
    if (!(a < s && s < b)) {
      s = (a + b) / 2;
      if (!(a < s && s < b)) return a;
    }
    hs_real slope;
    const hs_real f = value_and_slope(c, n, s, &slope);
    if (f < 0)
      a = s;
    else
      b = s;
    const hs_real after = slope > 0 ? s - f / slope : a;
    if (slope > 0 && a <= after && after <= b && (after - s) * (after - s) <= HS_UNIT * after * after) return after;
    s = after;
  }
  return a;
}

/* Find the last point in [start, end] where a polynomial rises through 0, knowing that it is positive at `end`: 1; 0
   where it is positive all the way. The polynomial is c, of degree n; where `reduced`, c over its factor s, whose
   Bernstein coefficients are n / k times those of c behind the first, b_k. They have the signs of these. */
static int last_root(hs_run *run, const hs_real *c, int n, int reduced, hs_real start, hs_real end, hs_real *root) {
  hs_cut *const cuts = run->cuts;
  const hs_real *const own = bernstein_of(run, c, n) + reduced, degree = n; /* of c */
  int open = 1;
  c += reduced, n -= reduced;
  if (start == 0 && end == 1 && own[0] <= 0 && 0 < own[n] && changes(own, n) <= 1)
    return *root = refined(c, n, start, end), 1;
  for (int k = 0; k <= n; k++) cuts[0].b[k] = reduced ? own[k] * degree / (k + 1) : own[k];
  if (end < 1) {
    split(cuts[0].b, n, end, run->left);
    copy(cuts[0].b, run->left, n + 1);
  }
  if (start > 0) split(cuts[0].b, n, start / end, run->left);
  cuts[0].low = start, cuts[0].high = end;
  while (open) {
    hs_cut *const cut = &cuts[--open];
    hs_real *const b = cut->b;
    const hs_real low = cut->low, high = cut->high;
    hs_real least = b[0];
    for (int i = 1; i <= n; i++) least = hs_min(least, b[i]);
    if (least > 0) continue;
    if (b[0] <= 0 && 0 < b[n] && changes(b, n) <= 1) return *root = refined(c, n, low, high), 1;
    if (high - low <= HS_UNIT) {
      if (b[0] > 0) continue; /* what it rose through lies before */
      return *root = low, 1;
    }
    const hs_real middle = (low + high) / 2;
    copy(cuts[open + 1].b, b, n + 1);
    split(cuts[open + 1].b, n, 0.5, cut->b);
    cut->low = low, cut->high = middle;
    cuts[open + 1].low = middle, cuts[open + 1].high = high;
    open += 2;
  }
  return 0;
}
