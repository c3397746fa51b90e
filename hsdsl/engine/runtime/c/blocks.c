/* Systems of equations of an implicit step, of states and their derivatives. See hsdsl/engine/integrators/linear.py.

   `own` states have a matrix; the columns of derivatives, where there are any, have the same one. */

#include "functions.h"

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
