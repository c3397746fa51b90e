/* The values of a run that are drawn: at both ends of each arc, and at equal parts of the run between them. */

static int64_t last_row(const hs_chunk *c, int64_t arc) {
  return arc + 1 < c->arcs ? c->arc[arc + 1].first - 1 : c->rows - 1;
}

/* Write down the times that are drawn: both ends of each arc, and equal parts of the run between them. */
static page_refusal choose_times(double samples) {
  const hs_chunk *c = &run.task.chunk;
  const int64_t room = (int64_t)samples + 2 * c->arcs + 2;
  const double part = c->times[c->rows - 1] / samples;
  int64_t n = 0;
  if (room > run.room) {
    if (PAGE_GROW(run.time, room) || PAGE_GROW(run.arc_of, room) ||
        PAGE_GROW(run.states, room * PAGE_STATES + 1) || PAGE_GROW(run.results, room * PROBLEM_OUTPUTS + 1))
      return PAGE_NO_MEMORY;
    run.room = room;
  }
  for (int64_t a = 0; a < c->arcs; a++) {
    const double start = c->times[c->arc[a].first], end = c->times[last_row(c, a)];
    run.arc_of[n] = (double)a, run.time[n++] = start;
    for (double k = floor(start / part) + 1; part > 0 && k * part < end && n < room - 2; k++)
      if (k * part > start) run.arc_of[n] = (double)a, run.time[n++] = k * part;
    if (end > start) run.arc_of[n] = (double)a, run.time[n++] = end;
  }
  run.points = n;
  return PAGE_RAN;
}

/* Copy a row of the run to a point. */
static void at_row(int64_t point, int64_t row) {
  const hs_chunk *c = &run.task.chunk;
  const int32_t *columns = page_columns + run.layouts[(int64_t)run.arc_of[point]] * PAGE_STATES;
  for (int s = 0; s < PAGE_STATES; s++)
    run.states[s * run.points + point] = columns[s] < 0 ? NAN : c->values[row * PROBLEM_WIDTH + columns[s]];
  for (int k = 0; k < PROBLEM_OUTPUTS; k++)
    run.results[point * PROBLEM_OUTPUTS + k] = c->outputs[row * PROBLEM_OUTPUTS + k];
}

/* Evaluate the run at the times that are drawn. At both ends of an arc its own rows count. */
static void evaluate(void) {
  hs_chunk *c = &run.task.chunk;
  double scratch[2 * PROBLEM_WIDTH + 1];
  for (int64_t a = 0; a < c->arcs; a++) {
    const int own = page_layout_of_mode[c->arc[a].mode];
    run.layouts[a] = own >= 0 ? own : a ? run.layouts[a - 1] : 0;
  }
  for (int i = 0; i < PROBLEM_DEGREE * PROBLEM_WIDTH; i++) c->pieces[c->rows * PROBLEM_DEGREE * PROBLEM_WIDTH + i] = 0.0;
  const hs_sampling sampling = {&hs_the_model, &run.timeline, c->rows, c->arcs, run.points, PROBLEM_WIDTH,
                                PROBLEM_DEGREE, PROBLEM_OUTPUTS, PAGE_STATES, 0, c->times, c->values, c->outputs,
                                c->pieces + PROBLEM_DEGREE * PROBLEM_WIDTH, c->arc, run.layouts, page_dimensions,
                                page_columns, run.time, run.states, run.results, scratch};
  hs_sample(&sampling);
  for (int64_t i = 0; i < run.points; i++) {
    const int64_t a = (int64_t)run.arc_of[i];
    if (i == 0 || run.arc_of[i - 1] != run.arc_of[i]) at_row(i, c->arc[a].first);
    else if (i + 1 == run.points || run.arc_of[i + 1] != run.arc_of[i]) at_row(i, last_row(c, a));
  }
}
