/* The last flights of a run, and whether they shrink: of an edge that leads back, or of edges that take turns (M11).
   See hsdsl/engine/simulate/flights.py. */

#include "functions.h"

/* Transition `back` before the last one. */
static const hs_made *made_before(const hs_run *run, int back) { return &run->made[(run->jump - 1 - back) % FREE]; }

/* The last few flights between transitions of the last edge that was reached, the last one first; 0 where they are not
   as many. Where they are `of_flow`, time in strips does not count. */
static int last_flights(const hs_run *run, int of_flow, hs_real *flight) {
  const int count = FREE < run->jump ? FREE : (int)run->jump;
  int entries = 0, flights = -1;
  while (entries < count - 1 && made_before(run, entries)->entry) entries++;
  const hs_made *const last = made_before(run, entries);
  hs_time later = 0.0, waited = 0.0;
  for (int i = 0; i < count && flights < LEAST_FLIGHTS; i++) {
    const hs_made *const made = made_before(run, i);
    if (made->mode != last->mode || made->mode != made->target || (made->entry && made->edge == last->edge)) break;
    if (of_flow && flights >= 0 && made->resumed == made->resumed) waited = waited + (made->resumed - made->time);
    if (made->edge != last->edge) continue;
    if (flights >= 0) flight[flights] = later - (made->time + waited);
    flights++, later = made->time + waited;
  }
  return flights == LEAST_FLIGHTS;
}

/* After how many transitions those of the last few rounds repeat; 0 where they do not, on entry or in strips. */
static int period(const hs_run *run) {
  for (int n = 1; LEAST_FLIGHTS * n < FREE && LEAST_FLIGHTS * n < run->jump; n++) {
    int repeats = 1, waits = 0;
    for (int i = 0; i <= LEAST_FLIGHTS * n && repeats; i++) {
      const hs_made *const made = made_before(run, i), *const other = made_before(run, i < n ? i : i - n);
      repeats = made->edge == other->edge && made->mode == other->mode;
      waits |= made->entry || made->resumed != made->time;
    }
    if (repeats) return waits ? 0 : n;
  }
  return 0;
}

/* How long the last few rounds of edges that take turns lasted, the last one first; 0 where fewer than two do. */
static int round_flights(const hs_run *run, hs_real *flight) {
  const int n = period(run);
  for (int i = 0; n > 1 && i < LEAST_FLIGHTS; i++)
    flight[i] = made_before(run, i * n)->time - made_before(run, (i + 1) * n)->time;
  return n > 1;
}

/* Whether the last few flights, of rounds or of the last edge, shrink: the last one, and the largest ratio of them. */
static int shrinking(const hs_run *run, int of_flow, hs_real *flight, hs_real *ratio) {
  hs_real flights[LEAST_FLIGHTS];
  if (!round_flights(run, flights) && !last_flights(run, of_flow, flights)) return 0;
  *flight = flights[0], *ratio = 0.0;
  for (int i = 0; i < LEAST_FLIGHTS; i++) {
    if (!(flights[i] > 0)) return 0;
    if (i) *ratio = hs_max(*ratio, flights[i - 1] / flights[i]);
  }
  return *ratio < 1;
}

/* The same with all time, looked at once behind each transition. */
static int contraction(hs_run *run, hs_real *flight, hs_real *ratio) {
  if (run->contracted != run->jump) run->contracts = shrinking(run, 0, &run->flight, &run->flight_ratio);
  run->contracted = run->jump;
  *flight = run->flight, *ratio = run->flight_ratio;
  return run->contracts;
}

/* The time of flow up to t since the first of the last transitions, without that in strips. */
static hs_time flown(const hs_run *run, hs_time t) {
  hs_time found = t - made_before(run, FREE - 1)->time;
  for (int i = FREE - 1; i >= 0; i--) {
    const hs_made *made = made_before(run, i);
    found = found - (made->resumed == made->resumed ? made->resumed - made->time : 0);
  }
  return found;
}
