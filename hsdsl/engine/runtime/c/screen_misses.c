/* Turning points of surfaces along steps of a recorded run, and the one that comes closest. See
   hsdsl/engine/simulate/verdict/misses.py. */

#include "screen_parts.h"

/* Rates of all surfaces at a point; not-a-number where there is none. */
static void all_rates(hs_view *v, double t, const double *x, double *to) {
  for (int k = 0; k < v->table->surfaces; k++)
    if (v->table->rates[k](v->p, t, x, &to[k])) to[k] = NAN;
}

/* Whether the rate of a surface is not zero for round-off alone where a step begins, and is not above zero at its end. */
static int surely_turns(hs_view *v, int64_t row, int k) {
  const hs_formula *const rate = &v->f->rate[k];
  for (int end = 0; end < 2; end++) {
    set_row(v, row + end);
    range_operations(v->f, rate->first, rate->last, first_register(v), v->range);
    const hs_range found = v->range[rate->result[0]];
    if (end ? !(found.high <= 0) : !(found.low > 0)) return 0;
  }
  return 1;
}

/* Note the turning point that comes closest to its surface, in errors, of each mode. */
static void note_near_miss(hs_view *v, int64_t row) {
  const hs_record *run = &v->s->run;
  const double begin = run->times[row], length = run->times[row + 1] - begin, middle = begin + length / 2;
  const hs_formula *const surfaces = &v->f->surfaces;
  int evaluated = 0;
  for (int k = 0; k < v->table->surfaces; k++) {
    if (!(v->at_start[k] > 0 && v->at_end[k] <= 0 && surely_turns(v, row, k))) continue;
    if (!evaluated) {
      along_step(v, run, row, 0.5, v->z);
      if (v->table->values(v->p, middle, v->z, v->values)) return;
      v->range[0] = outwards(middle, middle, 0.0);
      for (int i = 0; i < v->n; i++)
        v->range[1 + i] = outwards(v->z[i] - v->mode_error[i], v->z[i] + v->mode_error[i], 0x1p-52);
      range_operations(v->f, surfaces->first, surfaces->last, first_register(v), v->range);
      evaluated = 1;
    }
    const double below = -v->values[k], moved = v->range[surfaces->result[k]].high;
    const double margin = below > 0 ? below / hs_max(moved + below, HS_NOTHING) : INFINITY;
    hs_near_miss *const best = &v->nearest[v->mode];
    if (margin < best->margin) {
      best->margin = margin, best->row = row, best->surface = k, best->segment = v->segment;
      copy(v->miss_error + v->mode * v->s->model->width, v->mode_error, v->n);
    }
  }
}

/* The rate of a surface at a share of a step; the states there are left in z. */
static int rate_within(hs_view *v, const hs_near_miss *miss, double share, double *rate) {
  const double *const times = v->s->run.times + miss->row;
  along_step(v, &v->s->run, miss->row, share, v->z);
  return v->table->rates[miss->surface](v->p, times[0] + share * (times[1] - times[0]), v->z, rate);
}

/* Close in on a turning point from both ends of its step (Illinois): the share of the step, or not-a-number. */
static double turning_share(hs_view *v, const hs_near_miss *miss) {
  double a = 0.0, b = 1.0, rising, falling, share = 1.0, rate, before;
  int side = 0;
  if (rate_within(v, miss, a, &rising) || rate_within(v, miss, b, &falling)) return NAN;
  for (int i = 0; i < ROUNDS; i++) {
    before = share;
    share = b - falling * (b - a) / (falling - rising);
    if (!(share > a && share < b)) share = (a + b) / 2;
    if (fabs(share - before) <= CLOSE_SHARE) return share;
    if (rate_within(v, miss, share, &rate)) return NAN;
    if (rate >= 0) {
      a = share, rising = rate;
      if (side > 0) falling /= 2;
      side = 1;
    } else {
      b = share, falling = rate;
      if (side < 0) rising /= 2;
      side = -1;
    }
  }
  return b;
}

/* How often the error fits between the surface and the turning point noted in the mode. */
static void measure_miss(hs_view *v) {
  hs_screen *const s = v->s;
  hs_near_miss *const best = &v->nearest[v->mode];
  const double *const times = s->run.times + best->row;
  const double share = turning_share(v, best);
  hs_near_surface found;
  copy(v->mode_error, v->miss_error + v->mode * s->model->width, v->n);
  best->middle = hs_min(times[0] + share * (times[1] - times[0]), times[1]);
  along_step(v, &s->run, best->row, share, v->z);
  if (share != share || evaluate_surfaces(v, best->middle, v->z) ||
      near_surface(v, best->surface, best->middle, v->z, &found)) {
    s->undecided |= BIT(HS_NEAREST);
    return;
  }
  best->start = found.value < 0 ? (found.error > 0 ? -found.value / found.error : INFINITY) : NAN;
}
