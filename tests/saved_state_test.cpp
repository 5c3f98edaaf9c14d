// SPDX-License-Identifier: MIT
// Saved states that are damaged, of another scene or of another version: what --resume takes, what it refuses, what it
// keeps.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "interrupt.hpp"
#include "itr/core.hpp"
#include "itr/output.hpp"
#include "itr/scene.hpp"
#include "output/certify.hpp"
#include "simulation/state.hpp"

namespace itr::output {
namespace {

class SavedStateTest : public InterruptTest {};

class DamageTest : public SavedStateTest {
 protected:
  /// A run of 12 steps, each of which is saved.
  fs::path make_run() const {
    const fs::path run = folder / "run";
    Case which = kStopped;
    which.steps = 12;
    EXPECT_EQ(start(arguments(which, run, 0)).wait(), 0) << text_of(folder / "log");
    return run;
  }
  Command resume(const fs::path& run) const {
    Case which = kStopped;
    which.steps = 16;
    return start(arguments(which, run, 30, true));
  }
  Command certify_run(const fs::path& run) const { return Command({}, folder / "log", 0, {"certify", run.string()}); }
  static void flip(const fs::path& file, std::size_t at, int bit) {
    std::string bytes = text_of(file);
    bytes.at(at) = static_cast<char>(bytes.at(at) ^ (1 << bit));
    std::ofstream(file, std::ios::binary) << bytes;
  }
  /// Where the values of a dataset begin.
  static std::size_t place_of(const fs::path& file, const std::string& name) {
    const hdf5::Session session;
    const std::vector<double> values = hdf5::File::open(file).read_doubles(name).values;
    const std::string bytes = text_of(file);
    const std::string_view pattern(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
    const std::size_t at = bytes.rfind(pattern);
    EXPECT_NE(at, std::string::npos) << name;
    return at;
  }
};

TEST_F(DamageTest, OfTheNewestStateIsSaidAndAnOlderOneServes) {
  const fs::path whole = folder / "whole", run = make_run();
  Case which = kStopped;
  which.steps = 16;
  ASSERT_EQ(start(arguments(which, whole, 0)).wait(), 0);
  const auto frames = stored_frames(run);
  flip(frames[12], place_of(frames[12], "/checkpoint/history/v/0") + 8, 3);
  std::ofstream(frames[11], std::ios::binary) << text_of(frames[11]).substr(0, 3000);
  const Command certified = certify_run(run);
  EXPECT_EQ(certified.wait(), 2);  // of a frame that is cut off
  fs::remove(frames[11]);
  const Command again = certify_run(run);
  EXPECT_EQ(again.wait(), 4) << again.said();
  EXPECT_NE(again.said().find("frames/000012.h5: /checkpoint/history/v/0 is damaged"), std::string::npos) << again.said();
  const Command resumed = resume(run);
  ASSERT_EQ(resumed.wait(), 0) << resumed.said();
  EXPECT_NE(resumed.said().find("/checkpoint/history/v/0: found values of another digest"), std::string::npos);
  EXPECT_NE(resumed.said().find("going on after step 10"), std::string::npos) << resumed.said();
  EXPECT_EQ(results_of(run), results_of(whole));
}

TEST_F(DamageTest, OfOneBitOfAnArrayIsAlwaysSaid) {
  const fs::path run = make_run(), file = stored_frames(run).back();
  const std::string bytes = text_of(file);
  struct Array {
    std::string name;
    std::size_t begin, size;
  };
  std::vector<Array> arrays;
  {
    const hdf5::Session session;
    const hdf5::File frame = hdf5::File::open(file);
    const auto add = [&](const std::string& name, const auto& values) {
      const std::string_view pattern(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
      const std::size_t at = bytes.find(pattern);
      if (pattern.size() >= 16 && at != std::string::npos && at == bytes.rfind(pattern))
        arrays.push_back({name, at, pattern.size()});
    };
    for (const std::string& name : frame.digest_names()) {
      if (name[0] == '@' || !(name.starts_with("/mesh/") || name.starts_with("/checkpoint/"))) continue;
      if (frame.holds_text(name))
        add(name, frame.read_text(name));
      else if (frame.holds_integers(name))
        add(name, frame.read_integers(name).values);
      else
        add(name, frame.read_doubles(name).values);
    }
  }
  EXPECT_GT(arrays.size(), 8u);
  std::mt19937 random(1);
  for (int i = 0; i < 200; ++i) {
    const Array& array = arrays[random() % arrays.size()];
    flip(file, array.begin + random() % array.size, static_cast<int>(random() % 8));
    EXPECT_EQ(find_damage(file), std::vector{array.name});
    const auto saved = find_saved_state(run);
    ASSERT_TRUE(saved.has_value());
    if (saved->step == 12) {
      EXPECT_THROW(read_checkpoint<2>(*saved), InputError) << array.name;
    } else {
      EXPECT_EQ(saved->passed_over.size(), 1u) << array.name;
    }
    std::ofstream(file, std::ios::binary) << bytes;
  }
}

/// As a host may hand in, or a file whose digests are right.
TEST_F(DamageTest, OfInvariantsIsRefused) {
  const fs::path run = make_run();
  const auto saved = find_saved_state(run);
  ASSERT_TRUE(saved.has_value());
  auto checkpoint = read_checkpoint<2>(*saved);
  const State<2> good = *checkpoint.state;
  const scene::Scene scene =
      scene::read(fmt::format("{}/examples/{}", ITR_SOURCE_DIR, kStopped.scene), {{"/space/remesh/enabled", "false"}});
  linear::Registry registry;
  Simulation<2> simulation(std::get<itr::Setup<2>>(scene.setup), registry);
  EXPECT_NO_THROW(simulation.restore(good));
  const auto message_of = [&](const std::function<void(State<2>&)>& change) {
    State<2> state = good;
    change(state);
    try {
      simulation.restore(std::move(state));
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  const auto expect = [&](const char* part, const std::function<void(State<2>&)>& change) {
    EXPECT_NE(message_of(change).find(part), std::string::npos) << message_of(change);
  };
  expect("saved velocities", [](State<2>& s) { s.history.v.clear(); });
  expect("saved velocities", [](State<2>& s) { s.history.v[0].conservativeResize(4); });
  expect("saved positions: found 3 past states", [](State<2>& s) { s.history.x.push_back(s.history.x[0]); });
  expect("saved accelerations", [](State<2>& s) { s.history.a.push_back(s.history.x[0]); });
  expect("saved velocities[3]: found nan", [](State<2>& s) { s.history.v[0][3] = NAN; });
  expect("saved positions[0]: found inf", [](State<2>& s) { s.history.x[0][0] = HUGE_VAL; });
  expect("length of saved deviation", [](State<2>& s) { s.deviation = VectorX::Zero(2); });
  expect("saved deviation[1]", [](State<2>& s) { s.deviation = s.history.x[0], s.deviation[1] = NAN; });
  expect("saved time", [](State<2>& s) { s.t = NAN; });
  expect("saved step", [](State<2>& s) { s.step = -1; });
  expect("body of a saved cell", [](State<2>& s) {
    std::vector<Vec<2>> rest;
    std::vector<std::array<int, 3>> cells;
    for (int v = 0; v < s.mesh.num_vertices(); ++v) rest.push_back(s.mesh.rest(v));
    for (int c = 0; c < s.mesh.cell_slots(); ++c) cells.push_back(s.mesh.cell(c));
    const std::vector<int> body(cells.size(), 77);
    s.mesh = Mesh<2>(rest, cells, body);
  });
  expect("is inverted", [](State<2>& s) { std::swap(s.history.x[0][0], s.history.x[0][2]); });
  expect("surfaces intersect", [](State<2>& s) {  // through the wall
    for (int v = 0; v < s.mesh.num_vertices(); ++v) s.history.x[0][2 * v] += 0.1;
  });
  EXPECT_EQ(message_of([](State<2>&) {}), "taken");
}

/// A beam whose remeshing makes curved edges.
Case curved(int steps) {
  return {"curved",
          "cantilever.json",
          steps,
          R"("dt":0.02)",
          {"/space/remesh/curve/enabled=true", "/geometry/0/n_refs=1", "/space/remesh/split/acceptance_tolerance=300"}};
}

class CurvedRunTest : public InterruptTest, public ::testing::WithParamInterface<const char*> {};

TEST_P(CurvedRunTest, KeepsItsCurvedEdgesWhereRemeshingChanges) {
  const fs::path run = folder / "run";
  ASSERT_EQ(start(arguments(curved(4), run, 0)).wait(), 0);
  const auto lines = results_of(run);
  const std::size_t edges = read_frame(stored_frames(run).back()).curved_edges.size();
  ASSERT_GT(edges, 0u);
  Case which = curved(6);
  which.sets.emplace_back(GetParam());
  const Command resumed = start(arguments(which, run, 0, true) + Arguments{"--allow-changes"});
  ASSERT_EQ(resumed.wait(), 0) << resumed.said();
  EXPECT_NE(resumed.said().find("going on after step 4"), std::string::npos) << resumed.said();
  const auto longer = results_of(run);
  ASSERT_EQ(longer.size(), 7u);
  EXPECT_TRUE(std::equal(lines.begin(), lines.end(), longer.begin()));
  const StoredFrame last = read_frame(stored_frames(run).back());
  EXPECT_GT(last.curved_edges.size(), edges / 2);
  if (GetParam() == std::string("/space/remesh/enabled=false")) {
    EXPECT_EQ(last.curved_edges.size(), edges);
  }
  EXPECT_TRUE(certify(run).passed());
}

INSTANTIATE_TEST_SUITE_P(Changes, CurvedRunTest,
                         ::testing::Values("/space/remesh/enabled=false", "/space/remesh/curve/enabled=false"),
                         [](const auto& info) { return std::string(info.index == 0 ? "fixed_mesh" : "no_new_curves"); });

/// Older states would not fit either, and their steps would replace those that are there.
TEST_F(SavedStateTest, AStateThatDoesNotFitIsRefusedAndKept) {
  const fs::path run = folder / "run";
  ASSERT_EQ(start(arguments(curved(4), run, 0)).wait(), 0);
  const auto lines = results_of(run);
  const auto frames = stored_frames(run);
  Case which = curved(6);
  which.sets.insert(which.sets.end(), {"/space/remesh/curve/enabled=false", "/solver/advanced/lump_mass_matrix=true"});
  const Command resumed = start(arguments(which, run, 0, true) + Arguments{"--allow-changes"});
  EXPECT_EQ(resumed.wait(), 2) << resumed.said();
  EXPECT_NE(resumed.said().find("000004.h5: /solver/advanced/lump_mass_matrix"), std::string::npos) << resumed.said();
  EXPECT_EQ(results_of(run), lines);
  EXPECT_EQ(stored_frames(run), frames);
}

TEST_F(SavedStateTest, OtherUnitsInOneFolderAreRefused) {
  const fs::path run = folder / "run";
  Case which = kStopped;
  which.steps = 3;
  which.sets.emplace_back(R"(/units={"mass":"g"})");
  ASSERT_EQ(start(arguments(which, run, 0)).wait(), 0) << text_of(folder / "log");
  const auto lines = results_of(run);
  which.steps = 5;
  const Arguments to_si = {"--set", R"(/output/units="SI")"};
  const Command mixed = start(arguments(which, run, 0, true) + to_si);
  EXPECT_EQ(mixed.wait(), 2) << mixed.said();
  EXPECT_NE(mixed.said().find("/output/units: found results in m, kg, s; expected results in m, g, s"), std::string::npos)
      << mixed.said();
  EXPECT_EQ(results_of(run), lines);
  const Command same = start(arguments(which, run, 0, true));
  EXPECT_EQ(same.wait(), 0) << same.said();
  const Command anew = start(arguments(which, folder / "si", 0) + to_si);
  EXPECT_EQ(anew.wait(), 0) << anew.said();
}

/// As after an update of itr that changed the format of saved states.
TEST_F(SavedStateTest, FramesWithoutAReadableStateAreRefusedAndKept) {
  const fs::path run = folder / "run";
  const Command first = start(arguments(kStopped, run, 30));
  ASSERT_EQ(stop_at(first, run, 5, SIGINT), 3) << first.said();
  const auto frames = stored_frames(run);
  const auto lines = results_of(run);
  for (const auto& frame : frames) {
    std::string bytes = text_of(frame);
    for (std::size_t at; (at = bytes.find("checkpoint_format")) != std::string::npos;) bytes[at] = 'C';
    std::ofstream(frame, std::ios::binary) << bytes;
  }
  const Command second = start(arguments(kStopped, run, 30, true));
  EXPECT_EQ(second.wait(), 2);
  EXPECT_NE(second.said().find("no state that can be read"), std::string::npos) << second.said();
  EXPECT_EQ(stored_frames(run), frames);
  EXPECT_EQ(results_of(run), lines);
}

/// Results that itr 0.1 (928a048, `tests/states_0.1/scene.json`) stored after five steps.
class ResultsOf01 : public SavedStateTest {
 protected:
  Command go_on(const std::string& name, const Arguments& more = {}) const {
    fs::copy(data / name, folder / name, fs::copy_options::recursive);
    return run(name, more, {"--resume"});
  }
  Command run(const std::string& name, const Arguments& sets, const Arguments& options) const {
    Arguments words = {(data / "scene.json").string(), "-o", (folder / name).string(), "--threads", "1"};
    words.insert(words.end(), options.begin(), options.end());
    for (const std::string& set : sets) words.insert(words.end(), {"--set", set});
    words.insert(words.end(), {"--set", "/time/time_steps=8"});
    return start(words);
  }
  Command itr(const Arguments& command) const { return Command({}, folder / "log", 0, command); }

  const fs::path data = fs::path(ITR_SOURCE_DIR) / "tests/states_0.1";
};

TEST_F(ResultsOf01, HaveStatesThatAreRead) {
  for (const std::string name : {"fixed", "remeshed"}) {
    const auto saved = find_saved_state(data / name);
    ASSERT_TRUE(saved.has_value()) << name;
    EXPECT_EQ(scene::defaults_of(saved->scene), "itr-0");
    const auto checkpoint = read_checkpoint<2>(*saved);
    const State<2>& state = *checkpoint.state;
    const StoredFrame frame = read_frame(saved->file);
    EXPECT_EQ(state.step, 5);
    EXPECT_EQ(std::vector<double>(state.history.x[0].begin(), state.history.x[0].end()), frame.x);
    EXPECT_EQ(state.remesh_memory.refusals.empty(), name == "fixed");
    EXPECT_EQ(state.strata.empty(), name == "fixed");
    const Json totals = Json::parse(checkpoint.totals), summary = Json::parse(text_of(data / name / "summary.json"));
    for (const char* field : {"vertices", "newton_iterations", "min_distance", "history_loss"})
      EXPECT_EQ(totals.at(field), summary.at(field)) << field;
    for (const auto& [term, energy] : summary.at("energy").items()) EXPECT_EQ(totals.at("energy").at(term), energy) << term;
    for (const char* field : {"splits", "collapses"})
      for (const auto& [reason, count] : summary.at(field).at("refused").items())
        EXPECT_EQ(totals.at(field).at("refused").at(reason), count) << reason;
  }
}

TEST_F(ResultsOf01, GoOn) {
  const Command resumed = go_on("fixed");
  ASSERT_EQ(resumed.wait(), 0) << resumed.said();
  EXPECT_NE(resumed.said().find("going on after step 5"), std::string::npos) << resumed.said();
  const Command anew = run("anew", {}, {"--defaults", "itr-0"});
  ASSERT_EQ(anew.wait(), 0) << anew.said();
  const std::vector<Json> lines = results_of(folder / "fixed"), expected = results_of(folder / "anew");
  ASSERT_EQ(lines.size(), 9u);
  ASSERT_EQ(expected.size(), 9u);
  for (const int step : {5, 8})
    for (const char* term : {"inertia", "elastic", "body", "total"}) {
      const double energy = expected[step]["energy"][term];
      EXPECT_NEAR(lines[step]["energy"][term].get<double>(), energy, 1e-6 * std::abs(energy)) << term << " of step " << step;
    }
  EXPECT_EQ(summary_of(folder / "fixed")["steps"], 8);

  const Command remeshed = go_on("remeshed", {"/space/remesh/enabled=true"});
  ASSERT_EQ(remeshed.wait(), 0) << remeshed.said();
  EXPECT_NE(remeshed.said().find("going on after step 5"), std::string::npos) << remeshed.said();
  EXPECT_EQ(results_of(folder / "remeshed").size(), 9u);
  const auto tried = [](const fs::path& run) { return summary_of(run)["splits"]["tried"].get<int>(); };
  EXPECT_GT(tried(folder / "remeshed"), tried(data / "remeshed"));
}

TEST_F(ResultsOf01, AreReadByTheCommands) {
  for (const std::string name : {"fixed", "remeshed"}) {
    fs::copy(data / name, folder / name, fs::copy_options::recursive);
    const std::string run = (folder / name).string(), forces = text_of(folder / name / "forces.csv");
    const Command certified = itr({"certify", run});
    EXPECT_EQ(certified.wait(), 0) << certified.said();
    const Command completed = itr({"forces", run});
    EXPECT_EQ(completed.wait(), 0) << completed.said();
    EXPECT_EQ(count_lines(folder / name / "forces.csv"), 7) << "a header, step 0 and five steps";
    const Command page = itr({"report", run});
    EXPECT_EQ(page.wait(), 0) << page.said();
  }
  const Command compared = itr({"distance", (folder / "fixed").string(), (folder / "remeshed").string()});
  ASSERT_EQ(compared.wait(), 0) << compared.said();
  const Json errors = Json::parse(compared.said());
  EXPECT_EQ(errors["times"], 1);
  EXPECT_GT(errors["l2"].get<double>(), 0);
  EXPECT_LT(errors["l2"].get<double>(), 0.2);
}

}  // namespace
}  // namespace itr::output
