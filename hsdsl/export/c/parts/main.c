/* Run the exported model and print its transitions as JSON, every digit of every number. */

#include <stdio.h>

#include "instance.h"

static hs_instance instance;
static const char *const *names = problem_start_state; /* of the states of the mode that the run is in */

static void print_string(const char *text) {
  putchar('"');
  for (; *text; text++) {
    if ((unsigned char)*text < 0x20)
      printf("\\u%04x", (unsigned)*text);
    else
      printf(*text == '"' || *text == '\\' ? "\\%c" : "%c", *text);
  }
  putchar('"');
}

/* JSON has no numbers that are not finite. */
static void print_number(double number) {
  if (number - number == 0)
    printf("%.17g", number);
  else
    printf("null");
}

static void print_states(const char *key, const char *const *name, const hs_real *x, int count) {
  printf(", \"%s\": {", key);
  for (int s = 0; s < count; s++) {
    if (s) printf(", ");
    print_string(name[s]);
    printf(": ");
    print_number(x[s]);
  }
  printf("}");
}

static int print_transition(void *context, const hs_transition_written *written) {
  const hs_transition *made = written->made;
  const hs_mode *mode = &hs_the_model.mode[made->mode];
  const hs_edge *edge = &mode->edge[made->edge];
  (void)context;
  printf("%s\n    {\"index\": %ld, \"time\": ", written->number ? "," : "", (long)written->number);
  print_number(made->time);
  printf(", \"resumed\": ");
  print_number(made->resumed);
  printf(", \"edge\": ");
  print_string(problem_edge[made->mode][made->edge]);
  printf(", \"from\": ");
  print_string(problem_mode_name[made->mode]);
  printf(", \"to\": ");
  print_string(problem_mode_name[edge->target]);
  print_states("before", problem_state[made->mode], written->before, mode->dimension);
  if (written->after) {
    names = problem_edge_state[made->mode][made->edge];
    print_states("after", names, written->after, edge->target_dimension);
  } else {
    printf(", \"after\": null");
  }
  printf(", \"alternatives\": [");
  for (int i = 0; i < made->alternatives; i++) {
    if (i) printf(", ");
    print_string(problem_edge[made->mode][written->alternatives[i]]);
  }
  printf("]}");
  return 0;
}

static hs_row_written last;
static hs_real last_x[PROBLEM_WIDTH + 1], last_outputs[PROBLEM_OUTPUTS + 1];

static int keep_row(void *context, const hs_row_written *row) {
  (void)context;
  last = *row;
  for (int s = 0; s < row->dimension; s++) last_x[s] = row->x[s];
  for (int i = 0; i < PROBLEM_OUTPUTS; i++) last_outputs[i] = row->outputs[i];
  return 0;
}

int main(void) {
  const hs_sink sink = {0, keep_row, print_transition};
  hs_open(&instance);
  instance.sink = sink;
  printf("{\n  \"model\": ");
  print_string(problem_name);
  printf(",\n  \"scheme\": ");
  print_string(problem_scheme);
  printf(",\n  \"method\": ");
  print_string(problem_method_name);
  printf(",\n  \"transitions\": [");
  hs_run_instance(&instance);
  printf("],\n  \"stop\": {\"reason\": \"%s\", \"time\": ", hs_stop_word(&instance.task.stop));
  print_number(instance.task.stop.time);
  printf("},\n  \"final\": {\"time\": ");
  print_number(last.time);
  printf(", \"mode\": ");
  print_string(problem_mode_name[last.mode]);
  print_states("state", names, last_x, last.dimension);
  print_states("outputs", problem_output, last_outputs, PROBLEM_OUTPUTS);
  printf("}\n}\n");
  return instance.task.stop.reason > HS_FINAL;
}
