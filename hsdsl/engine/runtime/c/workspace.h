/* What hs_workspace() gives, as a constant expression: so the memory of a run can be static.

   The terms are those of lay_out() and lay_out_located() in hs.c, array by array. */

#ifndef HS_WORKSPACE_H
#define HS_WORKSPACE_H

#include "run.h"

#define HS_LARGER(a, b) ((a) > (b) ? (a) : (b))
#define HS_TAKEN(count, type) (((count) * (int)sizeof(type) + (int)sizeof(double) - 1) / (int)sizeof(double))
#define HS_NUMBERS(count) HS_TAKEN(count, hs_real)

/* w: states of the largest mode; m, e: surfaces and edges of the mode with most; data: numbers that routines are bound
   to, with those of contacts; modes, lines, states, derivatives, factors: see hs_model.
   kind, stages, extra, order, degree: see hs_method. */
#define HS_PIECE(w, degree) HS_NUMBERS(HS_LARGER(degree, 3) * (w))
#define HS_STAGES(w, all) (HS_TAKEN(all, hs_real *) + ((all)-1) * HS_NUMBERS(w))
#define HS_SPAN(w, degree) (2 * HS_NUMBERS(w) + HS_PIECE(w, degree))
#define HS_SPACE(w, m, e, lines, states, data, derivatives, factors, kind, stages, extra, order, degree)           \
  (19 * HS_NUMBERS(w) + HS_NUMBERS(states) + HS_TAKEN(w, int) + HS_STAGES(w, (stages) + 1 + (extra)) +            \
   ((kind) == HS_TAYLOR ? HS_NUMBERS((lines) * ((order) + 2)) : 0) + HS_IMPLICIT_SPACE(kind, w, factors) +                 \
   6 * HS_NUMBERS(m) + HS_NUMBERS((w) + 1) + HS_NUMBERS(2 * (w)) + 4 * HS_TAKEN(m, int) + 2 * HS_TAKEN(e, int) +   \
   HS_NUMBERS(data) + HS_NUMBERS(derivatives) +                                                                    \
   2 * HS_PIECE(w, degree) + HS_TAKEN(m, hs_crossing) + (m) * HS_NUMBERS(w))

#define HS_MOST_DEGREE(order, degree) HS_LARGER(HS_LARGER(order, degree), LEAST_MOST_DEGREE)
#define HS_LOCATED_SPACE_OF(w, m, modes, stages, extra, degree, most)                                        \
  (3 * HS_TAKEN(m, int) + 2 * HS_SPAN(w, degree) + 3 * HS_NUMBERS(w) + \
   HS_NUMBERS(2 * (w)) + \
   HS_STAGES(w, (stages) + 1 + (extra)) + 4 * HS_NUMBERS(m) + HS_TAKEN(m, hs_riser) + HS_NUMBERS(((most) + 1 + HS_TESTS) * (m)) +                                              \
   (2 + MOST_CUTS) * HS_NUMBERS((most) + 1) + HS_NUMBERS(((most) + 1) * ((most) + 2) / 2) +                        \
   HS_TAKEN(MOST_CUTS, hs_cut) + HS_TAKEN((modes) * (m), int) + HS_NUMBERS(modes) + HS_TAKEN(modes, int) +         \
   2 * HS_NUMBERS(MOST_PARTS) + HS_NUMBERS(MOST_PARTS * (m) * ((most) + 1)) + HS_NUMBERS(MOST_PARTS * (m)) +       \
   2 * HS_TAKEN(MOST_PARTS * (m), int))
#define HS_LOCATED_SPACE(w, m, modes, stages, extra, order, degree) \
  HS_LOCATED_SPACE_OF(w, HS_LARGER(m, 1), modes, stages, extra, degree, HS_MOST_DEGREE(order, degree))

/* Memory of a paused run. */
#define HS_PAUSE_NUMBERS(w, modes, states) (5 * (w) + (states) + (modes))
#define HS_PAUSE_INTEGERS(m, modes) (2 * (m) + (modes)*HS_LARGER(m, 1) + (modes))

#endif
