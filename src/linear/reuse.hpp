// SPDX-License-Identifier: MIT
// Factors that serve more than one system: the last one preconditions conjugate gradients on the next matrix, as long as
// that is cheaper than a factorisation.
#pragma once

#include <memory>
#include <vector>

#include "itr/types.hpp"
#include "linear/system.hpp"

namespace itr::linear {

struct SystemView;

/// Matrix that a factor was made of.
struct FactoredMatrix {
  std::shared_ptr<const SparsityPattern> pattern;  ///< never null
  std::vector<double> values;
  int block_size = 1;
};

/// Whether columns follow one another, each with its diagonal first and ascending rows below it: what was read from a file
/// may be anything.
bool is_lower_triangle(const SparsityPattern& pattern);

/// Null where the arrays are no lower triangle: for those that were read from a file.
std::shared_ptr<const FactoredMatrix> make_factored_matrix(SparsityPattern pattern, std::vector<double> values,
                                                           int block_size);

/// A factor, and what it has been worth: a value. Whoever has it can make the factor again, and goes on with the same bits.
struct FactorRecord {
  std::shared_ptr<const FactoredMatrix> matrix;  ///< null: there is none
  double spent = 0;                              ///< on it and on the systems that it served [s, by counts]
  double served = 0;                             ///< systems; one that is solved to half of the digits is half a one
  double iterations = 0;                         ///< a system, of the last of them
  int pause = 0, next_pause = 1;                 ///< systems that are not tried, now and after the next failure
};

/// Counts over all systems since the start.
struct SolveCounts {
  int factorizations = 0;
  int solves = 0;      ///< systems that were solved
  int reused = 0;      ///< of these, by a factor that was there
  int iterations = 0;  ///< of conjugate gradients over such factors, failed attempts included
};

/// A solver over a direct one. A matrix that is the last one bit by bit is not factorised again. Another one of the same
/// order, whatever its pattern, may be given to conjugate gradients with the last factor as preconditioner (solve_system);
/// where they take too long or meet a direction of no positive curvature, the matrix is factorised.
///
/// Choices depend on counts (flops of a factorisation, entries of a factor, iterations), never on time. A matrix
/// that iterations solved to 1e-8 is positive definite: the factor is (none of an indefinite matrix is kept), they start
/// from an error with a part in every direction, and with positive curvatures throughout, the part in a direction of
/// negative curvature could not have shrunk. (The residual does not show one whose curvature is below some 1e-4 of the
/// factor's; after looser solves it shows less.)
///
/// Over an iterative solver it only counts.
class ReusingSolver final : public Solver {
 public:
  /// `solver` must outlive this.
  explicit ReusingSolver(Solver& solver);
  ~ReusingSolver() override;

  std::string_view name() const override { return solver_.name(); }
  std::string_view name_in_use() const override { return solver_.name_in_use(); }
  Capabilities capabilities() const override { return solver_.capabilities(); }
  Outcome analyze(const SparsityPattern& pattern, const AnalyzeHints& hints) override;
  Outcome factorize(std::span<const double> values) override;
  /// With the factor; none is there after a solve_system that needed none.
  SolveReport solve(std::span<const double> B, std::span<double> X, int columns, double asked_residual) override;
  Statistics statistics() const override;
  std::string message() const override;

  /// Solves A x = b for the matrix of these values: to `asked.residual` by a factor of it, else to `asked.loose` by
  /// iterations, else factorises it first. If x is empty, only what the matrix is is found out. With U the system is that of
  /// A + U U^T, of which A is what gets factorised.
  SystemReport solve_system(std::span<const double> values, std::span<const double> b, const Asked& asked,
                            std::span<double> x, const MatrixX* U = nullptr);
  /// Solves with the factor that is there, whatever matrix of this order it is of. False where there is none.
  bool precondition(std::span<const double> residual, std::span<double> z);
  /// Whether the matrix given last has been factorised.
  bool has_factor() const { return last_ == Last::factorized || last_ == Last::found; }

  /// The factor for a saved state; none where its fill-reducing order came from an earlier pattern, so that it could not be
  /// made again from its matrix alone.
  FactorRecord record() const;
  /// Goes on from a record: with the factor that is there where it is that one, else it is made again, or dropped.
  void restore(const FactorRecord& record);
  const SolveCounts& counts() const { return counts_; }

 private:
  /// State of the matrix that was given last.
  enum class Last {
    none,
    factorized,
    found,     ///< the factor that was there is its own
    iterated,  ///< iterations have solved its system
    refused    ///< they found it not positive definite
  };
  struct Costs;
  struct Iteration;

  void take_in(std::span<const double> values);
  bool may_iterate(std::span<const double> values, std::span<const double> b);
  Outcome analyze_now();
  Outcome factorize_now(std::span<const double> values);
  void iterate(const SystemView& system, double asked);
  void pause();
  SystemReport solve_by_factor(const SystemView& system, const Asked& asked, std::span<double> x);
  Costs costs() const;

  Solver& solver_;
  FactorRecord factor_;
  bool has_own_order_ = false;  ///< the order of solver_'s analysis came from the pattern analysed, not from an earlier one
  bool is_analyzed_ = false;    ///< the pattern below by solver_
  std::shared_ptr<const SparsityPattern> pattern_;
  int block_size_ = 1;
  std::vector<int> dofs_;
  std::vector<double> coordinates_;
  bool may_keep_order_ = true;  ///< so said every call of analyze since solver_ analysed last
  Last last_ = Last::none;
  std::unique_ptr<Iteration> iteration_;
  int iterations_ = 0;  ///< of the last solve
  SolveCounts counts_;
};

}  // namespace itr::linear
