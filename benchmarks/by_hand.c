/* Relaxed midpoint for the forced oscillator with stop at 14 or 0, with the model written into the loop; keeps rows. */

#include <math.h>
#include <stdlib.h>

double relaxed_midpoint(double a, double c, double f, double w, double x, double v, double step, double relaxation,
                        double until) {
  const double damping = 2 * a, stiffness = w * w, stop = 14.0;
  const long room = (long)(until / step * 1.01) + 1000;
  double *times = malloc(room * sizeof(double)), *positions = malloc(room * sizeof(double)),
         *velocities = malloc(room * sizeof(double));
  double t = 0.0;
  long rows = 0;
  while (t < until) {
    double h = t + step < until ? step : until - t;
    const double slope = f * cos(2.5 * t) - damping * v - stiffness * x;
    double xn, vn, depth, half;
    for (;;) {
      half = 0.5 * h;
      const double xm = x + half * v, vm = v + half * slope;
      xn = x + h * vm;
      vn = v + h * (f * cos(2.5 * (t + half)) - damping * vm - stiffness * xm);
      depth = xn - stop;
      if (depth <= relaxation) break;
      h = half;
    }
    t += h;
    if (depth > 0) {
      v = -c * (v + (stop - x) / (xn - x) * (vn - v));
      x = stop;
      t += relaxation - depth;
    } else {
      x = xn, v = vn;
    }
    if (rows < room) times[rows] = t, positions[rows] = x, velocities[rows] = v, rows++;
  }
  free(times), free(positions), free(velocities);
  return x;
}
