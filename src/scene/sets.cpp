// SPDX-License-Identifier: MIT
#include "sets.hpp"

#include <algorithm>

namespace itr::scene {

Label read_label(const Node& node, int fallback) {
  if (!node.exists()) return {fallback};
  if (node.json().is_string()) {
    const std::string name = node.string("");
    if (name.empty()) node.fail("a number, or a name");
    std::error_code ignored;
    if (std::filesystem::is_regular_file(node.document().resolve(name), ignored))
      node.fail(abbreviate(node.json()) + ", a file", "a number or a name: files of ids are for selections of bodies");
    return {0, name};
  }
  if (!node.json().is_number()) node.fail("a number, or a name");
  const int id = node.integer(fallback);
  if (id < 0 || id > 2147483646) node.fail("an id of 0 to 2147483646");
  return {id};
}

std::string text_of(const Label& label) { return label.name.empty() ? std::to_string(label.number) : label.name; }

namespace {

/// Numbers and names only: what is neither is refused where it is read.
void add_labels(const Node& ids, std::set<Label>& labels) {
  for (const Node& id : ids.items()) {
    if (id.json().is_number_integer() && id.json() >= 0 && id.json() <= 2147483646) labels.insert({id.json().get<int>()});
    if (id.json().is_string()) labels.insert({0, id.string("")});
  }
}

}  // namespace

References collect_references(const Node& root) {
  References references;
  for (const Node& entry : root["materials"].items()) add_labels(entry["id"], references.bodies);
  for (const Node& entry : root["space"]["discr_order"].items()) add_labels(entry["id"], references.bodies);
  for (const char* list : {"solution", "velocity", "acceleration"})
    for (const Node& entry : root["initial_conditions"][list].items()) add_labels(entry["id"], references.bodies);
  for (const Node& entry : root["boundary_conditions"]["rhs"].items()) add_labels(entry["id"], references.bodies);
  for (const char* list : {"dirichlet_boundary", "neumann_boundary", "normal_aligned_neumann_boundary",
                           "nodal_neumann_boundary", "pressure_boundary", "obstacle_displacements"})
    for (const Node& entry : root["boundary_conditions"][list].items()) add_labels(entry["id"], references.surfaces);
  for (const Node& entry : root["boundary_conditions"]["pressure_boundary"].items())
    for (const char* key : {"from", "leaks_to"}) add_labels(entry[key], references.surfaces);
  for (const Node& entry : root["contact"]["friction_pairs"].items())
    for (const char* side : {"a", "b"})
      for (auto* labels : {&references.bodies, &references.surfaces}) add_labels(entry[side], *labels);
  for (const Node& entry : root["boundary_conditions"]["pressure_cavity"].items())
    add_labels(entry["id"], references.surfaces);
  for (const Node& entry : root["boundary_conditions"]["periodic"].items())
    add_labels(entry["boundary_ids"], references.surfaces);
  for (const char* list : {"springs", "couplings"})
    for (const Node& entry : root[list].items()) add_labels(entry["id"], references.surfaces);
  for (const Node& entry : root["shapes"].items()) add_labels(entry["surface"], references.surfaces);
  for (const Node& entry : root["ties"].items())
    for (const char* side : {"a", "b"}) add_labels(entry[side], references.surfaces);
  for (const Node& entry : root["output"]["forces"].items()) {
    add_labels(entry["bodies"], references.bodies);
    add_labels(entry["surfaces"], references.surfaces);
  }
  references.surfaces.erase({0, "all"});  // of them
  return references;
}

void add_penetrated(const Node& root, LabelIds& surfaces) {
  for (const Node& entry : root["boundary_conditions"]["pressure_boundary"].items()) {
    std::set<Label> labels;
    if (entry["penetrates"].boolean(false)) add_labels(entry["id"], labels);
    for (const Label& label : labels) surfaces.add_penetrated(label);
  }
}

int LabelIds::key(const std::set<Label>& labels, int preferred) {
  const auto [found, is_new] = keys_.try_emplace(labels, static_cast<int>(sets_.size()));
  if (is_new) sets_.emplace_back(labels, preferred);
  return found->second;
}

void LabelIds::choose() {
  std::set<int> taken;
  const auto is_number = [](const std::set<Label>& labels) { return labels.size() == 1 && labels.begin()->name.empty(); };
  for (const auto& [labels, preferred] : sets_)
    if (is_number(labels)) taken.insert(labels.begin()->number);
  ids_.clear();
  int next = 1;
  for (const auto& [labels, preferred] : sets_) {
    int id = preferred;
    if (is_number(labels)) {
      id = labels.begin()->number;
    } else if (id < 0 || !taken.insert(id).second) {
      while (!taken.insert(next).second) ++next;
      id = next;
    }
    ids_.push_back(id);
    for (const Label& label : labels) of_[label].push_back(id);
  }
  const auto is_penetrated = [&](const Label& label) { return penetrated_.contains(label); };
  for (std::size_t key = 0; key < sets_.size(); ++key) {
    const std::set<Label>& labels = sets_[key].first;
    if (!penetrated_.contains({0, "all"}) && std::ranges::none_of(labels, is_penetrated)) continue;
    while (!taken.insert(next).second) ++next;
    wet_[ids_[key]] = next;
    for (const Label& label : labels) of_[label].push_back(next);
  }
}

void LabelIds::imply(int key, const std::string& name) {
  const auto [found, is_new] = implied_.try_emplace(key, name);
  if (!is_new && found->second != name) found->second.clear();
}

std::map<std::string, std::vector<int>> LabelIds::names() const {
  std::map<std::string, std::vector<int>> names;
  for (const auto& [label, ids] : of_)
    if (!label.name.empty()) names.emplace(label.name, ids);
  for (const auto& [key, name] : implied_)
    if (!name.empty() && !of_.contains({0, name})) names[name].push_back(ids_[key]);
  return names;
}

const std::vector<int>& LabelIds::of(const Label& label) const {
  static const std::vector<int> none;
  const auto found = of_.find(label);
  return found == of_.end() ? none : found->second;
}

std::string LabelIds::list(const std::set<int>* ids, std::string names) const {
  std::vector<int> numbers;
  const auto counts = [&](int id) { return !ids || ids->contains(id); };
  for (const auto& [label, of_label] : of_) {
    if (std::none_of(of_label.begin(), of_label.end(), counts)) continue;
    if (label.name.empty())
      numbers.push_back(label.number);
    else
      names += ", \"" + label.name + "\"";
  }
  for (const auto& [label, why] : why_)
    if (why.empty() && !label.name.empty() && !of_.contains(label)) names += ", \"" + label.name + "\"";
  if (numbers.empty()) return names.empty() ? "there is none" : names.substr(2);
  return list_ids(numbers) + names;
}

void LabelIds::refuse(const Node& node, const Label& label, const std::string& expected, const std::string& why) const {
  const auto known = why_.find(label);
  const std::string reason = known == why_.end() || known->second.empty() ? why : " (" + known->second + ")";
  node.fail(abbreviate(node.json()) + ", which nothing has" + reason, expected + list());
}

}  // namespace itr::scene
