// SPDX-License-Identifier: MIT
// sim.h5: that HDF5's library reads what we write without it, after each link, a full disk and a kill.
#include "output/frame_links.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "core/hdf5.hpp"
#include "itr/core.hpp"
#include "output/files.hpp"
#include "temporary_path.hpp"

namespace itr::output {
namespace {

namespace fs = std::filesystem;

std::string name_of(int step) { return fmt::format("frames/{:06}.h5", step); }

std::string text_of(const fs::path& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

herr_t add_name(hid_t, const char* name, const H5L_info_t* info, void* names) {
  if (info->type == H5L_TYPE_EXTERNAL) static_cast<std::vector<std::string>*>(names)->emplace_back(name);
  return 0;
}

class FrameLinksTest : public testing::Test {
 protected:
  FrameLinksTest() {
    folder = temporary_path();
    fs::remove_all(folder);
    fs::create_directories(folder / "frames");
  }
  ~FrameLinksTest() override { fs::remove_all(folder); }

  /// The library's list of the links; fails where it cannot read the file.
  std::vector<std::string> names() const {
    std::vector<std::string> found;
    const hdf5::Session session;
    const hdf5::Handle file(H5Fopen(path().c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
    EXPECT_TRUE(file.is_valid());
    if (!file.is_valid()) return found;
    const hdf5::Handle group(H5Gopen2(file.id(), "/frames", H5P_DEFAULT), H5Gclose);
    EXPECT_TRUE(group.is_valid());
    H5G_info_t info;
    EXPECT_GE(H5Gget_info(group.id(), &info), 0);
    EXPECT_GE(H5Literate(group.id(), H5_INDEX_NAME, H5_ITER_INC, nullptr, add_name, &found), 0);
    EXPECT_EQ(info.nlinks, found.size());
    return found;
  }

  static std::vector<std::string> expected(int count) {
    std::vector<std::string> result;
    for (int step = 0; step < count; ++step) result.push_back(fmt::format("{:06}", step));
    return result;
  }

  void store(int step) const {
    const hdf5::Session session;
    hdf5::File frame = hdf5::File::create(folder / name_of(step));
    frame.write("/fields/x", std::vector<double>{1.0 * step, 2}, 2);
    write_file(folder / name_of(step), frame.image());
  }

  fs::path path() const { return folder / "sim.h5"; }
  fs::path folder;
};

TEST_F(FrameLinksTest, TheLibraryReadsTheFileAfterEachLink) {
  constexpr int kFrames = 400;  // several pages
  FrameLinks links(path(), {});
  EXPECT_TRUE(names().empty());
  for (int step = 0; step < kFrames; ++step) {
    store(step);
    links.append(name_of(step));
    ASSERT_EQ(names(), expected(step + 1));
  }
  const hdf5::Session session;
  const hdf5::File file = hdf5::File::open(path(), hdf5::OtherFiles::followed);
  for (int step = 0; step < kFrames; ++step)
    EXPECT_EQ(file.read_doubles(fmt::format("/frames/{:06}/fields/x", step)).values[0], step);
}

TEST_F(FrameLinksTest, AFileThatIsBegunAnewIsTheSameAsOneThatHasGrown) {
  for (const int count : {0, 1, 5, 111, 112, 113, 114, 1000}) {
    std::vector<std::string> files;
    {
      FrameLinks grown(path(), {});
      for (int step = 0; step < count; ++step) grown.append(files.emplace_back(name_of(step)));
    }
    const std::string bytes = text_of(path());
    FrameLinks begun(path(), files);
    EXPECT_EQ(text_of(path()), bytes) << count;
    EXPECT_EQ(names(), expected(count));
    begun.append(name_of(count));
    EXPECT_EQ(names(), expected(count + 1));
  }
}

TEST_F(FrameLinksTest, TheLastLinkCanBeTakenBack) {
  FrameLinks links(path(), {});
  for (int step = 0; step < 300; ++step) {
    links.append("frames/999999.h5");
    links.drop_last();
    ASSERT_EQ(names(), expected(step));
    links.append(name_of(step));
    ASSERT_EQ(names(), expected(step + 1));
  }
}

TEST_F(FrameLinksTest, AFullDiskLeavesTheFileReadableAndTheNextLinkCounts) {
  std::signal(SIGXFSZ, SIG_IGN);
  FrameLinks links(path(), {});
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit limit{9000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &limit);
  int step = 0;
  EXPECT_THROW(for (; step < 1000; ++step) links.append(name_of(step)), InputError);
  setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_GT(step, 50);
  EXPECT_EQ(names(), expected(step));
  for (; step < 1000; ++step) links.append(name_of(step));
  EXPECT_EQ(names(), expected(step));
}

TEST_F(FrameLinksTest, AKilledWriterLeavesAFileThatCanBeRead) {
  for (int round = 0; round < 40; ++round) {
    fs::remove(path());
    const pid_t child = fork();
    if (child == 0) {
      FrameLinks links(path(), {});
      for (int step = 0;; ++step) links.append(name_of(step));
    }
    while (!fs::exists(path())) std::this_thread::sleep_for(std::chrono::microseconds(50));
    std::this_thread::sleep_for(std::chrono::microseconds(137 * round));
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    const auto found = names();
    ASSERT_EQ(found, expected(static_cast<int>(found.size())));
  }
}

}  // namespace
}  // namespace itr::output
