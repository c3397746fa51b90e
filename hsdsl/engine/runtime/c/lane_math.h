/* Sines and cosines of several numbers at once, with the bits of the C library. Glibc has them within 0.55 units in the
   last place (see its s_sin.c). So where the exact number is that much nearer to one number than to all others, glibc
   gives that one. It is found here by sums of two numbers each, which are within a 32nd of a unit. The other lanes, one in
   six, are left to the library; so is what is large, small, or has no value. */

#ifndef HS_LANE_MATH_H
#define HS_LANE_MATH_H

#if defined(__GLIBC__) && (defined(__AVX512DQ__) || defined(__FMA__))
#define OFF 0.55       /* units in the last place that the library may be off by, */
#define OWN (1.0 / 32) /* and what is found here */
#define MOST_TURNED 0x1p20
#define LEAST_TURNED 0x1p-20

/* a * b + c in one rounding. */
HS_INLINE hs_wide fused(hs_wide a, hs_wide b, hs_wide c) {
#if defined(__AVX512DQ__)
  return (hs_wide)_mm512_fmadd_pd((__m512d)a, (__m512d)b, (__m512d)c);
#else
  return (hs_wide)_mm256_fmadd_pd((__m256d)a, (__m256d)b, (__m256d)c);
#endif
}

/* The lanes in which the library gives `found`, where `off` is added to it for the exact number. Below a power of two
   numbers are closer. */
HS_INLINE hs_mask is_rounded(hs_wide found, hs_wide off) {
  const hs_mask digits = (hs_mask)found & 0xfffffffffffff;
  return (found + off * (0.5 / (1 - OFF - OWN)) == found) & (digits != 0);
}

HS_INLINE hs_wide series_in(hs_wide x, const double *c, int n) {
  hs_wide v = wide_all(c[n - 1]);
  for (int k = n - 2; k >= 0; k--) v = fused(v, x, wide_all(c[k]));
  return v;
}

/* The sine of x and so many quarters of a turn; the lanes in which the library gives it. */
static hs_mask turned(hs_wide x, int64_t quarters, hs_wide *found) {
  static const double of_sine[] = {1.0 / 120,        -1.0 / 5040,           1.0 / 362880,         -1.0 / 39916800,
                                   1.0 / 6227020800, -1.0 / 1307674368000., 1.0 / 355687428096000.};
  static const double of_cosine[] = {-1.0 / 720,      1.0 / 40320,           -1.0 / 3628800,         1.0 / 479001600,
                                     -1. / 87178291200, 1.0 / 20922789888000., -1.0 / 6402373705728000.};
  static const double round = 0x1.8p52, sixth = 1.0 / 6, rest_of_sixth = 0x1.5555555555555p-57;
  static const double of_24 = 1.0 / 24, rest_of_24 = 0x1.5555555555555p-59;
  const hs_wide shifted = x * 0x1.45f306dc9c883p-1 + round, n = shifted - round;
  const hs_mask quarter = (hs_mask)shifted + quarters;
  /* x less n quarters of a turn, r + rest: the first difference is exact */
  const hs_wide begun = fused(-n, wide_all(0x1.921fb54442d18p+0), x), part = n * 0x1.1a62633145c07p-54;
  const hs_wide r = begun - part, lost = fused(n, wide_all(0x1.1a62633145c07p-54), -part);
  const hs_wide rest = ((begun - r) - part) - (lost - n * 0x1.f1976b7ed8fbcp-110);
  const hs_wide z = r * r, z_rest = fused(r, r, -z);
  const hs_wide cube = r * z, cube_rest = fused(r, z, -cube) + r * z_rest, s3 = cube * -sixth;
  const hs_wide s3_rest = fused(cube, wide_all(-sixth), -s3) - (cube * rest_of_sixth + cube_rest * sixth);
  const hs_wide fourth = z * z, fourth_rest = fused(z, z, -fourth) + 2 * z * z_rest, c4 = fourth * of_24;
  const hs_wide c4_rest = fused(fourth, wide_all(of_24), -c4) + (fourth * rest_of_24 + fourth_rest * of_24);
  const hs_wide half = 0.5 * z, less = 1 - half, sine = r + s3, cosine = less + c4;
  const hs_wide s_low = (s3 - (sine - r)) + (cube * z * series_in(z, of_sine, 7) + (s3_rest + rest * cosine));
  const hs_wide c_low = (c4 - (cosine - less)) + (((1 - less) - half) + fourth * z * series_in(z, of_cosine, 7) +
                                                  (c4_rest - (0.5 * z_rest + rest * sine)));
  const hs_mask odd = -(quarter & 1), sign = (quarter & 2) << 62;
  const hs_wide high = hs_choose(odd, cosine, sine), low = hs_choose(odd, c_low, s_low), sum = high + low;
  const hs_mask sure = is_rounded(sum, low - (sum - high)) & (wide_fabs(x) < MOST_TURNED) & (wide_fabs(sum) > LEAST_TURNED);
  *found = hs_choose(sure, (hs_wide)((hs_mask)sum ^ sign), *found);
  return sure;
}

static hs_mask quick_sin(hs_wide x, hs_wide *found) { return turned(x, 0, found); }
static hs_mask quick_cos(hs_wide x, hs_wide *found) { return turned(x, 1, found); }
#else
#define quick_sin quick_none
#define quick_cos quick_none
#endif

static hs_mask quick_none(hs_wide x, hs_wide *found) { return (void)found, (x != x) & (x == x); }

#endif
