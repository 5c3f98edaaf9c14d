// SPDX-License-Identifier: MIT
// Numbers and names by which a scene refers to bodies and to parts of their surface, and the ids that stand for them in a
// mesh.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "itr/mesh.hpp"
#include "mesh/facet_tags.hpp"
#include "node.hpp"

namespace itr::scene {

/// An id as a scene writes it: a number, or a name that a mesh file or a selection gives.
struct Label {
  int number = 0;  ///< counts where there is no name
  std::string name{};
  auto operator<=>(const Label&) const = default;
};
/// A number of 0 to 2147483646, or a name. The fallback where there is nothing.
Label read_label(const Node& node, int fallback);
/// The name, or the digits.
std::string text_of(const Label& label);

/// The labels that conditions, materials and outputs of a scene ask for: groups of a file that nobody asks for leave no
/// trace.
struct References {
  std::set<Label> bodies, surfaces;
};
References collect_references(const Node& root);

/// Ids by label. Parts that are in several sets have an id of their own, which then stands for each of these, too.
class LabelIds {
 public:
  /// The key of what is in exactly these sets; `preferred` is the id that it gets unless another has it; kNone: any
  /// above 0.
  int key(const std::set<Label>& labels, int preferred = kNone);
  /// Notes the name that a file gives the number of a key, which the scene does not ask for: output keeps it where it is the
  /// only one. Empty: there is none.
  void imply(int key, const std::string& name);
  /// Notes that a fluid penetrates a surface ("all": all of them): its facets get another id once they are wet, which stands
  /// for each of their sets, too.
  void add_penetrated(const Label& label) { penetrated_.insert(label); }
  /// Ids of wet facets, by those that they have before.
  const std::map<int, int>& wet() const { return wet_; }
  /// Chooses the ids of all keys. A part that is in a numbered set only has its number.
  void choose();
  int id(int key) const { return ids_[key]; }

  /// The ids of a set; none where there is nothing.
  const std::vector<int>& of(const Label& label) const;
  const std::map<Label, std::vector<int>>& all() const { return of_; }
  /// Ids by name, also by those that the scene does not ask for.
  std::map<std::string, std::vector<int>> names() const;
  /// Notes for messages that a mesh file has the set, and why it has no ids; an empty reason counts before others.
  void explain(const Label& label, const std::string& why) {
    std::string& known = why_.try_emplace(label, why).first->second;
    if (why.empty()) known.clear();
  }
  /// Refuses a label that nothing has: `expected` is followed by those that there are.
  [[noreturn]] void refuse(const Node& node, const Label& label, const std::string& expected,
                           const std::string& why = "") const;
  /// The labels that there are, or those that stand for one of these ids, with other names, as ", \"wall\"".
  std::string list(const std::set<int>* ids = nullptr, std::string names = "") const;

 private:
  std::map<std::set<Label>, int> keys_;
  std::vector<std::pair<std::set<Label>, int>> sets_;  ///< by key: labels, preferred id
  std::vector<int> ids_;                               ///< by key
  std::map<Label, std::vector<int>> of_;
  std::set<Label> penetrated_;
  std::map<int, int> wet_;
  std::map<Label, std::string> why_;
  std::map<int, std::string> implied_;  ///< names by key
};

/// Bodies by the ids of their cells; surfaces by the tags of facets and vertices, and the ids of obstacles.
struct Sets {
  LabelIds bodies, surfaces;

  /// Tags that facets of the mesh have, and those that they get where they are wetted.
  template <int Dim>
  std::set<int> facet_tags(const Mesh<Dim>& mesh) const {
    std::set<int> tags = itr::facet_tags(mesh);
    for (const auto& [before, wet] : surfaces.wet())
      if (tags.contains(before)) tags.insert(wet);
    return tags;
  }
};

/// Notes the surfaces that fluids of the scene penetrate.
void add_penetrated(const Node& root, LabelIds& surfaces);

}  // namespace itr::scene
