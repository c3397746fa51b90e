/* Systems of linear equations: dense, in a sparse pattern, and of states with columns of derivatives of them.
   See hsdsl/engine/integrators/linear.py. Complex numbers are pairs of real ones. */

static void exchange_rows(hs_real *a, int n, int i, int k) {
  if (i == k) return;
  for (int j = 0; j < n; j++) {
    const hs_real kept = a[i * n + j];
    a[i * n + j] = a[k * n + j];
    a[k * n + j] = kept;
  }
}

static void exchange_places(int *order, int i, int k) {
  const int kept = order[i];
  order[i] = order[k];
  order[k] = kept;
}

/* Whether a is larger than b, each relative to the scale of the unknown of its row; without one only than zero. */
HS_INLINE int is_larger(hs_real a, hs_real of_a, hs_real b, hs_real of_b) {
  return of_a > 0 && of_b > 0 ? a * of_b > b * of_a : b == 0 && a > 0;
}

/* Factor the matrix a of n rows in place, inverse pivots on its diagonal; not 0 where it has no inverse. `scales` are
   those of the unknowns; only rows of one of the `groups` exchange places, where these are not 0. */
HS_INLINE int factored(int n, hs_real *restrict a, int *restrict order, const hs_real *scales, const int *groups) {
  for (int i = 0; i < n; i++) order[i] = i;
  for (int k = 0; k < n; k++) {
    int pivot = k;
    for (int i = k + 1; i < n; i++)
      if (!(groups && groups[i] != groups[k]) &&
          is_larger(fabs(a[i * n + k]), scales[order[i]], fabs(a[pivot * n + k]), scales[order[pivot]]))
        pivot = i;
    exchange_rows(a, n, k, pivot);
    exchange_places(order, k, pivot);
    if (!(fabs(a[k * n + k]) > 0)) return 1;
    a[k * n + k] = 1 / a[k * n + k];
    for (int i = k + 1; i < n; i++) {
      if (a[i * n + k] == 0) continue;
      const hs_real share = a[i * n + k] = a[i * n + k] * a[k * n + k];
      for (int j = k + 1; j < n; j++) a[i * n + j] = a[i * n + j] - share * a[k * n + j];
    }
  }
  return 0;
}

/* Solve for a right-hand side, to `found`. */
HS_INLINE void solve(int n, const hs_real *restrict a, const int *restrict order, const hs_real *restrict right,
                     hs_real *restrict found) {
  for (int i = 0; i < n; i++) found[i] = right[order[i]];
  for (int i = 0; i < n; i++)
    for (int j = 0; j < i; j++) found[i] = found[i] - a[i * n + j] * found[j];
  for (int i = n - 1; i >= 0; i--) {
    for (int j = i + 1; j < n; j++) found[i] = found[i] - a[i * n + j] * found[j];
    found[i] = found[i] * a[i * n + i];
  }
}

/* The same of a complex matrix, real and imaginary parts apart; the size of a pivot is the sum of its parts' sizes. */
HS_INLINE int factored_complex(int n, hs_real *restrict re, hs_real *restrict im, int *restrict order,
                               const hs_real *scales, const int *groups) {
  for (int i = 0; i < n; i++) order[i] = i;
  for (int k = 0; k < n; k++) {
    int pivot = k;
    for (int i = k + 1; i < n; i++)
      if (!(groups && groups[i] != groups[k]) &&
          is_larger(fabs(re[i * n + k]) + fabs(im[i * n + k]), scales[order[i]],
                        fabs(re[pivot * n + k]) + fabs(im[pivot * n + k]), scales[order[pivot]]))
        pivot = i;
    exchange_rows(re, n, k, pivot);
    exchange_rows(im, n, k, pivot);
    exchange_places(order, k, pivot);
    const hs_real size = re[k * n + k] * re[k * n + k] + im[k * n + k] * im[k * n + k];
    if (!(size > 0)) return 1;
    const hs_real c = re[k * n + k] = re[k * n + k] / size, d = im[k * n + k] = -im[k * n + k] / size;
    for (int i = k + 1; i < n; i++) {
      const hs_real a = re[i * n + k], b = im[i * n + k];
      if (a == 0 && b == 0) continue;
      const hs_real p = re[i * n + k] = c * a - d * b, q = im[i * n + k] = c * b + d * a;
      for (int j = k + 1; j < n; j++) {
        const hs_real u = re[k * n + j], v = im[k * n + j];
        re[i * n + j] = re[i * n + j] - (p * u - q * v);
        im[i * n + j] = im[i * n + j] - (p * v + q * u);
      }
    }
  }
  return 0;
}

/* Take the products of row i with what is known off its right-hand side a + i b. */
HS_INLINE void take_off(int n, const hs_real *re, const hs_real *im, hs_real *a, hs_real *b, int i, int first,
                        int end) {
  for (int j = first; j < end; j++) {
    const hs_real c = re[i * n + j], d = im[i * n + j];
    a[i] = a[i] - (c * a[j] - d * b[j]);
    b[i] = b[i] - (c * b[j] + d * a[j]);
  }
}

HS_INLINE void solve_complex(int n, const hs_real *restrict re, const hs_real *restrict im, const int *restrict order,
                             const hs_real *const right[2], hs_real *restrict a, hs_real *restrict b) {
  for (int i = 0; i < n; i++) a[i] = right[0][order[i]], b[i] = right[1][order[i]];
  for (int i = 0; i < n; i++) take_off(n, re, im, a, b, i, 0, i);
  for (int i = n - 1; i >= 0; i--) {
    take_off(n, re, im, a, b, i, i + 1, n);
    const hs_real c = re[i * n + i], d = im[i * n + i], p = a[i], q = b[i];
    a[i] = c * p - d * q;
    b[i] = c * q + d * p;
  }
}

/* Factor the entries `a` in place, inverse pivots on the diagonal; not 0 where a pivot is zero. */
static int sparse_factored(int n, const hs_elimination *of, hs_real *restrict a, hs_real *restrict row) {
  for (int i = 0; i < n; i++) {
    for (int at = of->start[i]; at < of->start[i + 1]; at++) row[of->column[at]] = a[at];
    for (int at = of->start[i]; at < of->diagonal[i]; at++) {
      const int k = of->column[at];
      const hs_real share = row[k] = row[k] * a[of->diagonal[k]];
      for (int above = of->diagonal[k] + 1; above < of->start[k + 1]; above++)
        row[of->column[above]] = row[of->column[above]] - share * a[above];
    }
    for (int at = of->start[i]; at < of->start[i + 1]; at++) a[at] = row[of->column[at]];
    if (!(fabs(row[i]) > 0)) return 1;
    a[of->diagonal[i]] = 1 / row[i];
  }
  return 0;
}

/* Solve for a right-hand side, to `found`. */
static void sparse_solve(int n, const hs_elimination *of, const hs_real *restrict values, const hs_real *restrict right,
                         hs_real *restrict y, hs_real *restrict found) {
  for (int i = 0; i < n; i++) {
    hs_real left = right[of->order[i]];
    for (int at = of->start[i]; at < of->diagonal[i]; at++) left = left - values[at] * y[of->column[at]];
    y[i] = left;
  }
  for (int i = n - 1; i >= 0; i--) {
    hs_real left = y[i];
    for (int at = of->diagonal[i] + 1; at < of->start[i + 1]; at++) left = left - values[at] * y[of->column[at]];
    y[i] = left * values[of->diagonal[i]];
    found[of->order[i]] = y[i];
  }
}

/* The same of a complex matrix, real and imaginary parts apart. */
static int sparse_factored_complex(int n, const hs_elimination *of, hs_real *restrict re, hs_real *restrict im,
                                   hs_real *restrict c, hs_real *restrict d) {
  for (int i = 0; i < n; i++) {
    for (int at = of->start[i]; at < of->start[i + 1]; at++) c[of->column[at]] = re[at], d[of->column[at]] = im[at];
    for (int at = of->start[i]; at < of->diagonal[i]; at++) {
      const int k = of->column[at];
      const hs_real p = c[k], q = d[k], u = re[of->diagonal[k]], v = im[of->diagonal[k]];
      const hs_real r = c[k] = u * p - v * q, s = d[k] = u * q + v * p;
      for (int above = of->diagonal[k] + 1; above < of->start[k + 1]; above++) {
        const int j = of->column[above];
        c[j] = c[j] - (r * re[above] - s * im[above]);
        d[j] = d[j] - (r * im[above] + s * re[above]);
      }
    }
    for (int at = of->start[i]; at < of->start[i + 1]; at++) re[at] = c[of->column[at]], im[at] = d[of->column[at]];
    const hs_real size = c[i] * c[i] + d[i] * d[i];
    if (!(size > 0)) return 1;
    re[of->diagonal[i]] = c[i] / size, im[of->diagonal[i]] = -d[i] / size;
  }
  return 0;
}

static void sparse_solve_complex(int n, const hs_elimination *of, const hs_real *restrict re, const hs_real *restrict im,
                                 const hs_real *const right[2], hs_real *restrict a, hs_real *restrict b,
                                 hs_real *restrict one, hs_real *restrict two) {
  for (int i = 0; i < n; i++) {
    hs_real u = right[0][of->order[i]], v = right[1][of->order[i]];
    for (int at = of->start[i]; at < of->diagonal[i]; at++) {
      const hs_real c = re[at], d = im[at], p = a[of->column[at]], q = b[of->column[at]];
      u = u - (c * p - d * q);
      v = v - (c * q + d * p);
    }
    a[i] = u, b[i] = v;
  }
  for (int i = n - 1; i >= 0; i--) {
    hs_real u = a[i], v = b[i];
    for (int at = of->diagonal[i] + 1; at < of->start[i + 1]; at++) {
      const hs_real c = re[at], d = im[at], p = a[of->column[at]], q = b[of->column[at]];
      u = u - (c * p - d * q);
      v = v - (c * q + d * p);
    }
    const hs_real c = re[of->diagonal[i]], d = im[of->diagonal[i]];
    a[i] = one[of->order[i]] = c * u - d * v;
    b[i] = two[of->order[i]] = c * v + d * u;
  }
}

HS_INLINE hs_blocks blocks_of(const hs_mode *mode) {
  const hs_variation *const v = columns_of(mode);
  hs_blocks found = {mode->dimension, mode->dimension, v, mode->dimension > 3 ? mode->elimination : 0, 0};
  if (v) found.n = v->columns[v->count], found.own = v->own, found.of = v->elimination;
  return found;
}

/* Solve for a right-hand side of the own states. */
HS_INLINE void solve_own(hs_radau *radau, int own, const hs_elimination *of, const hs_real *right, hs_real *found) {
  if (of)
    sparse_solve(own, of, radau->real, right, radau->scratch[0], found);
  else
    solve(own, radau->real, radau->order, right, found);
}

HS_INLINE void solve_own_complex(hs_radau *radau, int own, const hs_elimination *of, const hs_real *const right[2],
                                 hs_real *a, hs_real *b) {
  if (of)
    sparse_solve_complex(own, of, radau->re, radau->im, right, radau->scratch[0], radau->scratch[1], a, b);
  else
    solve_complex(own, radau->re, radau->im, radau->turned, right, a, b);
}

/* Add what the changes of the own states make of the right-hand sides of the columns. */
HS_INLINE void add_linked(const hs_radau *radau, const hs_variation *v, const hs_real *own, hs_real *right) {
  for (int e = 0; e < v->links; e++)
    right[v->linked[e]] = right[v->linked[e]] + radau->linked[e] * own[v->linking[e]];
}

/* A column as a vector of the own states, zero for derivatives that it does not have: itself, or in `spread`. */
HS_INLINE const hs_real *spread_column(const hs_blocks of, int k, const hs_real *all, hs_real *spread) {
  const hs_variation *const v = of.v;
  const int own = of.own;
  if (of.whole) return all + (k + 1) * own;
  const int begin = v->columns[k], count = v->columns[k + 1] - begin;
  if (count == own) return all + begin;
  for (int i = 0; i < own; i++) spread[i] = 0.0;
  for (int i = 0; i < count; i++) spread[v->rows[begin - own + i]] = all[begin + i];
  return spread;
}

/* Where the solution of a column goes, and from there to its place. */
HS_INLINE hs_real *room_of_column(const hs_blocks of, int k, hs_real *all, hs_real *spread) {
  const hs_variation *const v = of.v;
  const int own = of.own;
  if (of.whole) return all + (k + 1) * own;
  return v->columns[k + 1] - v->columns[k] == own ? all + v->columns[k] : spread;
}

HS_INLINE void place_column(const hs_blocks of, int k, const hs_real *column, hs_real *all) {
  const hs_variation *const v = of.v;
  const int own = of.own;
  if (of.whole) return;
  const int begin = v->columns[k], count = v->columns[k + 1] - begin;
  if (count == own) return;
  for (int i = 0; i < count; i++) all[begin + i] = column[v->rows[begin - own + i]];
}

/* Solve for the columns, where `found` has the solution for the own states; right-hand sides of columns are changed. */
HS_INLINE void solve_columns(hs_run *run, hs_blocks blocks, hs_real *right, hs_real *found) {
  hs_radau *const radau = &run->radau;
  const hs_variation *const v = columns_of(run->here.table) ? blocks.v : 0;
  if (!v) return;
  add_linked(radau, v, found, right);
  for (int k = 0; k < v->count; k++) {
    hs_real *const room = room_of_column(blocks, k, found, radau->spread[1]);
    solve_own(radau, blocks.own, blocks.of, spread_column(blocks, k, right, radau->spread[0]), room);
    place_column(blocks, k, room, found);
  }
}

/* Solve with the factors of the real matrix. */
HS_INLINE void solve_all(hs_run *run, hs_blocks blocks, hs_real *right, hs_real *found) {
  solve_own(&run->radau, blocks.own, blocks.of, right, found);
  solve_columns(run, blocks, right, found);
}

HS_INLINE void solve_all_complex(hs_run *run, hs_blocks blocks, hs_real *const *right, hs_real *a, hs_real *b) {
  hs_radau *const radau = &run->radau;
  const hs_variation *const v = columns_of(run->here.table) ? blocks.v : 0;
  const hs_elimination *const of = blocks.of;
  const int own = blocks.own;
  hs_real *const *const spread = radau->spread;
  const hs_real *const first[2] = {right[0], right[1]};
  solve_own_complex(radau, own, of, first, a, b);
  if (!v) return;
  add_linked(radau, v, a, right[0]);
  add_linked(radau, v, b, right[1]);
  for (int k = 0; k < v->count; k++) {
    const hs_real *const both[2] = {spread_column(blocks, k, right[0], spread[0]),
                                    spread_column(blocks, k, right[1], spread[1])};
    hs_real *const c = room_of_column(blocks, k, a, spread[2]), *const d = room_of_column(blocks, k, b, spread[3]);
    solve_own_complex(radau, own, of, both, c, d);
    place_column(blocks, k, c, a);
    place_column(blocks, k, d, b);
  }
}

/* Keep h times the derivatives of columns by the own states. */
static void link_columns(hs_run *run, const hs_variation *v, hs_real h) {
  for (int e = 0; e < v->links; e++) run->radau.linked[e] = h * run->radau.rows[v->link[e]];
}
