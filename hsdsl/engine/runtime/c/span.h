/* What steps by Taylor series are made of: of one run, and compiled again for lanes of runs (lane.h). A branch that
   depends on numbers is a choice here, since each lane has its own. See hsdsl/engine/integrators/taylor.py. */

#ifndef HS_SPAN_H
#define HS_SPAN_H

#include "run.h"

#if !defined(HS_WIDTH)
typedef int hs_mask;
#define hs_any(mask) (mask)
#define hs_choose(mask, yes, no) ((mask) ? (yes) : (no))
#define root_in(mask, x, m) root(x, m)
#endif

#define ALMOST (1 - 0x1p-30)
#define UNKNOWN_TOLERANCE 1e-10
#define LAST_TERM 4
#define TERM_BEFORE 32

/* The size of numbers of two sizes, of which the first is negative where a reset's terms gave it: see hs_sizes. */
HS_INLINE hs_real joined(hs_real scale, hs_real size) {
  return hs_choose(scale < 0, -hs_max(-scale, size), hs_max(scale, size));
}

/* End of a step of length h from t, which is stretched to the limit where it nearly gets there. */
HS_INLINE hs_time end_of_step(hs_time t, hs_real *h, hs_time limit) {
  const hs_mask before = *h < (limit - t) * ALMOST;
  const hs_time end = hs_choose(before, t + *h, limit);
  *h = hs_choose(before, *h, limit - t);
  return end;
}

/* The largest coefficient m of n states, relative to the tolerance of their scales. */
HS_INLINE hs_real largest_term(const hs_real *lines, const hs_real *scales, int n, int order, hs_number tolerance,
                               int m) {
  hs_real largest = HS_ALL(0.0);
  for (int s = 0; s < n; s++) {
    const hs_real size = tolerance * scales[s];
    const hs_mask counts = size > HS_NOTHING;
    largest = hs_choose(counts, hs_max(largest, fabs(lines[(s + 1) * (order + 2) + m]) / size), largest);
  }
  return largest;
}

/* The step at which the first terms of n states that are left out stay below the tolerance, of their scales;
   not-a-number where all vanish. A root takes long: where logarithms, which are too low by less than an eighth, say that
   the second one is smaller, it alone is computed. */
HS_INLINE hs_real step_of_terms(const hs_real *lines, const hs_real *scales, int n, int order, hs_number tolerance) {
  const hs_real last = largest_term(lines, scales, n, order, tolerance, order);
  const hs_real next = largest_term(lines, scales, n, order, tolerance, order + 1);
  const hs_mask digits = (last > HS_NOTHING) & (next > HS_NOTHING);
  const hs_mask second = digits & (low_log2(next) * order > (low_log2(last) + 0.125) * (order + 1));
  hs_real least = HS_ALL(NAN);
  hs_mask shorter = (last > 0) & ~second;
  if (hs_any(shorter)) least = hs_choose(shorter, root_in(shorter, last, order), least);
  shorter = (next > 0) & ((least != least) | (next * least > last));
  if (hs_any(shorter)) least = hs_choose(shorter, smaller(least, root_in(shorter, next, order + 1)), least);
  return least;
}

HS_INLINE void fill_powers(hs_real *powers, int order, hs_real h) {
  hs_real power = h;
  for (int m = 1; m <= order; m++, power = power * h) powers[m] = power;
}

/* How badly the polynomial solves the equation at its end: (h X' - h f) / (order + 1), of h X' in `error`. */
HS_INLINE void left_of(hs_real *error, const hs_real *end, int n, int order, hs_real h) {
  for (int s = 0; s < n; s++) error[s] = (error[s] - h * end[s]) / (order + 1);
}

/* What is done for each of the states s to s + 1, or s + 3, the last one again where there are fewer. */
#define OF_TWO(what) what(0) what(1)
#define OF_FOUR(what) OF_TWO(what) what(2) what(3)
#define BEGIN(i)                                                            \
  const int s##i = s + i < n ? s + i : n - 1;                               \
  const hs_real *const line##i = lines + (s##i + 1) * (order + 2);          \
  hs_real z##i = line##i[order] * powers[order], moved##i = order * z##i;
#define KEEP_LAST(i) c[s##i] = z##i;
#define ADD(i)                                       \
  const hs_real part##i = line##i[m] * powers[m];    \
  c[s##i] = part##i;                                 \
  z##i = part##i + z##i;                             \
  moved##i = factor * part##i + moved##i;
#define END(i) z[s##i] = x[s##i] + z##i, error[s##i] = moved##i;

#define SPAN_OF(each)                       \
  {                                         \
    hs_real *c = piece + (order - 1) * w;   \
    hs_number factor = order;               \
    each(BEGIN) each(KEEP_LAST)             \
    for (int m = order - 1; m > 0; m--) {   \
      c -= w, factor -= 1;                  \
      each(ADD)                             \
    }                                       \
    each(END)                               \
  }

/* A step of n states from x, of coefficients that are known: its polynomial to `piece` (w numbers a power), its end to
   z, and h X' there to `error`. Up to four states go together, since the sums of one wait for each other. */
HS_INLINE void taylor_span(const hs_real *lines, const hs_real *x, int n, int w, int order, const hs_real *powers,
                           hs_real *piece, hs_real *z, hs_real *error) {
  int s = 0;
  for (; s + 2 < n; s += 4) SPAN_OF(OF_FOUR)
  if (s < n) SPAN_OF(OF_TWO)
}

#endif
