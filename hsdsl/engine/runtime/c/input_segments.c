/* Sampled inputs over time. See hsdsl/engine/simulate/input_segments.py. */

#include "functions.h"

/* The segment that time is in; at a boundary the later one. */
static int64_t segment_at(const hs_timeline *timeline, hs_time t) {
  int64_t low = 0, high = timeline->segments;
  while (low < high) {
    const int64_t middle = (low + high) / 2;
    if (t < timeline->start[middle])
      high = middle;
    else
      low = middle + 1;
  }
  return low > 0 ? low - 1 : 0;
}

/* Where the segment that the run is in ends, at the latest where it pauses; the last one lasts until then. */
static hs_time segment_end(const hs_run *run) {
  const hs_timeline *timeline = run->task->timeline;
  const int64_t segment = run->here.segment;
  const int open = segment == timeline->segments - 1 && hs_finite(run->pause);
  return open ? run->pause : earlier(timeline->end[segment], run->pause);
}

/* Whether another segment is behind the one that the run is in. */
static int segment_follows(const hs_run *run) { return run->here.segment + 1 < run->task->timeline->segments; }

static const hs_real *segment_data(const hs_run *run, int64_t segment) {
  return run->task->timeline->data + segment * run->model->data;
}
