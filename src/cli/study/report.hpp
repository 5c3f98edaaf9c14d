// SPDX-License-Identifier: MIT
// What a study says: its rows as CSV and JSON, orders, and answers in words.
#pragma once

#include <string>
#include <vector>

#include "results.hpp"

namespace itr::cli::study {

/// A kind of error, as columns, plots and sentences name it.
struct Measure {
  const char* name;   ///< "h1"
  const char* label;  ///< "H1 error of the displacement, relative"
  const char* unit;   ///< "", "m"
  double Errors::*value;
};
const std::vector<Measure>& measures();

/// A kind of cost.
struct Cost {
  const char* name;   ///< "seconds"
  const char* label;  ///< "processor seconds"
  double Row::*value;
};
const std::vector<Cost>& costs();

struct Results {
  std::string scene;      ///< path
  std::string settings;   ///< what `--set` and `--solver` gave to all runs
  std::string reference;  ///< in words
  int dim = 2;
  int frames = 0;  ///< at most so many times are compared
  bool is_dynamic = false;
  std::vector<Row> rows;  ///< by plan
};

std::string csv(const Results& results);
std::string json(const Results& results);
/// A page in Markdown: answers first, then orders, all runs, what failed.
std::string page(const Results& results);

}  // namespace itr::cli::study
