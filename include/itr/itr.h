/* SPDX-License-Identifier: MIT */
/** @file
 * ITR in C: for C, Fortran and whatever calls C functions.
 *
 * Objects are handles, arrays are plain: interleaved, ids from 0, SI units; the library copies what it is given. Functions
 * that can fail return a status and leave a message in the handle: which array, which index, what was found, what was
 * expected. Handles are used by one thread at a time; different handles do not disturb each other. Nothing is printed. */
#ifndef ITR_ITR_H
#define ITR_ITR_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Of the functions that the shared library shows. */
#if defined(_WIN32)
#define ITR_C_API
#else
#define ITR_C_API __attribute__((visibility("default")))
#endif

/** What a function returns. */
typedef enum itr_status {
  ITR_SUCCESS = 0,   /**< done */
  ITR_BAD_INPUT = 2, /**< a mistake in what was handed in */
  ITR_STOPPED = 3,   /**< a step could not be done: the state is that before it */
  ITR_CANCELLED = 4, /**< a callback ended the step: the state is that before it */
  ITR_ERROR = 5      /**< out of memory, or an error of the library's own */
} itr_status;

typedef struct itr_model itr_model;           /**< what is simulated */
typedef struct itr_simulation itr_simulation; /**< one that goes on */
typedef struct itr_snapshot itr_snapshot;     /**< a saved state */

/** Writes `dimension` numbers (a pressure: one) for the rest position X and the time t. */
typedef void (*itr_function)(const double* X, double t, double* value, void* user);
/** Adds to the forces f [N] of n vertices at rest positions X and positions x; n may be that of a new mesh. */
typedef void (*itr_force_function)(size_t n, const double* X, const double* x, double t, double* f, void* user);
/** Takes a symmetric block (dimension * num_vertices squared numbers) of some vertices; `to` is what came with it. */
typedef void (*itr_block_receiver)(void* to, size_t num_vertices, const int* vertices, const double* block);
/** Gives blocks of -df/dx [N/m] of such forces. */
typedef void (*itr_stiffness_function)(size_t n, const double* X, const double* x, double t, itr_block_receiver add,
                                       void* to, void* user);
/** After a Newton iteration; 0 ends the step. */
typedef int (*itr_iteration_function)(int iteration, double energy, double gradient_norm, double step_norm, void* user);

/** The change of a mesh within a step; valid during the call. Maps have the new id for each old one, -1 where it is gone.
 * Row i of the transfer operator (compressed rows) gives what a field has at new vertex i: the sum of value[k] times the
 * field at old vertex column[k], k from row_start[i] to row_start[i + 1]. facet_parent: by new facet, the old one on which
 * its middle lies. */
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
/** A listener; the change is valid during the call. */
typedef void (*itr_mesh_function)(const itr_mesh_change* change, void* user);
/** L2 projection of a field of `components` a vertex from the old mesh to the new one: integrals are kept. */
ITR_C_API itr_status itr_project(const itr_mesh_change* change, size_t components, const double* old_field,
                                 double* new_field);

/** level: 0 debug, 1 information, 2 warning */
typedef void (*itr_log_function)(int level, const char* message, void* user);

/** "0.1.0", of the library. */
ITR_C_API const char* itr_version(void);

/* --- models: copied by the simulations that are made from them ---------------------------------------------------- */

/** dimension 2 or 3; NULL for another one or where there is no memory. */
ITR_C_API itr_model* itr_model_create(int dimension);
ITR_C_API void itr_model_destroy(itr_model* model); /**< NULL is allowed */
/** Of the last function that failed; never NULL, valid until the next call. */
ITR_C_API const char* itr_model_message(const itr_model* model);
/** Everything from a scene file, also the dimension; single keys may be set afterwards. */
ITR_C_API itr_status itr_model_read_scene(itr_model* model, const char* file);
/** Keys of a scene file but for geometry and output: a JSON object, merged into what is there; or one key by its pointer
 * ("/time/dt") and JSON text. Materials go by body; as `id`, conditions have what the add functions return. */
ITR_C_API itr_status itr_model_set_options(itr_model* model, const char* json);
/** One key, by its pointer and JSON text. Of a scene that was read, any key: it is read again. */
ITR_C_API itr_status itr_model_set_option(itr_model* model, const char* pointer, const char* value);
/** The same of a number. */
ITR_C_API itr_status itr_model_set_number(itr_model* model, const char* pointer, double value);
/** vertices: num_vertices * dimension [m]; cells: num_cells * (dimension + 1); bodies: an id a cell, or NULL: all 0. */
ITR_C_API itr_status itr_model_set_mesh(itr_model* model, size_t num_vertices, const double* vertices, size_t num_cells,
                                        const int* cells, const int* bodies);
/** facets: num_facets * dimension vertices. `id` (may be NULL) gets the number for options. */
ITR_C_API itr_status itr_model_add_boundary(itr_model* model, const char* name, size_t num_facets, const int* facets,
                                            int* id);
/** The facets of the boundary that are in the box. */
ITR_C_API itr_status itr_model_add_boundary_box(itr_model* model, const char* name, const double* box_min,
                                                const double* box_max, int* id);
/** A stored-energy density W(F) of the program's own, which has to be frame-indifferent, for F of det F > 0, by columns: W
 * [J/m^d], the stress P = dW/dF (d x d [Pa]) and H = d2W/dF2 (d^2 x d^2, symmetric [Pa]), d the dimension. Several threads
 * may call the functions. For a body that the options give a material, of which E, nu (a scale) and density stay. */
typedef struct itr_law {
  double (*density)(int d, const double* F, void* user);
  void (*stress)(int d, const double* F, double* P, void* user);
  void (*hessian)(int d, const double* F, double* H, void* user);
} itr_law;
/** The law of a body that the options give a material; `user` comes back with each call. One body has one law. */
ITR_C_API itr_status itr_model_set_law(itr_model* model, int body, const itr_law* law, void* user);
/** Geometry that only collides: vertices (num_vertices * dimension [m]), edges (num_edges * 2 ids of these) and, in 3D,
 * triangles (num_triangles * 3). `id` (may be NULL) gets the number for options. */
ITR_C_API itr_status itr_model_add_obstacle(itr_model* model, const char* name, size_t num_vertices, const double* vertices,
                                            size_t num_edges, const int* edges, size_t num_triangles, const int* triangles,
                                            int* id);

/* --- simulations --------------------------------------------------------------------------------------------------- */

/** Where it fails *simulation is NULL and the message is the model's. `log` may be NULL. */
ITR_C_API itr_status itr_simulation_create(itr_model* model, itr_log_function log, void* user, itr_simulation** simulation);
ITR_C_API void itr_simulation_destroy(itr_simulation* simulation); /**< NULL is allowed */
/** Of the last function that failed; never NULL, valid until the next call. */
ITR_C_API const char* itr_simulation_message(const itr_simulation* simulation);

/** One step of the length dt [s]; 0: as the one before, or as the options say. */
ITR_C_API itr_status itr_step(itr_simulation* simulation, double dt);
/** Finds the mesh of the next step and stays at its start, on that mesh: before sub-iterations on a frozen one. */
ITR_C_API itr_status itr_adapt(itr_simulation* simulation, double dt);
/** [s] The functions that return no status want a handle, not NULL. */
ITR_C_API double itr_time(const itr_simulation* simulation);
/** How many were done. */
ITR_C_API int itr_steps(const itr_simulation* simulation);
ITR_C_API int itr_finished(const itr_simulation* simulation); /**< as many steps as the options ask for */
/** 2 or 3. */
ITR_C_API int itr_dimension(const itr_simulation* simulation);

/** Conditions from the next step on; mask: `dimension` flags, all 0 releases. Arrays are by vertex of the present mesh. */
ITR_C_API itr_status itr_fix(itr_simulation* simulation, const char* boundary, const int* mask, itr_function displacement,
                             void* user);
/** displacements: num_vertices * dimension [m]. */
ITR_C_API itr_status itr_fix_values(itr_simulation* simulation, const char* boundary, const int* mask,
                                    const double* displacements);
/** Force by rest area [N/m^2], in 2D by length [N/m]; NULL: none. */
ITR_C_API itr_status itr_set_traction(itr_simulation* simulation, const char* boundary, itr_function traction, void* user);
/** tractions: num_vertices * dimension. */
ITR_C_API itr_status itr_set_traction_values(itr_simulation* simulation, const char* boundary, const double* tractions);
/** Along inward normals as they are then, the same unit: one number; NULL: none. */
ITR_C_API itr_status itr_set_pressure(itr_simulation* simulation, const char* boundary, itr_function pressure, void* user);
/** pressures: num_vertices. */
ITR_C_API itr_status itr_set_pressure_values(itr_simulation* simulation, const char* boundary, const double* pressures);
/** Body force by mass [m/s^2]; NULL: none. */
ITR_C_API itr_status itr_set_acceleration(itr_simulation* simulation, itr_function acceleration, void* user);
/** accelerations: num_vertices * dimension. */
ITR_C_API itr_status itr_set_acceleration_values(itr_simulation* simulation, const double* accelerations);
/** Displacement of an obstacle's vertices from rest [m]. */
ITR_C_API itr_status itr_move_obstacle(itr_simulation* simulation, const char* obstacle, itr_function displacement,
                                       void* user);
/** Where they are at the end of the next steps: num_vertices * dimension [m]. */
ITR_C_API itr_status itr_move_obstacle_to(itr_simulation* simulation, const char* obstacle, size_t num_vertices,
                                          const double* positions);
ITR_C_API itr_status itr_set_forces(itr_simulation* simulation, const double* forces); /**< [N]; NULL: none */
/** Forces of present positions; NULL: none. With their stiffness (NULL: none) a step takes fewer rounds. */
ITR_C_API itr_status itr_set_follower_forces(itr_simulation* simulation, itr_force_function forces,
                                             itr_stiffness_function stiffness, void* user);
/** What a term of the program's own is a sum over: the whole mesh, or the patch around an edit, which numbers its vertices
 * itself; valid during a call. Obstacles' vertices come last. boundaries: an id a facet, -1: none. */
typedef struct itr_part {
  size_t num_vertices, num_cells, num_facets;
  const double* X;
  const int *cells, *bodies, *facets, *boundaries;
  double t; /**< end of the step [s] */
} itr_part;
/** An energy [J], its gradient [N] and symmetric blocks of its Hessian [N/m] at positions x: a sum over cells, facets or
 * points at rest positions, not over vertex numbers. Several threads may call the functions. */
typedef struct itr_term {
  double (*energy)(const itr_part* part, const double* x, void* user);
  void (*add_gradient)(const itr_part* part, const double* x, double* gradient, void* user);
  void (*add_hessian)(const itr_part* part, const double* x, itr_block_receiver add, void* to, void* user);
} itr_term;
/** Adds a term to the incremental potential, or puts it in the place of the one of this name; NULL: it goes. */
ITR_C_API itr_status itr_set_term(itr_simulation* simulation, const char* name, const itr_term* term, void* user);
/** Of the bodies: num_vertices * dimension [m/s]. */
ITR_C_API itr_status itr_set_velocities(itr_simulation* simulation, const double* velocities);
/** No remeshing while it is not 0. */
ITR_C_API itr_status itr_freeze_mesh(itr_simulation* simulation, int frozen);

/** The state. Arrays belong to the simulation and are valid until the next call that changes it. */
ITR_C_API size_t itr_num_vertices(const itr_simulation* simulation);
/** Of the present mesh. */
ITR_C_API size_t itr_num_cells(const itr_simulation* simulation);
/** Of its boundary. */
ITR_C_API size_t itr_num_facets(const itr_simulation* simulation);
/** num_vertices * dimension [m]. */
ITR_C_API const double* itr_positions(const itr_simulation* simulation);
/** num_vertices * dimension [m/s]. */
ITR_C_API const double* itr_velocities(const itr_simulation* simulation);
/** These are copied into arrays of the caller's: */
ITR_C_API itr_status itr_get_rest_positions(itr_simulation* simulation, double* X);
/** num_cells * (dimension + 1) ids of vertices. */
ITR_C_API itr_status itr_get_cells(itr_simulation* simulation, int* cells);
/** num_cells ids. */
ITR_C_API itr_status itr_get_bodies(itr_simulation* simulation, int* bodies);
/** num_facets * dimension ids of vertices, outward. */
ITR_C_API itr_status itr_get_facets(itr_simulation* simulation, int* facets);
/** num_facets ids of boundaries; -1: none. */
ITR_C_API itr_status itr_get_facet_boundaries(itr_simulation* simulation, int* ids);

/** Forces on vertices [N], by kind; there are some after the first step since they are watched, else it is NULL. */
typedef enum itr_force { ITR_CONTACT = 0, ITR_FRICTION = 1, ITR_REACTION = 2, ITR_APPLIED = 3 } itr_force;
/** Asks for forces, which cost some gradients a step. */
ITR_C_API itr_status itr_watch_forces(itr_simulation* simulation, int watched);
/** num_vertices * dimension [N]. */
ITR_C_API const double* itr_forces(const itr_simulation* simulation, itr_force kind);
/** Of the present state, num_cells numbers [Pa]. */
ITR_C_API itr_status itr_get_von_mises(itr_simulation* simulation, double* von_mises);
/** Cauchy's, num_cells * dimension * dimension numbers, row by row [Pa]. */
ITR_C_API itr_status itr_get_stress(itr_simulation* simulation, double* stress);
/** On a boundary or an obstacle, of all kinds: force (dimension numbers) and moment about a point (2D: one number, 3D: three). */
ITR_C_API itr_status itr_resultant(itr_simulation* simulation, const char* boundary, const double* about, double* force,
                                   double* moment);

/** Of the last step [J]: inertia, elastic, body, contact, friction, damping, host, total. */
typedef struct itr_energies {
  double inertia, elastic, body, contact, friction, damping, host, total;
} itr_energies;
/** Of the last step: counts; the energy that the projection forgot [J], the least distance of what is in contact [m], the
 * least ratio of volumes, present by rest; seconds. */
typedef struct itr_step_statistics {
  int newton_iterations, linear_solves, factorizations, splits, collapses, swaps, smooths, cut_steps;
  double history_loss, min_distance, min_volume_ratio, seconds;
} itr_step_statistics;
/** Of the last step. */
ITR_C_API void itr_get_energies(const itr_simulation* simulation, itr_energies* energies);
/** Of the last step. */
ITR_C_API void itr_get_statistics(const itr_simulation* simulation, itr_step_statistics* statistics);

/** Saved states: cheap; the same steps from one have the same bits. NULL where there is no memory. */
ITR_C_API itr_snapshot* itr_save(const itr_simulation* simulation);
/** To a state of this simulation; the snapshot stays. */
ITR_C_API itr_status itr_restore(itr_simulation* simulation, const itr_snapshot* snapshot);
ITR_C_API void itr_snapshot_destroy(itr_snapshot* snapshot); /**< NULL is allowed */

/** Events; NULL: nobody listens. */
ITR_C_API itr_status itr_on_iteration(itr_simulation* simulation, itr_iteration_function listener, void* user);
/** After a step that changed the mesh. */
ITR_C_API itr_status itr_on_mesh_change(itr_simulation* simulation, itr_mesh_function listener, void* user);

#ifdef __cplusplus
}
#endif

#endif
