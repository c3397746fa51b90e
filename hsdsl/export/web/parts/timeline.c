/* Inputs over time, cut at samples and where switches change.
   See hsdsl/engine/simulate/input_segments.py and hsdsl/engine/simulate/switches.py. */

#include <string.h>

#define PAST_END 4 /* ties of time after the end, where inputs have the values after a jump at it */

static int refused_input;

/* Add a segment with room for its data, which are those of `data`; 0 where there is no memory. */
static double *add_segment(page_segments *s, double start, double end, int jump, const double *data) {
  if (s->count == s->room) {
    const int64_t room = 2 * s->room + 16;
    if (PAGE_GROW(s->start, room) || PAGE_GROW(s->end, room) || PAGE_GROW(s->jump, room) ||
        PAGE_GROW(s->data, room * (PROBLEM_DATA + 1)))
      return 0;
    s->room = room;
  }
  s->start[s->count] = start;
  s->end[s->count] = end;
  s->jump[s->count] = jump;
  double *const own = s->data + s->count++ * PROBLEM_DATA;
  if (data) memcpy(own, data, PROBLEM_DATA * sizeof *own);
  return own;
}

static int compare(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

/* The times and values of an input's samples, in `own` where they are computed. */
static page_refusal samples_of(const page_input *input, const double *p, double **own, const double **times,
                               const double **values) {
  *times = input->times, *values = input->values;
  if (input->samples) {
    if (PAGE_GROW(*own, 2 * (int64_t)input->count)) return PAGE_NO_MEMORY;
    if (input->samples(p, *own)) return PAGE_NO_SAMPLE;
    *times = *own, *values = *own + input->count;
  }
  for (int i = 0; i < input->count; i++)
    if (!hs_finite((*times)[i]) || !hs_finite((*values)[i])) return PAGE_NO_SAMPLE;
  for (int i = 1; i < input->count; i++) {
    const double *const t = *times + i;
    const int again = input->linear && t[0] == t[-1] && !(i > 1 && t[-2] == t[0]);
    if (!(t[-1] < t[0]) && !again) return PAGE_UNSORTED;
  }
  return PAGE_RAN;
}

/* Write (a, b, c) of the segment from t on: constant before the first and after the last sample. Return how many samples
   are not after t. */
static int line_at(const page_input *input, const double *times, const double *values, double t, double *abc) {
  int low = 0, high = input->count;
  while (low < high) {
    const int middle = (low + high) / 2;
    if (t < times[middle])
      high = middle;
    else
      low = middle + 1;
  }
  const int k = low > 0 ? low - 1 : 0;
  const int still = low == 0 || !input->linear || k + 1 == input->count;
  abc[0] = values[k];
  abc[1] = still ? values[0] * 0 : (values[k + 1] - values[k]) / (times[k + 1] - times[k]);
  abc[2] = times[k];
  return low;
}

/* Whether one of these samples is after a jump between two ramps. */
static int jumps_within(const double *times, const double *values, int from, int to) {
  for (int k = from > 1 ? from : 1; k < to; k++)
    if (times[k] == times[k - 1] && values[k] != values[k - 1]) return 1;
  return 0;
}

static int same(double a, double b) { return a == b || (a != a && b != b); }

/* The number of a switch at a time; not-a-number where its argument has no value. */
static double number_at(const page_switch *s, const double *data, double t) {
  double out[2];
  int bad = 0;
  if (s->argument(data, t, out) || !hs_finite(out[0])) return NAN;
  return s->is_floor ? hs_floor(out[0], &bad) : hs_sign(out[0], &bad);
}

/* Where a switch that is linear in time changes in a part, in order, from the earliest on. */
static page_refusal line_cuts(const page_switch *s, const double *data, double a, double b, int64_t most,
                              page_segments *found) {
  double line[3];
  found->count = 0;
  if (s->line(data, line)) return PAGE_SWITCHES;
  if (line[1] == 0.0 || line[2] == 0.0) return PAGE_RAN;
  const double x = line[0] + line[1] * a / line[2], y = line[0] + line[1] * b / line[2];
  const double low = s->is_floor ? ceil(hs_min(x, y)) : 0.0, high = s->is_floor ? floor(hs_max(x, y)) : 0.0;
  if (!s->is_floor && (hs_min(x, y) > 0 || hs_max(x, y) < 0)) return PAGE_RAN;
  if (!(high - low < (double)most)) return PAGE_SWITCHES;
  for (double level = low; level <= high; level++)
    if (!add_segment(found, (level - line[0]) * line[2] / line[1], 0, 0, 0)) return PAGE_NO_MEMORY;
  qsort(found->start, (size_t)found->count, sizeof(double), compare);
  return PAGE_RAN;
}

static page_refusal known_cuts(const page_switch *s, page_segments *found) {
  found->count = 0;
  for (int i = 0; i < s->cuts; i++)
    if (!add_segment(found, s->cut[i], 0, 0, 0)) return PAGE_NO_MEMORY;
  return PAGE_RAN;
}

/* The number of a switch between two times that it does not change between. */
static double number_between(const page_switch *s, const double *data, double a, double b) {
  const double middle = (a + b) / 2;
  int k = 0;
  if (s->line) return number_at(s, data, middle);
  while (k < s->cuts && s->cut[k] <= middle) k++;
  return s->number[k];
}

/* Cut segments where switch number i changes; those before it are known. */
static page_refusal cut_at_switch(int i, double until, const page_segments *from, page_segments *to,
                                  page_segments *cuts) {
  const page_switch *s = &page_switches[i];
  const int place = PROBLEM_DATA - PAGE_SWITCH_COUNT + i;
  double before = 0.0;
  int64_t left = PAGE_MOST_SWITCHES;
  for (int64_t k = to->count = 0; k < from->count; k++) {
    const double *data = from->data + k * PROBLEM_DATA, tie = HS_TIE * until;
    const double first = from->start[k], end = from->end[k];
    const page_refusal refusal = s->line ? line_cuts(s, data, first, end, left, cuts) : known_cuts(s, cuts);
    if (refusal != PAGE_RAN) return refusal;
    left -= s->line ? cuts->count : 0;
    double a = first;
    const int64_t own = to->count;
    for (int64_t c = 0; c <= cuts->count; c++) {
      const double b = c < cuts->count ? cuts->start[c] : end;
      if (c < cuts->count && !(b - a > tie && end - b > tie)) continue;
      double number = number_between(s, data, a, b);
      if (number != number && k && first >= until) number = before; /* a model need not have a meaning after its end */
      if (to->count > own && same(number, before)) {
        to->end[to->count - 1] = b;
      } else {
        const int jump = (to->count == own && from->jump[k]) || (s->jumps && to->count > 0 && !same(number, before));
        double *row = add_segment(to, a, b, jump, data);
        if (!row) return PAGE_NO_MEMORY;
        row[place] = number;
      }
      before = number;
      a = b;
    }
  }
  return PAGE_RAN;
}

/* Cut time from 0 to `until` at every sample of every input, and a little beyond it. */
static page_refusal cut_at_samples(const double *p, double until, page_segments *made, page_segments *cuts) {
  static double *own[PAGE_INPUT_COUNT + 1];
  const double *times[PAGE_INPUT_COUNT + 1], *values[PAGE_INPUT_COUNT + 1];
  int passed[PAGE_INPUT_COUNT + 1];
  made->count = cuts->count = 0;
  if (!add_segment(cuts, 0, 0, 0, 0)) return PAGE_NO_MEMORY;
  for (int i = 0; i < PAGE_INPUT_COUNT; i++) {
    const page_refusal refusal = samples_of(&page_inputs[i], p, &own[i], &times[i], &values[i]);
    if (refusal != PAGE_RAN) return refused_input = i, refusal;
    for (int k = 0; k < page_inputs[i].count; k++)
      if (times[i][k] > 0 && times[i][k] < until && !add_segment(cuts, times[i][k], 0, 0, 0)) return PAGE_NO_MEMORY;
  }
  if (until > 0 && !add_segment(cuts, until, 0, 0, 0)) return PAGE_NO_MEMORY;
  qsort(cuts->start, (size_t)cuts->count, sizeof(double), compare);
  for (int64_t c = 0; c < cuts->count; c++) {
    const double start = cuts->start[c], tie = HS_TIE * until;
    if (c && start == cuts->start[c - 1]) continue;
    double *row = add_segment(made, start, until > 0 ? until + PAST_END * HS_TIE * until : until, 0, 0);
    if (!row) return PAGE_NO_MEMORY;
    for (int i = 0; i < PROBLEM_PARAMETERS; i++) row[i] = p[i];
    for (int i = PROBLEM_PARAMETERS; i < PROBLEM_DATA; i++) row[i] = 0.0;
    if (made->count > 1) made->end[made->count - 2] = start;
    for (int i = 0; i < PAGE_INPUT_COUNT; i++) {
      double *abc = row + PROBLEM_PARAMETERS + 3 * i;
      const int count = line_at(&page_inputs[i], times[i], values[i], start < until ? start : until + tie, abc);
      const int changed = page_inputs[i].sloped ? abc[1] != abc[1 - PROBLEM_DATA] : 0;
      if (made->count > 1 && (changed || (!page_inputs[i].linear && abc[0] != abc[-PROBLEM_DATA]) ||
                              jumps_within(times[i], values[i], passed[i], count)))
        made->jump[made->count - 1] = 1;
      passed[i] = count;
    }
  }
  return PAGE_RAN;
}

/* Let the segments end with the run, at a jump there with one of no length. */
static void end_segments(double until, page_segments *s) {
  int64_t k = 0;
  if (until == 0) return;
  while (k < s->count && s->start[k] < until) k++;
  if (k < s->count && s->start[k] == until && s->jump[k]) s->end[k++] = until;
  s->count = k;
}

static page_segments page_made[2], page_cuts;

/* Make the timeline of parameters. */
static page_refusal make_timeline(const double *p, double until, hs_timeline *timeline) {
  page_segments *made = &page_made[0];
  page_refusal refusal = cut_at_samples(p, until, made, &page_cuts);
  for (int i = 0; i < PAGE_SWITCH_COUNT && refusal == PAGE_RAN; i++) {
    page_segments *other = &page_made[made == &page_made[0]];
    refusal = cut_at_switch(i, until, made, other, &page_cuts);
    made = other;
  }
  end_segments(until, made);
  const hs_timeline table = {made->count, made->start, made->end, made->jump, made->data};
  *timeline = table;
  return refusal;
}
