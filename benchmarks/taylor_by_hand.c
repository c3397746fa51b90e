/* Taylor's method for the forced oscillator with stop, with the model written into its recurrences: what a person might
   write for this one answer, fast. All impacts in a step are isolated (Bernstein form); samples go to `out`. An
   impact slower than `rest` while the force presses ends the flight: the mass is held until the force lets go. */

#include <math.h>

enum { MOST = 31, DEPTH = 60 };

typedef struct {
  double b[MOST + 1], low, high;
} cut;

static double choose[MOST + 1][MOST + 1];

void prepare(void) {
  for (int n = 0; n <= MOST; n++)
    for (int k = 0; k <= n; k++) choose[n][k] = k == 0 || k == n ? 1.0 : choose[n - 1][k - 1] + choose[n - 1][k];
}

static double value(const double *c, int n, double s, double *slope) {
  double v = c[n], d = 0.0;
  for (int k = n - 1; k >= 0; k--) d = v + s * d, v = c[k] + s * v;
  *slope = d;
  return v;
}

/* The first root at which the polynomial rises, in (0, 1]; 2 where there is none. */
static double first_rise(const double *c, int n) {
  static cut cuts[DEPTH + 2];
  double bound = c[0];
  for (int k = 1; k <= n; k++) bound += c[k] > 0 ? c[k] : 0.0;
  if (bound < 0) return 2.0;
  double *b = cuts[0].b;
  for (int k = 0; k <= n; k++) b[k] = c[k] / choose[n][k];
  for (int k = 1; k <= n; k++)
    for (int i = n; i >= k; i--) b[i] += b[i - 1];
  cuts[0].low = 0.0, cuts[0].high = 1.0;
  for (int open = 1; open;) {
    cut *const here = &cuts[--open];
    double most = here->b[0];
    int changes = 0;
    for (int k = 1; k <= n; k++) {
      most = here->b[k] > most ? here->b[k] : most;
      changes += (here->b[k] > 0) != (here->b[k - 1] > 0);
    }
    if (most <= 0) continue;
    if (changes == 1 && here->b[0] <= 0) {
      double a = here->low, z = here->high, s = (a + z) / 2, slope;
      for (int i = 0; i < 100; i++) {
        const double f = value(c, n, s, &slope);
        if (f < 0) a = s; else z = s;
        double next = slope > 0 ? s - f / slope : a;
        if (!(a < next && next < z)) next = (a + z) / 2;
        if (fabs(next - s) <= 1e-16) return next;
        s = next;
      }
      return s;
    }
    if (open >= DEPTH || here->high - here->low < 1e-15) continue;
    const double middle = (here->low + here->high) / 2, high = here->high;
    cut *const left = &cuts[open + 1];
    left->low = here->low, left->high = middle;
    left->b[0] = here->b[0];
    for (int j = 1; j <= n; j++) {
      for (int i = 0; i <= n - j; i++) here->b[i] = 0.5 * (here->b[i] + here->b[i + 1]);
      left->b[j] = here->b[0];
    }
    here->low = middle, here->high = high;
    open += 2;
  }
  return 2.0;
}

/* When f cos(u t) falls through a force, after t. */
static double release(double f, double u, double force, double t) {
  const double turn = 2 * acos(-1.0), phase = acos(force / f), end = (floor(u * t / turn) * turn + phase) / u;
  return end > t ? end : end + turn / u;
}

/* Returns the number of impacts. */
int taylor(double a, double c, double f, double w, double u, double stop, double x, double v, double rest,
           double tolerance, double until, int samples, const double *times, double *out) {
  const double stiffness = w * w, damping = 2 * a;
  const int n = (int)ceil(3 - 0.5 * log(tolerance));
  double t = 0.0;
  int next = 0, impacts = 0, standing = x == stop, landed = standing, released = 0;
  while (t < until) {
    if (landed && fabs(v) <= rest && f * cos(u * t) > stiffness * stop) {
      t = fmin(release(f, u, stiffness * stop, t), until), v = 0.0;
      for (; next < samples && times[next] <= t; next++) out[next] = stop;
      landed = 0, released = 1;
      continue;
    }
    double X[MOST + 2], V[MOST + 2], C[MOST + 2], S[MOST + 2], P[MOST + 1];
    X[0] = x, V[0] = v, C[0] = cos(u * t), S[0] = sin(u * t);
    for (int k = 0; k <= n; k++) {
      const double share = 1.0 / (k + 1);
      X[k + 1] = V[k] * share;
      V[k + 1] = released && k == 0 ? 0.0 : (f * C[k] - damping * V[k] - stiffness * X[k]) * share;
      C[k + 1] = -u * S[k] * share;
      S[k + 1] = u * C[k] * share;
    }
    double size = fmax(fabs(X[n]) / (1 + fabs(x)), fabs(V[n]) / (1 + fabs(v))) / tolerance;
    double h = pow(size, -1.0 / n);
    size = fmax(fabs(X[n + 1]) / (1 + fabs(x)), fabs(V[n + 1]) / (1 + fabs(v))) / tolerance;
    h = fmin(fmin(h, pow(size, -1.0 / (n + 1))), until - t);
    double power = 1.0;
    for (int k = 0; k <= n; k++) P[k] = X[k] * power, power *= h;
    P[0] = standing ? 0.0 : x - stop;
    const double s = first_rise(P + standing, n - standing);
    const double share = s <= 1 ? s : 1.0, length = share * h, end = s > 1 && h == until - t ? until : t + length;
    for (; next < samples && times[next] <= end; next++) {
      const double d = times[next] - t;
      double y = X[n];
      for (int k = n - 1; k >= 0; k--) y = X[k] + d * y;
      out[next] = y;
    }
    double y = V[n], z = X[n];
    for (int k = n - 1; k >= 0; k--) y = V[k] + length * y, z = X[k] + length * z;
    t = end, standing = landed = s <= 1, released = 0;
    if (standing)
      x = stop, v = -c * y, impacts++;
    else
      x = z, v = y;
  }
  return impacts;
}
