// SPDX-License-Identifier: MIT
// Systems on the disk: written as they were solved, refused where their files are damaged.
#include <gtest/gtest.h>

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "itr/core.hpp"
#include "linear_systems.hpp"
#include "verification/solvers/dump.hpp"

namespace itr::linear {
namespace {

TEST(Systems, ComeBackFromTheDiskAsTheyWereSolved) {
  const auto folder = std::filesystem::path(::testing::TempDir()) / ("itr_systems_" + std::to_string(::getpid()));
  const Elastic elastic = elasticity(2, 5, 0.3);
  const auto solver = make_dumping_solver(Registry().create("eigen"), folder, 2);
  ASSERT_EQ(solver->analyze(elastic.pattern, elastic.hints()), Outcome::ok);
  ASSERT_EQ(solver->factorize(elastic.values), Outcome::ok);
  std::vector<double> b(elastic.pattern.order), x(b.size());
  for (std::size_t i = 0; i < b.size(); ++i) b[i] = std::cos(static_cast<double>(i));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(solver->solve(b, x, 1, 1e-10).outcome, Outcome::ok);
  EXPECT_FALSE(std::filesystem::exists(folder / "000001"));
  const DumpedSystem back = read_system(folder / "000002");
  EXPECT_EQ(back.pattern, elastic.pattern);
  EXPECT_EQ(back.values, elastic.values);
  EXPECT_EQ(back.rhs, b);
  EXPECT_EQ(back.block_size, 2);
  EXPECT_EQ(back.dofs, elastic.dofs);
  EXPECT_EQ(back.coordinates, elastic.coordinates);
  EXPECT_THROW(read_system(folder / "000001"), InputError);
  std::filesystem::remove_all(folder);
}

TEST(Systems, AreRefusedWhereTheirFilesAreDamaged) {
  const auto folder = std::filesystem::path(::testing::TempDir()) / ("itr_damaged_" + std::to_string(::getpid()));
  const Elastic elastic = elasticity(2, 3, 0.3);
  const DumpedSystem good{elastic.pattern, elastic.values,     std::vector<double>(elastic.pattern.order, 1.0), 2,
                          elastic.dofs,    elastic.coordinates};
  const auto is_refused = [&] {
    EXPECT_THROW(read_system(folder), InputError);
    write_system(folder, good);
  };
  write_system(folder, good);
  EXPECT_NO_THROW(read_system(folder));
  const auto refused = [&](auto&& damage) {
    DumpedSystem system = good;
    damage(system);
    write_system(folder, system);
    is_refused();
  };
  refused([](DumpedSystem& s) { s.pattern.row_indices.back() = 1000; });
  refused([](DumpedSystem& s) { s.pattern.row_indices[1] = -1; });
  refused([](DumpedSystem& s) { std::swap(s.pattern.column_starts[1], s.pattern.column_starts[2]); });
  refused([](DumpedSystem& s) { s.pattern.column_starts[0] = 1; });
  refused([](DumpedSystem& s) { s.rhs.pop_back(); });
  refused([](DumpedSystem& s) { s.coordinates.resize(s.dofs.size()); });
  refused([](DumpedSystem& s) { s.dofs[1] = s.dofs[0]; });
  refused([](DumpedSystem& s) { s.block_size = 0; });
  std::filesystem::resize_file(folder / "values.npy", 200);
  is_refused();
  for (const std::string shape : {"(-1", "(x", "(9999999999999999999999", "(999999999999"}) {
    const auto file = folder / "values.npy";
    std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
    std::string header(128, ' ');
    stream.read(header.data(), 128);
    const auto place = header.find("(");
    header.replace(place, shape.size(), shape);
    stream.seekp(0);
    stream.write(header.data(), 128);
    stream.close();
    is_refused();
  }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace itr::linear
