// SPDX-License-Identifier: MIT
// Writes the results of a study: its rows as CSV and JSON, orders, and answers in words.
#pragma once

#include <optional>
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
  std::string scene;          ///< path
  std::string settings;       ///< what `--set` and `--solver` gave to all runs
  std::string notes;          ///< what else holds for all runs
  std::string reference;      ///< in words
  std::string reference_run;  ///< its name; empty: it is none of the rows
  std::string refused;        ///< why nothing is said against the reference; empty: it is said
  /// How far a second reference is from the first: smaller errors are not told. None: unknown.
  std::optional<Errors> worth;
  std::string second_reference;  ///< in words
  int dim = 2;
  int frames = 0;  ///< at most so many times are compared
  bool is_dynamic = false, has_friction = false;
  std::vector<Row> rows;  ///< by plan
};

/// Errors against the reference, not those of runs among themselves.
bool is_against_reference(const Row& row);
/// An error that is not below what the reference is worth; none where it is, or where there is none.
std::optional<double> told_error(const Results& results, const Row& row, const Measure& measure);
/// Error as a share of the reference's size; none for measures without one.
std::optional<double> relative_error(const Results& results, const Row& row, const Measure& measure);
/// Within a scene's size, as far as that can be seen: nothing holds a body that leaves it.
bool flies(const Results& results, const Row& row);

std::string csv(const Results& results);
std::string json(const Results& results);
/// A page in Markdown: doubts and answers first, then orders, all runs, what they warned of.
std::string page(const Results& results);

}  // namespace itr::cli::study
