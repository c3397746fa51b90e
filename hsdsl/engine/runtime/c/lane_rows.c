/* Runs in lanes: the numbers that a run brings along and those of its step, as columns of a row of lanes, and ways from
   one row to another, to the run and back. See lanes.c. */

#include "hs_lanes.h"

typedef struct hs_seat hs_seat;

/* Lanes, and who has them: 0 where a lane is free. */
typedef struct {
  hs_lanes l;
  int64_t columns, carried; /* numbers of a run and its step, and of those what a run brings along */
  int lanes, count;
  hs_seat *seat[HS_MOST_LANES];
} hs_row_of_lanes;

struct hs_seat {
  hs_ensemble *instance;
  hs_run run;
  hs_time limit;
  int32_t *mode; /* in which it may make a step in a lane; -1 where it may not, or is there */
  hs_row_of_lanes own; /* of one lane, with what the run brings along to the next one that it gets, */
  int has_own;         /* if it comes from a lane */
  int has_jumped;      /* whether it has made a transition there */
};

static hs_seat *seat_of(const hs_team *team, int64_t i) { return (hs_seat *)team->seats + i; }

static void take_columns(hs_store *store, int64_t count, double **const *each) {
  for (; *each; each++) **each = numbers(store, count);
}

static void lay_out_lanes(hs_row_of_lanes *row, const hs_model *model, const hs_method *method, int64_t lanes,
                          hs_store *store) {
  const int64_t n = model->width, m = model->surfaces, order = method->order, most = (order + 1) * (order + 2) / 2;
  const hs_row_of_lanes none = {0};
  *row = none;
  hs_lanes *const l = &row->l;
  double **const one[] = {&l->t, &l->limit, &l->longest, &l->made, &l->since, &l->brief, 0};
  double **const states[] = {&l->x, &l->scales, &l->scale, &l->entered, &l->before, 0};
  double **const step[] = {&l->h, &l->t1, &l->first, 0};
  double **const surfaces[] = {&l->starts, &l->ends, &l->open, 0};
  double **const found[] = {&l->values, &l->weights, &l->shares, &l->slopes, &l->theta, &l->time, 0};
  double **const scratch[] = {&l->end, &l->error, &l->sizes, 0};
  const int64_t begun = store->used;
  take_columns(store, lanes, one);
  l->p = numbers(store, (int64_t)model->data * lanes);
  take_columns(store, n * lanes, states);
  l->known = numbers(store, (int64_t)model->states * lanes);
  l->standing = numbers(store, m * lanes);
  row->carried = (store->used - begun) / lanes;
  take_columns(store, lanes, step);
  l->z = numbers(store, n * lanes);
  take_columns(store, m * lanes, surfaces);
  l->piece = numbers(store, n * order * lanes);
  l->curves = numbers(store, m * (order + 1) * lanes);
  row->columns = (store->used - begun) / lanes;
  l->lines = numbers(store, (int64_t)model->lines * (order + 2) * lanes);
  l->gradient = numbers(store, (n + 1) * lanes);
  take_columns(store, n * lanes, scratch);
  take_columns(store, m * lanes, found);
  l->q = numbers(store, m * n * lanes);
  l->stood = numbers(store, lanes), l->within = numbers(store, lanes);
  l->inverse = numbers(store, (most + lanes - 1) / lanes * lanes);
  if (store->numbers) fill_binomials(l->inverse, (int)order);
  for (int64_t i = 0; store->numbers && i < most; i++) l->inverse[i] = 1 / l->inverse[i];
  l->modes = model->mode;
  l->order = method->order;
  l->most = MOST_SHORT;
  row->lanes = (int)lanes;
}

int64_t hs_lane_memory(const hs_model *model, const hs_method *method, int64_t places, int32_t lanes) {
  hs_store store = {0, HS_MOST_LANES};
  hs_row_of_lanes row;
  for (int i = 0; i < 2; i++) lay_out_lanes(&row, model, method, lanes, &store);
  for (int64_t i = 0; i < places; i++) lay_out_lanes(&row, model, method, 1, &store);
  take(&store, places, sizeof(hs_seat));
  take(&store, model->flows, sizeof(int64_t));
  take(&store, places, sizeof(int32_t));
  return store.used;
}

/* Copy numbers of a lane. */
static void copy_lane(const hs_row_of_lanes *from, int lane, const hs_row_of_lanes *to, int other, int64_t count) {
  for (int64_t i = 0; i < count; i++) to->l.t[i * to->lanes + other] = from->l.t[i * from->lanes + lane];
}

static void gather(const double *column, hs_real *to, int n, int lanes, int lane) {
  for (int i = 0; i < n; i++) to[i] = column[i * lanes + lane];
}

static void scatter(const hs_real *from, double *column, int n, int lanes, int lane) {
  for (int i = 0; i < n; i++) column[i * lanes + lane] = from[i];
}

/* Put the run of a seat into a lane. */
static void enter_lane(hs_row_of_lanes *row, int lane, hs_seat *seat) {
  hs_run *const run = &seat->run;
  const hs_lanes *const l = &row->l;
  const int n = run->here.dimension, lanes = row->lanes;
  row->seat[lane] = seat, row->count++;
  *seat->mode = -1;
  if (seat->has_own) {
    copy_lane(&seat->own, 0, row, lane, row->carried);
    return;
  }
  seat->has_jumped = 0;
  l->t[lane] = run->here.t;
  l->limit[lane] = seat->limit;
  l->longest[lane] = run->control.tolerance > 0 ? run->control.largest : run->control.h;
  l->made[lane] = run->pace.made, l->since[lane] = run->pace.since, l->brief[lane] = run->pace.brief;
  scatter(run->here.p, l->p, run->model->data, lanes, lane);
  scatter(run->x, l->x, n, lanes, lane);
  scatter(run->sizes.scales, l->scales, n, lanes, lane);
  scatter(run->sizes.scale, l->scale, n, lanes, lane);
  scatter(run->entered, l->entered, n, lanes, lane);
  scatter(run->sizes.known, l->known, run->model->states, lanes, lane);
  for (int s = 0; s < n; s++) l->before[s * lanes + lane] = run->has_before ? span_size(run, &run->before, 1.0, s) : 0.0;
  for (int k = 0; k < run->here.table->surfaces; k++) l->standing[k * lanes + lane] = run->surfaces.active[k];
}

/* Take a run out of a lane, to bring it along into another one that makes steps in its mode. */
static void clear_lane(hs_row_of_lanes *row, int lane) {
  hs_seat *const seat = row->seat[lane];
  copy_lane(row, lane, &seat->own, 0, row->carried);
  row->seat[lane] = 0, row->count--;
  seat->has_own = 1;
  *seat->mode = seat->run.here.mode;
}

/* Let the run of a lane go. */
static void free_lane(hs_row_of_lanes *row, int lane) {
  row->seat[lane]->has_own = 0;
  row->seat[lane] = 0, row->count--;
}

/* Have the run of a seat where a lane has taken it; `written`: its last row as well, where lanes write none. */
static void leave_lane(hs_row_of_lanes *row, int lane, hs_seat *seat, int written) {
  hs_run *const run = &seat->run;
  const hs_lanes *const l = &row->l;
  const int n = run->here.dimension, lanes = row->lanes;
  run->here.t = l->t[lane];
  run->pace.made = (int)l->made[lane], run->pace.since = l->since[lane];
  gather(l->x, run->x, n, lanes, lane);
  gather(l->scales, run->sizes.scales, n, lanes, lane);
  if (seat->has_jumped) {
    gather(l->scale, run->sizes.scale, n, lanes, lane);
    gather(l->entered, run->entered, n, lanes, lane);
    gather(l->known, run->sizes.known, run->model->states, lanes, lane);
  }
  gather(l->before, run->before.largest, n, lanes, lane);
  run->has_before = run->before.sized = 1;
  run->here.active = run->surfaces.has_starts = 0;
  for (int k = 0; k < run->here.table->surfaces; k++)
    run->here.active += run->surfaces.active[k] = l->standing[k * lanes + lane] != 0;
  if (written && run->lanes.bare) append(run, run->here.t, run->x, 0);
  free_lane(row, lane);
}

/* Put the step of a lane where try_series() writes its own. */
static void step_of_lane(const hs_row_of_lanes *row, int lane, hs_run *run) {
  const hs_lanes *const l = &row->l;
  const int n = run->here.dimension, w = run->width, lanes = row->lanes;
  begin_span(run, l->h[lane], l->t1[lane]);
  gather(l->z, run->z, n, lanes, lane);
  run->span.piece.degree = l->order;
  for (int m = 0; m < l->order; m++) gather(l->piece + m * n * lanes, run->span.piece.c + m * w, n, lanes, lane);
}

/* The same of surfaces along it: see series_curves(). */
static void curves_of_lane(const hs_row_of_lanes *row, int lane, hs_run *run) {
  const hs_lanes *const l = &row->l;
  const int count = run->here.table->surfaces, order = l->order, lanes = row->lanes;
  hs_curves *const curves = &run->curves;
  begin_curves(curves, count);
  gather(l->starts, run->surfaces.starts, count, lanes, lane);
  gather(l->ends, run->surfaces.ends, count, lanes, lane);
  for (int k = 0; k < count; k++) {
    hs_real *const c = coefficients_of(curves, 0, k);
    gather(l->curves + k * (order + 1) * lanes, c, order + 1, lanes, lane);
    c[0] = run->surfaces.starts[k];
    *degree_of(curves, 0, k) = degree_without_zeros(c, order);
    *off_of(curves, 0, k) = 0;
    curves->certain[k] = 1;
  }
}
