// SPDX-License-Identifier: MIT
// The compiled half of the Python package: AnySimulation with arrays in NumPy's hands. itr/__init__.py is what users see.
#include <dlfcn.h>
#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cmath>
#include <filesystem>

#include "apps/report/report.hpp"
#include "core/parallel.hpp"
#include "embed/c_callbacks.hpp"
#include "itr/itr.hpp"
#include "itr/output.hpp"
#include "simulation/report_fields.hpp"

namespace py = pybind11;

/// Folder of solver modules: in the prefix that the package is installed in (lib/pythonX.Y/site-packages/itr/_itr.so).
extern "C" const char* itr_installed_backends() {
  static const std::string folder = [] {
    Dl_info info{};
    dladdr(reinterpret_cast<void*>(&itr_installed_backends), &info);
    std::filesystem::path prefix = std::filesystem::absolute(info.dli_fname ? info.dli_fname : "");
    for (int level = 0; level < 5; ++level) prefix = prefix.parent_path();
    return (prefix / ITR_BACKEND_DIR).string();
  }();
  return folder.c_str();
}

namespace {

using itr::AnySimulation;
using itr::Model;
using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Ints = py::array_t<int, py::array::c_style | py::array::forcecast>;

template <typename T>
std::span<const T> view(const py::array_t<T, py::array::c_style | py::array::forcecast>& array) {
  return {array.data(), static_cast<std::size_t>(array.size())};
}

template <typename T>
py::array_t<T> copied(const std::vector<T>& values, int columns) {
  const auto rows = static_cast<py::ssize_t>(values.size()) / columns;
  py::array_t<T> result = columns == 1 ? py::array_t<T>(rows) : py::array_t<T>({rows, py::ssize_t{columns}});
  std::copy(values.begin(), values.end(), result.mutable_data());
  return result;
}

/// Shows values that live as long as `owner` does as an array: no copy, not to be written to.
template <typename Owner>
py::array_t<double> shared(std::span<const double> values, int columns, Owner owner) {
  const py::capsule base(new Owner(std::move(owner)), [](void* p) { delete static_cast<Owner*>(p); });
  py::array_t<double> result({static_cast<py::ssize_t>(values.size()) / columns, py::ssize_t{columns}}, values.data(), base);
  result.attr("setflags")(py::arg("write") = false);
  return result;
}

/// A compiled function by its address; 0: none.
template <typename Function>
void set_function(Function*& function, std::uintptr_t address) {
  function = reinterpret_cast<Function*>(address);
}

/// f's result, an array of as many numbers as `size`.
Doubles asked_array(const py::object& result, const char* name, Eigen::Index size) {
  Doubles values = Doubles::ensure(result);
  if (!values || values.size() != size)
    throw itr::InputError(
        {"", name, values ? std::to_string(values.size()) + " numbers" : "no array of numbers", std::to_string(size)});
  return values;
}

/// f of nodal values, or where `values` has less than `nodal_axes` axes, of the constant function of them.
template <typename F>
void with_values(const Doubles& values, int nodal_axes, const char* name, int components, F&& f) {
  if (values.ndim() >= nodal_axes) return f(view(values));
  const auto fail = [&](const std::string& found, const std::string& expected) {
    throw itr::InputError({"", name, found, expected});
  };
  if (values.size() != components) fail(std::to_string(values.size()) + " numbers", std::to_string(components));
  const std::vector<double> constant(values.data(), values.data() + values.size());
  for (const double value : constant)
    if (!std::isfinite(value)) fail(std::to_string(value), "a finite number");
  f(itr::HostFunction([=](const double*, double, double* result) { std::copy(constant.begin(), constant.end(), result); }));
}

std::string json(const py::handle& value) { return py::module_::import("json").attr("dumps")(value).cast<std::string>(); }

py::object to_python(int value) { return py::int_(value); }
py::object to_python(double value) { return py::float_(value); }
py::object to_python(const itr::OperationCount& count) { return py::int_(count.accepted); }
py::object to_python(const itr::StepSeconds& seconds) { return py::float_(seconds.total); }
py::object to_python(const itr::EnergyReport& energy) {
  py::dict result;
  itr::for_each_field(itr::kEnergyFields, [&](const auto& field) { result[field.name] = to_python(energy.*field.member); });
  return result;
}
/// No program is shown these.
py::object to_python(const std::vector<itr::MomentumChange>&) { return py::none(); }
py::object to_python(const std::vector<itr::RejectedStep>&) { return py::none(); }
py::object to_python(const itr::ErrorReport&) { return py::none(); }

py::dict describe(const itr::StepReport& report) {
  py::dict result;
  itr::for_each_field(itr::kStepFields, [&](const auto& field) {
    if (field.shown & itr::in_program) result[field.name] = to_python(report.*field.member);
  });
  return result;
}

/// Listeners of Python's are called under its lock, which a step does not hold.
itr::Logger logger_of(const std::function<void(int, std::string)>& log) {
  if (!log) return {};
  return itr::Logger([log](itr::LogLevel level, std::string_view text) {
    const py::gil_scoped_acquire lock;
    log(static_cast<int>(level), std::string(text));
  });
}

void add_model(py::module_& m) {
  py::class_<Model>(m, "Model")
      .def(py::init<int>())
      .def_static("from_scene",
                  [](const std::string& file, const py::dict& overrides) {
                    std::vector<itr::scene::Override> list;
                    for (const auto& [pointer, value] : overrides)
                      list.push_back({pointer.cast<std::string>(), json(value)});
                    return Model::from_scene(file, list);
                  })
      .def_property_readonly("dimension", &Model::dimension)
      .def("set_options", [](Model& model, const py::dict& options) { model.set_options(json(options)); })
      .def("set_option",
           [](Model& model, const std::string& pointer, const py::object& value) { model.set_option(pointer, json(value)); })
      .def("set_law",
           [](Model& model, int body, std::uintptr_t density, std::uintptr_t stress, std::uintptr_t hessian,
              std::uintptr_t user) {
             itr_law law{};
             set_function(law.density, density);
             set_function(law.stress, stress);
             set_function(law.hessian, hessian);
             model.set_law(body, itr::law_of(law, reinterpret_cast<void*>(user)));
           })
      .def("set_mesh", [](Model& model, const Doubles& vertices, const Ints& cells,
                          const Ints& bodies) { model.set_mesh(view(vertices), view(cells), view(bodies)); })
      .def("set_quadratic_mesh",
           [](Model& model, const Doubles& nodes, const Ints& cells, const Ints& bodies) {
             model.set_quadratic_mesh(view(nodes), view(cells), view(bodies));
           })
      .def("add_boundary_facets",
           [](Model& model, const std::string& name, const Ints& facets) { return model.add_boundary(name, view(facets)); })
      .def("name_body", &Model::name_body)
      .def("add_boundary_box", [](Model& model, const std::string& name, const Doubles& low,
                                  const Doubles& high) { return model.add_boundary(name, view(low), view(high)); })
      .def("add_boundary_rule",
           [](Model& model, const std::string& name, const py::function& rule) {
             const int d = model.dimension();
             return model.add_boundary(name, [&](const double* X) { return rule(py::array_t<double>(d, X)).cast<bool>(); });
           })
      .def("add_obstacle",
           [](Model& model, const std::string& name, const Doubles& vertices, const Ints& edges, const Ints& triangles) {
             return model.add_obstacle(name, view(vertices), view(edges), view(triangles));
           });
}

struct Saved {
  AnySimulation::Saved state;
};

py::object positions(const AnySimulation& s, bool velocities) {
  return std::visit(
      [&](const auto& snapshot) -> py::object {
        return shared(velocities ? s.velocities() : s.positions(), s.dimension(), snapshot.state);
      },
      s.save());
}

/// Takes a step without Python's lock and returns its outcome.
template <typename Step>
py::tuple outcome(const Step& step) {
  itr::StepResult result;
  {
    const py::gil_scoped_release unlock;
    result = step();
  }
  return py::make_tuple(result.ok, result.cancelled, result.reason);
}

/// They are asked for once a round, not within trials: forces(X, x, t) gives an array as x, stiffness(X, x, t) vertices
/// (m x k) and as many blocks (m x kd x kd). Either may be None.
void set_follower_forces(AnySimulation& s, const py::object& forces, const py::object& stiffness) {
  const int d = s.dimension();
  if (forces.is_none()) return s.set_follower_forces(nullptr);
  const auto rows = [d](itr::ConstVectorView v) {
    return py::array_t<double>({static_cast<py::ssize_t>(v.size()) / d, py::ssize_t{d}}, v.data());
  };
  AnySimulation::StiffnessFunction blocks;
  if (!stiffness.is_none())
    blocks = [=, f = stiffness.cast<std::function<py::object(py::object, py::object, double)>>()](
                 itr::ConstVectorView X, itr::ConstVectorView x, double t, const itr::StiffnessReceiver& add) {
      const py::gil_scoped_acquire lock;
      const auto [vertices, values] = f(rows(X), rows(x), t).cast<std::pair<Ints, Doubles>>();
      const py::ssize_t k = vertices.ndim() == 2 ? vertices.shape(1) : 1, side = k * d;
      asked_array(values, "follower stiffness.block", vertices.size() / std::max<py::ssize_t>(k, 1) * side * side);
      for (py::ssize_t i = 0; i * k < vertices.size(); ++i)
        add({vertices.data() + i * k, static_cast<std::size_t>(k)}, values.data() + i * side * side);
    };
  s.set_follower_forces(
      [=, f = forces.cast<std::function<py::object(py::object, py::object, double)>>()](
          itr::ConstVectorView X, itr::ConstVectorView x, double t, itr::VectorView result) {
        const py::gil_scoped_acquire lock;
        const Doubles values = asked_array(f(rows(X), rows(x), t), "follower forces", x.size());
        result += Eigen::Map<const itr::VectorX>(values.data(), x.size());
      },
      std::move(blocks));
}

/// Writes steps into a folder as the command does.
class Recorder {
 public:
  Recorder(AnySimulation& simulation, std::filesystem::path directory, int every, bool overwrite) : directory_(directory) {
    if (every < 1) throw itr::InputError({"", "every", std::to_string(every), "a number > 0"});
    itr::output::Folder folder(directory);
    if (!overwrite && folder.has_results())
      throw itr::InputError(
          {directory.string(), "folder", "results of an earlier run", "another folder, or overwrite=True"});
    with(simulation, [&](auto& s) {
      const itr::output::RunInfo info{"a program", s.solver_name(), itr::num_threads()};
      writer_ = std::make_unique<itr::output::Writer>(std::move(folder), itr::OutputOptions{every}, info);
      write(s, s.report());
    });
  }
  void add(AnySimulation& simulation) {
    with(simulation, [&](auto& s) { write(s, simulation.report()); });
  }
  /// Indexes and sums are as of now.
  void finish(AnySimulation& simulation) {
    with(simulation, [&](auto& s) {
      const std::string outcome = simulation.finished() ? "finished" : "recorded so far";
      writer_->finish(outcome, s.solver_name_in_use());
    });
  }
  std::string directory() const { return directory_.string(); }

 private:
  template <typename F>
  static void with(AnySimulation& simulation, const F& f) {
    simulation.dimension() == 2 ? f(simulation.as<2>()) : f(simulation.as<3>());
  }
  template <typename Simulation>
  void write(Simulation& s, const itr::StepReport& report) {
    s.observe([&](const auto& frame) { writer_->write(frame, report); });
  }

  std::filesystem::path directory_;
  std::unique_ptr<itr::output::Writer> writer_;
};

void add_recorder(py::module_& m) {
  py::class_<Recorder>(m, "Recorder")
      .def(py::init<AnySimulation&, std::string, int, bool>())
      .def("add", &Recorder::add)
      .def("finish", &Recorder::finish)
      .def_property_readonly("directory", &Recorder::directory);
  m.def("write_report", [](const std::string& directory, const std::string& file, int every, double max_mb) {
    return itr::report::write_report(directory, file, {every, max_mb}).notes;
  });
}

void add_simulation(py::module_& m) {
  py::class_<Saved>(m, "Saved");
  py::class_<AnySimulation>(m, "Simulation")
      .def(py::init([](const Model& model, const std::function<void(int, std::string)>& log) {
        return std::make_unique<AnySimulation>(model, logger_of(log));
      }))
      .def("step", [](AnySimulation& s, double dt) { return outcome([&] { return s.step(dt); }); })
      .def("adapt", [](AnySimulation& s, double dt) { return outcome([&] { return s.adapt(dt); }); })
      .def_property_readonly("dimension", &AnySimulation::dimension)
      .def_property_readonly("time", &AnySimulation::time)
      .def_property_readonly("step_length", &AnySimulation::step_length)
      .def_property_readonly("steps", &AnySimulation::steps)
      .def_property_readonly("finished", &AnySimulation::finished)
      .def_property_readonly("warnings", &AnySimulation::warnings)
      .def_property_readonly("report", [](const AnySimulation& s) { return describe(s.report()); })
      .def("fix",
           [](AnySimulation& s, const std::string& boundary, const Ints& mask, const Doubles& values) {
             with_values(values, 2, "displacement", s.dimension(), [&](auto&& f) { s.fix(boundary, view(mask), f); });
           })
      .def("set_traction",
           [](AnySimulation& s, const std::string& boundary, const Doubles& values) {
             with_values(values, 2, "traction", s.dimension(), [&](auto&& f) { s.set_traction(boundary, f); });
           })
      .def("set_pressure",
           [](AnySimulation& s, const std::string& boundary, const Doubles& values) {
             with_values(values, 1, "pressure", 1, [&](auto&& f) { s.set_pressure(boundary, f); });
           })
      .def("set_acceleration",
           [](AnySimulation& s, const Doubles& values) {
             with_values(values, 2, "acceleration", s.dimension(), [&](auto&& f) { s.set_acceleration(f); });
           })
      .def("set_eigenstrain", [](AnySimulation& s, const Doubles& strains) { s.set_eigenstrain(view(strains)); })
      .def("move_obstacle", [](AnySimulation& s, const std::string& obstacle,
                               const Doubles& values) { s.move_obstacle(obstacle, view(values)); })
      .def("set_forces", [](AnySimulation& s, const Doubles& forces) { s.set_forces(view(forces)); })
      .def("set_follower_forces", &set_follower_forces)
      .def("set_term",
           [](AnySimulation& s, const std::string& name, std::uintptr_t energy, std::uintptr_t gradient,
              std::uintptr_t hessian, std::uintptr_t user) {
             itr_term term{};
             set_function(term.energy, energy);
             set_function(term.add_gradient, gradient);
             set_function(term.add_hessian, hessian);
             s.set_term(name, itr::term_of(term, reinterpret_cast<void*>(user)));
           })
      .def("remove_term", [](AnySimulation& s, const std::string& name) { s.set_term(name, {}); })
      .def("set_velocities", [](AnySimulation& s, const Doubles& values) { s.set_velocities(view(values)); })
      .def("freeze_mesh", &AnySimulation::freeze_mesh)
      .def_property_readonly("num_vertices", &AnySimulation::num_vertices)
      .def_property_readonly("curved_edges", [](const AnySimulation& s) { return copied(s.curved_edges(), 2); })
      .def_property_readonly("positions", [](const AnySimulation& s) { return positions(s, false); })
      .def_property_readonly("velocities", [](const AnySimulation& s) { return positions(s, true); })
      .def_property_readonly("rest_positions",
                             [](const AnySimulation& s) { return copied(s.rest_positions(), s.dimension()); })
      .def_property_readonly("cells", [](const AnySimulation& s) { return copied(s.cells(), s.dimension() + 1); })
      .def_property_readonly("bodies", [](const AnySimulation& s) { return copied(s.bodies(), 1); })
      .def_property_readonly("facets", [](const AnySimulation& s) { return copied(s.facets(), s.dimension()); })
      .def_property_readonly("facet_boundaries", [](const AnySimulation& s) { return copied(s.facet_boundaries(), 1); })
      .def_property_readonly("obstacle_positions",
                             [](const AnySimulation& s) { return copied(s.obstacle_positions(), s.dimension()); })
      .def_property_readonly("contact_pressure", [](const AnySimulation& s) { return copied(s.contact_pressure(), 1); })
      .def_property_readonly("elastic_density", [](const AnySimulation& s) { return copied(s.elastic_density(), 1); })
      .def_property_readonly("von_mises", [](const AnySimulation& s) { return copied(s.von_mises(), 1); })
      .def_property_readonly("stress",
                             [](const AnySimulation& s) { return copied(s.stress(), s.dimension() * s.dimension()); })
      .def("watch_forces", &AnySimulation::watch_forces)
      .def("forces",
           [](const AnySimulation& s, int kind) -> py::object {
             const itr::VectorX& values = s.forces().*itr::kForcesOnBodies[kind];
             if (values.size() == 0) return py::none();
             return copied(std::vector<double>(values.begin(), values.end()), s.dimension());
           })
      .def("resultant",
           [](const AnySimulation& s, const std::vector<std::string>& parts, const Doubles& about) {
             const auto sum = s.resultant(parts, view(about));
             return py::make_tuple(copied(sum.force, 1), copied(sum.moment, 1));
           })
      .def("save", [](const AnySimulation& s) { return Saved{s.save()}; })
      .def("restore", [](AnySimulation& s, const Saved& saved) { s.restore(saved.state); })
      .def("on_iteration",
           [](AnySimulation& s, const std::function<bool(int, double, double, double)>& listener) {
             if (!listener) return s.on_iteration(nullptr);
             s.on_iteration([listener](const itr::NewtonProgress& p) {
               const py::gil_scoped_acquire lock;
               return listener(p.iteration, p.energy, p.gradient_norm, p.step_norm);
             });
           })
      .def("on_mesh_change", [](AnySimulation& s, const py::object& listener) {
        if (listener.is_none()) return s.on_mesh_change(nullptr);
        s.on_mesh_change([listener = listener.cast<std::function<void(py::object)>>()](const itr::AnyMeshChange& change) {
          using namespace py::literals;
          const py::gil_scoped_acquire lock;
          const auto& P = change.interpolation;
          const auto ints = [](const int* p, Eigen::Index n) { return py::array_t<int>(n, p); };
          const auto project =
              py::cpp_function([project = change.project](const itr::MatrixX& fields) { return project(fields); });
          listener(py::dict(
              "vertex"_a = copied(change.vertex, 1), "cell"_a = copied(change.cell, 1), "facet"_a = copied(change.facet, 1),
              "facet_parent"_a = copied(change.facet_parent, 1), "shape"_a = py::make_tuple(P.rows(), P.cols()),
              "indptr"_a = ints(P.outerIndexPtr(), P.rows() + 1), "indices"_a = ints(P.innerIndexPtr(), P.nonZeros()),
              "data"_a = py::array_t<double>(P.nonZeros(), P.valuePtr()), "project"_a = project));
        });
      });
}

}  // namespace

PYBIND11_MODULE(_itr, m) {
  m.doc() = "compiled half of the package itr";
  m.attr("__version__") = ITR_VERSION;
  py::register_exception<itr::InputError>(m, "InputError", PyExc_ValueError);
  add_model(m);
  add_simulation(m);
  add_recorder(m);
}
