/* Executions of events that wait behind the first of their event. See hsdsl/engine/simulate/queues.py. */

#include "functions.h"

void hs_forget_waits(const hs_model *model, hs_tail *tail) {
  for (int q = 0; q < model->queues; q++) tail[q].first = tail[q].count = 0;
}

/* Where the i-th that waits has its time and its values. */
static hs_real *wait_at(const hs_model *model, const hs_tail *tail, int64_t i) {
  return tail->waits + (tail->first + i) * model->queued;
}

/* Room for one more behind the last: 0, or not 0 where there is none. */
static int room_for_wait(const hs_model *model, hs_tail *tail, hs_task *task) {
  hs_tail larger = *tail;
  if (tail->first + tail->count < tail->room) return 0;
  if (2 * tail->first <= tail->room) {
    larger.room = 2 * tail->room > FEWEST_WAITS ? 2 * tail->room : FEWEST_WAITS;
    if (!task || task->lengthen(task, &larger)) larger = *tail;
  }
  const size_t size = (size_t)(tail->count * model->queued) * sizeof(hs_real);
  if (size) memmove(larger.waits, wait_at(model, tail, 0), size);
  larger.first = 0;
  *tail = larger;
  return tail->count == tail->room;
}

/* Before when others are made before one that waits until a time. */
static hs_real not_tied(hs_real time) { return time - HS_TIE * fabs(time); }

/* Let one wait, its values in states x, behind those of the first `high` that are made before it or tied with it. It is
   not made before the one ahead of it, nor before `earliest`. */
static void insert_wait(const hs_model *model, hs_tail *tail, const hs_queue *queue, const hs_real *x, int64_t high,
                        hs_real earliest) {
  int64_t low = 0;
  while (low < high) {
    const int64_t middle = low + (high - low) / 2;
    if (x[queue->value[0]] < not_tied(*wait_at(model, tail, middle)))
      high = middle;
    else
      low = middle + 1;
  }
  hs_real *const place = wait_at(model, tail, low);
  const hs_real ahead = low ? *wait_at(model, tail, low - 1) : earliest;
  memmove(place + model->queued, place, (size_t)((tail->count - low) * model->queued) * sizeof(hs_real));
  for (int i = 0; i < queue->values; i++) place[i] = x[queue->value[i]];
  if (*place < ahead) *place = ahead;
  tail->count++;
}

/* Take part in a reset from x to z of the same mode; not 0 where more wait than may. */
static int advance_queue(const hs_model *model, hs_tail *tail, hs_task *task, const hs_queue *queue, const hs_real *x,
                         hs_real *z) {
  const hs_real had = x[queue->waiting], has = z[queue->waiting];
  if (has < 1) {
    tail->first = tail->count = 0;
  } else if (has < had && tail->count) {
    for (int i = 0; i < queue->values; i++) z[queue->value[i]] = wait_at(model, tail, 0)[i];
    tail->first++, tail->count--;
  } else if (1 <= had && had < has) {
    if (room_for_wait(model, tail, task)) return 1;
    const int goes_first = z[queue->value[0]] < not_tied(x[queue->value[0]]);
    insert_wait(model, tail, queue, goes_first ? x : z, goes_first ? 0 : tail->count, x[queue->value[0]]);
    for (int i = 0; i < queue->values && !goes_first; i++) z[queue->value[i]] = x[queue->value[i]];
    return has > queue->most;
  }
  return 0;
}

int hs_let_wait(const hs_model *model, hs_tail *tail, hs_task *task, const hs_mode *from, const hs_real *x,
                const hs_mode *to, hs_real *z) {
  int full = -1;
  if (from != to) hs_forget_waits(model, tail);
  for (int k = 0; from == to && k < to->queues; k++)
    if (advance_queue(model, &tail[to->queue[k].number], task, &to->queue[k], x, z)) full = k;
  return full;
}
