/* SPDX-License-Identifier: MIT */
/** @file
 * ITR in C: for C, Fortran and other languages that call C functions.
 *
 * Objects are handles. Arrays are plain and interleaved, ids count from 0, units are SI. The library copies its arguments.
 * A function that can fail returns a status and leaves a message in the handle. The message names the array, the index,
 * what was found and what was expected. One thread at a time may use a handle; different handles are independent. The
 * library prints nothing.
 *
 * `length` is the number of entries of the array after it; a wrong one is ITR_BAD_INPUT. A callback may read and save the
 * simulation that calls it, which stands before the step. A change from inside is ITR_BAD_INPUT, except of conditions in a
 * listener of mesh changes. A callback must not destroy the simulation. A program in short:
 *
 *     itr_model* model = itr_model_create(2);
 *     itr_simulation* simulation = NULL;
 *     if (itr_model_read_scene(model, "scene.json") || itr_simulation_create(model, NULL, NULL, &simulation))
 *       puts(itr_model_message(model));
 *     else
 *       while (!itr_finished(simulation) && itr_step(simulation, 0) == ITR_SUCCESS) printf("%g s\n", itr_time(simulation));
 */
#ifndef ITR_ITR_H
#define ITR_ITR_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Marks the functions that the shared library exports. */
#if defined(_WIN32)
#define ITR_C_API
#else
#define ITR_C_API __attribute__((visibility("default")))
#endif

/** The status that a function returns. */
typedef enum itr_status {
  ITR_SUCCESS = 0,   /**< done */
  ITR_BAD_INPUT = 2, /**< an argument is wrong */
  ITR_STOPPED = 3,   /**< the step failed; the state is as before it */
  ITR_CANCELLED = 4, /**< a callback ended the step; the state is as before it */
  ITR_ERROR = 5      /**< out of memory, or an internal error */
} itr_status;

typedef struct itr_model itr_model;           /**< description of a problem */
typedef struct itr_simulation itr_simulation; /**< a running simulation */
typedef struct itr_snapshot itr_snapshot;     /**< a saved state */

/** Writes the value at the rest position X [m] and the time t [s]: `dimension` numbers, one for a pressure. */
typedef void (*itr_function)(const double* X, double t, double* value, void* user);
/** Adds forces to f [N], for n vertices at rest positions X and positions x [m]. After remeshing n may have changed. */
typedef void (*itr_force_function)(size_t n, const double* X, const double* x, double t, double* f, void* user);
/** Receives the symmetric block of some vertices, (dimension * num_vertices)^2 numbers. `to` is passed on unchanged. */
typedef void (*itr_block_receiver)(void* to, size_t num_vertices, const int* vertices, const double* block);
/** Passes blocks of -df/dx [N/m] of an itr_force_function to `add`. */
typedef void (*itr_stiffness_function)(size_t n, const double* X, const double* x, double t, itr_block_receiver add,
                                       void* to, void* user);
/** Called after each Newton iteration. Returning 0 cancels the step. */
typedef int (*itr_iteration_function)(int iteration, double energy, double gradient_norm, double step_norm, void* user);

/** How remeshing changed the mesh within a step. Valid during the call.
 *
 * vertex, cell and facet map each old id to the new one, or to -1 where the old entity is gone. facet_parent maps each new
 * facet to the old facet on which its middle lies. row_start, column and value are the interpolation as compressed rows: a
 * field at new vertex i is the sum of value[k] * field[column[k]] for k from row_start[i] to row_start[i + 1] - 1. */
typedef struct itr_mesh_change {
  size_t old_vertices, old_cells, old_facets, new_vertices, new_facets;
  const int* vertex;
  const int* cell;
  const int* facet;
  const int* facet_parent;
  const int* row_start;
  const int* column;
  const double* value;
  const void* projection; /**< for itr_project */
} itr_mesh_change;
/** Called after a step that changed the mesh. */
typedef void (*itr_mesh_function)(const itr_mesh_change* change, void* user);
/** Projects a field with `components` numbers a vertex from the old mesh to the new one in L2, which keeps integrals. */
ITR_C_API itr_status itr_project(const itr_mesh_change* change, size_t components, const double* old_field,
                                 double* new_field);

/** level: 0 debug, 1 information, 2 warning */
typedef void (*itr_log_function)(int level, const char* message, void* user);

/** Version of the library, such as "0.2.0". */
ITR_C_API const char* itr_version(void);

/* --- models: copied by the simulations that are made from them ---------------------------------------------------- */

/** Makes an empty model of dimension 2 or 3. Returns NULL for another dimension or without memory. */
ITR_C_API itr_model* itr_model_create(int dimension);
ITR_C_API void itr_model_destroy(itr_model* model); /**< NULL is allowed */
/** Message of the last function that failed. Never NULL, valid until the next call. */
ITR_C_API const char* itr_model_message(const itr_model* model);
/** Reads a whole scene file, dimension included. Keys may be set afterwards. */
ITR_C_API itr_status itr_model_read_scene(itr_model* model, const char* file);
/** Merges a JSON object with keys of a scene, other than geometry and output, into the options. Materials refer to bodies by
 * `id`; conditions refer to the ids that the add functions return. */
ITR_C_API itr_status itr_model_set_options(itr_model* model, const char* json);
/** Sets one key by its pointer ("/time/dt") and JSON text. A scene that was read is read again, so any key may be set. */
ITR_C_API itr_status itr_model_set_option(itr_model* model, const char* pointer, const char* value);
/** Sets one key to a number. */
ITR_C_API itr_status itr_model_set_number(itr_model* model, const char* pointer, double value);
/** Sets the mesh: num_vertices * dimension positions [m], num_cells * (dimension + 1) vertex ids, and a body id a cell. NULL
 * for bodies puts all cells into body 0. */
ITR_C_API itr_status itr_model_set_mesh(itr_model* model, size_t num_vertices, const double* vertices, size_t num_cells,
                                        const int* cells, const int* bodies);
/** Sets a mesh of quadratic cells, which have a node at the middle of each edge: 6 nodes in 2D (edges 01, 12, 20), 10 in 3D
 * (01, 12, 20, 03, 13, 23), as in VTK. Vertices keep their order. */
ITR_C_API itr_status itr_model_set_quadratic_mesh(itr_model* model, size_t num_nodes, const double* nodes, size_t num_cells,
                                                  const int* cells, const int* bodies);
/** Names facets of the boundary, num_facets * dimension vertex ids. Writes the id for options to `id` unless it is NULL. */
ITR_C_API itr_status itr_model_add_boundary(itr_model* model, const char* name, size_t num_facets, const int* facets,
                                            int* id);
/** Names the boundary facets whose vertices are all in the box. */
ITR_C_API itr_status itr_model_add_boundary_box(itr_model* model, const char* name, const double* box_min,
                                                const double* box_max, int* id);
/** A hyperelastic law of the program: the energy density W(F) [J/m^d], the stress P = dW/dF [Pa] (d x d) and the tangent
 * H = d2W/dF2 [Pa] (d^2 x d^2, symmetric), for dimension d. Matrices are stored by columns. W must be frame-indifferent; F
 * always has a positive determinant. Several threads may call the functions. */
typedef struct itr_law {
  double (*density)(int d, const double* F, void* user);
  void (*stress)(int d, const double* F, double* P, void* user);
  void (*hessian)(int d, const double* F, double* H, void* user);
} itr_law;
/** Sets the law of a body. The options still give that body a material: its density stays, and its E and nu serve as a
 * scale. `user` is passed to each call. */
ITR_C_API itr_status itr_model_set_law(itr_model* model, int body, const itr_law* law, void* user);
/** Adds an obstacle: num_vertices * dimension positions [m], num_edges * 2 vertex ids and, in 3D, num_triangles * 3. Writes
 * the id for options to `id` unless it is NULL. */
ITR_C_API itr_status itr_model_add_obstacle(itr_model* model, const char* name, size_t num_vertices, const double* vertices,
                                            size_t num_edges, const int* edges, size_t num_triangles, const int* triangles,
                                            int* id);

/* --- simulations --------------------------------------------------------------------------------------------------- */

/** Makes a simulation from a copy of the model. On failure *simulation is NULL and the model has the message. `log` may be
 * NULL. */
ITR_C_API itr_status itr_simulation_create(itr_model* model, itr_log_function log, void* user, itr_simulation** simulation);
ITR_C_API void itr_simulation_destroy(itr_simulation* simulation); /**< NULL is allowed */
/** Message of the last function that failed. Never NULL, valid until the next call. */
ITR_C_API const char* itr_simulation_message(const itr_simulation* simulation);

/** Takes one step of length dt [s]. With dt = 0 the length is that of the step before, or the one in the options. */
ITR_C_API itr_status itr_step(itr_simulation* simulation, double dt);
/** Finds the mesh of the next step and stays at the start of that step, on the new mesh. Sub-iterations on a frozen mesh
 * begin with it. */
ITR_C_API itr_status itr_adapt(itr_simulation* simulation, double dt);
/** Present time [s]; not a number without a simulation. */
ITR_C_API double itr_time(const itr_simulation* simulation);
/** Number of steps taken; -1 without a simulation. */
ITR_C_API int itr_steps(const itr_simulation* simulation);
/** Whether all steps of the options are taken; -1 without a simulation. */
ITR_C_API int itr_finished(const itr_simulation* simulation);
/** Dimension, 2 or 3; -1 without a simulation. */
ITR_C_API int itr_dimension(const itr_simulation* simulation);

/** Prescribes displacements [m] on a boundary from the next step on. `mask` has `dimension` flags, one a component; all 0
 * releases the boundary. */
ITR_C_API itr_status itr_fix(itr_simulation* simulation, const char* boundary, const int* mask, itr_function displacement,
                             void* user);
/** The same by an array over the vertices (num_vertices * dimension) or nodes of the present mesh [m]. */
ITR_C_API itr_status itr_fix_values(itr_simulation* simulation, const char* boundary, const int* mask, size_t length,
                                    const double* displacements);
/** Sets the force by rest area [N/m^2], in 2D by rest length [N/m]. NULL removes it. */
ITR_C_API itr_status itr_set_traction(itr_simulation* simulation, const char* boundary, itr_function traction, void* user);
/** The same by an array, num_vertices * dimension, or by node. */
ITR_C_API itr_status itr_set_traction_values(itr_simulation* simulation, const char* boundary, size_t length,
                                             const double* tractions);
/** Sets the pressure against the deformed surface [N/m^2], in 2D [N/m]: one number. NULL removes it. */
ITR_C_API itr_status itr_set_pressure(itr_simulation* simulation, const char* boundary, itr_function pressure, void* user);
/** The same by an array, num_vertices, or by node. */
ITR_C_API itr_status itr_set_pressure_values(itr_simulation* simulation, const char* boundary, size_t length,
                                             const double* pressures);
/** Sets the body force by mass [m/s^2]. NULL removes it. */
ITR_C_API itr_status itr_set_acceleration(itr_simulation* simulation, itr_function acceleration, void* user);
/** The same by an array, num_vertices * dimension, or by node. */
ITR_C_API itr_status itr_set_acceleration_values(itr_simulation* simulation, size_t length, const double* accelerations);
/** Sets the strain of the bodies where they are free of stress, the same in all directions: num_vertices numbers, or by
 * node. NULL removes it, as it does one of the options. */
ITR_C_API itr_status itr_set_eigenstrain(itr_simulation* simulation, size_t length, const double* strains);
/** Moves an obstacle: displacement of its vertices from rest [m]. */
ITR_C_API itr_status itr_move_obstacle(itr_simulation* simulation, const char* obstacle, itr_function displacement,
                                       void* user);
/** Moves an obstacle to positions at the end of the next steps, num_vertices * dimension [m]. */
ITR_C_API itr_status itr_move_obstacle_to(itr_simulation* simulation, const char* obstacle, size_t num_vertices,
                                          const double* positions);
/** Sets dead forces on nodes, num_nodes * dimension [N]. NULL removes them. */
ITR_C_API itr_status itr_set_forces(itr_simulation* simulation, size_t length, const double* forces);
/** Sets forces that depend on present positions. NULL removes them. With their stiffness a step takes fewer rounds. */
ITR_C_API itr_status itr_set_follower_forces(itr_simulation* simulation, itr_force_function forces,
                                             itr_stiffness_function stiffness, void* user);
/** The part of the mesh over which a term sums: the whole mesh, or the patch around an operation of the remesher. A patch
 * has its own vertex numbers. Obstacles' vertices come last. `boundaries` has an id a facet, -1 for none. Valid during a
 * call. */
typedef struct itr_part {
  size_t num_vertices, num_cells, num_facets;
  const double* X;
  const int *cells, *bodies, *facets, *boundaries;
  double t; /**< end of the step [s] */
} itr_part;
/** An energy of the program [J], its gradient [N] and symmetric blocks of its Hessian [N/m] at positions x. It must be a sum
 * over cells, facets or points at rest positions, because vertex numbers change. Several threads may call the functions. */
typedef struct itr_term {
  double (*energy)(const itr_part* part, const double* x, void* user);
  void (*add_gradient)(const itr_part* part, const double* x, double* gradient, void* user);
  void (*add_hessian)(const itr_part* part, const double* x, itr_block_receiver add, void* to, void* user);
} itr_term;
/** Adds a term to the incremental potential, or replaces the one of this name. NULL removes it. */
ITR_C_API itr_status itr_set_term(itr_simulation* simulation, const char* name, const itr_term* term, void* user);
/** Sets the velocities of the bodies, num_nodes * dimension [m/s]. */
ITR_C_API itr_status itr_set_velocities(itr_simulation* simulation, size_t length, const double* velocities);
/** Stops remeshing while `frozen` is not 0. */
ITR_C_API itr_status itr_freeze_mesh(itr_simulation* simulation, int frozen);

/** Number of vertices of the bodies. Arrays of the state belong to the simulation and are valid until a call changes it.
 * Without a simulation they are NULL and numbers are 0. */
ITR_C_API size_t itr_num_vertices(const itr_simulation* simulation);
/** Number of nodes: vertices, then the nodes of curved edges. */
ITR_C_API size_t itr_num_nodes(const itr_simulation* simulation);
/** Copies the ends of each curved edge, (num_nodes - num_vertices) * 2 vertex ids, in the order of their nodes. */
ITR_C_API itr_status itr_get_curved_edges(itr_simulation* simulation, size_t length, int* edges);
/** Number of cells of the present mesh. */
ITR_C_API size_t itr_num_cells(const itr_simulation* simulation);
/** Number of facets of its boundary. */
ITR_C_API size_t itr_num_facets(const itr_simulation* simulation);
/** Positions, num_nodes * dimension [m]. */
ITR_C_API const double* itr_positions(const itr_simulation* simulation);
/** Velocities, num_nodes * dimension [m/s]. */
ITR_C_API const double* itr_velocities(const itr_simulation* simulation);
/** Copies rest positions, num_nodes * dimension [m]. */
ITR_C_API itr_status itr_get_rest_positions(itr_simulation* simulation, size_t length, double* X);
/** Copies cells, num_cells * (dimension + 1) vertex ids. */
ITR_C_API itr_status itr_get_cells(itr_simulation* simulation, size_t length, int* cells);
/** Copies the body of each cell, num_cells ids. */
ITR_C_API itr_status itr_get_bodies(itr_simulation* simulation, size_t length, int* bodies);
/** Copies boundary facets, num_facets * dimension vertex ids, oriented outward. */
ITR_C_API itr_status itr_get_facets(itr_simulation* simulation, size_t length, int* facets);
/** Copies the boundary id of each facet, num_facets ids, -1 for none. */
ITR_C_API itr_status itr_get_facet_boundaries(itr_simulation* simulation, size_t length, int* ids);

/** Kinds of forces on vertices. */
typedef enum itr_force {
  ITR_CONTACT = 0, /**< with its damping */
  ITR_FRICTION = 1,
  ITR_REACTION = 2,
  ITR_APPLIED = 3,
  ITR_BODY = 4,    /**< body forces */
  ITR_RESIDUAL = 5 /**< what the solve left of the sum of all forces and inertia */
} itr_force;
/** Turns the computation of forces on or off. It costs a few gradients a step. */
ITR_C_API itr_status itr_watch_forces(itr_simulation* simulation, int watched);
/** Forces of one kind, num_nodes * dimension [N]; NULL before the first step in which they are watched. */
ITR_C_API const double* itr_forces(const itr_simulation* simulation, itr_force kind);
/** Copies the contact force by present area at each node, num_nodes numbers [Pa], in 2D [N/m]. Forces must be watched. */
ITR_C_API itr_status itr_get_contact_pressure(itr_simulation* simulation, size_t length, double* pressure);
/** Copies von Mises' equivalent stress, num_cells numbers [Pa]. */
ITR_C_API itr_status itr_get_von_mises(itr_simulation* simulation, size_t length, double* von_mises);
/** Copies Cauchy's stress, num_cells * dimension * dimension numbers, row by row [Pa]. */
ITR_C_API itr_status itr_get_stress(itr_simulation* simulation, size_t length, double* stress);
/** Sum of all kinds of forces on a boundary or a body, or of bodies on an obstacle: force [N], `dimension` numbers, and
 * moment about a point [N m], one number in 2D and three in 3D. A part is a name or an id ("3"): names are tried
 * before ids, and of each those of boundaries, then obstacles, then bodies; "boundary:3", "obstacle:3" and "body:3" look
 * among these alone. ITR_BAD_INPUT for what nothing has. */
ITR_C_API itr_status itr_resultant(itr_simulation* simulation, const char* part, const double* about, double* force,
                                   double* moment);
/** Resultant on the part with this id, whatever has it for its name. */
ITR_C_API itr_status itr_resultant_of_id(itr_simulation* simulation, int id, const double* about, double* force,
                                         double* moment);

/** Energies of the last step by term [J]. `host` sums the terms of the program. */
typedef struct itr_energies {
  double inertia, elastic, body, contact, friction, damping, host, total;
} itr_energies;
/** Counts and measures of the last step. history_loss is the energy that the projection onto the new mesh forgot [J],
 * min_distance the smallest gap in contact [m], min_volume_ratio the smallest ratio of present to rest volume of a cell. */
typedef struct itr_step_statistics {
  int newton_iterations, linear_solves, factorizations, splits, curves, straightens, collapses, swaps, smooths, cut_steps;
  double history_loss, min_distance, min_volume_ratio, seconds;
} itr_step_statistics;
/** Writes the energies of the last step, of what itr_adapt or itr_restore led to, or of the start. */
ITR_C_API itr_status itr_get_energies(itr_simulation* simulation, itr_energies* energies);
/** Writes the statistics of the same. */
ITR_C_API itr_status itr_get_statistics(itr_simulation* simulation, itr_step_statistics* statistics);

/** Saves the state, at almost no cost. The same steps from it give the same bits. Returns NULL without memory or without a
 * simulation. */
ITR_C_API itr_snapshot* itr_save(const itr_simulation* simulation);
/** Goes back to a state that this simulation saved. The snapshot stays valid. */
ITR_C_API itr_status itr_restore(itr_simulation* simulation, const itr_snapshot* snapshot);
ITR_C_API void itr_snapshot_destroy(itr_snapshot* snapshot); /**< NULL is allowed */

/** Sets the listener to Newton iterations. NULL removes it. */
ITR_C_API itr_status itr_on_iteration(itr_simulation* simulation, itr_iteration_function listener, void* user);
/** Sets the listener to changes of the mesh. NULL removes it. */
ITR_C_API itr_status itr_on_mesh_change(itr_simulation* simulation, itr_mesh_function listener, void* user);

#ifdef __cplusplus
}
#endif

#endif
