// SPDX-License-Identifier: MIT
// A run has its folder alone, and removes and replaces only files that runs wrote there.
#include "itr/output.hpp"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "interrupt.hpp"
#include "itr/core.hpp"

namespace itr::output {
namespace {

/// Contents by name; folders end with a slash.
std::map<std::string, std::string> contents_of(const fs::path& directory) {
  std::map<std::string, std::string> contents;
  for (const auto& entry : fs::recursive_directory_iterator(directory)) {
    const std::string name = fs::relative(entry.path(), directory).string();
    if (entry.is_directory())
      contents[name + "/"] = "";
    else
      contents[name] = text_of(entry.path());
  }
  return contents;
}

std::set<std::string> names_in(const fs::path& directory) {
  std::set<std::string> names;
  for (const auto& [name, ignored] : contents_of(directory)) names.insert(name);
  return names;
}

void put(const fs::path& path, const std::string& text = "mine") {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

class FolderTest : public InterruptTest {
 protected:
  Arguments short_run(const fs::path& run, int steps = 4) const {
    Case which = kStopped;
    which.steps = steps;
    return arguments(which, run, 30);
  }
};

const Arguments kAll = {"--report", "--set", "/output/paraview/vtu=true", "--set",
                        R"(/output/forces=[{"name":"ball","bodies":1}])"};

TEST_F(FolderTest, FilesThatNoRunWroteStay) {
  const fs::path run = folder / "run";
  const std::vector<std::string> mine = {"notes.tmp",      "frames/notes.tmp", "frames/sim.h5.tmp", "frames/000000.h5.tmp",
                                         "sim.h5.tmp",     "frames/7.h5",      "vtu/mine.vtu",      "vtu/000001.vtu",
                                         "forces.csv",     "sim.pvd",          "report.html",       "steps.jsonl.tmp",
                                         "sim.h5.17-0.tmp"};
  for (const auto& name : mine) put(run / name);
  for (const Arguments& how : {Arguments{}, Arguments{"--overwrite"}, Arguments{"--resume"}}) {
    const Command command = start(short_run(run) + how);
    ASSERT_EQ(command.wait(), 0) << command.said();
    EXPECT_EQ(results_of(run).size(), 5u);
    for (const auto& name : mine) EXPECT_EQ(text_of(run / name), "mine") << name;
  }
}

TEST_F(FolderTest, ARunThatWouldReplaceAFileOfSomebodyElseIsRefused) {
  const fs::path run = folder / "run";
  for (const char* name : {"sim.h5", "sim.xdmf", "steps.jsonl", "summary.json", "frames/000000.h5", "frames/000999.h5",
                           "forces.csv", "sim.pvd", "vtu/000002.vtu", "report.html", "itr-files.txt"}) {
    fs::remove_all(run);
    put(run / name);
    const auto before = contents_of(run);
    for (const Arguments& how : {Arguments{}, Arguments{"--overwrite"}}) {
      const Command command = start(short_run(run) + kAll + how);
      EXPECT_EQ(command.wait(), 2) << name;
      EXPECT_NE(command.said().find((run / name).string()), std::string::npos) << command.said();
      EXPECT_EQ(contents_of(run), before) << name;
    }
  }
}

/// A file that was put there after the run is somebody else's, too.
TEST_F(FolderTest, ARefusedRunLeavesTheOneBefore) {
  const fs::path run = folder / "run";
  ASSERT_EQ(start(short_run(run)).wait(), 0);
  put(run / "frames/000012.h5");
  const auto before = contents_of(run);
  for (const char* how : {"--overwrite", "--resume"}) {
    const Command command = start(short_run(run, 20) + Arguments{how});
    EXPECT_EQ(command.wait(), 2) << how;
    EXPECT_NE(command.said().find("frames/000012.h5"), std::string::npos) << command.said();
    EXPECT_EQ(contents_of(run), before) << how;
  }
}

TEST_F(FolderTest, OverwriteLeavesNothingOfTheRunBefore) {
  const fs::path run = folder / "run", fresh = folder / "fresh";
  ASSERT_EQ(start(short_run(run, 9) + kAll).wait(), 0) << text_of(folder / "log");
  for (const char* name : {"report.html", "sim.pvd", "vtu/000009.vtu", "forces.csv"})
    ASSERT_TRUE(fs::exists(run / name)) << name;
  for (const char* name : {"notes.txt", "frames/x.tmp", "vtu/mine.vtu"}) put(run / name);
  const Command over = start(short_run(run) + Arguments{"--overwrite"});
  ASSERT_EQ(over.wait(), 0) << over.said();
  EXPECT_NE(over.said().find("removed"), std::string::npos) << over.said();
  ASSERT_EQ(start(short_run(fresh)).wait(), 0);
  std::set<std::string> expected = names_in(fresh);
  expected.merge(std::set<std::string>{"notes.txt", "frames/x.tmp", "vtu/", "vtu/mine.vtu"});
  EXPECT_EQ(names_in(run), expected);
  expect_same_results(fresh, run);

  ASSERT_EQ(Command({run.string()}, folder / "log", 0, {"report"}).wait(), 0) << text_of(folder / "log");
  ASSERT_TRUE(fs::exists(run / "report.html"));
  ASSERT_EQ(start(short_run(run) + Arguments{"--overwrite"}).wait(), 0);
  EXPECT_EQ(names_in(run), expected) << "a report that was made afterwards is one of that run";
}

TEST_F(FolderTest, ReportsReplaceNoFileOfSomebodyElse) {
  const fs::path run = folder / "run";
  ASSERT_EQ(start(short_run(run)).wait(), 0);
  put(run / "report.html");
  const Command refused({run.string()}, folder / "log", 0, {"report"});
  EXPECT_EQ(refused.wait(), 2) << refused.said();
  EXPECT_EQ(text_of(run / "report.html"), "mine");
  fs::remove(run / "report.html");
  std::ofstream(run / "itr-files.txt", std::ios::app) << "frames/0000";  // as a run that is killed may leave it
  for (int i = 0; i < 2; ++i) EXPECT_EQ(Command({run.string()}, folder / "log", 0, {"report"}).wait(), 0);
  ASSERT_EQ(start(short_run(run) + Arguments{"--overwrite"}).wait(), 0);
  EXPECT_FALSE(fs::exists(run / "report.html"));
}

TEST_F(FolderTest, WithoutOverwriteNothingOfARunIsReplaced) {
  const fs::path run = folder / "run";
  ASSERT_EQ(start(short_run(run) + kAll).wait(), 0);
  fs::remove_all(run / "frames");
  for (const char* name : {"steps.jsonl", "summary.json"}) fs::remove(run / name);
  const auto before = contents_of(run);
  const Command again = start(short_run(run));
  EXPECT_EQ(again.wait(), 2) << again.said();
  EXPECT_EQ(contents_of(run), before);
}

TEST_F(FolderTest, WhatAKilledRunWasWritingIsRemoved) {
  const fs::path run = folder / "run";
  ASSERT_EQ(start(short_run(run)).wait(), 0);
  std::ofstream(run / "itr-files.txt", std::ios::app) << "process 4711\nframes/000005.h5\nframes/0000";
  for (const char* name : {"frames/000005.h5.4711-0.tmp", "sim.h5.4711-3.tmp"}) put(run / name);
  for (const char* name : {"sim.h5.4712-0.tmp", "frames/000006.h5.4711-0.tmp"}) put(run / name);
  const Command more = start(short_run(run, 8) + Arguments{"--resume"});
  ASSERT_EQ(more.wait(), 0) << more.said();
  for (const char* name : {"frames/000005.h5.4711-0.tmp", "sim.h5.4711-3.tmp"}) EXPECT_FALSE(fs::exists(run / name)) << name;
  for (const char* name : {"sim.h5.4712-0.tmp", "frames/000006.h5.4711-0.tmp"}) EXPECT_TRUE(fs::exists(run / name)) << name;
  EXPECT_EQ(results_of(run).size(), 9u);
}

TEST_F(FolderTest, ARunThatIsKilledWhileItRemovesTheOneBeforeIsBegunAgain) {
  const fs::path run = folder / "run", fresh = folder / "fresh";
  ASSERT_EQ(start(short_run(run, 20)).wait(), 0);
  put(run / "frames/notes.txt");
  std::ofstream(run / "itr-files.txt", std::ios::app) << "removing\n";
  for (const char* name : {"steps.jsonl", "frames/000000.h5", "frames/000001.h5"}) fs::remove(run / name);
  const Command command = start(short_run(run) + Arguments{"--resume"});
  ASSERT_EQ(command.wait(), 0) << command.said();
  ASSERT_EQ(start(short_run(fresh)).wait(), 0);
  expect_same_results(fresh, run);
  std::set<std::string> expected = names_in(fresh);
  expected.insert("frames/notes.txt");
  EXPECT_EQ(names_in(run), expected);
}

/// Versions before 25 November 2026 left no list.
TEST_F(FolderTest, AFolderWithoutAListIsStillOfARun) {
  const fs::path run = folder / "run", fresh = folder / "fresh";
  ASSERT_EQ(start(short_run(run) + kAll).wait(), 0);
  put(run / "frames/notes.txt");
  fs::remove(run / "itr-files.txt");
  EXPECT_EQ(start(short_run(run)).wait(), 2);
  EXPECT_FALSE(fs::exists(run / "itr-files.txt"));
  const Command more = start(short_run(run, 8) + kAll + Arguments{"--resume"});
  ASSERT_EQ(more.wait(), 0) << more.said();
  EXPECT_EQ(results_of(run).size(), 9u);
  fs::remove(run / "itr-files.txt");
  ASSERT_EQ(start(short_run(run) + Arguments{"--overwrite"}).wait(), 0);
  ASSERT_EQ(start(short_run(fresh)).wait(), 0);
  std::set<std::string> expected = names_in(fresh);
  expected.insert("frames/notes.txt");
  EXPECT_EQ(names_in(run), expected);
}

TEST_F(FolderTest, TwoRunsInOneFolderAreRefusedUntilTheFirstHasEnded) {
  const fs::path run = folder / "run";
  Case longer = kStopped;
  longer.steps = 100000;
  longer.sets.push_back(R"(/output/forces=[{"name":"ball","bodies":1}])");
  const Command first(arguments(longer, run, 0), folder / "first");
  ASSERT_TRUE(wait_until([&] { return count_lines(run / "steps.jsonl") >= 3; })) << "the run does not go on";
  for (const Arguments& how : {Arguments{}, Arguments{"--overwrite"}, Arguments{"--resume"}}) {
    const int lines = count_lines(run / "steps.jsonl");
    const Command forces({run.string()}, folder / "log", 0, {"forces"});
    EXPECT_EQ(forces.wait(), 2);
    EXPECT_NE(forces.said().find("another run at work"), std::string::npos) << forces.said();
    const Command second = start(arguments(longer, run, 0) + how);
    EXPECT_EQ(second.wait(), 2);
    EXPECT_NE(second.said().find("another run at work"), std::string::npos) << second.said();
    EXPECT_GE(count_lines(run / "steps.jsonl"), lines);
  }
  first.send(SIGKILL);
  EXPECT_EQ(first.wait(), -SIGKILL);
  expect_readable(run);
  longer.steps = static_cast<int>(find_saved_state(run)->step) + 2;
  const Command last = start(arguments(longer, run, 0) + Arguments{"--resume"});
  EXPECT_EQ(last.wait(), 0) << last.said();
  EXPECT_EQ(results_of(run).size(), static_cast<std::size_t>(longer.steps) + 1);
}

TEST_F(FolderTest, ALockEndsWithItsOwnerAndLeavesNothing) {
  const fs::path run = folder / "deep/er/run";
  {
    const Folder first(run);
    EXPECT_FALSE(first.has_results());
    EXPECT_THROW(Folder{run}, InputError);
  }
  EXPECT_FALSE(fs::exists(folder / "deep"));
  put(run / "notes.txt");
  const auto before = contents_of(run);
  EXPECT_NO_THROW(Folder{run});
  EXPECT_EQ(contents_of(run), before);
  Folder second(run);
  EXPECT_EQ(second.begin({}), 0);
  EXPECT_THROW(second.claim("notes.txt"), InputError);
  second.claim("frames/000000.h5");
  put(run / "frames/000000.h5");
  EXPECT_NO_THROW(second.claim("frames/000000.h5"));
  put(run / "frames/000001.h5");
  EXPECT_THROW(second.claim("frames/000001.h5"), InputError);
}

/// Each of many that start at once either has the folder or is refused.
TEST_F(FolderTest, OfRunsThatStartAtOnceOneIsAtWork) {
  const fs::path run = folder / "run";
  std::vector<Command> commands;
  for (int i = 0; i < 6; ++i) commands.emplace_back(short_run(run, 40), folder / fmt::format("log{}", i));
  int done = 0;
  for (const Command& command : commands) {
    const int status = command.wait();
    EXPECT_TRUE(status == 0 || status == 2) << command.said();
    done += status == 0;
  }
  EXPECT_EQ(done, 1);
  EXPECT_EQ(results_of(run).size(), 41u);
  expect_readable(run);
}

}  // namespace
}  // namespace itr::output
