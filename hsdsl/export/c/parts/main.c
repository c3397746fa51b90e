/* Run the exported model and print its transitions as JSON, every digit of every number. */

#include <stdio.h>
#include <string.h>

#include "hs_math.h"
#include "instance.h"

static hs_instance instance;
static const char *const *names = problem_start_state; /* of the states of the mode that the run is in */

static void print_text(const char *text) {
  for (; *text; text++) {
    if ((unsigned char)*text < 0x20)
      printf("\\u%04x", (unsigned)*text);
    else
      printf(*text == '"' || *text == '\\' ? "\\%c" : "%c", *text);
  }
}

static void print_string(const char *text) {
  putchar('"');
  print_text(text);
  putchar('"');
}

/* The index of the mode that a part is in. */
static int mode_of(int part, const hs_real *x) {
  return problem_part_number[part] < 0 ? 0 : (int)x[problem_part_number[part]] - 1;
}

/* The name of a mode; of a system of parts that of the product mode at a state. */
static void print_mode(int mode, const hs_real *x) {
  if (!PROBLEM_PARTS) print_text(problem_mode_name[mode]);
  for (int part = 0; part < PROBLEM_PARTS; part++) {
    if (part) putchar(' ');
    print_text(problem_part[part]);
    putchar('=');
    print_text(problem_part_mode[part][mode_of(part, x)]);
  }
}

/* Whether the mode at a state has it; the numbers of parts' modes are in its name. */
static int has_state(int s, const hs_real *x) {
  const int owner = PROBLEM_PARTS ? problem_owner[s] : -1;
  return owner < 0 ? !PROBLEM_PARTS : problem_owned[s][mode_of(owner, x)] == '1';
}

/* JSON has no numbers that are not finite. */
static void print_number(double number) {
  if (number - number == 0)
    printf("%.17g", number);
  else
    printf("null");
}

static void print_item(int first, const char *name, double value) {
  if (!first) printf(", ");
  print_string(name);
  printf(": ");
  print_number(value);
}

static void print_states(const char *key, const char *const *name, const hs_real *x, int count) {
  int printed = 0;
  printf(", \"%s\": {", key);
  for (int s = 0; s < count; s++)
    if (has_state(s, x) && !strchr(name[s], '@')) /* in names of what events remember, and in no others */
      print_item(!printed++, name[s], x[s]);
  printf("}");
}

static void print_outputs(const hs_real *outputs) {
  printf(", \"outputs\": {");
  for (int i = 0; i < PROBLEM_OUTPUTS; i++) print_item(!i, problem_output[i], outputs[i]);
  printf("}");
}

static int print_transition(void *context, const hs_transition_written *written) {
  const hs_transition *made = written->made;
  const hs_mode *mode = &hs_the_model.mode[made->mode];
  const hs_edge *edge = &mode->edge[made->edge];
  hs_real x[PROBLEM_WIDTH + 1];
  (void)context;
  printf("%s\n    {\"index\": %ld, \"time\": ", written->number ? "," : "", (long)written->number);
  print_number(made->time);
  printf(", \"resumed\": ");
  print_number(made->resumed);
  printf(", \"edge\": ");
  print_string(problem_edge[made->mode][made->edge]);
  printf(", \"from\": \"");
  print_mode(made->mode, written->before);
  printf("\", \"to\": \"");
  print_mode(edge->target, hs_landing(&instance, written, x));
  putchar('"');
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
  printf(", \"mode\": \"");
  print_mode(last.mode, last_x);
  putchar('"');
  print_states("state", names, last_x, last.dimension);
  print_outputs(last_outputs);
  printf("}\n}\n");
  return instance.task.stop.reason > HS_FINAL;
}
