/* The value of a run at many times. See hsdsl/engine/execution/run.py.

   Times in one piece are evaluated together, a block of them at once: one sum waits for its last product, many do not.
   Every value is computed as the Python twin does: x + s (c_1 + s (c_2 + ...)). */

#if defined(__GNUC__) && !defined(__clang__)
#define HS_UNROLLED __attribute__((optimize("O3")))
#else
#define HS_UNROLLED
#endif

enum { STEPS_BEFORE_SEARCH = 8, BLOCK = 16 };
/* A row's piece, and which of its arc's states the columns are. */
typedef struct {
  int64_t row, arc;
  double begin, end;
  const double *x, *c;
  int degree;
  const int32_t *column;
  int dimension;
} hs_place;

/* Evaluate the columns at `count` times of one piece, at most a block; to `out` and further columns after it. */
HS_INLINE void evaluate_block(const hs_sampling *s, const hs_place *at, const double *time, int count, double *out) {
  const int w = s->width;
  const double length = at->end - at->begin;
  double u[BLOCK], y[BLOCK];
  for (int q = 0; q < count; q++) u[q] = (time[q] - at->begin) / length;
  for (int k = 0; k < s->columns; k++, out += s->samples) {
    const int place = at->column[k];
    const double *const c = place < 0 ? 0 : at->c + place, x = place < 0 ? NAN : at->x[place];
    int top = place < 0 ? -1 : at->degree - 1;
    while (top >= 0 && c[top * w] == 0) top--; /* many states are polynomials of low degree */
    if (top < 0) {
      for (int q = 0; q < count; q++) out[q] = x + 0.0;
      continue;
    }
    for (int q = 0; q < count; q++) y[q] = c[top * w];
    for (int m = top - 1; m >= 0; m--)
      for (int q = 0; q < count; q++) y[q] = c[m * w] + u[q] * y[q];
    for (int q = 0; q < count; q++) out[q] = x + u[q] * y[q];
  }
}

/* The same at all times from one up to another, which are in one piece. */
HS_UNROLLED static void evaluate_piece(const hs_sampling *s, const hs_place *at, int64_t from, int64_t to) {
  for (; to - from >= BLOCK; from += BLOCK) evaluate_block(s, at, s->time + from, BLOCK, s->states + from);
  evaluate_block(s, at, s->time + from, (int)(to - from), s->states + from);
}

/* The last row not after a time; it is likely to be soon after `from`. */
HS_INLINE int64_t row_at(const hs_sampling *s, double t, int64_t from) {
  const double *times = s->times;
  int64_t low = from, high = s->rows;
  if (t < times[from]) {
    low = 0, high = from;
  } else {
    for (int i = 0; i < STEPS_BEFORE_SEARCH; i++, low++)
      if (low + 1 == s->rows || t < times[low + 1]) return low;
  }
  while (high - low > 1) {
    const int64_t middle = low + (high - low) / 2;
    if (times[middle] <= t)
      low = middle;
    else
      high = middle;
  }
  return low;
}

/* The arc that a row is in: the last one that begins not after it. */
HS_INLINE int64_t arc_at(const hs_sampling *s, int64_t row, int64_t from) {
  int64_t low = from, high = s->arcs;
  if (s->arc[from].first > row)
    low = 0, high = from;
  else
    for (int i = 0; i < STEPS_BEFORE_SEARCH; i++, low++)
      if (low + 1 == s->arcs || row < s->arc[low + 1].first) return low;
  while (high - low > 1) {
    const int64_t middle = low + (high - low) / 2;
    if (s->arc[middle].first <= row)
      low = middle;
    else
      high = middle;
  }
  return low;
}

/* Go to a row. The straight line to the next one is a piece of degree 1. */
HS_INLINE void go_to(const hs_sampling *s, int64_t row, hs_place *at) {
  const int w = s->width;
  at->row = row;
  at->arc = arc_at(s, row, at->arc);
  const int layout = s->layout ? s->layout[at->arc] : 0;
  at->column = s->column + layout * s->columns;
  at->dimension = s->dimension[layout];
  at->begin = s->times[row];
  at->end = row + 1 < s->rows ? s->times[row + 1] : INFINITY;
  at->x = s->values + row * w;
  at->degree = s->degree;
  at->c = s->pieces + row * s->degree * w;
  if (s->degree == 0 && row + 1 < s->rows) {
    at->degree = 1;
    at->c = s->scratch;
    for (int k = 0; k < w; k++) s->scratch[k] = at->x[w + k] - at->x[k];
  }
}

/* What was recorded at a row. */
static void at_row(const hs_sampling *s, const hs_place *at, int64_t row, int64_t i) {
  for (int k = 0; k < s->columns; k++)
    s->states[k * s->samples + i] = at->column[k] < 0 ? NAN : s->values[row * s->width + at->column[k]];
  for (int k = 0; k < s->outputs; k++) s->results[i * s->outputs + k] = s->recorded[row * s->outputs + k];
}

/* Outputs between rows, from the states there; not-a-number where they have no value. */
static void outputs_between(const hs_sampling *s, const hs_place *at, int64_t i) {
  const hs_mode *mode = &s->model->mode[s->arc[at->arc].mode];
  const int w = s->width;
  const double t = s->time[i], u = (t - at->begin) / (at->end - at->begin);
  const double *p = s->timeline->data + segment_at(s->timeline, t) * s->model->data;
  double *const state = s->scratch + w, *const out = s->results + i * s->outputs;
  for (int k = 0; k < at->dimension; k++) {
    double y = at->c[(at->degree - 1) * w + k];
    for (int m = at->degree - 2; m >= 0; m--) y = at->c[m * w + k] + u * y;
    state[k] = at->x[k] + u * y;
  }
  if (mode->dimension != at->dimension || mode->outputs(p, t, state, out))
    for (int k = 0; k < s->outputs; k++) out[k] = NAN;
}

/* Whether a time is outside the run; to round-off it is not, and is moved to the run's end. */
static int outside(const hs_sampling *s, double *t) {
  const double start = s->times[0], end = s->times[s->rows - 1];
  const double slack = HS_TIE * hs_max(fabs(start), fabs(end));
  if (!(*t >= start - slack && *t <= end + slack)) return 1;
  *t = hs_min(hs_max(*t, start), end);
  return 0;
}

/* The number of the first time from `i` on that is not between a place's row and the next. */
HS_UNROLLED static int64_t after_piece(const hs_sampling *s, const hs_place *at, int64_t i) {
  while (i < s->samples && at->begin < s->time[i] && s->time[i] < at->end) i++;
  return i;
}

int64_t hs_sample(const hs_sampling *s) {
  hs_place at;
  if (!s->samples) return -1;
  at.arc = 0;
  go_to(s, 0, &at);
  for (int64_t i = 0; i < s->samples;) {
    if (outside(s, &s->time[i])) return i;
    const double t = s->time[i];
    if (!(at.begin <= t && t < at.end)) go_to(s, row_at(s, t, at.row), &at);
    if (t == at.begin) {
      int64_t row = at.row;
      while (s->left && row > 0 && s->times[row - 1] == t) row--;
      if (row < at.row) go_to(s, row, &at);
      at_row(s, &at, row, i++);
      continue;
    }
    const int64_t start = i;
    i = after_piece(s, &at, i);
    evaluate_piece(s, &at, start, i);
    for (int64_t k = start; s->outputs && k < i; k++) outputs_between(s, &at, k);
  }
  return -1;
}

int64_t hs_sample_record(const hs_sampling *shared, const hs_record *record, const int32_t *layout, int64_t samples,
                         double *memory) {
  hs_sampling s = *shared;
  s.rows = record->rows, s.arcs = record->arcs, s.width = record->width, s.degree = record->degree;
  s.times = record->times, s.values = record->values, s.recorded = record->recorded, s.pieces = record->pieces;
  s.arc = record->arc, s.layout = layout, s.samples = samples;
  s.time = memory, s.states = s.time + samples, s.results = s.states + s.columns * samples;
  s.scratch = s.results + s.outputs * samples;
  return hs_sample(&s);
}
