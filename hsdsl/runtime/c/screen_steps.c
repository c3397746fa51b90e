/* Surfaces and the flow along steps of a recorded run. See hsdsl/simulate/verdict: steps, misses, flows. */

#include "screen_view.h"

static void set_box(hs_view *v, double low, double high, int i, double more) {
  const double wide = more + CUTTING * hs_max(fabs(low), fabs(high));
  v->range[1 + i] = outwards(low - wide, high + wide, 0x1p-52);
}

static void set_times(hs_view *v, double begin, double length, double start, double width) {
  v->range[0] = outwards(begin + start * length, begin + (start + width) * length, 0x1p-52);
}

/* Of the surfaces that are still open for a part of a step, mark those that may turn close to zero on it. */
static int turns_close(hs_view *v, const int *before, int *open) {
  const int base = first_register(v);
  const hs_formula *const surfaces = &v->f->surfaces;
  int any = 0;
  range_operations(v->f, surfaces->first, surfaces->last, base, v->range);
  for (int k = 0; k < v->table->surfaces; k++) {
    const hs_range value = v->range[surfaces->result[k]];
    open[k] = before[k] && !(value.high < 0);
    if (!open[k]) continue;
    const hs_formula *const rate = &v->f->rate[k];
    range_operations(v->f, rate->first, rate->last, base, v->range);
    const hs_range slope = v->range[rate->result[0]];
    open[k] = !(slope.low > 0 || slope.high < 0);
    any |= open[k];
  }
  return any;
}

/* Whether nothing is open but the surface that is crossed at the end of the arc: `crossings` looks at how it is. */
static int only_crossed(const hs_view *v, const int *open) {
  for (int k = 0; k < v->table->surfaces; k++)
    if (open[k] && k != v->crossed) return 0;
  return 1;
}

static double *coefficients_at(const hs_view *v, int level) {
  return v->bernstein + level * (int64_t)(v->s->run.degree + 1) * v->s->model->width;
}

/* Cut no states but those that open surfaces and their rates depend on: others keep the box of the whole step. */
static void cut_few(hs_view *v, const int *open) {
  for (int i = 0; i < v->n; i++) v->cut[i] = 0;
  for (int k = 0; k < v->table->surfaces; k++) {
    const hs_sparse *const slopes = &v->table->gradients[k];
    const hs_formula *const rate = &v->f->rate[k];
    if (!open[k]) continue;
    for (int i = 0; i < slopes->count; i++)
      if (slopes->place[i]) v->cut[slopes->place[i] - 1] = 1;
    for (int i = rate->first; i <= rate->last; i++) {
      const hs_operation *const o = &v->f->operation[i];
      const int one = i < rate->last ? o->a : rate->result[0], other = i < rate->last ? o->b : 0;
      if (one > 0 && one <= v->n) v->cut[one - 1] = 1;
      if (other > 0 && other <= v->n) v->cut[other - 1] = 1;
    }
  }
}

/* Bernstein coefficients of the states along a whole step. */
static void whole_step(hs_view *v, int64_t row) {
  const double *x = recorded_row(&v->s->run, row), *c = recorded_piece(&v->s->run, row);
  const int d = v->s->run.degree, w = v->s->run.width;
  double *b = coefficients_at(v, 0);
  for (int i = 0; i < v->n; i++, b += d + 1)
    for (int k = 0; k <= d && v->cut[i]; k++) {
      b[k] = x[i];
      for (int l = 1; l <= k; l++) b[k] += v->matrix[k * (d + 1) + l] * c[(l - 1) * w + i];
    }
  v->looks = 0;
}

/* Those of the first half of a part, at the next level; those of the second half take its place. Then of that half. */
static void take_half(hs_view *v, int level, int second) {
  const int d = v->s->run.degree;
  double *whole = coefficients_at(v, level), *part = coefficients_at(v, level + 1);
  for (int i = 0; i < v->n; i++, whole += d + 1, part += d + 1) {
    if (!v->cut[i]) continue;
    if (second) {
      copy(part, whole, d + 1);
      continue;
    }
    for (int k = 0; k <= d; k++) { /* de Casteljau */
      part[k] = whole[0];
      for (int m = 0; m < d - k; m++) whole[m] = (whole[m] + whole[m + 1]) / 2;
    }
  }
}

/* The box that a part of a step lies in, states moved by so many errors. */
static void set_part(hs_view *v, int64_t row, int level, double start, double width, double errors) {
  const double *times = v->s->run.times, *b = coefficients_at(v, level);
  const int d = v->s->run.degree;
  set_times(v, times[row], times[row + 1] - times[row], start, width);
  for (int i = 0; i < v->n; i++, b += d + 1) {
    if (!v->cut[i]) continue;
    double low = b[0], high = b[0];
    for (int k = 1; k <= d; k++) low = hs_min(low, b[k]), high = hs_max(high, b[k]);
    set_box(v, low, high, i, errors * v->own[i]);
  }
}

/* Look at both halves of a part, and at their halves. */
static int halves_close(hs_view *v, int64_t row, int level, double start, double width) {
  const int most = v->s->model->surfaces, ends = row + 1 == v->last && start + width == 1.0;
  if (level >= END_LEVELS && ends && only_crossed(v, v->open + level * most)) return 0;
  if (level == LEVELS) return 1;
  for (int half = 0; half < 2; half++) {
    const double from = start + half * width / 2;
    take_half(v, level, half);
    set_part(v, row, level + 1, from, width / 2, SAFE);
    if (++v->looks > MOST_LOOKS) return 1;
    if (turns_close(v, v->open + level * most, v->open + (level + 1) * most) &&
        halves_close(v, row, level + 1, from, width / 2))
      return 1;
  }
  return 0;
}

/* Whether a surface may turn close to zero along a step. */
static int turns_along(hs_view *v, int64_t row) {
  const hs_record *run = &v->s->run;
  const double *x = recorded_row(run, row), *c = recorded_piece(run, row);
  const int d = run->degree, w = run->width, m = v->table->surfaces;
  if (!m) return 0;
  for (int i = 0; i < v->n; i++) {
    double total = 0.0, size = 0.0;
    for (int k = 0; k < d; k++) total += c[k * w + i], size += fabs(c[k * w + i]);
    set_box(v, x[i] + (total - size) / 2, x[i] + (total + size) / 2, i, SAFE * v->own[i]);
  }
  set_times(v, run->times[row], run->times[row + 1] - run->times[row], 0.0, 1.0);
  for (int k = 0; k < m; k++) v->open[v->s->model->surfaces + k] = 1;
  if (!turns_close(v, v->open + v->s->model->surfaces, v->open)) return 0;
  cut_few(v, v->open);
  whole_step(v, row);
  return halves_close(v, row, 0, 0.0, 1.0);
}

/* How much the derivative of the step's polynomial changes along it, at least: from its start to its middle or end. */
static double shown_change(const hs_view *v, int64_t row, int i) {
  const double *c = recorded_piece(&v->s->run, row) + i;
  const int d = v->s->run.degree, w = v->s->run.width;
  double middle = 0.0, end = 0.0, power = 0.5;
  for (int k = 1; k < d; k++, power /= 2) {
    const double term = (k + 1) * c[k * w];
    end += term;
    middle += term * power;
  }
  return hs_max(fabs(end), fabs(middle));
}

/* How far the enclosed flow lies beyond the derivatives of the states on a part, and how far these vary there. */
static double flow_beyond(const hs_view *v, int level, int i, double width, double *varies) {
  const int d = v->s->run.degree;
  const double *const b = coefficients_at(v, level) + i * (d + 1);
  double below = INFINITY, above = -INFINITY;
  for (int k = 0; k < d; k++) below = hs_min(below, b[k + 1] - b[k]), above = hs_max(above, b[k + 1] - b[k]);
  below *= d / width, above *= d / width;
  const hs_range f = v->range[v->f->flow.result[i]];
  *varies = above - below;
  return hs_max(f.high - above, below - f.low);
}

/* Enclose the flow on a part of a step, without errors. */
static void enclose_flow(hs_view *v, int64_t row, int level, double start, double width) {
  set_part(v, row, level, start, width, 0.0);
  range_operations(v->f, v->f->flow.first, v->f->flow.last, first_register(v), v->range);
}

/* How much a step shows of each state's slope: an eighth of it, or of the enclosure's own width, is no pulse. */
static void look_at_whole(hs_view *v, int64_t row) {
  for (int i = 0; i < v->n; i++) v->cut[i] = 1;
  whole_step(v, row);
  enclose_flow(v, row, 0, 0.0, 1.0);
  for (int i = 0; i < v->n; i++) {
    double varies;
    const double beyond = flow_beyond(v, 0, i, v->s->run.times[row + 1] - v->s->run.times[row], &varies);
    v->enough[i] = hs_max(beyond, varies) / RESOLVED;
    v->unseen[i] = 1;
  }
}

/* Whether the flow may be on a part what the polynomial does not show: halves are looked at until they tell. */
static int flow_open(hs_view *v, int64_t row, int level, double start, double width) {
  const int w = v->s->model->width;
  const double length = width * (v->s->run.times[row + 1] - v->s->run.times[row]);
  int *const before = v->unseen + level * w, *const open = before + w, any = 0;
  if (++v->looks > MOST_LOOKS) return 1;
  if (level) enclose_flow(v, row, level, start, width);
  for (int i = 0; i < v->n; i++) {
    double varies;
    const double beyond = flow_beyond(v, level, i, length, &varies);
    open[i] = before[i] && !(beyond <= v->enough[i] || beyond * length <= v->own[i]);
    any |= open[i];
  }
  if (!any) return 0;
  if (level == LEVELS) return 1;
  for (int half = 0; half < 2; half++) {
    take_half(v, level, half);
    if (flow_open(v, row, level + 1, start + half * width / 2, width / 2)) return 1;
  }
  return 0;
}

/* Enclose the flow over discs that hold what the polynomial p of a step is where |s| <= size. */
static void enclose_in_discs(hs_view *v, int64_t row, double size) {
  const hs_screen *s = v->s;
  const double *x = recorded_row(&s->run, row), *c = recorded_piece(&s->run, row);
  const int d = s->run.degree, w = s->run.width;
  v->disc[0] = disc(s->run.times[row], size * (s->run.times[row + 1] - s->run.times[row]));
  for (int i = 0; i < v->n; i++) {
    double radius = 0.0, power = size;
    for (int k = 0; k < d; k++, power *= size) radius += fabs(c[k * w + i]) * power;
    v->disc[1 + i] = disc(x[i], radius);
  }
  disc_operations(v->f, v->f->flow.first, v->f->flow.last, first_register(v), v->disc);
}

/* Whether the flow may be along a step what its Taylor polynomial p does not show.

   F(s) = f(p(s)) is analytic where |s| < size; its coefficients are at most M/size**k there, M being how far f differs
   from its first value over discs that hold p(s), those last enclosed. The first d are those of the derivative of p. So
   along the step both differ by at most M size**(1 - d)/(size - 1). */
static int disc_hides(hs_view *v, int64_t row, double size) {
  const double length = v->s->run.times[row + 1] - v->s->run.times[row];
  const double less = 1 / size;
  double share = 1 / (size - 1);
  for (int k = 1; k < v->s->run.degree; k++) share *= less;
  for (int i = 0; i < v->n; i++) {
    const double hidden = v->disc[v->f->flow.result[i]].radius * share;
    if (!(hidden <= v->enough[i] || hidden * length <= v->own[i])) return 1;
  }
  return 0;
}

/* Whether the flow is known to be analytic on the discs that it was enclosed over. */
static int all_known(const hs_view *v) {
  for (int i = 0; i < v->n; i++)
    if (!hs_finite(v->disc[v->f->flow.result[i]].radius)) return 0;
  return 1;
}

/* Whether no slope of the flow is without a bound along a step: it is analytic around it. */
static int has_bound(hs_view *v, int64_t row) {
  enclose_in_discs(v, row, LEAST_SIZE);
  return all_known(v);
}

static int flow_hides(hs_view *v, int64_t row) {
  if (v->f->affine && !v->f->steep) return 0;
  const double length = v->s->run.times[row + 1] - v->s->run.times[row];
  const int by_discs = v->s->taylor && v->table->series;
  if (by_discs) { /* where these hide nothing the flow is analytic around the step, and its slopes have a bound */
    enclose_in_discs(v, row, LARGEST_SIZE);
    for (int i = 0; i < v->n; i++) v->enough[i] = shown_change(v, row, i) / (RESOLVED * length);
    if (!disc_hides(v, row, LARGEST_SIZE) && all_known(v)) return 0;
  }
  look_at_whole(v, row);
  if (by_discs && !disc_hides(v, row, LARGEST_SIZE) && all_known(v)) return 0;
  if (v->f->steep && !has_bound(v, row)) return 1;
  for (double size = 1.5; by_discs && size >= LEAST_SIZE; size -= 0.25) {
    enclose_in_discs(v, row, size);
    if (!disc_hides(v, row, size)) return 0;
  }
  return flow_open(v, row, 0, 0.0, 1.0);
}

/* Rates of all surfaces at a point; not-a-number where there is none. */
static void all_rates(hs_view *v, double t, const double *x, double *to) {
  for (int k = 0; k < v->table->surfaces; k++)
    if (v->table->rates[k](v->p, t, x, &to[k])) to[k] = NAN;
}

/* Whether the rate of a surface is not zero for round-off alone where a step begins, and is not above zero at its end. */
static int surely_turns(hs_view *v, int64_t row, int k) {
  const hs_formula *const rate = &v->f->rate[k];
  for (int end = 0; end < 2; end++) {
    const double t = v->s->run.times[row + end], *x = recorded_row(&v->s->run, row + end);
    v->range[0].low = v->range[0].high = t;
    for (int i = 0; i < v->n; i++) v->range[1 + i].low = v->range[1 + i].high = x[i];
    range_operations(v->f, rate->first, rate->last, first_register(v), v->range);
    const hs_range found = v->range[rate->result[0]];
    if (end ? !(found.high <= 0) : !(found.low > 0)) return 0;
  }
  return 1;
}

/* Note the turning point that comes closest to its surface, in errors, of each mode. */
static void look_for_miss(hs_view *v, int64_t row) {
  const hs_record *run = &v->s->run;
  const double begin = run->times[row], length = run->times[row + 1] - begin, middle = begin + length / 2;
  const hs_formula *const surfaces = &v->f->surfaces;
  int looked = 0;
  for (int k = 0; k < v->table->surfaces; k++) {
    if (!(v->at_start[k] > 0 && v->at_end[k] <= 0 && surely_turns(v, row, k))) continue;
    if (!looked) {
      along_step(v, run, row, 0.5, v->z);
      if (v->table->values(v->p, middle, v->z, v->values)) return;
      v->range[0] = outwards(middle, middle, 0.0);
      for (int i = 0; i < v->n; i++) v->range[1 + i] = outwards(v->z[i] - v->own[i], v->z[i] + v->own[i], 0x1p-52);
      range_operations(v->f, surfaces->first, surfaces->last, first_register(v), v->range);
      looked = 1;
    }
    const double below = -v->values[k], moved = v->range[surfaces->result[k]].high;
    const double margin = below > 0 ? below / hs_max(moved + below, 1e-300) : INFINITY;
    hs_near_miss *const best = &v->nearest[v->mode];
    if (margin < best->margin) {
      best->margin = margin, best->row = row, best->surface = k, best->segment = v->segment;
      copy(v->missed + v->mode * v->s->model->width, v->own, v->n);
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

/* How often the error fits between the surface and the turning point noted in the mode that is looked at. */
static void measure_miss(hs_view *v) {
  hs_screen *const s = v->s;
  hs_near_miss *const best = &v->nearest[v->mode];
  const double *const times = s->run.times + best->row;
  const double share = turning_share(v, best);
  hs_judged found;
  copy(v->own, v->missed + v->mode * s->model->width, v->n);
  best->middle = hs_min(times[0] + share * (times[1] - times[0]), times[1]);
  along_step(v, &s->run, best->row, share, v->z);
  if (share != share || evaluate_surfaces(v, best->middle, v->z) ||
      judge_surface(v, best->surface, best->middle, v->z, &found)) {
    s->doubts |= DOUBT(HS_NEAREST);
    return;
  }
  best->start = found.value < 0 ? (found.shift > 0 ? -found.value / found.shift : INFINITY) : NAN;
}

/* Whether an edge's surface may be passed although its `if` is false, along a step. */
static int passes(hs_view *v, int64_t row) {
  const hs_record *run = &v->s->run;
  int any = 0;
  for (int k = 0; k < v->table->edges; k++) any |= v->table->edge[k].conditional;
  if (!any) return 0;
  for (int end = 1; end >= 0; end--) {
    if (evaluate_surfaces(v, run->times[row + end], recorded_row(run, row + end))) return 1;
    for (int k = 0; k < v->table->edges; k++) {
      const double slack = v->magnitudes[k] * 0x1p-36;
      const int there = end ? v->values[k] > -slack : v->values[k] <= slack;
      v->open[k] = there && v->table->edge[k].conditional && (end || v->open[k]);
      if (row + 1 == v->last && v->crossed == k) v->open[k] = 0;
    }
  }
  for (int k = 0; k < v->table->edges; k++)
    if (v->open[k]) return 1;
  return 0;
}

/* Look at the step that begins at a row; errors are those at its end. */
static void look_at_step(hs_view *v, int64_t row, int *known) {
  hs_screen *const s = v->s;
  const double end = s->run.times[row + 1];
  const int64_t segment = segment_at(s->timeline, s->run.times[row]);
  if (segment != v->segment) bind(v, v->mode, segment), *known = 0;
  if (!(end > s->run.times[row])) {
    *known = 0;
    return;
  }
  if (turns_along(v, row)) s->turning[row] = 1, s->doubts |= DOUBT(HS_TURNING);
  if (flow_hides(v, row)) s->changing[row] = 1, s->doubts |= DOUBT(HS_FLOW_CHANGE);
  if (!(s->doubts & DOUBT(HS_TRANSPARENT)) && passes(v, row)) s->doubts |= DOUBT(HS_TRANSPARENT);
  if (!*known) all_rates(v, s->run.times[row], recorded_row(&s->run, row), v->at_start);
  all_rates(v, end, recorded_row(&s->run, row + 1), v->at_end);
  look_for_miss(v, row);
  swap(&v->at_start, &v->at_end);
  *known = 1;
}
