/* The exported model as one function of numbers: a MEX file, or with GATEWAY_PROGRAM a program that reads and writes
   files of them. In: scheme, step, tolerance, largest step, relaxation, until, most transitions, mode, the states and
   the parameters. Out: why the run ended and when, how many rows and transitions there are, and of how many states; then
   rows (time, transitions before, mode, states), and transitions (time, resumed, mode, edge, on entry, states before
   and after). */

#include <stdio.h>
#include <stdlib.h>

#define HS_GROWS
#include "given.h"
#include "hs_math.h"

enum { GIVEN_NUMBERS = 8 + PROBLEM_WIDTH + PROBLEM_PARAMETERS, HEAD = 5 };
enum { ROW = 3 + PROBLEM_WIDTH, TRANSITION = 5 + 2 * PROBLEM_WIDTH };

typedef struct {
  double *number;
  size_t count, room;
} numbers;

static hs_given_run own;
static numbers rows, transitions;

/* Room for further numbers; 0 where there is none. */
static double *further(numbers *all, size_t count) {
  if (all->count + count > all->room) {
    const size_t room = 2 * all->room + 64 * count;
    double *larger = realloc(all->number, room * sizeof *larger);
    if (!larger) return 0;
    all->number = larger, all->room = room;
  }
  all->count += count;
  return all->number + all->count - count;
}

/* States, zero after those of the mode. */
static void put(double *to, const hs_real *x, int count) {
  for (int s = 0; s < PROBLEM_WIDTH; s++) to[s] = s < count ? x[s] : 0.0;
}

static int take_row(void *context, const hs_row_written *row) {
  double *to = further(&rows, ROW);
  (void)context;
  if (!to) return 1;
  to[0] = row->time, to[1] = (double)row->jump, to[2] = row->mode + 1;
  put(to + 3, row->x, row->dimension);
  return 0;
}

static int take_transition(void *context, const hs_transition_written *written) {
  const hs_transition *made = written->made;
  const hs_mode *mode = &hs_the_model.mode[made->mode];
  double *to = further(&transitions, TRANSITION);
  hs_real x[PROBLEM_WIDTH + 1];
  (void)context;
  if (!to) return 1;
  to[0] = made->time, to[1] = made->resumed, to[2] = made->mode + 1, to[3] = made->edge + 1, to[4] = made->entry;
  put(to + 5, written->before, mode->dimension);
  put(to + 5 + PROBLEM_WIDTH, hs_landing(&own.run, written, x), mode->edge[made->edge].target_dimension);
  return 0;
}

/* Run, and keep what it gives; `head` gets the first numbers of the output. Not 0 where memory is short. */
static int run(const double *in, double *head) {
  const hs_sink sink = {0, take_row, take_transition};
  const hs_given given = {in[1], in[2], in[3], in[4], in[5], (int64_t)hs_min(in[6], 4e18)};
  const hs_scheme scheme = in[0] > 0 ? HS_LOCATED : HS_RELAXED;
  double *workspace = malloc((size_t)hs_workspace(&hs_the_model, &problem_method, scheme) * sizeof *workspace);
  if (!workspace) return 1;
  rows.count = transitions.count = 0;
  hs_open_given(&own, &given, in + 8 + PROBLEM_WIDTH, (int)in[7] - 1, in + 8);
  own.run.sink = sink;
  own.run.task.workspace = workspace;
  own.run.task.settings.scheme = scheme;
  head[0] = hs_run_given(&own);
  head[1] = own.run.task.stop.time;
  head[2] = (double)(rows.count / ROW), head[3] = (double)(transitions.count / TRANSITION), head[4] = PROBLEM_WIDTH;
  free(workspace);
  return 0;
}

static void give_back(void) {
  free(rows.number);
  free(transitions.number);
  memset(&rows, 0, sizeof rows);
  memset(&transitions, 0, sizeof transitions);
}

#if defined(GATEWAY_PROGRAM)

int main(int count, char **words) {
  double in[GIVEN_NUMBERS], head[HEAD];
  FILE *file = count == 3 ? fopen(words[1], "rb") : 0;
  if (!file || fread(in, sizeof *in, GIVEN_NUMBERS, file) != GIVEN_NUMBERS || fclose(file) || run(in, head)) return 1;
  file = fopen(words[2], "wb");
  const int written = file && fwrite(head, sizeof *head, HEAD, file) == HEAD &&
                      fwrite(rows.number, sizeof *head, rows.count, file) == rows.count &&
                      fwrite(transitions.number, sizeof *head, transitions.count, file) == transitions.count;
  give_back();
  return !written || fclose(file);
}

#else
#include "mex.h"

void mexFunction(int results, mxArray *result[], int arguments, const mxArray *argument[]) {
  double head[HEAD], *out;
  (void)results;
  if (arguments != 1 || !mxIsDouble(argument[0]) || mxGetNumberOfElements(argument[0]) != GIVEN_NUMBERS)
    mexErrMsgIdAndTxt("hsdsl:arguments", "expected %d numbers; call hsdsl_simulate", (int)GIVEN_NUMBERS);
  if (run(mxGetPr(argument[0]), head)) mexErrMsgIdAndTxt("hsdsl:memory", "out of memory");
  result[0] = mxCreateDoubleMatrix(HEAD + rows.count + transitions.count, 1, mxREAL);
  out = mxGetPr(result[0]);
  memcpy(out, head, sizeof head);
  if (rows.count) memcpy(out + HEAD, rows.number, rows.count * sizeof *out);
  if (transitions.count) memcpy(out + HEAD + rows.count, transitions.number, transitions.count * sizeof *out);
  give_back();
}
#endif
