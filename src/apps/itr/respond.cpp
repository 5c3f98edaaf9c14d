// SPDX-License-Identifier: MIT
// `itr respond`: what `itr fit` asks for the law that it fits, so that a law is told to the code once.
#include <iostream>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "energy/elastic/law_sum.hpp"
#include "scene/readers.hpp"

namespace itr::cli {

namespace {

/// Lists for strains e_i = ln s_i: W, dW/de_i and the upper triangle of d2W/de_i de_j, row by row.
nlohmann::json answer(const nlohmann::json& question) {
  const scene::Document document =
      scene::parse_document(nlohmann::json{{"materials", question.at("material")}}.dump(), "material", {});
  const LawSum sum = scene::read_law_sum(scene::Node(document)["materials"], 3);
  nlohmann::json rows = nlohmann::json::array();
  for (const auto& strains : question.at("strains")) {
    const Vec<3> e(strains.at(0).get<double>(), strains.at(1).get<double>(), strains.at(2).get<double>());
    const StretchSum response = response_to(sum, e, e.sum());
    nlohmann::json row = {response.value, response.first[0], response.first[1], response.first[2]};
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j) row.push_back(response.second(i, j));
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace

int respond() {
  for (std::string line; std::getline(std::cin, line);) std::cout << answer(nlohmann::json::parse(line)).dump() << std::endl;
  return done;
}

}  // namespace itr::cli
