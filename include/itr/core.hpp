// SPDX-License-Identifier: MIT
// Errors, messages, units and numbers of threads, which everything uses.
//
// The three kinds of failure: a user's mistake throws InputError; a numerical outcome is an enum in a summary; a broken
// invariant of ours throws InternalError through ITR_CHECK (core/check.hpp).
#pragma once

#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

/// Marks the classes and functions that the shared library exports: all others are hidden.
#define ITR_EXPORT __attribute__((visibility("default")))

namespace itr {

/// A mistake in something that a user handed in: says the file, the place in it (a JSON pointer, a line), what was
/// found and what was expected. The command prints it and ends with status 2.
class ITR_EXPORT InputError : public std::runtime_error {
 public:
  struct Parts {
    std::string file;      ///< path of the offending file; empty where there is none
    std::string place;     ///< JSON pointer, "line 12", option name
    std::string found;     ///< what is there
    std::string expected;  ///< what would have been right
  };
  explicit InputError(Parts parts);
  const Parts& parts() const { return parts_; }

 private:
  Parts parts_;
};

/// A broken invariant of the library itself.
class ITR_EXPORT InternalError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

// The library never prints: what it has to say goes to the Logger that the caller handed in.

enum class LogLevel { debug, info, warning };

/// A value that forwards messages to a sink; without a sink it drops them.
class Logger {
 public:
  using Sink = std::function<void(LogLevel, std::string_view)>;
  Logger() = default;
  explicit Logger(Sink sink) : sink_(std::move(sink)) {}
  void operator()(LogLevel level, std::string_view message) const {
    if (sink_) sink_(level, message);
  }
  void debug(std::string_view message) const { (*this)(LogLevel::debug, message); }
  void info(std::string_view message) const { (*this)(LogLevel::info, message); }
  void warning(std::string_view message) const { (*this)(LogLevel::warning, message); }

 private:
  Sink sink_;
};

// The units that a scene's numbers are in, and its results. Everything that computes is in SI units.

/// SI units unless made by names. A unit is asked for by its SI name, such as "m/s^2", "N", "Pa", "kg/m^3" or "J s^2"; the
/// force, stress and energy of a system follow from length, mass and time. In 2D, numbers in SI units are for a thickness of
/// 1 m, and those of a scene for a thickness of its unit of length.
class ITR_EXPORT Units {
 public:
  Units() = default;
  /// Names of length_names() and so on.
  Units(const std::string& length, const std::string& mass, const std::string& time);

  static std::vector<std::string> length_names();
  static std::vector<std::string> mass_names();
  static std::vector<std::string> time_names();
  /// Length of one of length_names() [m].
  static double length_in_metres(const std::string& name);

  int dim = 3;            ///< of the scene
  bool has_steps = true;  ///< false in statics, where t is 1 and "s" counts for nothing
  bool is_si() const { return is_si_; }
  const std::string& length() const { return length_.name; }
  const std::string& mass() const { return mass_.name; }
  const std::string& time() const { return time_.name; }

  /// Factor from the scene's unit of this kind to SI units; 1 for "" and "deg".
  double factor(std::string_view unit) const;
  double to_si(double value, std::string_view unit) const { return is_si_ ? value : value * factor(unit); }
  double from_si(double value, std::string_view unit) const { return is_si_ ? value : value / factor(unit); }
  /// The scene's unit of this kind: "MPa" for "Pa" in mm, t, s.
  std::string name(std::string_view unit) const;
  /// A value in SI units as a scene's user reads it, such as "3.2 mm".
  std::string text(double value, std::string_view unit, int digits = 4) const;

 private:
  struct Base {
    std::string name;
    double factor = 1;  ///< in SI units
  };
  Base length_{"m"}, mass_{"kg"}, time_{"s"};
  bool is_si_ = true;
};

/// Limits the number of threads of all parallel loops run while it lives (0: as many as there
/// are cores that this process may use, by its affinity and by the quota of its control group).
class ITR_EXPORT ThreadLimit {
 public:
  explicit ThreadLimit(int threads);
  ~ThreadLimit();
  ThreadLimit(const ThreadLimit&) = delete;
  ThreadLimit& operator=(const ThreadLimit&) = delete;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Threads that a parallel loop would use now.
ITR_EXPORT int num_threads();

}  // namespace itr
