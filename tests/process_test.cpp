// SPDX-License-Identifier: MIT
// Cores that a process may use.
#include "core/process.hpp"

#include <gtest/gtest.h>
#include <sched.h>

#include <fstream>

#include "temporary_path.hpp"

namespace itr {
namespace {

namespace fs = std::filesystem;

/// A folder with the files of /proc and /sys that tell of control groups.
class AvailableCores : public ::testing::Test {
 protected:
  AvailableCores() : root_(temporary_path()) {
    cpu_set_t set;
    CPU_ZERO(&set);
    sched_getaffinity(0, sizeof(set), &set);
    cores_ = CPU_COUNT(&set);
  }
  ~AvailableCores() override { fs::remove_all(root_); }
  void write(const fs::path& path, const std::string& text) {
    fs::create_directories((root_ / path).parent_path());
    std::ofstream(root_ / path) << text;
  }
  int available() const { return available_cores(root_); }

  fs::path root_;
  int cores_ = 0;
};

TEST_F(AvailableCores, AreThoseOfTheAffinityWithoutAQuota) {
  EXPECT_EQ(available(), cores_);
  write("proc/self/cgroup", "0::/user/job\n");
  write("sys/fs/cgroup/user/job/cpu.max", "max 100000\n");
  EXPECT_EQ(available(), cores_);
}

TEST_F(AvailableCores, AreFewerWhereAGroupHasAQuota) {
  write("proc/self/cgroup", "0::/user/job\n");
  write("sys/fs/cgroup/user/job/cpu.max", "max 100000\n");
  write("sys/fs/cgroup/user/cpu.max", "30000 100000\n");  // of the group around it
  EXPECT_EQ(available(), 1);
  write("sys/fs/cgroup/user/cpu.max", "100000000 100000\n");
  EXPECT_EQ(available(), cores_);
}

TEST_F(AvailableCores, KnowTheFirstVersionOfControlGroups) {
  write("proc/self/cgroup", "4:memory:/job\n2:cpu,cpuacct:/job\n0::/\n");
  write("sys/fs/cgroup/memory/job/cpu.cfs_quota_us", "1\n");  // not where it counts
  write("sys/fs/cgroup/memory/job/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(available(), cores_);
  write("sys/fs/cgroup/cpu,cpuacct/job/cpu.cfs_quota_us", "-1\n");
  write("sys/fs/cgroup/cpu,cpuacct/job/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(available(), cores_);
  write("sys/fs/cgroup/cpu,cpuacct/job/cpu.cfs_quota_us", "90000\n");
  EXPECT_EQ(available(), 1);
}

TEST_F(AvailableCores, FollowTheAffinityOfThisThread) {
  cpu_set_t all, one;
  CPU_ZERO(&all);
  CPU_ZERO(&one);
  sched_getaffinity(0, sizeof(all), &all);
  for (int core = 0; core < CPU_SETSIZE; ++core)
    if (CPU_ISSET(core, &all)) {
      CPU_SET(core, &one);
      break;
    }
  ASSERT_EQ(sched_setaffinity(0, sizeof(one), &one), 0);
  EXPECT_EQ(available(), 1);
  sched_setaffinity(0, sizeof(all), &all);
}

}  // namespace
}  // namespace itr
