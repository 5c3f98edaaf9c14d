/* SPDX-License-Identifier: MIT */
/* The C interface: a block falls onto a moving floor and is refined; the program carries a field of its own along, goes back
 * to a saved state, and gets an error message. */
#include <itr/itr.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N = 5 };

static double* field; /* of the program's own: 1 + X + 2 Y at the vertices */

static void carry_field(const itr_mesh_change* change, void* user) {
  double* carried = calloc(change->new_vertices, sizeof *carried);
  for (size_t i = 0; i < change->new_vertices; ++i)
    for (int k = change->row_start[i]; k < change->row_start[i + 1]; ++k)
      carried[i] += change->value[k] * field[change->column[k]];
  free(field);
  field = carried;
  ++*(int*)user;
}

static void gravity(const double* X, double t, double* value, void* user) {
  (void)X, (void)t, (void)user;
  value[0] = 0, value[1] = -9.81;
}

static void lift(const double* X, double t, double* value, void* user) {
  (void)X;
  value[0] = 0, value[1] = *(const double*)user * t;
}

static int fail(const char* message) {
  fprintf(stderr, "bounce: %s\n", message);
  return 1;
}

int main(void) {
  double vertices[2 * N * N], floor_vertices[] = {-1, 0, 1, 0}, speed = 0.5, about[] = {0, 0}, force[2], moment[1];
  int cells[6 * (N - 1) * (N - 1)], floor_edges[] = {0, 1}, changes = 0, *cell = cells;
  for (int i = 0; i < N * N; ++i) vertices[2 * i] = 0.05 * (i % N), vertices[2 * i + 1] = 0.05 * (i / N) + 0.01;
  for (int i = 0; i < N * (N - 1); ++i)
    if (i % N < N - 1) {
      const int corners[] = {i, i + 1, i + N + 1, i, i + N + 1, i + N};
      memcpy(cell, corners, sizeof corners);
      cell += 6;
    }
  itr_model* model = itr_model_create(2);
  if (itr_model_set_mesh(model, N * N, vertices, 2 * (N - 1) * (N - 1), cells, NULL) ||
      itr_model_add_obstacle(model, "floor", 2, floor_vertices, 1, floor_edges, 0, NULL, NULL) ||
      itr_model_set_options(model, "{\"materials\": {\"type\": \"NeoHookean\", \"E\": 1e5, \"nu\": 0.3, \"rho\": 1000},"
                                   "\"time\": {\"dt\": 0.002, \"time_steps\": 1, \"integrator\": \"ImplicitEuler\"},"
                                   "\"contact\": {\"enabled\": true, \"dhat\": 0.002},"
                                   "\"solver\": {\"contact\": {\"barrier_stiffness\": 1e6}},"
                                   "\"space\": {\"remesh\": {\"enabled\": true}}}") ||
      itr_model_set_number(model, "/space/remesh/split/acceptance_tolerance", 1e-3))
    return fail(itr_model_message(model));

  itr_simulation* simulation;
  if (itr_simulation_create(model, NULL, NULL, &simulation)) return fail(itr_model_message(model));
  itr_model_destroy(model);
  field = malloc(N * N * sizeof *field);
  for (int v = 0; v < N * N; ++v) field[v] = 1 + vertices[2 * v] + 2 * vertices[2 * v + 1];
  itr_on_mesh_change(simulation, carry_field, &changes);
  itr_set_acceleration(simulation, gravity, NULL);
  itr_move_obstacle(simulation, "floor", lift, &speed);
  itr_watch_forces(simulation, 1);
  for (int step = 0; step < 40; ++step)
    if (itr_step(simulation, 0.002)) return fail(itr_simulation_message(simulation));

  double* X = malloc(2 * itr_num_vertices(simulation) * sizeof *X);
  itr_get_rest_positions(simulation, 2 * itr_num_vertices(simulation), X);
  for (size_t v = 0; v < itr_num_vertices(simulation); ++v)
    if (fabs(field[v] - 1 - X[2 * v] - 2 * X[2 * v + 1]) > 1e-12) return fail("the field was not carried along");
  free(X);
  free(field);

  itr_on_mesh_change(simulation, NULL, NULL);
  itr_snapshot* saved = itr_save(simulation);
  itr_step(simulation, 0.001);
  const double once = itr_positions(simulation)[1];
  itr_restore(simulation, saved);
  itr_step(simulation, 0.001);
  if (itr_positions(simulation)[1] != once) return fail("the replay differs");
  itr_snapshot_destroy(saved);

  if (itr_resultant(simulation, "nowhere", about, force, moment) != ITR_BAD_INPUT) return fail("no error");
  printf("%zu vertices after %d changes of the mesh; and an error: %s\n", itr_num_vertices(simulation), changes,
         itr_simulation_message(simulation));
  itr_simulation_destroy(simulation);
  return changes > 0 ? 0 : 1;
}
