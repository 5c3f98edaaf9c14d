// SPDX-License-Identifier: MIT
#include "core/process.hpp"

#include <sched.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>

namespace itr {

namespace {

namespace fs = std::filesystem;

/// Cores by the quota of one control group: its processor time over its period; infinity where there is no limit.
double quota_of(const fs::path& group) {
  double quota = 0, period = 0;
  if (std::ifstream version2(group / "cpu.max"); version2 >> quota >> period && period > 0) return quota / period;
  std::ifstream first(group / "cpu.cfs_quota_us"), second(group / "cpu.cfs_period_us");
  if (first >> quota && second >> period && quota > 0 && period > 0) return quota / period;
  return std::numeric_limits<double>::infinity();
}

/// Whether a list of controllers, separated by commas, has `name`; that of version 2 is empty.
bool has_controller(const std::string& list, const std::string& name) {
  return list.empty() || ("," + list + ",").find("," + name + ",") != std::string::npos;
}

/// The least quota of the control groups that this process is in, and of those around them.
double least_quota(const fs::path& root) {
  const fs::path groups = root / "sys/fs/cgroup";
  double least = std::numeric_limits<double>::infinity();
  std::ifstream memberships(root / "proc/self/cgroup");
  for (std::string line; std::getline(memberships, line);) {  // number:controllers:/path
    std::istringstream parts(line);
    std::string number, controllers, path;
    if (!std::getline(parts, number, ':') || !std::getline(parts, controllers, ':') || !std::getline(parts, path)) continue;
    if (!has_controller(controllers, "cpu")) continue;
    for (fs::path group = fs::path(path).relative_path();; group = group.parent_path()) {
      least = std::min(least, quota_of(groups / controllers / group));
      if (group.empty()) break;
    }
  }
  return least;
}

}  // namespace

double peak_rss_mb() {
  // getrusage counts the memory of the program that started this one, too.
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::strtod(line.c_str() + 6, nullptr) / 1024;
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

int available_cores(const std::filesystem::path& root) {
  cpu_set_t set;
  CPU_ZERO(&set);
  const int cores = sched_getaffinity(0, sizeof(set), &set) == 0 ? std::max(1, CPU_COUNT(&set)) : 1;
  const double quota = least_quota(root);
  return quota < cores ? std::max(1, static_cast<int>(std::ceil(quota))) : cores;
}

double processor_seconds_now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

}  // namespace itr
