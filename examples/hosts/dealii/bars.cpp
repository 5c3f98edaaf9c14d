// SPDX-License-Identifier: MIT
// Thermoelastic contact: two bars between rigid walls, of which the upper one is hot, grow until they touch; then heat flows
// from one to the other, by h = c p where ITR presses them on each other with the pressure p. This program solves for the
// temperature by deal.II on ITR's mesh. ITR has the strain of heat, does the contact and refines the mesh where that gains
// energy; the temperature follows by ITR's L2 transfer. Flux and pressure are compared with the closed form.
#include <deal.II/dofs/dof_handler.h>
#include <deal.II/dofs/dof_tools.h>
#include <deal.II/fe/fe_simplex_p.h>
#include <deal.II/fe/fe_values.h>
#include <deal.II/fe/mapping_fe.h>
#include <deal.II/grid/tria.h>
#include <deal.II/lac/dynamic_sparsity_pattern.h>
#include <deal.II/lac/precondition.h>
#include <deal.II/lac/solver_cg.h>
#include <deal.II/lac/sparse_matrix.h>
#include <deal.II/lac/vector.h>
#include <deal.II/numerics/matrix_tools.h>

#include <cmath>
#include <cstdio>
#include <itr/itr.hpp>

namespace {

using Point = dealii::Point<2>;

constexpr double kWidth = 0.1, kGap = 1e-5;               // of the bars, between them [m]
constexpr double kLength[] = {0.15, 0.2};                 // lower and upper bar [m]
constexpr double kYoung = 1e6, kPoisson = 0.3;            // [Pa]
constexpr double kConductivity[] = {50, 15};              // [W/m/K]
constexpr double kWall[] = {20, 120};                     // temperatures of the lower and the upper one [C]
constexpr int kBoundary[] = {1, 2};                       // their ids
constexpr double kCapacity = 2e6;                         // by rest volume [J/m^3/K]
constexpr double kExpansion = 2e-4, kConductance = 1e-1;  // alpha [1/K], c of h = c p [W/N/K]

/// Linear elements on the present shape of ITR's mesh, with ITR's vertex numbers.
class Heat {
 public:
  explicit Heat(itr::AnySimulation& simulation) : simulation_(simulation), temperature_(simulation.num_vertices()) {
    temperature_ = kWall[0];
    content_ = content();
    simulation.watch_forces(true);
    simulation.on_mesh_change([this](const itr::AnyMeshChange& change) {
      itr::MatrixX field = Eigen::Map<const itr::VectorX>(temperature_.begin(), temperature_.size());
      field = change.project(field);
      temperature_.reinit(static_cast<unsigned>(field.size()));
      std::copy(field.data(), field.data() + field.size(), temperature_.begin());
      std::printf("  %d vertices; heat content %.9e J/m before the transfer, %.9e after\n", simulation_.num_vertices(),
                  content_, content());
      transfer_error_ = std::max(transfer_error_, std::abs(content() / content_ - 1));
    });
  }

  /// Finds the steady temperature. Returns the heat flux into the upper bar by width [W/m^2].
  double solve() {
    discretise();
    dealii::SparseMatrix<double> matrix(pattern_);
    add_conduction(matrix);
    for (const Pair& pair : pairs_)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          matrix.add(dof_[pair.vertices[i]], dof_[pair.vertices[j]], pair.conductance * pair.weights[i] * pair.weights[j]);
    dealii::SparseMatrix<double> whole(pattern_);
    whole.copy_from(matrix);
    dealii::Vector<double> T(temperature_.size()), load(T.size());
    std::map<dealii::types::global_dof_index, double> held;
    const std::vector<int> facets = simulation_.facets(), boundaries = simulation_.facet_boundaries();
    for (std::size_t i = 0; i < facets.size(); ++i)
      for (int wall = 0; wall < 2; ++wall)
        if (boundaries[i / 2] == kBoundary[wall]) held[dof_[facets[i]]] = kWall[wall];
    dealii::MatrixTools::apply_boundary_values(held, matrix, T, load);
    dealii::SolverControl control(1000, 1e-12 * load.l2_norm());
    dealii::PreconditionSSOR<dealii::SparseMatrix<double>> ssor;
    ssor.initialize(matrix, 1.2);
    dealii::SolverCG<dealii::Vector<double>>(control).solve(matrix, T, load, ssor);
    for (unsigned v = 0; v < T.size(); ++v) temperature_[v] = T[dof_[v]];
    content_ = content();
    whole.vmult(load, T);
    double flux = 0;
    for (const auto& [dof, value] : held)
      if (value == kWall[1]) flux += load[dof];
    return flux / kWidth;
  }

  /// Strain of heat, by vertex.
  std::vector<double> strains() const {
    std::vector<double> strains;
    for (const double T : temperature_) strains.push_back(kExpansion * (T - kWall[0]));
    return strains;
  }
  double transfer_error() const { return transfer_error_; }

 private:
  /// A vertex and the two of the nearest facet of another body; `weights` times temperatures is the jump.
  struct Pair {
    int vertices[3];
    double weights[3];
    double conductance;  ///< [W/K], in 2D [W/m/K]
  };

  Point position(int v) const { return {simulation_.positions()[2 * v], simulation_.positions()[2 * v + 1]}; }

  /// Heat content above 0 C, in 2D [J/m].
  double content() const {
    const std::vector<int> cells = simulation_.cells();
    const std::vector<double> X = simulation_.rest_positions();
    double sum = 0;
    for (std::size_t c = 0; c < cells.size(); c += 3) {
      const auto edge = [&](int i, int k) { return X[2 * cells[c + i] + k] - X[2 * cells[c] + k]; };
      const double area = (edge(1, 0) * edge(2, 1) - edge(1, 1) * edge(2, 0)) / 2;
      for (int i = 0; i < 3; ++i) sum += kCapacity * area / 3 * temperature_[cells[c + i]];
    }
    return sum;
  }

  void discretise() {
    std::vector<Point> points;
    for (int v = 0; v < simulation_.num_vertices(); ++v) points.push_back(position(v));
    const std::vector<int> cells = simulation_.cells(), bodies = simulation_.bodies();
    std::vector<dealii::CellData<2>> data(bodies.size(), dealii::CellData<2>(3));
    for (std::size_t c = 0; c < data.size(); ++c) {
      std::copy_n(cells.begin() + 3 * c, 3, data[c].vertices.begin());
      data[c].material_id = bodies[c];
    }
    dofs_.clear();
    triangulation_.clear();
    triangulation_.create_triangulation(points, data, {});
    dofs_.reinit(triangulation_);
    dofs_.distribute_dofs(element_);
    dof_.resize(points.size());
    for (const auto& cell : dofs_.active_cell_iterators())
      for (const unsigned i : cell->vertex_indices()) dof_[cell->vertex_index(i)] = cell->vertex_dof_index(i, 0);
    find_pairs();
    dealii::DynamicSparsityPattern pattern(dofs_.n_dofs());
    dealii::DoFTools::make_sparsity_pattern(dofs_, pattern);
    for (const Pair& pair : pairs_)
      for (const int i : pair.vertices)
        for (const int j : pair.vertices) pattern.add(dof_[i], dof_[j]);
    pattern_.copy_from(pattern);
  }

  void add_conduction(dealii::SparseMatrix<double>& matrix) const {
    dealii::FEValues<2> values(mapping_, element_, dealii::QGaussSimplex<2>(1),
                               dealii::update_gradients | dealii::update_JxW_values);
    std::vector<dealii::types::global_dof_index> ids(3);
    for (const auto& cell : dofs_.active_cell_iterators()) {
      values.reinit(cell);
      cell->get_dof_indices(ids);
      const double k = kConductivity[cell->material_id()];
      for (const unsigned q : values.quadrature_point_indices())
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j)
            matrix.add(ids[i], ids[j], k * values.shape_grad(i, q) * values.shape_grad(j, q) * values.JxW(q));
    }
  }

  /// Each pressed vertex conducts through half of its area to the nearest point of the other body, so that both sides have
  /// their half.
  void find_pairs() {
    const std::vector<double> pressure = simulation_.contact_pressure();
    const itr::VectorX& force = simulation_.forces().contact;
    const std::vector<int> facets = simulation_.facets(), cells = simulation_.cells(), bodies = simulation_.bodies();
    std::vector<int> body(pressure.size());
    for (std::size_t i = 0; i < cells.size(); ++i) body[cells[i]] = bodies[i / 3];
    pairs_.clear();
    for (int v = 0; v < simulation_.num_vertices(); ++v) {
      if (pressure[v] <= 0) continue;
      const double area = force.segment<2>(2 * v).norm() / pressure[v], h = kConductance * pressure[v];
      double nearest = std::numeric_limits<double>::infinity();
      Pair pair{};
      for (std::size_t f = 0; f < facets.size(); f += 2) {
        const int a = facets[f], b = facets[f + 1];
        if (body[a] == body[v]) continue;
        const auto along = position(b) - position(a), to = position(v) - position(a);
        const double t = std::clamp(to * along / along.norm_square(), 0.0, 1.0);
        const double distance = (to - t * along).norm();
        if (distance < nearest) pair = {{v, a, b}, {1, t - 1, -t}, h * area / 2}, nearest = distance;
      }
      pairs_.push_back(pair);
    }
  }

  itr::AnySimulation& simulation_;
  dealii::FE_SimplexP<2> element_{1};
  dealii::MappingFE<2> mapping_{element_};
  dealii::Triangulation<2> triangulation_;
  dealii::DoFHandler<2> dofs_;
  dealii::SparsityPattern pattern_;
  std::vector<dealii::types::global_dof_index> dof_;  ///< by vertex
  std::vector<Pair> pairs_;
  dealii::Vector<double> temperature_;  ///< by vertex
  double content_ = 0, transfer_error_ = 0;
};

itr::Model bars(bool remesh) {
  std::vector<double> vertices;
  std::vector<int> cells, bodies;
  const int columns[] = {5, 4}, rows[] = {7, 9};
  for (int body = 0; body < 2; ++body) {
    const int n = columns[body] + 1, first = static_cast<int>(vertices.size()) / 2;
    for (int j = 0; j <= rows[body]; ++j)
      for (int i = 0; i < n; ++i)
        vertices.insert(vertices.end(),
                        {kWidth * i / columns[body], kLength[body] * j / rows[body] + body * (kLength[0] + kGap)});
    for (int j = 0; j < rows[body]; ++j)
      for (int i = 0; i < n - 1; ++i) {
        const int a = first + j * n + i, d = a + n;
        cells.insert(cells.end(), {a, a + 1, d + 1, a, d + 1, d});
        bodies.insert(bodies.end(), 2, body);
      }
  }
  itr::Model model(2);
  model.set_mesh(vertices, cells, bodies);
  const double top = vertices.back();
  model.add_boundary("lower wall", [](const double* X) { return X[1] < 1e-9; });
  model.add_boundary("upper wall", [=](const double* X) { return X[1] > top - 1e-9; });
  model.add_boundary("sides", [](const double* X) { return std::min(X[0], kWidth - X[0]) < 1e-9; });
  model.set_options(R"({"materials": {"type": "LinearElasticity", "E": 1e6, "nu": 0.3, "rho": 1000},
    "time": {"dt": 1, "time_steps": 1, "quasistatic": true}, "contact": {"enabled": true, "dhat": 1e-5}})");
  model.set_option("/space/remesh", remesh ? R"({"enabled": true, "split": {"acceptance_tolerance": 1e-8}})" : "{}");
  return model;
}

struct Steady {
  double flux, pressure;  ///< [W/m^2], [Pa]
  /// The larger relative difference.
  double off(const Steady& other) const {
    return std::max(std::abs(flux / other.flux - 1), std::abs(pressure / other.pressure - 1));
  }
};

/// Flux and pressure by bisection for p. The law is linear, the sides slide on walls, stress is plane; surfaces that touch
/// stay apart by less than kGap, which is not known better.
Steady closed_form() {
  double low = 0, high = kYoung, flux = 0;
  for (int i = 0; i < 100; ++i) {
    const double p = (low + high) / 2, compression = p * (1 - kPoisson * kPoisson) / kYoung;
    double lower = kLength[0], upper = kLength[1];  // as they are now
    for (int round = 0; round < 30; ++round) {
      flux = (kWall[1] - kWall[0]) / (lower / kConductivity[0] + 1 / (kConductance * p) + upper / kConductivity[1]);
      const double by_lower = flux * lower / kConductivity[0], by_upper = flux * upper / kConductivity[1];  // drops [K]
      const double expansion = (1 + kPoisson) * kExpansion;
      lower = kLength[0] * (1 + expansion * by_lower / 2 - compression);
      upper = kLength[1] * (1 + expansion * (kWall[1] - kWall[0] - by_upper / 2) - compression);
    }
    (lower + upper - kLength[0] - kLength[1] > kGap ? low : high) = p;
  }
  return {flux, low};
}

Steady run(bool remesh) {
  itr::AnySimulation simulation(bars(remesh));
  const auto rest = [](const double*, double, double* u) { u[0] = u[1] = 0; };
  const std::vector<int> all = {1, 1}, across = {1, 0};
  for (const char* wall : {"lower wall", "upper wall"}) simulation.fix(wall, all, rest);
  simulation.fix("sides", across, rest);
  Heat heat(simulation);
  double flux = 0, pressure = 0;
  for (int i = 0; i < 20; ++i) {
    if (const auto result = simulation.step(1); !result.ok) throw std::runtime_error(result.reason);
    const double before = flux;
    flux = heat.solve();
    pressure = std::abs(simulation.resultant("upper wall").force[1]) / kWidth;
    std::printf("step %2d: %4d vertices, flux %9.3f W/m^2, pressure %8.3f Pa\n", i, simulation.num_vertices(), flux,
                pressure);
    if (i > 2 && std::abs(flux - before) < 1e-6 * flux) break;
    simulation.set_eigenstrain(heat.strains());
  }
  if (heat.transfer_error() > 1e-12) throw std::runtime_error("the transfer lost heat");
  if (remesh && simulation.num_vertices() < 150) throw std::runtime_error("the mesh was hardly refined");
  return {flux, pressure};
}

}  // namespace

int main() try {
  const Steady fixed = run(false), remeshed = run(true), expected = closed_form();
  std::printf("closed form: flux %.3f W/m^2, pressure %.3f Pa\noff it by %.1e, remeshed by %.1e; apart by %.1e\n",
              expected.flux, expected.pressure, fixed.off(expected), remeshed.off(expected), remeshed.off(fixed));
  return std::max(fixed.off(expected), remeshed.off(expected)) < 1e-3 ? 0 : 1;
} catch (const std::exception& error) {
  return std::fprintf(stderr, "bars: %s\n", error.what()), 2;
}
