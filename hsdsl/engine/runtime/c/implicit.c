/* Implicit steps of a run: where the text of Radau IIA (hsdsl/engine/scheme/radau.py) meets modes and the workspace. */

/* A mode's columns of derivatives; exported C has none. */
static inline const hs_variation *columns_of(const hs_mode *mode) {
#if defined(HS_COLUMNS)
  return mode->variation;
#else
  return (void)mode, (const hs_variation *)0;
#endif
}

HS_INLINE hs_blocks blocks_of(const hs_mode *mode) {
  const hs_variation *const v = columns_of(mode);
  const int n = mode->dimension, entries = mode->jacobian.count;
  hs_blocks of = {n, n, n, entries, entries, mode->jacobian.place, v, n > 3 ? mode->elimination : 0, 0};
  if (!v) return of;
  of.n = v->columns[v->count], of.own = v->own, of.inside = v->entries, of.pattern = v->elimination;
  of.whole = of.n == of.own * (1 + v->count);
  return of;
}

/* The same where so many states have a matrix, dense, and all columns of derivatives of them: numbers that a compiler
   knows. */
HS_INLINE hs_blocks of_size(hs_blocks of, int own, int columns) {
  of.own = own, of.n = own * (1 + columns), of.pattern = 0, of.whole = 1;
  if (!columns) of.width = own, of.varied = 0;
  return of;
}

HS_INLINE int implicit_step_in(hs_run *run, hs_blocks of, hs_time t, hs_real h) {
  int solved = 0;
  if (radau_step(run, of, run->method->collocation, &run->step.radau, t, h, run->x, run->slope, run->sizes.scales, run->z,
                 &solved))
    return NO_VALUE;
  return solved ? 0 : NO_CONVERGENCE;
}

/* Steps of systems with so many states, a function each: a compiler takes much longer for a large one. */
#define STEPS_OF(name, own, columns)                                      \
  HS_APART static int name(hs_run *run, hs_time t, hs_real h) {           \
    const hs_blocks of = blocks_of(run->here.table);                      \
    return implicit_step_in(run, of_size(of, own, columns), t, h);        \
  }
#if !defined(__OPTIMIZE_SIZE__)
STEPS_OF(step_of_two, 2, 0)
STEPS_OF(step_of_three, 3, 0)
STEPS_OF(step_of_two_and_column, 2, 1)
STEPS_OF(step_of_two_and_columns, 2, of.varied->count)
STEPS_OF(step_of_three_and_columns, 3, of.varied->count)
#endif

HS_APART static int step_of_any(hs_run *run, hs_time t, hs_real h) {
  return implicit_step_in(run, blocks_of(run->here.table), t, h);
}

/* Try a step; compiled for two and three states apart, a tenth faster, and a third where these have columns. */
HS_INLINE int implicit_step(hs_run *run, hs_time t, hs_real h) {
#if !defined(__OPTIMIZE_SIZE__)
  const hs_mode *const mode = run->here.table;
  if (!columns_of(mode)) {
    if (mode->dimension == 2) return step_of_two(run, t, h);
    if (mode->dimension == 3) return step_of_three(run, t, h);
    return step_of_any(run, t, h);
  }
  const hs_blocks of = blocks_of(mode);
  if (of.whole && !of.pattern) {
    if (of.n == 4 && of.own == 2) return step_of_two_and_column(run, t, h);
    if (of.own == 2) return step_of_two_and_columns(run, t, h);
    if (of.own == 3) return step_of_three_and_columns(run, t, h);
  }
#endif
  return step_of_any(run, t, h);
}

/* Make a part of the last step. */
static int implicit_landing(hs_run *run, hs_time t, hs_real h) {
  const hs_mode *const mode = run->here.table;
  int solved = 0;
  if (radau_landing(run, blocks_of(mode), run->method->collocation, &run->step.radau, t, h, run->x, run->sizes.scales,
                    mode->measures, mode->measured, run->z, &solved))
    return NO_VALUE;
  return solved ? 0 : NO_CONVERGENCE;
}

static void implicit_piece(hs_run *run, hs_polynomial *piece) {
  piece->degree = 3;
  fill_piece(blocks_of(run->here.table), run->method->collocation, &run->step.radau, run->width, piece->c);
}

/* What stays for a whole run. */
static void begin_implicit(hs_run *run) {
  hs_radau *const radau = &run->step.radau;
  const hs_real tolerance = hs_max(run->control.tolerance, 0);
  radau->unit = radau->resolved.unit = HS_UNIT;
  radau->tolerance = radau->resolved.tolerance = tolerance;
  radau->enough = tolerance > 0 ? enough_of(HS_UNIT, tolerance, sqrt(tolerance)) : 0;
  radau->soon = run->task->settings.step;
  radau->most = MOST_HALVINGS;
}

/* Room for so many vectors. */
static hs_real **vectors(hs_store *store, int count, int64_t length) {
  hs_real **const found = take(store, count, sizeof(hs_real *));
  for (int i = 0; i < count; i++) {
    hs_real *const one = numbers(store, length);
    if (store->numbers) found[i] = one;
  }
  return found;
}

static void lay_out_radau(hs_radau *radau, int w, int factors, int varied, hs_store *store) {
  hs_factors *const by = &radau->factors;
  hs_real **const matrices[] = {&radau->rows, &radau->fresh, &by->real, &by->re, &by->im};
  hs_real ***const threes[] = {&radau->z,      &radau->last,   &radau->transformed,
                               &radau->change, &radau->slopes, &radau->right};
  hs_real **const states[] = {&radau->largest, &radau->ended, &radau->least, &radau->resolved.diagonal};
  for (int i = 0; i < 5; i++) *matrices[i] = numbers(store, factors);
  for (int i = 0; i < 6; i++) *threes[i] = vectors(store, 3, w);
  for (int i = 0; i < 4; i++) *states[i] = numbers(store, w);
  by->scratch = vectors(store, 2, w);
  by->links = numbers(store, varied);
  by->spread = vectors(store, 4, varied ? w : 0);
  radau->lasting = numbers(store, varied ? w : 0);
  by->order = take(store, w, sizeof(int));
  by->turned = take(store, w, sizeof(int));
}
