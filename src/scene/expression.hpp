// SPDX-License-Identifier: MIT
// The expression language of scene files (docs/theory.md, "Expressions"): tinyexpr's grammar and functions, and PolyFEM's
// additions. Parsed once into a program for a stack of numbers.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace itr::scene {

/// Mistake in an expression, and its place (`what()` has both in words).
class ExpressionError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class Expression {
 public:
  struct Variables {
    double x = 0, y = 0, z = 0, t = 0;
  };

  /// `^` is left-associative and binds weaker than unary minus: -2^2 = 4. Throws ExpressionError.
  explicit Expression(std::string_view text);

  double operator()(const Variables& variables) const;
  bool is_constant() const { return !uses_space_ && !uses_time_; }
  bool uses_time() const { return uses_time_; }
  bool uses_space() const { return uses_space_; }
  /// Calls of sin, cos and tan of a plain number above a full turn, which may be meant as degrees.
  const std::vector<std::string>& large_angles() const { return large_angles_; }
  /// Times between these two at which it, or a derivative up to the second, may jump: where a condition, a sign or a whole
  /// number that depends on t alone changes. Of two changes within a thousandth of the way the first may be missed.
  std::vector<double> kinks(double begin, double end) const;

 private:
  friend class ExpressionParser;
  enum class Code : unsigned char { number, x, y, z, t, negate, add, subtract, multiply, divide, modulo, power, drop, call };
  struct Instruction {
    Code code;
    unsigned char arity = 0;
    int function = 0;  ///< index into the table of functions
    double number = 0;
  };

  static void apply(const Instruction& instruction, const Variables& variables, double*& top);
  /// Which piece of each piecewise function of t alone is taken at t.
  std::vector<double> pieces_at(double t) const;

  std::vector<Instruction> program_;
  std::vector<std::string> large_angles_;
  int depth_ = 0;  ///< most numbers on the stack at a time
  bool uses_space_ = false, uses_time_ = false;
};

}  // namespace itr::scene
