// SPDX-License-Identifier: MIT
#include "expression.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <span>

#include "core/quoted.hpp"

namespace itr::scene {

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kDeepest = 200;      ///< nesting: the parser recurses
constexpr int kStackOnFrame = 32;  ///< deeper programs take their stack from the heap

double factorial(double a) {
  if (!(a >= 0)) return kNaN;
  double product = 1;
  for (double i = 2; i <= std::floor(a) && product < kInfinity; ++i) product *= i;
  return product;
}

double combinations(double n, double r) {
  n = std::floor(n), r = std::floor(r);
  if (!(n >= 0 && r >= 0 && r <= n)) return kNaN;
  r = std::min(r, n - r);
  double result = 1;
  for (double i = 1; i <= r && result < kInfinity; ++i) result = result * (n - r + i) / i;
  return result;
}

double smoothstep(double a) {
  if (a <= 0) return 0;
  return a >= 1 ? 1 : a * a * (3 - 2 * a);
}

struct Function {
  std::string_view name;
  int arity;
  double (*call)(const double*);
};

// `log` is the decimal logarithm, as tinyexpr builds it by default.
constexpr Function kFunctions[] = {
    {"abs", 1, [](const double* a) { return std::abs(a[0]); }},
    {"acos", 1, [](const double* a) { return std::acos(a[0]); }},
    {"asin", 1, [](const double* a) { return std::asin(a[0]); }},
    {"atan", 1, [](const double* a) { return std::atan(a[0]); }},
    {"atan2", 2, [](const double* a) { return std::atan2(a[0], a[1]); }},
    {"ceil", 1, [](const double* a) { return std::ceil(a[0]); }},
    {"compare", 2, [](const double* a) { return a[0] < a[1] ? 1.0 : 0.0; }},
    {"cos", 1, [](const double* a) { return std::cos(a[0]); }},
    {"cosh", 1, [](const double* a) { return std::cosh(a[0]); }},
    {"deg2rad", 1, [](const double* a) { return a[0] * std::numbers::pi / 180; }},
    {"e", 0, [](const double*) { return std::numbers::e; }},
    {"exp", 1, [](const double* a) { return std::exp(a[0]); }},
    {"fac", 1, [](const double* a) { return factorial(a[0]); }},
    {"floor", 1, [](const double* a) { return std::floor(a[0]); }},
    {"half_smoothstep", 1, [](const double* a) { return 2 * smoothstep((a[0] + 1) / 2) - 1; }},
    {"if", 3, [](const double* a) { return a[0] >= 0 ? a[1] : a[2]; }},
    {"ln", 1, [](const double* a) { return std::log(a[0]); }},
    {"log", 1, [](const double* a) { return std::log10(a[0]); }},
    {"log10", 1, [](const double* a) { return std::log10(a[0]); }},
    {"max", 2, [](const double* a) { return a[0] > a[1] ? a[0] : a[1]; }},
    {"min", 2, [](const double* a) { return a[0] < a[1] ? a[0] : a[1]; }},
    {"ncr", 2, [](const double* a) { return combinations(a[0], a[1]); }},
    {"npr", 2, [](const double* a) { return combinations(a[0], a[1]) * factorial(a[1]); }},
    {"pi", 0, [](const double*) { return std::numbers::pi; }},
    {"pow", 2, [](const double* a) { return std::pow(a[0], a[1]); }},
    {"rotate_2D_x", 3, [](const double* a) { return a[0] * std::cos(a[2]) - a[1] * std::sin(a[2]); }},
    {"rotate_2D_y", 3, [](const double* a) { return a[0] * std::sin(a[2]) + a[1] * std::cos(a[2]); }},
    {"sign", 1, [](const double* a) { return a[0] > 0 ? 1.0 : (a[0] < 0 ? -1.0 : a[0]); }},
    {"sin", 1, [](const double* a) { return std::sin(a[0]); }},
    {"sinh", 1, [](const double* a) { return std::sinh(a[0]); }},
    {"smooth_abs", 2, [](const double* a) { return a[0] * std::tanh(a[1] * a[0]); }},
    {"smoothstep", 1, [](const double* a) { return smoothstep(a[0]); }},
    {"sqrt", 1, [](const double* a) { return std::sqrt(a[0]); }},
    {"tan", 1, [](const double* a) { return std::tan(a[0]); }},
    {"tanh", 1, [](const double* a) { return std::tanh(a[0]); }},
};

/// Which smooth piece of a function its arguments are on; 0 where it has one.
double piece_of(std::string_view name, const double* a) {
  const auto sign = [](double value) { return value > 0 ? 1.0 : (value < 0 ? -1.0 : 0.0); };
  if (name == "if") return a[0] >= 0;
  if (name == "compare" || name == "min" || name == "max") return a[0] < a[1];
  if (name == "abs" || name == "sign") return sign(a[0]);
  if (name == "floor" || name == "fac") return std::floor(a[0]);
  if (name == "ceil") return std::ceil(a[0]);
  if (name == "smoothstep") return (a[0] > 0) + (a[0] >= 1);
  if (name == "half_smoothstep") return (a[0] > -1) + (a[0] >= 1);
  return 0;
}

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

}  // namespace

/// Recursive descent over tinyexpr's grammar, writing postfix code:
///   list = sum {"," sum}; sum = term {("+"|"-") term}; term = factor {("*"|"/"|"%") factor};
///   factor = signed {"^" signed}; signed = {"+"|"-"} base;
///   base = number | variable | constant ["(" ")"] | function1 signed | function "(" sum {"," sum} ")" | "(" list ")"
class ExpressionParser {
 public:
  using Code = Expression::Code;

  ExpressionParser(std::string_view text, Expression& out) : text_(text), out_(out) {}

  void parse() {
    list();
    if (next() != '\0') fail(quoted(next()), "an operator or the end");
  }

 private:
  bool is_between_digits(std::size_t at) const {
    return at > 0 && at + 1 < text_.size() && is_digit(text_[at - 1]) && is_digit(text_[at + 1]);
  }

  /// Values of which the last counts. Between digits a comma would be meant as a decimal point.
  void list() {
    sum();
    while (take(',')) {
      if (is_between_digits(position_ - 1)) {
        --position_;
        fail("','", "'.': numbers have a decimal point");
      }
      emit({Code::drop}, -1);
      sum();
    }
  }

  void sum() {
    term();
    for (char c = next(); c == '+' || c == '-'; c = next()) {
      ++position_;
      term();
      emit({c == '+' ? Code::add : Code::subtract}, -1);
    }
  }

  void term() {
    factor();
    for (char c = next(); c == '*' || c == '/' || c == '%'; c = next()) {
      ++position_;
      factor();
      emit({c == '*' ? Code::multiply : (c == '/' ? Code::divide : Code::modulo)}, -1);
    }
  }

  void factor() {
    signed_base();
    while (take('^')) {
      signed_base();
      emit({Code::power}, -1);
    }
  }

  void signed_base() {
    bool negative = false;
    for (char c = next(); c == '+' || c == '-'; c = next()) {
      ++position_;
      negative ^= c == '-';
    }
    base();
    if (negative) emit({Code::negate}, 0);
  }

  void base() {
    if (++nesting_ > kDeepest) fail("more than " + std::to_string(kDeepest) + " levels of nesting", "fewer");
    const char c = next();
    if (is_digit(c) || c == '.') {
      number();
    } else if (is_letter(c)) {
      name();
    } else if (take('(')) {
      list();
      expect(')');
    } else {
      fail(c == '\0' ? "the end" : quoted(c), "a number, a name or '('");
    }
    --nesting_;
  }

  void number() {
    double value = 0;
    const char* begin = text_.data() + position_;
    const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), value);
    if (error != std::errc()) fail(quoted(text_.substr(position_)), "a number");
    position_ += static_cast<std::size_t>(end - begin);
    emit({Code::number, 0, 0, value}, 1);
  }

  void name() {
    const std::size_t begin = position_;
    while (position_ < text_.size() &&
           (is_letter(text_[position_]) || is_digit(text_[position_]) || text_[position_] == '_'))
      ++position_;
    const std::string_view word = text_.substr(begin, position_ - begin);
    if (variable(word)) return;
    for (int i = 0; i < static_cast<int>(std::size(kFunctions)); ++i)
      if (kFunctions[i].name == word) return function(i);
    position_ = begin;
    fail("the unknown name '" + std::string(word) + "'", known_names());
  }

  bool variable(std::string_view word) {
    if (word.size() != 1) return false;
    const auto index = std::string_view("xyzt").find(word[0]);
    if (index == std::string_view::npos) return false;
    constexpr std::array codes = {Code::x, Code::y, Code::z, Code::t};
    emit({codes[index]}, 1);
    (index < 3 ? out_.uses_space_ : out_.uses_time_) = true;
    return true;
  }

  void function(int index) {
    const int arity = kFunctions[index].arity;
    const std::size_t begin = position_ - kFunctions[index].name.size(), first = out_.program_.size();
    if (arity == 0) {
      if (take('(')) expect(')');
    } else if (arity == 1 && next() != '(') {
      signed_base();
    } else {
      arguments(kFunctions[index]);
    }
    find_large_angle(kFunctions[index].name, begin, first);
    emit({Code::call, static_cast<unsigned char>(arity), index}, 1 - arity);
  }

  /// Notes a call, from `begin` in the text to here, whose argument, from the instruction `first` on, is a plain number.
  void find_large_angle(std::string_view name, std::size_t begin, std::size_t first) {
    const std::span argument(out_.program_.begin() + static_cast<std::ptrdiff_t>(first), out_.program_.end());
    const bool is_angle = name == "sin" || name == "cos" || name == "tan";
    const bool is_plain = !argument.empty() && argument[0].code == Code::number &&
                          (argument.size() == 1 || (argument.size() == 2 && argument[1].code == Code::negate));
    if (is_angle && is_plain && std::abs(argument[0].number) > 2 * std::numbers::pi)
      out_.large_angles_.emplace_back(text_.substr(begin, position_ - begin));
  }

  void arguments(const Function& function) {
    expect('(');
    for (int i = 0; i < function.arity; ++i) {
      if (i > 0) expect(',');
      sum();
    }
    if (next() != ')')
      fail(quoted(next()), "')' after " + std::to_string(function.arity) + " argument(s) of " + std::string(function.name));
    expect(')');
  }

  char next() {
    while (position_ < text_.size() && is_space(text_[position_])) ++position_;
    return position_ < text_.size() ? text_[position_] : '\0';
  }

  bool take(char c) {
    if (next() != c) return false;
    ++position_;
    return true;
  }

  void expect(char c) {
    if (!take(c)) fail(next() == '\0' ? "the end" : quoted(next()), quoted(c));
  }

  void emit(Expression::Instruction instruction, int growth) {
    out_.program_.push_back(instruction);
    depth_ += growth;
    out_.depth_ = std::max(out_.depth_, depth_);
  }

  static std::string known_names() {
    std::string names = "x, y, z, t";
    for (const Function& function : kFunctions) names += ", " + std::string(function.name);
    return "one of " + names;
  }

  [[noreturn]] void fail(const std::string& found, const std::string& expected) const {
    throw ExpressionError(found + " at character " + std::to_string(position_ + 1) + " where there should be " + expected);
  }

  std::string_view text_;
  Expression& out_;
  std::size_t position_ = 0;
  int depth_ = 0, nesting_ = 0;
};

Expression::Expression(std::string_view text) { ExpressionParser(text, *this).parse(); }

/// Does one instruction on the stack whose end is `top`.
void Expression::apply(const Instruction& instruction, const Variables& variables, double*& top) {
  switch (instruction.code) {
    case Code::number:
      *top++ = instruction.number;
      break;
    case Code::x:
      *top++ = variables.x;
      break;
    case Code::y:
      *top++ = variables.y;
      break;
    case Code::z:
      *top++ = variables.z;
      break;
    case Code::t:
      *top++ = variables.t;
      break;
    case Code::negate:
      top[-1] = -top[-1];
      break;
    case Code::add:
      --top, top[-1] += top[0];
      break;
    case Code::subtract:
      --top, top[-1] -= top[0];
      break;
    case Code::multiply:
      --top, top[-1] *= top[0];
      break;
    case Code::divide:
      --top, top[-1] /= top[0];
      break;
    case Code::modulo:
      --top, top[-1] = std::fmod(top[-1], top[0]);
      break;
    case Code::power:
      --top, top[-1] = std::pow(top[-1], top[0]);
      break;
    case Code::drop:
      --top;
      break;
    case Code::call:
      top -= instruction.arity;
      *top = kFunctions[instruction.function].call(top);
      ++top;
      break;
  }
}

double Expression::operator()(const Variables& variables) const {
  std::array<double, kStackOnFrame> on_frame;
  std::vector<double> on_heap(depth_ > kStackOnFrame ? static_cast<std::size_t>(depth_) : 0);
  double* top = on_heap.empty() ? on_frame.data() : on_heap.data();  // one past the last number
  for (const Instruction& instruction : program_) apply(instruction, variables, top);
  return top[-1];
}

std::vector<double> Expression::pieces_at(double t) const {
  std::vector<double> stack(static_cast<std::size_t>(depth_)), pieces;
  std::vector<char> is_of_space(stack.size());
  double* top = stack.data();
  for (const Instruction& instruction : program_) {
    const auto before = top - stack.data();
    const auto first = instruction.code == Code::call ? before - instruction.arity : before - 2;
    const bool is_function = instruction.code == Code::call || instruction.code == Code::modulo;
    if (is_function &&
        std::none_of(is_of_space.begin() + first, is_of_space.begin() + before, [](char c) { return c != 0; }))
      pieces.push_back(instruction.code == Code::modulo ? std::trunc(stack[first] / stack[first + 1])
                                                        : piece_of(kFunctions[instruction.function].name, &stack[first]));
    apply(instruction, {.t = t}, top);
    if (instruction.code == Code::drop) continue;
    const auto after = top - stack.data();  // the newest number depends on what it is made of
    const bool is_new = instruction.code == Code::x || instruction.code == Code::y || instruction.code == Code::z;
    const bool is_made = std::any_of(is_of_space.begin() + std::min(after - 1, before), is_of_space.begin() + before,
                                     [](char c) { return c != 0; });
    is_of_space[after - 1] = is_new || is_made;
  }
  return pieces;
}

std::vector<double> Expression::kinks(double begin, double end) const {
  constexpr int kSamples = 1000;
  std::vector<double> found;
  if (!uses_time_) return found;
  std::vector<double> pieces = pieces_at(begin);
  for (int i = 1; i <= kSamples; ++i) {
    double low = begin + (end - begin) * (i - 1) / kSamples,
           high = i == kSamples ? end : begin + (end - begin) * i / kSamples;
    std::vector<double> next = pieces_at(high);
    if (next == pieces) continue;
    for (double middle = std::midpoint(low, high); low < middle && middle < high; middle = std::midpoint(low, high))
      (pieces_at(middle) == pieces ? low : high) = middle;
    found.push_back(high);
    pieces = std::move(next);
  }
  return found;
}

}  // namespace itr::scene
