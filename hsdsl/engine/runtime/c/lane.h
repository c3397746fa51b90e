/* Numbers of several runs as one vector. What is included after this file means such vectors by `hs_real`. Each lane
   has the bits that a number has: the same operations, and functions of the C library called lane by lane. */

#ifndef HS_LANE_H
#define HS_LANE_H

#undef HS_COLUMNS
#include "hs_math.h"
#include "hs_lanes.h"
#include "root.h"

#if defined(__AVX512DQ__)
#define HS_WIDTH 8
#else
#define HS_WIDTH 4
#endif
#if defined(__AVX__)
#include <immintrin.h>
#endif

typedef double hs_wide __attribute__((vector_size(8 * HS_WIDTH)));
typedef __typeof__((hs_wide){0} == (hs_wide){0}) hs_mask;

HS_INLINE hs_wide wide_all(double x) {
  hs_wide all;
  for (int i = 0; i < HS_WIDTH; i++) all[i] = x;
  return all;
}

/* A bit for each lane. */
HS_INLINE uint32_t bits_of(hs_mask mask) {
#if defined(__AVX512DQ__)
  return _mm512_movepi64_mask((__m512i)mask);
#elif defined(__AVX__)
  return (uint32_t)_mm256_movemask_pd((__m256d)mask);
#else
  uint32_t bits = 0;
  for (int i = 0; i < HS_WIDTH; i++) bits |= (uint32_t)(mask[i] & 1) << i;
  return bits;
#endif
}

HS_INLINE hs_mask mask_of(int32_t bits) {
  hs_mask mask;
  for (int i = 0; i < HS_WIDTH; i++) mask[i] = -(bits >> i & 1);
  return mask;
}

HS_INLINE int hs_any(hs_mask mask) { return bits_of(mask) != 0; }

/* By intrinsics what vectors of compilers say in three operations; of two numbers that are alike the first. */
#if defined(__AVX512DQ__)
HS_INLINE hs_wide hs_choose(hs_mask mask, hs_wide yes, hs_wide no) {
  return (hs_wide)_mm512_mask_blend_pd(_mm512_movepi64_mask((__m512i)mask), (__m512d)no, (__m512d)yes);
}
HS_INLINE hs_wide wide_min(hs_wide a, hs_wide b) { return (hs_wide)_mm512_min_pd((__m512d)b, (__m512d)a); }
HS_INLINE hs_wide wide_max(hs_wide a, hs_wide b) { return (hs_wide)_mm512_max_pd((__m512d)b, (__m512d)a); }
#elif defined(__AVX__)
HS_INLINE hs_wide hs_choose(hs_mask mask, hs_wide yes, hs_wide no) {
  return (hs_wide)_mm256_blendv_pd((__m256d)no, (__m256d)yes, (__m256d)mask);
}
HS_INLINE hs_wide wide_min(hs_wide a, hs_wide b) { return (hs_wide)_mm256_min_pd((__m256d)b, (__m256d)a); }
HS_INLINE hs_wide wide_max(hs_wide a, hs_wide b) { return (hs_wide)_mm256_max_pd((__m256d)b, (__m256d)a); }
#else
HS_INLINE hs_wide hs_choose(hs_mask mask, hs_wide yes, hs_wide no) {
  return (hs_wide)((mask & (hs_mask)yes) | (~mask & (hs_mask)no));
}
HS_INLINE hs_wide wide_min(hs_wide a, hs_wide b) { return hs_choose(b < a, b, a); }
HS_INLINE hs_wide wide_max(hs_wide a, hs_wide b) { return hs_choose(b > a, b, a); }
#endif

HS_INLINE hs_wide wide_fabs(hs_wide x) { return (hs_wide)((hs_mask)x & ~(hs_mask)wide_all(-0.0)); }

HS_INLINE hs_wide wide_smaller(hs_wide least, hs_wide h) {
  return hs_choose(h != h, least, hs_choose(least != least, h, wide_min(h, least)));
}

HS_INLINE hs_wide wide_low_log2(hs_wide x) {
  return __builtin_convertvector((hs_mask)x, hs_wide) * 0x1p-52 - 1023;
}

/* root() in some lanes. */
HS_INLINE hs_wide root_in(hs_mask lanes, hs_wide x, int m) {
  double numbers[HS_WIDTH];
  memcpy(numbers, &x, sizeof x);
  for (uint32_t left = bits_of(lanes); left; left &= left - 1)
    numbers[__builtin_ctz(left)] = root(numbers[__builtin_ctz(left)], m);
  memcpy(&x, numbers, sizeof x);
  return x;
}

/* from_zero() in some lanes; in the others there is none. */
static hs_wide wide_from_zero(hs_mask small, const hs_wide *c, int order, double tolerance) {
  hs_wide found = wide_all(NAN);
  for (int i = 0; i < HS_WIDTH; i++)
    if (small[i]) found[i] = from_zero((const double *)c + i, HS_WIDTH, order, tolerance);
  return found;
}

HS_INLINE hs_wide wide_div(hs_wide a, hs_wide b, int *bad) {
  *bad |= hs_any(b == 0.0);
  return a / b;
}

HS_INLINE hs_wide wide_abs(hs_wide x, int *bad) { return (void)bad, wide_fabs(x); }

#include "lane_math.h"

/* The last few arguments of a function, and what it gave: a step begins where the one before ended. */
#define KEPT 4
#define ALL_LANES ((1u << HS_WIDTH) - 1)
typedef struct {
  hs_wide x[KEPT], y[KEPT];
  int count, next;
} hs_known;

#define OF_ONE(name, quick)                                                 \
  static hs_wide wide_##name(hs_wide x, int *bad) {                         \
    static __thread hs_known known;                                         \
    hs_wide found = x;                                                      \
    uint32_t left = ALL_LANES;                                              \
    int failed = 0;                                                         \
    for (int k = 0; k < known.count; k++) {                                 \
      const hs_mask same = (hs_mask)known.x[k] == (hs_mask)x;               \
      found = hs_choose(same, known.y[k], found);                           \
      left &= ~bits_of(same);                                               \
    }                                                                       \
    if (!left) return found;                                                \
    left &= ~bits_of(quick(x, &found));                                     \
    double of[HS_WIDTH], to[HS_WIDTH];                                      \
    memcpy(of, &x, sizeof x), memcpy(to, &found, sizeof found);             \
    for (; left; left &= left - 1) {                                        \
      const int i = __builtin_ctz(left);                                    \
      to[i] = hs_##name(of[i], &failed);                                    \
    }                                                                       \
    memcpy(&found, to, sizeof found);                                       \
    *bad |= failed;                                                         \
    if (failed) return found;                                               \
    known.x[known.next] = x, known.y[known.next] = found;                   \
    known.next = (known.next + 1) % KEPT, known.count += known.count < KEPT; \
    return found;                                                           \
  }
#define EACH(name)                                                          \
  static inline hs_wide wide_##name(hs_wide x, int *bad) {                  \
    hs_wide found = x;                                                      \
    for (int i = 0; i < HS_WIDTH; i++) found[i] = hs_##name(x[i], bad);     \
    return found;                                                           \
  }
#define OF_TWO(name)                                                            \
  static inline hs_wide wide_##name(hs_wide x, hs_wide y, int *bad) {           \
    hs_wide found = x;                                                          \
    for (int i = 0; i < HS_WIDTH; i++) found[i] = hs_##name(x[i], y[i], bad);   \
    return found;                                                               \
  }
OF_ONE(sin, quick_sin) OF_ONE(cos, quick_cos) OF_ONE(tan, quick_none) OF_ONE(asin, quick_none)
OF_ONE(acos, quick_none) OF_ONE(atan, quick_none) OF_ONE(sinh, quick_none) OF_ONE(cosh, quick_none)
OF_ONE(tanh, quick_none) OF_ONE(asinh, quick_none) OF_ONE(acosh, quick_none) OF_ONE(atanh, quick_none)
OF_ONE(exp, quick_none) OF_ONE(log, quick_none) EACH(floor) EACH(sign) EACH(heaviside)
OF_TWO(pow) OF_TWO(atan2)

HS_INLINE hs_wide wide_sqrt(hs_wide x, int *bad) {
  hs_wide found = x;
  *bad |= hs_any(x < 0.0);
#if defined(__AVX512DQ__)
  found = (hs_wide)_mm512_sqrt_pd((__m512d)x);
#else
  for (int i = 0; i < HS_WIDTH; i++) found[i] = sqrt(x[i]);
#endif
  return found;
}

#define hs_real hs_wide
#define hs_time hs_wide
#undef HS_ALL
#define HS_ALL(number) wide_all(number)
#define fabs wide_fabs
#define smaller wide_smaller
#define low_log2 wide_low_log2
#define hs_min wide_min
#define hs_max wide_max
#define hs_div wide_div
#define hs_abs wide_abs
#define hs_sin wide_sin
#define hs_cos wide_cos
#define hs_tan wide_tan
#define hs_asin wide_asin
#define hs_acos wide_acos
#define hs_atan wide_atan
#define hs_sinh wide_sinh
#define hs_cosh wide_cosh
#define hs_tanh wide_tanh
#define hs_asinh wide_asinh
#define hs_acosh wide_acosh
#define hs_atanh wide_atanh
#define hs_exp wide_exp
#define hs_log wide_log
#define hs_floor wide_floor
#define hs_sign wide_sign
#define hs_heaviside wide_heaviside
#define hs_pow wide_pow
#define hs_atan2 wide_atan2
#define hs_sqrt wide_sqrt

#include "hs_series.h"
#include "span.h"
#include "primitives.h"
#include "polynomials.c"

/* The routines of a mode, for lanes: see hs_mode. */
typedef int hs_lane_routine(const hs_real *p, hs_real t, const hs_real *x, hs_real *out);

typedef struct {
  int (*shape)(const int *of, const hs_real *p, hs_real t, const hs_real *x, hs_real *out);
  const int *of;
} hs_lane_local;

typedef struct {
  hs_lane_local values;
  int count;
  const int *place;
} hs_lane_sparse;

typedef struct {
  hs_lane_local reset, spread; /* without shapes where these choose by numbers */
} hs_lane_edge;

#define hs_routine hs_lane_routine
#define hs_local hs_lane_local
#define hs_sparse hs_lane_sparse

typedef struct {
  int dimension, surfaces, edges;
  hs_lane_routine *flow, *values, *magnitudes;
  int (*series)(const hs_real *p, int order, hs_real t, const hs_real *x, hs_real *lines);
  int (*surface_series)(const hs_real *p, int order, hs_real *lines);
  const int *surface_line;
  const hs_lane_sparse *gradients;
  const hs_lane_local *rates;
  const hs_lane_edge *edge;
} hs_lane_mode;

#endif
