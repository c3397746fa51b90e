/* A recorded run, screened: which hypotheses surely hold of it. See hsdsl/engine/simulate/verdict.

   Every hypothesis of the theorem is screened in one pass over rows, arcs and transitions. Where it is not
   sure that there is no finding, the hypothesis is undecided and the place is marked. */

#include "screen_steps.c"

/* Whether more than FREE transitions have little flow between them. */
static int crowded_anywhere(const hs_screen *s) {
  const hs_transition *made = s->run.transition;
  double flown = 0.0, before[FREE + 1] = {0.0};
  for (int64_t k = 1; k < s->run.transitions; k++) {
    flown += made[k].time - resumed(&made[k - 1]);
    if (k >= FREE && !(flown - before[k % FREE] > s->relaxation)) return 1;
    before[k % FREE] = flown;
  }
  return 0;
}

/* Screen one arc of flow. */
static void screen_arc(hs_view *v) {
  hs_screen *const s = v->s;
  const hs_arc *arc = &s->run.arc[v->arc];
  const int64_t jump = arc->jump;
  const double shift =
      jump && !has_shadow(s) ? resumed(&s->finer.transition[jump - 1]) - resumed(&s->run.transition[jump - 1]) : 0.0;
  const int flown = takes_time(&s->run, v->arc);
  int known = 0;
  if (s->model->mode[arc->mode].final) return;
  bind(v, arc->mode, segment_at(s->timeline, s->run.times[arc->first]));
  v->last = last_row(&s->run, v->arc);
  v->crossed = crossed_at_end(v);
  if (flown && v->f->jumps) s->undecided |= BIT(HS_FLOW_CHANGE);
  for (int64_t row = arc->first; row <= v->last; row++) {
    reach_row(v, row, jump, shift);
    if (row == arc->first && flown) s->landing[v->arc] = lands_close(v);
    if (row > arc->first && flown) screen_step(v, row - 1, &known);
  }
  if (s->landing[v->arc]) s->undecided |= BIT(HS_LANDING);
  if (flown && (s->ending[v->arc] = ends_close(v, 0))) s->undecided |= BIT(HS_ENDING);
  const int leaves = v->arc + 1 == s->run.arcs || s->run.arc[v->arc + 1].jump > jump;
  if (!leaves || jump >= s->run.transitions) return;
  bind(v, v->mode, segment_at(s->timeline, s->run.transition[jump].time));
  if (reset_bends(v, &s->run.transition[jump], s->run.before + jump * s->model->width)) s->undecided |= BIT(HS_PARTED);
  if (!s->run.transition[jump].entry) screen_crossing(v, jump, flown);
}

/* Whether a transition within the error of the end is undecided; the view is at the last arc. */
static int undecided_end(hs_view *v) {
  const hs_screen *s = v->s;
  const int64_t count = s->run.transitions;
  const double end = s->run.times[s->run.rows - 1], length = end - s->run.times[0];
  v->last = s->run.rows - 1;
  v->crossed = -1;
  bind(v, s->run.arc[v->arc].mode, segment_at(s->timeline, end));
  if (v->table->final) return 0; /* there it ended */
  const int jumped = length > 0 && s->timeline->start[v->segment] == end; /* there an input jumps */
  if ((jumped || takes_time(&s->run, v->arc)) && ends_close(v, 1)) return 1;
  if (!count) return 0;
  const double last = s->run.transition[count - 1].time;
  return end - last < SAFE * (time_error_at(v, last) + s->tolerance * length);
}

static void screen_all(hs_view *v) {
  hs_screen *const s = v->s;
  const hs_transition *made = s->run.transition;
  for (v->arc = 0; v->arc < s->run.arcs; v->arc++)
    if (s->run.arc[v->arc].first <= last_row(&s->run, v->arc)) screen_arc(v);
  v->arc = s->run.arcs - 1;
  if (undecided_end(v)) s->undecided |= BIT(HS_ENDING);
  for (int64_t j = 0; j < s->run.transitions; j++) {
    if (made[j].alternatives) {
      if (ties_commute(v, j)) s->tied_times[s->commuting++] = made[j].time;
      else s->undecided |= BIT(HS_CHOICE);
    }
    if (jumps_close(v, &made[j])) s->crossing[j] |= HS_RESET_UNDECIDED, s->undecided |= BIT(HS_LANDING);
    s->marks |= s->crossing[j];
  }
  for (int i = 0; i < s->model->modes; i++) {
    const hs_near_miss *const each = &v->nearest[i];
    if (!(each->margin < INFINITY)) continue;
    bind(v, i, each->segment);
    measure_miss(v);
    if (each->start != each->start) continue;
    if (each->surface < s->model->mode[i].edges && s->model->mode[i].edge[each->surface].conditional)
      s->undecided |= BIT(HS_NEAREST);
    if (s->missed_mode < 0 || each->start < s->margin)
      s->margin = each->start, s->missed = each->middle, s->missed_mode = i, s->missed_surface = each->surface;
  }
}

static void lay_out_found(hs_screen *s, hs_store *store) {
  const int64_t rows = s->run.rows, arcs = s->run.arcs, transitions = s->run.transitions;
  s->crossing = take(store, transitions, sizeof(int32_t));
  s->landing = take(store, arcs, sizeof(int32_t));
  s->ending = take(store, arcs, sizeof(int32_t));
  s->turning = take(store, rows, sizeof(int32_t));
  s->changing = take(store, rows, sizeof(int32_t));
  s->shadow_errors = has_shadow(s) ? numbers(store, rows * s->run.width) : 0;
  s->time_errors = numbers(store, transitions);
  s->tied_times = numbers(store, transitions);
}

static hs_view make_view(hs_screen *s, hs_store *store) {
  const hs_model *model = s->model;
  const int w = model->width, m = model->surfaces > 0 ? model->surfaces : 1, d = s->run.degree;
  int registers = 0;
  for (int i = 0; i < model->modes; i++) {
    const int own = 1 + model->mode[i].dimension + model->data + s->formulas[i].constants + s->formulas[i].operations;
    registers = own > registers ? own : registers;
  }
  hs_view v = {.s = s, .mode = -1, .traced_mode = -1};
  lay_out_found(s, store);
  v.error = numbers(store, model->states);
  v.size = numbers(store, model->states);
  v.roundoff_floor = numbers(store, 2 * (int64_t)model->states);
  v.time_errors = s->time_errors;
  v.lines = numbers(store, has_shadow(s) ? (int64_t)model->lines * (s->order + 2) : 0);
  v.roundoff = numbers(store, w);
  v.defects = numbers(store, s->correction ? 5 * (int64_t)w : 0);
  v.derivatives = numbers(store, s->correction ? model->derivatives : 0);
  v.factors = numbers(store, s->correction ? model->factors : 0);
  v.inverse = numbers(store, s->correction ? model->factors : 0);
  v.exchanged = take(store, s->correction ? w : 0, sizeof(int));
  v.tied = take(store, s->run.transitions + 1, sizeof(int64_t));
  double **states[] = {&v.mode_error, &v.x, &v.y, &v.z, &v.slope, 0}, **of_surfaces[] = {&v.values, &v.magnitudes,
                       &v.at_start, &v.at_end, 0};
  for (double ***each = states; *each; each++) **each = numbers(store, w);
  for (double ***each = of_surfaces; *each; each++) **each = numbers(store, m);
  v.gradient = numbers(store, w + 1);
  v.matrix = numbers(store, (int64_t)(d + 1) * (d + 1));
  v.bernstein = numbers(store, (int64_t)(LEVELS + 1) * (d + 1) * w);
  v.open = take(store, (int64_t)(LEVELS + 2) * m, sizeof(int));
  v.beyond_at_start = take(store, m, sizeof(int));
  v.allowance = numbers(store, w);
  v.drift = numbers(store, w);
  v.miss_error = numbers(store, (int64_t)w * model->modes);
  v.cut = take(store, w, sizeof(int));
  v.range = take(store, registers, sizeof(hs_range));
  v.rounded = take(store, registers, sizeof(hs_rounded));
  v.traced = take(store, registers, sizeof(hs_rounded));
  v.around = take(store, registers, sizeof(hs_expansion));
  v.slopes = take(store, w, sizeof(hs_expansion));
  v.nearest = take(store, model->modes, sizeof(hs_near_miss));
  int64_t waits = 0;
  for (int q = 0; has_shadow(s) && q < model->queues; q++) waits += waits_of(s, q) * model->queued;
  v.tail = take(store, model->queues, sizeof(hs_tail));
  v.waits = numbers(store, waits);
  return v;
}

/* Begin what is found with nothing. */
static void begin_screen(hs_view *v) {
  hs_screen *const s = v->s;
  s->undecided = s->marks = 0;
  s->crossed = s->commuting = 0;
  s->missed_mode = -1;
  s->slowest = s->least = s->margin = INFINITY;
  for (int i = 0; i < s->model->states; i++) v->error[i] = v->size[i] = 0.0;
  for (int i = 0; i < s->model->modes; i++) v->nearest[i].margin = INFINITY;
  v->tied[0] = 0;
  for (int64_t j = 0; j < s->run.transitions; j++) {
    v->tied[j + 1] = v->tied[j] + s->run.transition[j].alternatives;
    s->crossing[j] = 0;
  }
  for (int64_t i = 0; i < s->run.arcs; i++) s->landing[i] = s->ending[i] = 0;
  for (int64_t i = 0; i < s->run.rows; i++) s->turning[i] = s->changing[i] = 0;
}

int64_t hs_screen_run(hs_screen *s, const hs_record *run, const hs_record *finer) {
  hs_store store = {s->workspace, 0};
  s->run = *run;
  if (finer) s->finer = *finer;
  hs_view v = make_view(s, &store);
  if (store.used > s->room) return store.used;
  begin_screen(&v);
  const int apart =
      has_shadow(s) ? !plain_arcs(&s->run, s->model) || !follow_run(&v)
               : !same_transitions(&v) || s->run.arc[s->run.arcs - 1].mode != s->finer.arc[s->finer.arcs - 1].mode;
  if (apart) s->undecided = BIT(HS_PARTED);
  else if (crowded_anywhere(s)) s->undecided = BIT(HS_ACCUMULATION);
  else screen_all(&v);
  if (outgrown(&v)) s->undecided |= BIT(HS_PARTED);
  return s->undecided || s->marks ? -1 : 0;
}
