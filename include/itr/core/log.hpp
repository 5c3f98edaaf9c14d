// SPDX-License-Identifier: MIT
// The library never prints: what it has to say goes to the Logger that the caller handed in.
#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace itr {

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

}  // namespace itr
