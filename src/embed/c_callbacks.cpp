// SPDX-License-Identifier: MIT
#include "c_callbacks.hpp"

#include <exception>

#include "arrays.hpp"

namespace itr {

namespace {

using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 9, 9>;

class LawOfProgram final : public OwnLaw {
 public:
  LawOfProgram(const itr_law& law, void* user) : law_(law), user_(user) {}
  double density(const Eigen::Ref<const MatrixX>& F) const override {
    return law_.density(dimension(F), SmallMatrix(F).data(), user_);
  }
  void stress(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> P) const override {
    SmallMatrix result = SmallMatrix::Zero(P.rows(), P.cols());
    law_.stress(dimension(F), SmallMatrix(F).data(), result.data(), user_);
    P = result;
  }
  void hessian(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> H) const override {
    SmallMatrix result = SmallMatrix::Zero(H.rows(), H.cols());
    law_.hessian(dimension(F), SmallMatrix(F).data(), result.data(), user_);
    H = result;
  }

 private:
  static int dimension(const Eigen::Ref<const MatrixX>& F) { return static_cast<int>(F.rows()); }
  itr_law law_;
  void* user_;
};

/// Hands a program's blocks on. What is thrown at one waits until the program's function has returned: no exception
/// crosses it.
class Blocks {
 public:
  explicit Blocks(const StiffnessReceiver& add) : add_(&add) {}
  static void receive(void* to, size_t num_vertices, const int* vertices, const double* block) noexcept {
    auto& self = *static_cast<Blocks*>(to);
    if (self.error_) return;
    try {
      if (!vertices || !block) refuse(vertices ? "block" : "vertices", "NULL", "an argument");
      (*self.add_)({vertices, num_vertices}, block);
    } catch (...) {
      self.error_ = std::current_exception();
    }
  }
  void finish() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  const StiffnessReceiver* add_;
  std::exception_ptr error_;
};

itr_part view(const HostPart& part) {
  return {part.X.size() / static_cast<std::size_t>(part.dimension),
          part.bodies.size(),
          part.boundaries.size(),
          part.X.data(),
          part.cells.data(),
          part.bodies.data(),
          part.facets.data(),
          part.boundaries.data(),
          part.t};
}

template <typename Function>
void require(Function* function, const char* name) {
  if (!function) refuse(name, "NULL", "a function");
}

}  // namespace

std::shared_ptr<const OwnLaw> law_of(const itr_law& law, void* user) {
  require(law.density, "law.density");
  require(law.stress, "law.stress");
  require(law.hessian, "law.hessian");
  return std::make_shared<const LawOfProgram>(law, user);
}

HostTerm term_of(const itr_term& term, void* user) {
  require(term.energy, "term.energy");
  require(term.add_gradient, "term.add_gradient");
  require(term.add_hessian, "term.add_hessian");
  return {[=](const HostPart& part, ConstVectorView x) {
            const itr_part shown = view(part);
            return term.energy(&shown, x.data(), user);
          },
          [=](const HostPart& part, ConstVectorView x, VectorView gradient) {
            const itr_part shown = view(part);
            term.add_gradient(&shown, x.data(), gradient.data(), user);
          },
          [=](const HostPart& part, ConstVectorView x, const StiffnessReceiver& add) {
            const itr_part shown = view(part);
            Blocks blocks(add);
            term.add_hessian(&shown, x.data(), &Blocks::receive, &blocks, user);
            blocks.finish();
          }};
}

AnySimulation::ForceFunction forces_of(itr_force_function forces, int dimension, void* user) {
  if (!forces) return nullptr;
  return [=](ConstVectorView X, ConstVectorView x, double t, VectorView f) {
    forces(static_cast<std::size_t>(x.size() / dimension), X.data(), x.data(), t, f.data(), user);
  };
}

AnySimulation::StiffnessFunction stiffness_of(itr_stiffness_function stiffness, int dimension, void* user) {
  if (!stiffness) return nullptr;
  return [=](ConstVectorView X, ConstVectorView x, double t, const StiffnessReceiver& add) {
    Blocks blocks(add);
    stiffness(static_cast<std::size_t>(x.size() / dimension), X.data(), x.data(), t, &Blocks::receive, &blocks, user);
    blocks.finish();
  };
}

}  // namespace itr
