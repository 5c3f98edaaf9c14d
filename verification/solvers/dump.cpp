// SPDX-License-Identifier: MIT
#include "dump.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>

#include "itr/core.hpp"
#include "linear/forwarding.hpp"
#include "linear/reuse.hpp"

namespace itr::linear {

namespace {

static_assert(std::endian::native == std::endian::little, "the files say so");
constexpr std::size_t kHeader = 128;  // bytes of NumPy's format 1.0: magic, version, length, text, padded

template <typename T>
constexpr const char* kType = std::is_same_v<T, double> ? "<f8" : "<i4";

template <typename T>
void write_array(const std::filesystem::path& file, std::span<const T> values) {
  std::ostringstream words;
  words << "{'descr': '" << kType<T> << "', 'fortran_order': False, 'shape': (" << values.size() << ",), }";
  std::string text = words.str();
  text.resize(kHeader - 10 - 1, ' ');
  const std::string header = std::string("\x93NUMPY\x01\x00", 8) + static_cast<char>(kHeader - 10) + '\0' + text + '\n';
  std::ofstream out(file, std::ios::binary);
  out << header;
  out.write(reinterpret_cast<const char*>(values.data()), static_cast<std::streamsize>(values.size_bytes()));
  out.close();
  if (!out) throw InputError({file.string(), "", "a file that cannot be written", "room in a folder that is writable"});
}

template <typename T>
std::vector<T> read_array(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string header(kHeader, '\0');
  in.read(header.data(), kHeader);
  const auto shape = header.find("'shape': (");
  if (!in || header.compare(0, 6, "\x93NUMPY") != 0 || header.find(kType<T>) == std::string::npos ||
      shape == std::string::npos)
    throw InputError(
        {file.string(), "", "no array of the expected type", std::string("NumPy's format 1.0, one axis, ") + kType<T>});
  std::uintmax_t count = 0;
  const char* const digits = header.data() + shape + 10;
  const auto parsed = std::from_chars(digits, header.data() + header.size(), count);
  std::error_code error;
  const auto bytes = std::filesystem::file_size(file, error);
  // Before memory is taken for what a damaged header says.
  if (error || parsed.ec != std::errc() || (bytes - kHeader) / sizeof(T) != count || (bytes - kHeader) % sizeof(T) != 0)
    throw InputError({file.string(), "", "a header whose shape is not that of its file",
                      std::to_string((bytes - kHeader) / sizeof(T)) + " values"});
  std::vector<T> values(count);
  in.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(values.size() * sizeof(T)));
  if (!in) throw InputError({file.string(), "", "a file that cannot be read", "a file that is readable"});
  return values;
}

class DumpingSolver final : public Forwarding {
 public:
  DumpingSolver(std::unique_ptr<Solver> solver, std::filesystem::path folder, int every)
      : solver_(std::move(solver)), folder_(std::move(folder)), every_(every) {}
  std::string_view name() const override { return solver_->name(); }
  Capabilities capabilities() const override {
    Capabilities of_solver = solver_->capabilities();
    of_solver.iterative = true;
    return of_solver;
  }

  Outcome analyze(const SparsityPattern& pattern, const AnalyzeHints& hints) override {
    system_.pattern = pattern;
    system_.block_size = hints.block_size;
    system_.dofs.assign(hints.dofs.begin(), hints.dofs.end());
    system_.coordinates.assign(hints.coordinates.begin(), hints.coordinates.end());
    return solver_->analyze(pattern, hints);
  }
  Outcome factorize(std::span<const double> values) override {
    system_.values.assign(values.begin(), values.end());
    return solver_->factorize(values);
  }
  SolveReport solve(std::span<const double> B, std::span<double> X, int columns, double asked) override {
    if (count_ % every_ == 0 && columns > 0) {
      system_.rhs.assign(B.begin(), B.begin() + system_.pattern.order);
      char name[16];
      std::snprintf(name, sizeof name, "%06d", count_);
      write_system(folder_ / name, system_);
    }
    ++count_;
    return solver_->solve(B, X, columns, asked);
  }

 private:
  const Solver& current() const override { return *solver_; }

  std::unique_ptr<Solver> solver_;
  std::filesystem::path folder_;
  int every_, count_ = 0;
  DumpedSystem system_;
};

}  // namespace

void write_system(const std::filesystem::path& folder, const DumpedSystem& system) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  write_array<int>(folder / "starts.npy", system.pattern.column_starts);
  write_array<int>(folder / "rows.npy", system.pattern.row_indices);
  write_array<double>(folder / "values.npy", system.values);
  write_array<double>(folder / "rhs.npy", system.rhs);
  write_array<int>(folder / "dofs.npy", system.dofs);
  write_array<double>(folder / "coordinates.npy", system.coordinates);
  write_array<int>(folder / "block_size.npy", std::span<const int>(&system.block_size, 1));
}

DumpedSystem read_system(const std::filesystem::path& folder) {
  DumpedSystem system;
  system.pattern.column_starts = read_array<int>(folder / "starts.npy");
  system.pattern.row_indices = read_array<int>(folder / "rows.npy");
  system.values = read_array<double>(folder / "values.npy");
  system.rhs = read_array<double>(folder / "rhs.npy");
  system.dofs = read_array<int>(folder / "dofs.npy");
  system.coordinates = read_array<double>(folder / "coordinates.npy");
  const auto block_size = read_array<int>(folder / "block_size.npy");
  system.pattern.order = static_cast<int>(system.pattern.column_starts.size()) - 1;
  const auto refuse_unless = [&](bool ok, const char* found) {
    if (!ok) throw InputError({folder.string(), "", found, "a system as write_system leaves it"});
  };
  refuse_unless(linear::is_lower_triangle(system.pattern), "starts and rows of no lower triangle");
  refuse_unless(block_size.size() == 1 && block_size[0] >= 1, "no block size");
  system.block_size = block_size[0];
  const auto n = static_cast<std::size_t>(system.pattern.order);
  const auto is_none_or = [](std::size_t size, std::size_t expected) { return size == 0 || size == expected; };
  refuse_unless(system.values.size() == system.pattern.nonzeros() && system.rhs.size() == n &&
                    is_none_or(system.dofs.size(), n) && is_none_or(system.coordinates.size(), n * system.block_size),
                "arrays of lengths that do not fit");
  for (std::size_t i = 0; i < system.dofs.size(); ++i)
    refuse_unless(system.dofs[i] > (i == 0 ? -1 : system.dofs[i - 1]), "dofs that do not ascend");
  return system;
}

std::unique_ptr<Solver> make_dumping_solver(std::unique_ptr<Solver> solver, std::filesystem::path folder, int every) {
  return std::make_unique<DumpingSolver>(std::move(solver), std::move(folder), every);
}

}  // namespace itr::linear
