/* Steps by Taylor series of any order. See hsdsl/engine/integrators/taylor.py. */

/* Room for the coefficients of one line. */
static int series_length(const hs_method *method) { return method->order + 2; }

/* Coefficients of state s. */
static const hs_real *series_of(const hs_run *run, int s) { return run->lines + (s + 1) * series_length(run->method); }

/* Whether the coefficients are those along the flow through (t, run->x). */
static int is_expanded(const hs_run *run, hs_time t) {
  if (!run->expanded || run->lines[0] != (hs_real)t) return 0;
  for (int s = 0; s < run->here.dimension; s++)
    if (series_of(run, s)[0] != run->x[s]) return 0;
  return 1;
}

/* Compute the coefficients along the flow through (t, run->x), shared by trials from there. Not 0 where it has none. */
static int expand(hs_run *run, hs_time t) {
  if (is_expanded(run, t)) return 0;
  run->expanded = !run->here.table->series(run->here.p, run->method->order, t, run->x, run->lines);
  return !run->expanded;
}

static int taylor_step(hs_run *run, hs_time t, hs_real h) {
  if (expand(run, t)) return 1;
  for (int s = 0; s < run->here.dimension; s++) {
    const hs_real *c = series_of(run, s);
    hs_real z = c[run->method->order];
    for (int m = run->method->order - 1; m > 0; m--) z = c[m] + h * z;
    run->z[s] = run->x[s] + h * z;
  }
  return 0;
}

static void fill_powers(hs_real *powers, int order, hs_real h) {
  hs_real power = h;
  for (int m = 1; m <= order; m++, power = power * h) powers[m] = power;
}

HS_INLINE void taylor_piece(const hs_run *run, const int n, hs_real h, hs_polynomial *piece) {
  const int order = run->method->order, w = run->width;
  piece->degree = order;
  for (int s = 0; s < n; s++) {
    const hs_real *const line = series_of(run, s);
    hs_real *c = piece->c + s, power = 1.0;
    for (int m = 1; m <= order; m++, c += w) {
      power = power * h;
      *c = line[m] * power;
    }
  }
}

/* How badly the polynomial solves the equation at its end: (h X' - h f) / (order + 1), of h X' in run->error. */
HS_INLINE void left_of(hs_run *run, const int n, hs_real h) {
  for (int s = 0; s < n; s++) run->error[s] = (run->error[s] - h * run->end[s]) / (run->method->order + 1);
}

HS_INLINE void taylor_error(hs_run *run, const int n, hs_real h) {
  const int order = run->method->order;
  hs_real powers[HS_MOST_ORDER + 1];
  fill_powers(powers, order, h);
  for (int s = 0; s < n; s++) {
    const hs_real *c = series_of(run, s);
    hs_real moved = order * (c[order] * powers[order]);
    for (int m = order - 1; m > 0; m--) moved = m * (c[m] * powers[m]) + moved;
    run->error[s] = moved;
  }
  left_of(run, n, h);
}

/* What is done for each of the states s to s + 1, or s + 3, the last one again where there are fewer. */
#define OF_TWO(what) what(0) what(1)
#define OF_FOUR(what) OF_TWO(what) what(2) what(3)
#define BEGIN(i)                                       \
  const int s##i = s + i < n ? s + i : n - 1;          \
  const hs_real *const line##i = series_of(run, s##i); \
  hs_real z##i = line##i[order] * powers[order], moved##i = order * z##i;
#define KEEP_LAST(i) c[s##i] = z##i;
#define ADD(i)                                       \
  const hs_real part##i = line##i[m] * powers[m];    \
  c[s##i] = part##i;                                 \
  z##i = part##i + z##i;                             \
  moved##i = factor * part##i + moved##i;
#define END(i) run->z[s##i] = run->x[s##i] + z##i, run->error[s##i] = moved##i;

#define SPAN_OF(each)                                  \
  {                                                    \
    hs_real *c = piece->c + (order - 1) * w, factor = order; \
    each(BEGIN) each(KEEP_LAST)                        \
    for (int m = order - 1; m > 0; m--) {              \
      c -= w, factor -= 1;                             \
      each(ADD)                                        \
    }                                                  \
    each(END)                                          \
  }

/* The same step, of coefficients that are known: its polynomial to `piece`, its end to run->z, and h X' there to
   run->error. Up to four states go together, since the sums of one wait for each other. */
HS_INLINE void taylor_span(hs_run *run, const int n, hs_real h, hs_polynomial *piece) {
  const int order = run->method->order, w = run->width;
  hs_real powers[HS_MOST_ORDER + 1];
  fill_powers(powers, order, h);
  piece->degree = order;
  int s = 0;
  for (; s + 2 < n; s += 4) SPAN_OF(OF_FOUR)
  if (s < n) SPAN_OF(OF_TWO)
}
