/* Corrections of recorded steps that no series repeats. See hsdsl/engine/simulate/verdict/correction.py. */

#include "screen_view.h"

enum { NODES = 4, POWERS = 6, SMALL = 3 /* states, kept in registers */ };

/* How much the polynomial of the run's step fails the flow at the share s, begun at x and moved by `bulge` u, its slope
   by `rate` u. */
HS_INLINE int defect_at(hs_view *v, const hs_shadow *c, int n, double s, const double *x, double bulge, double rate,
                        const double *restrict u, double *restrict g) {
  const int d = v->s->run.degree, w = v->s->run.width;
  const double *coefficient = recorded_piece(&v->s->run, c->row) + (d - 1) * w;
  const double *const roundoff = c->roundoff, h = c->h;
  double *restrict const at = v->z, *restrict const slope = v->slope;
  HS_SIMD
  for (int i = 0; i < n; i++) at[i] = s * coefficient[i], slope[i] = d * coefficient[i];
  for (int k = d - 1; k > 0; k--) {
    const double power = k;
    coefficient -= w;
    HS_SIMD
    for (int i = 0; i < n; i++) {
      at[i] = s * (coefficient[i] + at[i]);
      slope[i] = power * coefficient[i] + s * slope[i];
    }
  }
  HS_SIMD
  for (int i = 0; i < n; i++) {
    at[i] = x[i] + at[i] + bulge * u[i];
    slope[i] += rate * u[i];
  }
  if (c->table->flow(c->p, c->t + s * h, at, g)) return 1;
  HS_SIMD
  for (int i = 0; i < n; i++) g[i] = h * g[i] - slope[i] + roundoff[i];
  return 0;
}

/* Factor 1 - a h J, J being the derivatives of the flow where the run's step ends. A dense matrix is inverted:
   products need not wait for each other as the unknowns of a triangle do. */
HS_INLINE int factor_correction(hs_view *v, const hs_shadow *c, int n) {
  const double *const x = recorded_row(&v->s->run, c->row + 1), away = -v->s->correction->pole * c->h;
  const hs_sparse *const rows = &c->table->jacobian;
  const hs_elimination *const of = n > SMALL ? c->table->elimination : 0;
  double *const a = v->factors, *const unit = v->z, *const sizes = v->slope;
  if (rows->values(c->p, c->t + c->h, x, v->derivatives)) return 1;
  const int size = of ? of->size : n * n;
  for (int i = 0; i < size; i++) a[i] = 0.0;
  for (int i = 0; i < rows->count; i++) a[of ? of->place[i] : rows->place[i]] = away * v->derivatives[i];
  for (int i = 0; i < n; i++) a[of ? of->diagonal[i] : i * n + i] += 1.0;
  if (of) return sparse_factored(n, of, a, v->z);
  for (int i = 0; i < n; i++) sizes[i] = fabs(x[i]), unit[i] = 0.0;
  if (factored(n, a, v->exchanged, sizes, 0)) return 1;
  for (int i = 0; i < n; i++) {
    unit[i] = 1.0;
    solve(n, a, v->exchanged, unit, v->inverse + i * n);
    unit[i] = 0.0;
  }
  return 0;
}

/* The product of the inverse and a vector. */
HS_INLINE void solve_correction(hs_view *v, const hs_shadow *c, int n, const double *restrict right,
                                double *restrict d) {
  const double *restrict const w = v->inverse;
  if (n > SMALL && c->table->elimination) {
    sparse_solve(n, c->table->elimination, v->factors, right, v->z, d);
    return;
  }
  for (int i = 0; i < n; i++) d[i] = w[i] * right[0];
  for (int j = 1; j < n; j++)
    for (int i = 0; i < n; i++) d[i] += w[j * n + i] * right[j];
}

HS_INLINE void weigh(int n, const double *weight, double *const *g, double *restrict sum) {
  const double *const a = g[0], *const b = g[1], *const c = g[2], *const d = g[3];
  HS_SIMD
  for (int i = 0; i < n; i++) sum[i] = weight[0] * a[i] + weight[1] * b[i] + weight[2] * c[i] + weight[3] * d[i];
}

HS_INLINE int correct_in(hs_view *v, hs_shadow *c, int n, double *restrict apart) {
  const hs_correction *const known = v->s->correction;
  const double *const start = recorded_row(&v->s->run, c->row), *const end = recorded_row(&v->s->run, c->row + 1);
  double *g[NODES], *const u = v->defects + NODES * v->s->run.width, few[2][SMALL];
  double *restrict const right = n > SMALL ? v->slope : few[0], *restrict const d = n > SMALL ? c->y : few[1];
  for (int k = 0; k < NODES; k++) g[k] = v->defects + k * v->s->run.width;
  for (int i = 0; i < n; i++) c->roundoff[i] = copysign(c->roundoff[i], c->x[i] - start[i]), u[i] = 0.0;
  if (factor_correction(v, c, n) || defect_at(v, c, n, known->inside, start, 0.0, 0.0, u, g[0])) return 0;
  solve_correction(v, c, n, g[0], u);
  for (int i = 0; i < n; i++) apart[i] = fabs(c->x[i] - start[i] + known->pole * u[i]);
  for (int k = 0; k < NODES; k++)
    if (defect_at(v, c, n, known->node[k], c->x, known->bulge[k], known->slope[k], u, g[k])) return 0;
  weigh(n, known->weight[POWERS - 1], g, right);
  for (int m = POWERS - 2; m >= 0; m--) {
    solve_correction(v, c, n, right, d);
    weigh(n, known->weight[m], g, right);
    for (int i = 0; i < n; i++) right[i] += d[i];
  }
  solve_correction(v, c, n, right, d);
  for (int i = 0; i < n; i++) c->y[i] = end[i] + ((c->x[i] - start[i]) + d[i]);
  return 1;
}

static int correct_2(hs_view *v, hs_shadow *c, double *apart) {
  return correct_in(v, c, 2, apart);
}

static int correct_3(hs_view *v, hs_shadow *c, double *apart) {
  return correct_in(v, c, 3, apart);
}

static int correct_n(hs_view *v, hs_shadow *c, double *apart) {
  return correct_in(v, c, v->n, apart);
}

/* Find where the shadow run is at the end of the run's step, to y, further away by `roundoff`, which goes on as the
   flow does; and how far it is from the run inside, to `apart`. */
static int correct_step(hs_view *v, hs_shadow *c, double *apart) {
  return (v->n == 2 ? correct_2 : v->n == 3 ? correct_3 : correct_n)(v, c, apart);
}
