// SPDX-License-Identifier: MIT
// Reads scene files (PolyFEM's JSON, the keys in docs/scenes.md) into setups. This is the only module that knows JSON and
// expressions. A wrong scene throws an InputError before anything is computed.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "itr/options.hpp"
#include "itr/setup.hpp"

namespace itr::scene {

/// One `--set /json/pointer=VALUE`.
struct Override {
  std::string pointer;
  std::string value;  ///< JSON text
};

/// Names and ids of bodies, surfaces and obstacles, as conditions and /output/forces take them.
struct PartNames {
  std::map<std::string, std::vector<int>> bodies;     ///< ids by name
  std::map<std::string, std::vector<int>> surfaces;   ///< tags of facets and vertices by name
  std::map<std::string, std::vector<int>> obstacles;  ///< vertices by name
  std::map<int, std::vector<int>> obstacles_by_id;    ///< vertices by `surface_selection`
};

/// The set of defaults of a scene, with its version, and what it gave.
struct ChosenDefaults {
  std::string name;           ///< such as "itr-1"
  bool is_asked_for = false;  ///< by the scene or an override
  struct Value {
    std::string pointer, value, reason;  ///< the value as JSON text
  };
  std::vector<Value> values;                ///< that the scene leaves out and the set gives
  std::vector<std::string> unlike_polyfem;  ///< of PolyFEM's set: where results differ from PolyFEM's on purpose
  std::string information;                  ///< a line on a scene that may expect the other set; or nothing
};

/// The error that a scene asks for by /accuracy, and what follows from it (docs/theory.md, "Accuracy").
struct Accuracy {
  double value = 0;                            ///< relative; 0: none is asked for
  std::string of = "energy";                   ///< or a name of /output/forces or /output/points
  std::vector<ChosenDefaults::Value> derived;  ///< keys that the scene leaves open
  std::vector<std::string> kept;               ///< a sentence on each value of the scene that stays, and on a fixed mesh
  bool follows_bars = false;                   ///< whether the tolerance of remeshing may change from step to step
};

struct Scene {
  std::variant<Setup<2>, Setup<3>> setup;  ///< the dimension is chosen here, once
  OutputOptions output;
  int max_threads = 0;                ///< solver/max_threads; 0: all
  std::string directory;              ///< output/directory, may be empty
  std::vector<std::string> warnings;  ///< on values that are legal and suspicious
  PartNames parts;
  ChosenDefaults defaults;
  Accuracy accuracy{};
  std::string identity;  ///< JSON of all that the results depend on: the merged scene, hashes of its files
};

/// One difference between two identities, with its JSON pointer, and what it is of.
struct Change {
  std::string text;
  enum class Of {
    length,   ///< how long the run is: the steps are the same
    solving,  ///< how steps are solved: solver, tolerances, step cuts, remeshing
    scene     ///< what is simulated
  } of = Of::scene;
};
/// The name of the set of defaults in an identity; empty where there is none.
ITR_EXPORT std::string defaults_of(const std::string& identity);
ITR_EXPORT std::vector<Change> find_changes(const std::string& before, const std::string& now);

/// Reads, merges (`common`, `patch`), applies overrides, validates, loads meshes. Throws InputError.
ITR_EXPORT Scene read(const std::filesystem::path& file, const std::vector<Override>& overrides = {});

/// Geometry that a program brings instead of the files of a scene.
template <int Dim>
struct Geometry {
  Mesh<Dim> mesh;                                    ///< with the facet tags that conditions refer to as `id`
  Obstacles<Dim> obstacles;                          ///< without motions
  std::vector<int> id;                               ///< by obstacle vertex, as of a `surface_selection`; kNoTag: none
  std::map<std::string, std::vector<int>> bodies{};  ///< ids that options may call by these names
  /// Tags and obstacles' ids, likewise: first the id that options may write, then those of facets that are in others, too.
  std::map<std::string, std::vector<int>> surfaces{};
};

/// Makes a setup from a mesh and the other keys of a scene as JSON text: materials, time, contact, conditions, ... Throws
/// InputError as read(), and for keys of geometry and output. Appends to `warnings`.
template <int Dim>
ITR_EXPORT Setup<Dim> make_setup(Geometry<Dim> geometry, const std::string& options, const std::vector<Override>& overrides,
                                 std::vector<std::string>& warnings);
/// Its `solver/max_threads`; 0: all.
ITR_EXPORT int read_max_threads(const std::string& options, const std::vector<Override>& overrides);

/// The JSON Schema (draft 7) of scenes, made from the table that `read` checks keys and values against.
ITR_EXPORT std::string json_schema();
/// The page docs/scenes.md, made from the same table.
ITR_EXPORT std::string reference_page();

}  // namespace itr::scene
