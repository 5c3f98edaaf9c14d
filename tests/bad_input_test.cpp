// SPDX-License-Identifier: MIT
// Wrong input of a program gets the same error through C++ and C as through Python: the cases "api" of
// texts.txt.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <map>

#include "block.hpp"
#include "itr/itr.h"
#include "itr/itr.hpp"

namespace itr {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr const char* kOptions = R"({"materials": {"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000},
  "time": {"dt": 0.01, "time_steps": 10}, "contact": {"enabled": true, "dhat": 1e-3}})";
const std::array<double, 4> kWall{1, 0, 1, 1};
const std::array<int, 2> kEdge{0, 1}, kMask{1, 1};
const std::array<double, 2> kOrigin{0, 0};

struct Block {
  std::vector<double> vertices;
  std::vector<int> cells;
  Block() {
    const Mesh<2> mesh = make_block<2>();
    for (int v = 0; v < mesh.node_slots(); ++v) vertices.insert(vertices.end(), mesh.rest(v).begin(), mesh.rest(v).end());
    for (int c = 0; c < mesh.cell_slots(); ++c) cells.insert(cells.end(), mesh.cell(c).begin(), mesh.cell(c).end());
  }
};

struct NoLaw final : OwnLaw {
  double density(const Eigen::Ref<const MatrixX>&) const override { return 0; }
  void stress(const Eigen::Ref<const MatrixX>&, Eigen::Ref<MatrixX>) const override {}
  void hessian(const Eigen::Ref<const MatrixX>&, Eigen::Ref<MatrixX>) const override {}
};

/// As many numbers as asked for, the fourth (of less: the second) of which is none.
std::vector<double> with_nan(std::size_t size) {
  std::vector<double> values(size, 0.1);
  values[size > 4 ? 3 : 1] = kNan;
  return values;
}

Model make_model(const Block& block = {}) {
  Model model(2);
  model.set_mesh(block.vertices, block.cells);
  model.add_boundary("left", kOrigin, std::array{0.0, 1.0});
  model.add_obstacle("wall", kWall, kEdge);
  model.set_options(kOptions);
  return model;
}

struct Handles {
  itr_model* model = itr_model_create(2);
  itr_simulation* simulation = nullptr;
  Handles() = default;
  Handles(const Handles&) = delete;
  ~Handles() {
    itr_simulation_destroy(simulation);
    itr_model_destroy(model);
  }
  itr_status create() { return itr_simulation_create(model, nullptr, nullptr, &simulation); }
};

itr_status make(itr_model* model, const Block& block = {}) {
  const double high[] = {0, 1};
  itr_status status = itr_model_set_mesh(model, block.vertices.size() / 2, block.vertices.data(), block.cells.size() / 3,
                                         block.cells.data(), nullptr);
  if (!status) status = itr_model_add_boundary_box(model, "left", kOrigin.data(), high, nullptr);
  if (!status) status = itr_model_add_obstacle(model, "wall", 2, kWall.data(), 1, kEdge.data(), 0, nullptr, nullptr);
  return status ? status : itr_model_set_options(model, kOptions);
}

// --- what is said -------------------------------------------------------------------------------------------------

std::string cpp_says(const std::function<void()>& f) {
  try {
    f();
  } catch (const InputError& error) {
    return error.what();
  }
  return "nothing";
}
/// Message of a model that is changed, or of its simulation.
std::string cpp_model(const std::function<void(Model&)>& f) {
  return cpp_says([&] {
    Model model = make_model();
    f(model);
    AnySimulation simulation(model);
  });
}
std::string cpp_step(const std::function<void(AnySimulation&)>& f) {
  AnySimulation simulation(make_model());
  return cpp_says([&] { f(simulation); });
}
std::string c_says(itr_status status, const char* message) {
  EXPECT_TRUE(status == ITR_SUCCESS || status == ITR_BAD_INPUT) << status;
  return status == ITR_BAD_INPUT ? message : "nothing";
}
std::string c_model(const std::function<itr_status(itr_model*)>& f, const Block& block = {}) {
  Handles handles;
  itr_status status = make(handles.model, block);
  if (!status) status = f(handles.model);
  if (!status) status = handles.create();
  return c_says(status, itr_model_message(handles.model));
}
std::string c_step(const std::function<itr_status(itr_simulation*)>& f) {
  Handles handles;
  EXPECT_EQ(make(handles.model), ITR_SUCCESS);
  EXPECT_EQ(handles.create(), ITR_SUCCESS) << itr_model_message(handles.model);
  const itr_status status = f(handles.simulation);
  return c_says(status, itr_simulation_message(handles.simulation));
}

struct Says {
  std::string cpp, c;
};
Says of_block(const std::function<void(Block&)>& change) {
  Block block;
  change(block);
  return {cpp_says([&] { AnySimulation simulation(make_model(block)); }),
          c_model([](itr_model*) { return ITR_SUCCESS; }, block)};
}
Says of_option(const char* pointer, const char* value) {
  return {cpp_model([&](Model& m) { m.set_option(pointer, value); }),
          c_model([&](itr_model* m) { return itr_model_set_option(m, pointer, value); })};
}

void fall(size_t, const double*, const double*, double, double*, void*) {}
void bad_forces(size_t, const double*, const double*, double, double* f, void*) { f[3] = kNan; }
void bad_stiffness(size_t, const double*, const double*, double, itr_block_receiver add, void* to, void*) {
  const int vertex = 16;
  const double block[4] = {};
  add(to, 1, &vertex, block);
}

/// One for each case "api" of texts.txt.
std::map<std::string, Says> all_cases() {
  const std::vector<double> nans = with_nan(32), pressures = with_nan(16), wall = with_nan(4);
  const std::array facet{0, 16}, inner{0, 5}, edge{0, 2};
  const std::array low{5.0, 5.0}, high{6.0, 6.0};
  const std::array<double, 4> floor{0, 0, 1, HUGE_VAL};
  const auto law = std::make_shared<const NoLaw>();
  const itr_law c_law{[](int, const double*, void*) { return 0.0; }, [](int, const double*, double*, void*) {},
                      [](int, const double*, double*, void*) {}};
  const auto values = [&](void (AnySimulation::*set)(std::span<const double>),
                          itr_status (*c_set)(itr_simulation*, std::size_t, const double*)) {
    return Says{cpp_step([&](AnySimulation& s) { (s.*set)(nans); }),
                c_step([&](itr_simulation* s) { return c_set(s, nans.size(), nans.data()); })};
  };
  return {
      {"vertex", of_block([](Block& b) { b.vertices[5] = kNan; })},
      {"cell", of_block([](Block& b) { b.cells[4] = 16; })},
      {"inverted cell", of_block([](Block& b) { std::swap(b.cells[0], b.cells[1]); })},
      {"facet", {cpp_model([&](Model& m) { m.add_boundary("top", facet); }), c_model([&](itr_model* m) {
                   return itr_model_add_boundary(m, "top", 1, facet.data(), nullptr);
                 })}},
      {"inner facet", {cpp_model([&](Model& m) { m.add_boundary("top", inner); }), c_model([&](itr_model* m) {
                         return itr_model_add_boundary(m, "top", 1, inner.data(), nullptr);
                       })}},
      {"empty box", {cpp_model([&](Model& m) { m.add_boundary("top", low, high); }), c_model([&](itr_model* m) {
                       return itr_model_add_boundary_box(m, "top", low.data(), high.data(), nullptr);
                     })}},
      {"name", {cpp_model([&](Model& m) { m.add_boundary("left", kEdge); }), c_model([&](itr_model* m) {
                  return itr_model_add_boundary(m, "left", 1, kEdge.data(), nullptr);
                })}},
      {"obstacle vertex", {cpp_model([&](Model& m) { m.add_obstacle("floor", floor, kEdge); }), c_model([&](itr_model* m) {
                             return itr_model_add_obstacle(m, "floor", 2, floor.data(), 1, kEdge.data(), 0, nullptr,
                                                           nullptr);
                           })}},
      {"obstacle edge", {cpp_model([&](Model& m) { m.add_obstacle("floor", kWall, edge); }), c_model([&](itr_model* m) {
                           return itr_model_add_obstacle(m, "floor", 2, kWall.data(), 1, edge.data(), 0, nullptr, nullptr);
                         })}},
      {"unknown key", of_option("/contact/dhatt", "1")},
      {"time step", of_option("/time/dt", "-1")},
      {"law", {cpp_model([&](Model& m) { m.set_law(3, law); }), c_model([&](itr_model* m) {
                 return itr_model_set_law(m, 3, &c_law, nullptr);
               })}},
      {"step", {cpp_step([](AnySimulation& s) { s.step(-1); }), c_step([](itr_simulation* s) { return itr_step(s, -1); })}},
      {"boundary", {cpp_step([&](AnySimulation& s) { s.fix("lefd", kMask, nans); }), c_step([&](itr_simulation* s) {
                      return itr_fix_values(s, "lefd", kMask.data(), nans.size(), nans.data());
                    })}},
      {"displacement", {cpp_step([&](AnySimulation& s) { s.fix("left", kMask, nans); }), c_step([&](itr_simulation* s) {
                          return itr_fix_values(s, "left", kMask.data(), nans.size(), nans.data());
                        })}},
      {"traction", {cpp_step([&](AnySimulation& s) { s.set_traction("left", nans); }), c_step([&](itr_simulation* s) {
                      return itr_set_traction_values(s, "left", nans.size(), nans.data());
                    })}},
      {"pressure", {cpp_step([&](AnySimulation& s) { s.set_pressure("left", pressures); }), c_step([&](itr_simulation* s) {
                      return itr_set_pressure_values(s, "left", pressures.size(), pressures.data());
                    })}},
      {"acceleration", values(&AnySimulation::set_acceleration, &itr_set_acceleration_values)},
      {"force", values(&AnySimulation::set_forces, &itr_set_forces)},
      {"velocity", values(&AnySimulation::set_velocities, &itr_set_velocities)},
      {"obstacle", {cpp_step([&](AnySimulation& s) { s.move_obstacle("door", wall); }), c_step([&](itr_simulation* s) {
                      return itr_move_obstacle_to(s, "door", 2, wall.data());
                    })}},
      {"obstacle position",
       {cpp_step([&](AnySimulation& s) { s.move_obstacle("wall", wall); }),
        c_step([&](itr_simulation* s) { return itr_move_obstacle_to(s, "wall", 2, wall.data()); })}},
      {"obstacle positions",
       {cpp_step([&](AnySimulation& s) { s.move_obstacle("wall", kOrigin); }),
        c_step([&](itr_simulation* s) { return itr_move_obstacle_to(s, "wall", 1, kOrigin.data()); })}},
      {"follower force",
       {cpp_step([](AnySimulation& s) {
          s.set_follower_forces([](ConstVectorView, ConstVectorView, double, VectorView f) { f[3] = kNan; });
          s.step();
        }),
        c_step([](itr_simulation* s) {
          itr_set_follower_forces(s, bad_forces, nullptr, nullptr);
          return itr_step(s, 0);
        })}},
      {"follower vertex",
       {cpp_step([](AnySimulation& s) {
          s.set_follower_forces([](ConstVectorView, ConstVectorView, double, VectorView) {},
                                [](ConstVectorView, ConstVectorView, double, const StiffnessReceiver& add) {
                                  add(std::array{16}, std::array<double, 4>{}.data());
                                });
          s.step();
        }),
        c_step([](itr_simulation* s) {
          itr_set_follower_forces(s, fall, bad_stiffness, nullptr);
          return itr_step(s, 0);
        })}},
      {"resultant", {cpp_step([](AnySimulation& s) { s.resultant("lefd"); }), c_step([](itr_simulation* s) {
                       double force[2], moment;
                       return itr_resultant(s, "lefd", kOrigin.data(), force, &moment);
                     })}},
      {"not watched", {cpp_step([](AnySimulation& s) { s.resultant("left"); }), c_step([](itr_simulation* s) {
                         double force[2], moment;
                         return itr_resultant(s, "left", kOrigin.data(), force, &moment);
                       })}},
  };
}

TEST(BadInput, GetsTheErrorOfTheTableInCppAndC) {
  auto cases = all_cases();
  std::ifstream table(std::string(ITR_SOURCE_DIR) + "/tests/texts.txt");
  const std::string head = "== api: ";
  for (std::string line, expected; std::getline(table, line);) {
    if (!line.starts_with(head)) continue;
    const std::string key = line.substr(head.size());
    std::getline(table, expected);
    ASSERT_TRUE(cases.contains(key)) << key;
    EXPECT_EQ(cases[key].cpp, expected) << key;
    EXPECT_EQ(cases[key].c, expected) << key;
    cases.erase(key);
  }
  EXPECT_TRUE(cases.empty()) << cases.begin()->first << " is not in the table";
}

TEST(BadInput, OfFunctionsSaysWhere) {
  // A step that throws leaves the state as it was, and the next one is done.
  AnySimulation simulation(make_model());
  simulation.set_acceleration([](const double*, double, double* a) { a[1] = kNan; });
  const std::string message = cpp_says([&] { simulation.step(0.01); });
  EXPECT_TRUE(message.starts_with("acceleration at X = (")) << message;
  EXPECT_NE(message.find("t = 0.01: found 0, nan; expected finite numbers"), std::string::npos) << message;
  EXPECT_EQ(simulation.time(), 0);
  simulation.set_acceleration(nullptr);
  EXPECT_TRUE(simulation.step(0.01).ok);
  EXPECT_TRUE(cpp_step([](AnySimulation& s) {
                s.set_traction("left", [](const double*, double, double* f) { f[0] = HUGE_VAL; });
                s.step();
              }).starts_with("traction of 'left' at X = ("));
}

}  // namespace
}  // namespace itr
