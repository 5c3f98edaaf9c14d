// SPDX-License-Identifier: MIT
// The rows of the table of keys.
#include <iterator>
#include <list>

#include "key_table.hpp"

namespace itr::scene {

namespace {

using enum Role;
using enum Level;

// Pointers that stand in several places.
#define SELECTION "/geometry/*/{volume,surface,point}_selection/*"
#define CONDITIONS "/boundary_conditions/{dirichlet_boundary,neumann_boundary,pressure_boundary,obstacle_displacements}"
#define INTERPOLATION CONDITIONS "/*/interpolation/*"

constexpr Key kKeys[] = {
    {"/defaults", read, "itr|polyfem|itr-1|polyfem-1", "\"itr\"", "",
     "what keys that the scene leaves out stand for: ITR's values, or those of PolyFEM; with a version, or the newest",
     basic},
    {"/units/length", read, "nm|um|mm|cm|dm|m|km|in|ft", "\"m\"", "",
     "of all numbers of the scene, its meshes and results; defaults stay what they are in SI units", basic},
    {"/units/mass", read, "ug|mg|g|kg|t|lb", "\"kg\"", "",
     "with length and time it gives the units of force, stress and energy: mm, t, s are N, MPa, mJ", basic},
    {"/units/time", read, "ns|us|ms|s|min|h", "\"s\"", "", "see mass", basic},
    {"/units/characteristic_length", read, "positive", "1", "",
     "multiplies the tolerances x_delta, grad_norm, f_delta and friction_convergence_tol"},

    {"/geometry", read, "list", "", "", "bodies and obstacles, in this order; required", basic},
    {"/geometry/*", read, "", "", "", "one mesh file and what is made of it"},
    {"/geometry/*/mesh", read, "path", "", "",
     "mesh file: .msh (Gmsh 2.2 or 4.1), .inp (Abaqus, CalculiX), .vtu, .vtp, .vtk, .stl, .obj or .ply; relative to the "
     "scene's folder; required",
     basic},
    {"/geometry/*/type", read, "mesh|mesh_array|plane|ground|mesh_sequence", "\"mesh\"", "",
     "mesh_array makes copies; plane and ground are flat obstacles without end, which need no file; "
     "mesh_sequence is not supported yet"},
    {"/geometry/*/name", read, "string", "", "", "an id of all its cells, or of the obstacle"},
    {"/geometry/*/enabled", read, "boolean", "true", "", "false: as if the entry were not there, its file is not opened"},
    {"/geometry/*/is_obstacle", read, "boolean", "false", "",
     "only collides: it has no material and no unknowns, stands still or moves as prescribed", basic},
    {"/geometry/*/extract", read, "volume|surface|edges|points", "\"volume\"", "",
     "of an obstacle: what of it collides; bodies are volumes"},
    {"/geometry/*/n_refs", read, "natural", "0", "",
     "uniform refinements: each takes 4 times the elements in 2D, 8 times in 3D", basic},
    {"/geometry/*/unit", read, "|nm|um|mm|cm|dm|m|km|in|ft", "(/units/length)", "",
     "of the mesh file, before its transformation; \"\" is the default"},
    {"/geometry/*/height", read, "number", "0", "m", "of a ground: y in 2D and 3D"},
    {"/geometry/*/point", read, "numbers", "(the origin)", "m", "of a plane"},
    {"/geometry/*/normal", read, "numbers", "", "", "of a plane, either way; required there"},
    {"/geometry/*/array/offset", read, "number", "", "m", "distance between copies; required with mesh_array"},
    {"/geometry/*/array/size", read, "counts", "", "", "copies along each axis; required with mesh_array"},
    {"/geometry/*/array/relative", read, "boolean", "false", "", "offset is in extents of the mesh"},
    {"/geometry/*/transformation/scale", read, "number or numbers", "1", "", "first: about the origin, one or one an axis",
     basic},
    {"/geometry/*/transformation/dimensions", read, "number or numbers", "", "m",
     "a list scales to these extents instead of `scale`; a number has no effect"},
    {"/geometry/*/transformation/rotation", read, "number or numbers", "", "deg",
     "second: about the origin; 2D: one angle, counter-clockwise; 3D: as rotation_mode says", basic},
    {"/geometry/*/transformation/rotation_mode", read, "string", "\"xyz\"", "",
     "order of rotations about axes (angles are listed by axis), or axis_angle, quaternion (x, y, z, w), rotation_vector"},
    {"/geometry/*/transformation/translation", read, "numbers", "", "m", "third", basic},
    {"/geometry/*/advanced/normalize_mesh", read, "boolean", "false", "",
     "before all that: moves and scales the mesh into the unit box"},
    {"/geometry/*/advanced/refinement_location", read, "number", "0.5", "",
     "where n_refs cuts an obstacle's edges, in (0, 1)"},
    {"/geometry/*/advanced/force_linear_geometry", read, "boolean", "false", "",
     "takes the corners of a second-order mesh whose edges are curved at rest by more than 1 % of their length"},
    {"/geometry/*/{volume,surface,point}_selection", read, "list", "", "",
     "ids of cells (which material), of boundary facets (which condition; for an obstacle one id), of boundary vertices "
     "(held by conditions): an id for all, or rules, of which the first that matches wins; names of the mesh file stay, its "
     "numbers where no rule gives others",
     basic},
    {"/geometry/*/{volume,surface,point}_selection/*", read, "id", "", "", "id of all, or a rule with an id and a region"},
    {SELECTION "/id", read, "id", "", "",
     "number or name, given to what the region contains: barycentres of cells and facets, positions of vertices; no "
     "condition acts on id 0",
     basic},
    {SELECTION "/id_offset", read, "integer", "0", "",
     "alone: added to ids of the file; with threshold: added to the side's number"},
    {SELECTION "/threshold", read, "number", "", "m",
     "sides of the mesh's box, nearer than this: left 1, bottom 2, right 3, top 4, back 5, front 6, the rest 7", basic},
    {SELECTION "/box", read, "points", "", "m", "region: [[lowest corner], [highest]]", basic},
    {SELECTION "/center", read, "numbers", "", "m", "region: sphere, with radius"},
    {SELECTION "/radius", read, "non_negative", "", "m", "of the sphere or cylinder"},
    {SELECTION "/{p1,p2}", read, "numbers", "", "m", "region: cylinder between two points, with radius"},
    {SELECTION "/axis", read, "axis", "", "",
     "region: beyond `position` on an axis, 1 to 3 or [+-]x, y, z; negative: before it"},
    {SELECTION "/position", read, "number", "", "m", "on that axis"},
    {SELECTION "/normal", read, "numbers", "", "", "region: half-space, with point or offset"},
    {SELECTION "/point", read, "numbers", "", "m", "of its plane"},
    {SELECTION "/offset", read, "number", "", "m", "point = offset * normal"},
    {SELECTION "/relative", read, "boolean", "false", "",
     "positions are 0 to 1 over the box of this mesh after its transformation; radii are in its diagonals"},

    {"/materials", read, "list", "", "",
     "of the bodies; an object instead of a list is for everything, whatever its id; required", basic},
    {"/materials/*", read, "", "", "", "one material"},
    {"/materials/*/type", read,
     "NeoHookean|LinearElasticity|HookeLinearElasticity|SaintVenant|FixedCorotational|MooneyRivlin|MooneyRivlin3Param", "",
     "", "the law, see docs/theory.md; required", basic},
    {"/materials/*/id", read, "id or ids", "0", "", "number or name of cells, as volume_selection or the mesh file gives it",
     basic},
    {"/materials/*/E", read, "number or expression", "", "Pa", "Young's modulus, > 0", basic},
    {"/materials/*/nu", read, "number or expression", "", "", "Poisson's ratio, in (-1, 0.5)", basic},
    {"/materials/*/{lambda,mu}", read, "number or expression", "", "Pa", "Lame's parameters, both, instead of E and nu"},
    {"/materials/*/rho", read, "number or expression", "1", "kg/m^3",
     "density, in 2D too; a warning where it is absent and matters", basic},
    {"/materials/*/plane_strain", read, "boolean", "false", "", "2D: plane strain; false: plane stress"},
    {"/materials/*/{c1,c2,c3,d1,k}", read, "number", "", "Pa", "of the Mooney-Rivlin laws"},

    {"/boundary_conditions/rhs", read, "vector", "[]", "m/s^2",
     "pushes in the NEGATIVE direction, as in PolyFEM: gravity that pulls down y is [0, 9.81]", basic},
    {"/boundary_conditions/dirichlet_boundary", read, "list", "[]", "", "prescribed displacements", basic},
    {"/boundary_conditions/neumann_boundary", read, "list", "[]", "", "tractions, by rest area", basic},
    {"/boundary_conditions/pressure_boundary", read, "list", "[]", "",
     "pressures on the deformed surface, positive against the outward normal"},
    {"/boundary_conditions/obstacle_displacements", read, "list", "[]", "", "motion of obstacles", basic},
    {CONDITIONS "/*", read, "", "", "", "one condition; of several with one id the first wins"},
    {CONDITIONS "/*/id", read, "id or all", "", "",
     "number or name, as surface_selection, point_selection or the mesh file gives it, or \"all\"", basic},
    {"/boundary_conditions/{dirichlet_boundary,obstacle_displacements}/*/value", read, "vector", "", "m",
     "displacement from rest at time t (not an increment)", basic},
    {"/boundary_conditions/neumann_boundary/*/value", read, "vector", "", "N/m^2",
     "in 2D on bodies one unit of length thick (1 m in SI units)", basic},
    {"/boundary_conditions/pressure_boundary/*/value", read, "number or expression", "", "N/m^2", "2D: N/m"},
    {"/boundary_conditions/dirichlet_boundary/*/dimension", read, "booleans", "(all true)", "",
     "which components are prescribed: [true, false] is a roller", basic},
    {CONDITIONS "/*/interpolation", read, "list", "[]", "",
     "factors of time g(t), one or one a component, that the value is multiplied by"},
    {INTERPOLATION "/type", read, "none|linear|linear_ramp|piecewise_constant|piecewise_linear|piecewise_cubic", "", "",
     "1, t, a ramp, or through points; required"},
    {INTERPOLATION "/from", read, "number", "0", "s", "where the ramp begins; g = 0 there"},
    {INTERPOLATION "/to", read, "number", "", "s", "where it ends; g = to - from from there on"},
    {INTERPOLATION "/points", read, "numbers", "", "s", "times, increasing"},
    {INTERPOLATION "/values", read, "numbers", "", "", "g at these times"},
    {INTERPOLATION "/extend", read, "constant|extrapolate|repeat|repeat_offset", "\"constant\"", "",
     "before the first and after the last"},
    {"/initial_conditions/{solution,velocity}", read, "list", "[]", "",
     "displacement [m] or velocity [m/s] of bodies at t0; 0 where nothing is said", basic},
    {"/initial_conditions/acceleration", read, "list", "[]", "m/s^2",
     "for Newmark; \"consistent\": that which the forces at the start give"},
    {"/initial_conditions/{solution,velocity}/*", read, "", "", "", "one body"},
    {"/initial_conditions/acceleration/*", read, "consistent", "", "", "one body, or the word"},
    {"/initial_conditions/{solution,velocity,acceleration}/*/id", read, "id", "", "", "of the body's cells; required"},
    {"/initial_conditions/solution/*/value", read, "vector", "", "m", "of rest position"},
    {"/initial_conditions/velocity/*/value", read, "vector", "", "m/s", "of rest position"},
    {"/initial_conditions/acceleration/*/value", read, "vector", "", "m/s^2", "of rest position"},

    {"/time", read, "", "(absent: one static solve)", "", "two of tend, dt and time_steps", basic},
    {"/time/t0", read, "number", "0", "s", "where time begins"},
    {"/time/tend", read, "number", "", "s", "where it ends; a warning where it is no multiple of dt", basic},
    {"/time/dt", read, "positive", "", "s", "step; half of it costs twice the steps, which converge faster", basic},
    {"/time/time_steps", read, "count", "", "", "number of steps"},
    {"/time/integrator", read, "ImplicitEuler|ImplicitNewmark|BDF|BDF1|BDF2|BDF3|BDF4|BDF5|BDF6", "\"ImplicitEuler\"", "",
     "implicit Euler damps motion faster than a step, BDF2 much less, Newmark not at all; or an object with type", basic},
    {"/time/integrator/type", read, "ImplicitEuler|ImplicitNewmark|BDF|BDF1|BDF2|BDF3|BDF4|BDF5|BDF6", "", "",
     "as above; required"},
    {"/time/integrator/steps", read, "count", "1", "", "order of BDF, 1 to 6"},
    {"/time/integrator/beta", read, "positive", "0.25", "", "of Newmark"},
    {"/time/integrator/gamma", read, "positive", "0.5", "", "of Newmark"},
    {"/time/integrator/energy_growth_limit", read, "positive", "0.05", "",
     "of Newmark: a step that would create more than this part of the energy is taken by implicit Euler"},
    {"/time/quasistatic", read, "boolean", "false", "", "no inertia: each step is an equilibrium", basic},
    {"/time/step_cuts", read, "natural", "0", "",
     "a step whose solve fails is cut in half, so many times over, at most 20; 0: the run stops"},

    {"/contact/enabled", read, "boolean", "false", "",
     "contact between all surfaces, of one body too; without it bodies pass through each other", basic},
    {"/contact/dhat", read, "positive or auto", "0.001", "m",
     "distance below which surfaces push each other; unless given, at most dhat_percentage of the shortest surface edge; "
     "smaller: nearer to hard contact, more Newton iterations; auto: small beside thicknesses, edges and gaps, as "
     "`itr explain` says",
     basic},
    {"/contact/dhat_percentage", read, "positive", "0.8", "", "see dhat"},
    {"/contact/epsv", read, "positive or auto", "0.001", "m/s",
     "sliding slower than this is smoothed to sticking; auto: a thousandth of the largest relative motion in a step without "
     "inertia, else by a speed of the scene, as `itr explain` says"},
    {"/contact/friction_coefficient", read, "non_negative", "0", "", "Coulomb's, of all pairs; 0: no friction is computed",
     basic},
    {"/contact/use_convergent_formulation", read, "boolean", "false", "",
     "weights pairs by area, so that barrier_stiffness is a pressure and results converge with the mesh", basic},
    {"/contact/collision_mesh", read, "", "", "", "another surface touches in place of the boundary; not with remeshing"},
    {"/contact/collision_mesh/enabled", read, "boolean", "true", "", "false: as if it were not there"},
    {"/contact/collision_mesh/mesh", read, "path", "", "",
     "surface, moved by the first geometry's transformation; required"},
    {"/contact/collision_mesh/linear_map", read, "path", "", "",
     "HDF5 file with weight_triplets/{values,rows,cols}: what a mesh vertex, or a node of quadratic elements, gives to a "
     "surface vertex; "
     "required"},

    {"/solver/max_threads", read, "natural", "0", "", "0: all; results do not depend on it; --threads wins"},
    {"/solver/lagging_tolerance", read, "non_negative", "0", "",
     "rounds of solves for friction, pressure and damping go on until no force at a vertex changes by more than this part "
     "of "
     "the largest; a step that does not get there is cut (step_cuts), or else a warning says so; 0: rounds by number"},
    {"/solver/rayleigh_damping", read, "list", "[]", "", "damping in proportion to the Hessian of a term"},
    {"/solver/rayleigh_damping/*/form", read, "elasticity|contact", "", "", "of which term; required"},
    {"/solver/rayleigh_damping/*/stiffness", read, "non_negative", "", "s", "coefficient"},
    {"/solver/rayleigh_damping/*/stiffness_ratio", read, "non_negative", "", "1/s^2",
     "instead: coefficient = 3/4 ratio dt^3"},
    {"/solver/rayleigh_damping/*/lagging_iterations", read, "count", "1", "", "rounds in which the Hessian is taken anew"},

    {"/solver/linear/solver", read, "names", "\"eigen\"", "",
     "`itr solvers` lists them; of a list the first that is there; PolyFEM's names are understood; --solver wins", basic},
    {"/solver/linear/fallback", read, "names", "[]", "", "solvers that take over where that one fails"},
    {"/solver/linear/options", read, "object", "{}", "",
     "by solver, then by option: {\"cholmod\": {\"ordering\": \"metis\"}}"},

    {"/solver/contact/barrier_stiffness", read, "positive, auto or adaptive", "\"adaptive\"", "",
     "kappa: [Pa] with use_convergent_formulation; auto: from the stiffest body and dhat (docs/theory.md; `itr run` and "
     "`itr "
     "explain` print it); adaptive: follows the forces, as PolyFEM does; larger: wider gaps, fewer iterations"},
    {"/solver/contact/initial_barrier_stiffness", read, "positive", "1", "", "where adaptive stiffness begins"},
    {"/solver/contact/friction_iterations", read, "integer", "1", "",
     "solves a step, each with friction's normal forces of the one before; negative: until they agree; 0: no friction"},
    {"/solver/contact/friction_convergence_tol", read, "non_negative", "0.01", "N s", "when they agree, times dt"},

    {"/solver/nonlinear/max_iterations", read, "count", "3000", "",
     "of Newton's method in a solve; more than that: it failed"},
    {"/solver/nonlinear/force_tol", read, "non_negative", "1e-9", "",
     "converged: forces that are left below this part of the forces that act; not with a tolerance of gradients"},
    {"/solver/nonlinear/x_delta", read, "non_negative", "0", "m/s",
     "converged: Newton step shorter than this times dt (norm over all)"},
    {"/solver/nonlinear/grad_norm", read, "non_negative", "", "N s",
     "converged: gradient of the step's energy smaller than this times dt; any of x_delta, grad_norm, f_delta chooses these "
     "tolerances, which PolyFEM's paper version has, in place of those that follow"},
    {"/solver/nonlinear/{f_delta,advanced/f_delta}", read, "non_negative", "0", "J s",
     "converged: energy changed by less than this times dt, f_delta_step_tol times in a row"},
    {"/solver/nonlinear/x_delta_tol", read, "non_negative", "0", "",
     "converged: step below this, times scales that norm_type says (docs/theory.md)"},
    {"/solver/nonlinear/grad_norm_tol", read, "non_negative", "", "", "converged: gradient below this times such scales"},
    {"/solver/nonlinear/rel_grad_norm_tol", read, "non_negative", "", "", "of the solve's first gradient"},
    {"/solver/nonlinear/rel_x_delta_tol", read, "non_negative", "0", "", "of the solve's first step"},
    {"/solver/nonlinear/newton_decrement_tol", read, "non_negative", "0", "J s^2", "converged: a full step promises less"},
    {"/solver/nonlinear/norm_type", read, "L2|Linf|Euclidean", "\"L2\"", "", "L2 and Linf do not depend on the mesh"},
    {"/solver/nonlinear/{first_grad_norm_tol,advanced/first_grad_norm_tol}", read, "non_negative", "", "",
     "nothing is solved where the gradient is below it at the start"},
    {"/solver/nonlinear/iterations_per_strategy", read, "count", "4", "",
     "one less than the iterations with projection before the true Hessian is tried again"},
    {"/solver/nonlinear/advanced/f_delta_tol", read, "non_negative", "0", "J s^2", "as f_delta, not times dt"},
    {"/solver/nonlinear/advanced/f_delta_step_tol", read, "count", "100", "", "see f_delta"},
    {"/solver/nonlinear/Newton/use_psd_projection", read, "boolean", "true", "",
     "make Hessians definite where the sum is not; where it is indefinite, look for a minimum, or take its direction if it "
     "descends, as PolyFEM does, where the list of solvers begins with Eigen::...LDLT"},
    {"/solver/nonlinear/Newton/force_psd_projection", read, "boolean", "false", "", "in every iteration"},

    {"/solver/advanced/lump_mass_matrix", read, "boolean", "false", "", "mass in the vertices"},
    {"/solver/advanced/lagged_load_tolerance", read, "positive", "0.01", "",
     "pressure on a boundary that is not closed may end so much of itself off that of the positions it acts on; a step "
     "fails else"},
    {"/solver/advanced/characteristic_length", read, "number", "-1", "m",
     "scale of tolerances *_tol; not positive: diagonal of the bodies' box"},
    {"/solver/advanced/characteristic_force_density", read, "positive", "1e4", "N/m^3", "scale of grad_norm_tol"},

    {"/space/discr_order", read, "order", "1", "",
     "1: linear elements, 2: quadratic ones (curved edges); or a list by body, [{\"id\": 2, \"order\": 2}], bodies that are "
     "not listed are linear. An edge has the least order of the cells at it",
     basic},
    {"/space/advanced/quadrature_order", read, "integer", "-1", "",
     "degree of elasticity's quadrature on quadratic elements, 1 to 5; -1: 2, and the mass' is exact"},

    {"/space/remesh/enabled", read, "boolean", "false", "", "in-timestep remeshing", basic},
    {"/space/remesh/type", read, "physics|sizing_field", "\"physics\"", "",
     "what decides about splits and collapses: energies, or lengths of edges, the baseline that the paper compares with "
     "(docs/theory.md)"},
    {"/space/remesh/sizing_field/rel_min_edge_length", read, "non_negative", "0.01", "",
     "shorter edges are not split, in longest sides of the bodies' box: in contact nothing else ends it"},
    {"/space/remesh/screening", read, "energy-percentile|bounds", "\"bounds\"", "",
     "which edges are tried and what decides: those at the top by energy, by patches that relax (the paper); every edge, by "
     "what one vertex alone gains and by patches where that does not tell"},
    {"/space/remesh/relative_tolerance", read, "positive", "1e-4", "",
     "chooses split and collapse tolerances where split/acceptance_tolerance is not given: this part of the energy that is "
     "stored so far, or that the scene has (docs/theory.md); `itr run` and `itr explain` print them",
     basic},
    {"/space/remesh/split/enabled", read, "boolean", "true", "", ""},
    {"/space/remesh/split/acceptance_tolerance", read, "positive", "(relative_tolerance chooses)", "J",
     "least decrease of energy by a split, 2D: for a thickness of one unit of length (1 m in SI units); smaller: more "
     "vertices, smaller error; time goes with the vertices",
     basic},
    {"/space/remesh/split/culling_threshold", read, "share", "0.95", "",
     "with energy-percentile: edges below this share of the energies are not split"},
    {"/space/remesh/split/max_depth", read, "natural", "3", "", "generations of one edge a step"},
    {"/space/remesh/split/min_edge_length", read, "non_negative", "(1e-6 of the bodies' diagonal)", "m",
     "shorter edges are not split"},
    {"/space/remesh/curve/enabled", read, "boolean", "false", "",
     "edges become curved (quadratic elements, edge by edge) where that gains more for each new node than a split; without "
     "this key only where straight ones keep up a slender body that would buckle, in statics; false: never",
     basic},
    {"/space/remesh/curve/acceptance_tolerance", read, "positive", "(that of splits)", "J",
     "least decrease of energy by making an edge curved"},
    {"/space/remesh/straighten/enabled", read, "boolean", "(that of curve)", "",
     "curved edges become straight again where that costs next to nothing; a step that distorted curved cells stop is taken "
     "again with straight ones in any case"},
    {"/space/remesh/straighten/acceptance_tolerance", read, "number", "(that of collapses)", "J",
     "negative: increase of energy that straightening an edge may cost"},
    {"/space/remesh/collapse/enabled", read, "boolean", "true", "", ""},
    {"/space/remesh/collapse/acceptance_tolerance", read, "number", "(-1/100 of the split tolerance)", "J",
     "negative: increase of energy that a collapse may cost; nearer to 0, what contact has left behind stays fine"},
    {"/space/remesh/collapse/culling_threshold", read, "share", "0.01", "",
     "with energy-percentile: edges above this share are not collapsed"},
    {"/space/remesh/collapse/rel_max_edge_length", read, "non_negative", "1", "",
     "longest edge collapsed, in shortest edges of the initial mesh: at 1 the input mesh is never coarsened"},
    {"/space/remesh/swap/enabled", read, "boolean", "false", "", "edge swaps: better shapes, some more time"},
    {"/space/remesh/swap/acceptance_tolerance", read, "number", "(-1e-6 of the split tolerance)", "J",
     "as for collapses; of swaps that better the shape"},
    {"/space/remesh/smooth/enabled", read, "boolean", "false", "",
     "moves of vertices at rest: better shapes, some more time"},
    {"/space/remesh/smooth/acceptance_tolerance", read, "number", "(-1e-6 of the split tolerance)", "J",
     "as for collapses; of moves that better the shape"},

    {"/output/directory", read, "string", "\"\"", "", "result folder; -o wins; default: results/ and the name of the scene",
     basic},
    {"/output/units", read, "scene|SI", "\"scene\"", "", "of the results: those of /units, or SI units"},
    {"/output/checkpoint_period", read, "non_negative", "30", "",
     "seconds of the clock between states that --resume can go on from; 0: all frames"},
    {"/output/forces", read, "list", "[]", "",
     "curves of forces: forces.csv gets, by step, force and moment of contact, friction, reactions and all of them"},
    {"/output/forces/*", read, "", "", "", "one curve: of all vertices that it names, each once"},
    {"/output/forces/*/name", read, "string", "", "", "required"},
    {"/output/forces/*/surfaces", read, "id or ids", "", "",
     "as surface_selection or the mesh file gives them: what acts on these surfaces"},
    {"/output/forces/*/bodies", read, "id or ids", "", "",
     "as volume_selection or the mesh file gives them, or names of geometries: what acts on these bodies"},
    {"/output/forces/*/obstacles", read, "id or ids", "", "",
     "ids of surface_selection, or names: what bodies do to these obstacles"},
    {"/output/forces/*/about", read, "numbers", "(the origin)", "m", "what moments are about"},
    {"/output/paraview/skip_frame", read, "count", "1", "", "store every n-th step", basic},
    {"/output/paraview/vtu", read, "boolean", "false", "", "stored frames as vtu/NNNNNN.vtu too, and sim.pvd, their series"},
    {"/output/paraview/options/contact_forces", read, "boolean", "false", "N", "frames get /fields/contact_force", basic},
    {"/output/paraview/options/friction_forces", read, "boolean", "false", "N", "/fields/friction_force"},
    {"/output/paraview/options/reaction_forces", read, "boolean", "false", "N",
     "/fields/reaction_force: of what holds a vertex in its prescribed directions", basic},
    {"/output/paraview/options/scalar_values", read, "boolean", "false", "Pa", "/fields/von_mises, a cell", basic},
    {"/output/paraview/options/tensor_values", read, "boolean", "false", "Pa",
     "/fields/stress, Cauchy's, a cell, row by row", basic},
    {"/output/paraview/options/kinetic_energy", read, "boolean", "false", "J", "/totals/kinetic_energy"},
    {"/output/paraview/options/momentum", read, "boolean", "false", "kg m/s", "/totals/momentum"},
};

constexpr RefusedValue kRefusedValues[] = {
    {"/geometry/*/type", "mesh_sequence"},
    {"/space/discr_order", "3 and above"},
};

#undef SELECTION
#undef CONDITIONS
#undef INTERPOLATION

}  // namespace

std::span<const Key> keys() {
  static const Json unread = Json::parse(kUnreadKeys);
  static std::list<std::string> values;
  static const std::vector<Key> all = [] {
    const std::map<std::string, Role> roles = {
        {"ignored", ignored}, {"unwritten", unwritten}, {"only", only}, {"refused", refused}, {"removed", removed}};
    std::vector<Key> rows(std::begin(kKeys), std::end(kKeys));
    for (const Json& row : unread) {
      const auto text = [&](const char* name) { return row.at(name).get_ref<const std::string&>().c_str(); };
      values.push_back(row.contains("value") ? row["value"].dump() : "");
      rows.push_back({text("keys"), roles.at(text("role")), "", values.back().c_str(), "", text("reason")});
    }
    return rows;
  }();
  return all;
}

std::span<const RefusedValue> refused_values() { return kRefusedValues; }

}  // namespace itr::scene
