/* The set of states a chain of transitions at one instant has been in, as Python's set of (mode, state). */

#include "functions.h"

static int same_state(const double *a, const double *b, int n) {
  for (int s = 0; s < n; s++)
    if (a[s] != b[s]) return 0;
  return 1;
}

static uint64_t hash_of(int mode, const double *x, int n) {
  uint64_t hash = 1469598103934665603u ^ (uint64_t)mode;
  for (int s = 0; s < n; s++) {
    union {
      double number;
      uint64_t bits;
    } as;
    as.number = x[s] + 0.0; /* both zeros are the same */
    hash = (hash ^ as.bits) * 1099511628211u;
    hash ^= hash >> 29;
  }
  return hash;
}

static void forget(hs_visited *visited) {
  if (visited->count) memset(visited->slot, 0, 2 * (size_t)visited->room * sizeof *visited->slot);
  visited->count = 0;
}

/* Add a state; 1 where it was there. */
static int visit(hs_visited *visited, int width, int mode, const double *x, int n) {
  const uint64_t slots = 2 * (uint64_t)visited->room;
  uint64_t i = hash_of(mode, x, n) % slots;
  for (; visited->slot[i]; i = (i + 1) % slots) {
    const int64_t place = visited->slot[i] - 1;
    if (visited->mode[place] == mode && same_state(visited->state + place * width, x, n)) return 1;
  }
  copy(visited->state + visited->count * width, x, n);
  visited->mode[visited->count] = mode;
  visited->slot[i] = ++visited->count;
  return 0;
}

/* Ask the caller for twice the room when it is used up; not 0 where there is none. */
static int make_room(hs_run *run) {
  hs_visited *visited = &run->task->visited, larger;
  if (visited->count < visited->room) return 0;
  if (run->task->grow(run->task, &larger)) return 1;
  for (int64_t i = 0; i < visited->count; i++) {
    const int mode = visited->mode[i]; /* none of them final, so each has the states of its mode */
    visit(&larger, run->width, mode, visited->state + i * run->width, run->model->mode[mode].dimension);
  }
  *visited = larger;
  return 0;
}
