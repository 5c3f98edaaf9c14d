// SPDX-License-Identifier: MIT
// A term of the program's own: soft springs from the bottom of a block to the ground (a Winkler foundation), as a sum over
// boundary facets. The remesher sees it as it sees the library's terms: it is asked for patches too.
#include <cstdio>
#include <itr/itr.hpp>

namespace {

constexpr double kStiffness = 2e5;  // [N/m^3]
constexpr int kBottom = 1;

/// scale * k/2 * integral over the facets of a tag of |x - X|^2, by the trapezoidal rule.
class Foundation final : public itr::Energy {
 public:
  Foundation(const itr::CellSet<2>& cells, double scale) : cells_(cells) {
    for (const auto& facet : cells.facets)
      if (facet.tag == kBottom) {
        const auto [a, b] = facet.vertices;
        const double weight = scale * kStiffness * (cells.rest[a] - cells.rest[b]).norm() / 2;
        springs_.insert(springs_.end(), {{a, weight}, {b, weight}});
      }
  }
  std::string_view name() const override { return "foundation"; }
  double value(itr::ConstVectorView x, itr::Workspace&) const override {
    double sum = 0;
    for (const auto& [v, k] : springs_) sum += k / 2 * (x.segment<2>(2 * v) - cells_.rest[v]).squaredNorm();
    return sum;
  }
  void add_gradient(itr::ConstVectorView x, itr::VectorView g, itr::Workspace&) const override {
    for (const auto& [v, k] : springs_) g.segment<2>(2 * v) += k * (x.segment<2>(2 * v) - cells_.rest[v]);
  }
  void add_hessian(itr::ConstVectorView, itr::PsdProjection, itr::HessianSink& sink, itr::Workspace&) const override {
    for (const auto& [v, k] : springs_) {
      const itr::Mat<2> block = k * itr::Mat<2>::Identity();
      sink.add<2>(std::array{v}, block.data());
    }
  }

 private:
  const itr::CellSet<2>& cells_;
  std::vector<std::pair<int, double>> springs_;
};

}  // namespace

int main() try {
  itr::Model model(2);
  std::vector<double> vertices;
  std::vector<int> cells;
  for (int i = 0; i < 25; ++i) vertices.insert(vertices.end(), {i % 5 / 4.0, i / 5 / 4.0});
  for (int i = 0; i < 20; ++i)
    if (i % 5 < 4) cells.insert(cells.end(), {i, i + 1, i + 6, i, i + 6, i + 5});
  model.set_mesh(vertices, cells);
  model.add_boundary("bottom", std::array{0.0, 0.0}, std::array{1.0, 0.0});  // the first one: its id is kBottom
  model.set_options(R"({"materials": {"type": "NeoHookean", "E": 1e6, "nu": 0.3, "rho": 2000},
    "time": {"dt": 1, "time_steps": 2, "quasistatic": true},
    "boundary_conditions": {"rhs": [0, 9.81]},
    "space": {"remesh": {"enabled": true, "split": {"acceptance_tolerance": 0.5}}}})");
  itr::AnySimulation simulation(model);
  simulation.as<2>().conditions().terms.push_back(
      [](const itr::CellSet<2>& cells_of_scope, double, double scale) -> std::shared_ptr<const itr::Energy> {
        return std::make_shared<Foundation>(cells_of_scope, scale);
      });
  while (!simulation.finished())
    if (const auto result = simulation.step(); !result.ok) return std::printf("%s\n", result.reason.c_str()), 1;
  double lowest = 0;
  for (std::size_t i = 1; i < simulation.positions().size(); i += 2) lowest = std::min(lowest, simulation.positions()[i]);
  const double expected = -2000 * 9.81 / kStiffness;  // weight by stiffness
  std::printf("%d vertices; sinks %.4f m, by its weight %.4f m\n", simulation.num_vertices(), lowest, expected);
  return std::abs(lowest / expected - 1) < 0.1 ? 0 : 1;
} catch (const itr::InputError& error) {
  return std::fprintf(stderr, "own_energy_term: %s\n", error.what()), 2;
}
