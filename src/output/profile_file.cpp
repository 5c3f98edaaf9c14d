// SPDX-License-Identifier: MIT
#include "profile_file.hpp"

#include "report_json.hpp"

namespace itr::output {

ProfileFile::ProfileFile(const std::filesystem::path& directory, int threads)
    : file_(directory / kProfileFile, 0), threads_(threads) {}

void ProfileFile::add(int step) {
  Json line{{"step", step}, {"threads", threads_}, {"phases", Json::array()}};
  for (const PhaseTimes& times : profile_.take()) {
    Json predicted;
    for (std::size_t i = 0; i < kPredictedCores.size(); ++i)
      predicted[std::to_string(kPredictedCores[i])] = times.predicted[i];
    line["phases"].push_back({{"phase", times.name},
                              {"wall", times.wall},
                              {"processor", times.processor},
                              {"work", times.work},
                              {"span", times.span},
                              {"predicted", std::move(predicted)},
                              {"bytes", times.bytes}});
  }
  file_.append(line.dump());
}

}  // namespace itr::output
