// SPDX-License-Identifier: MIT
// From a scene file to one document: `common` and `patch` (docs/scenes.md), root path, command-line overrides.
#pragma once

#include "itr/scene.hpp"
#include "node.hpp"

namespace itr::scene {

/// Throws InputError: unreadable file, wrong JSON (with the line), a cycle of `common`, a patch that does not apply, an
/// override that is no JSON. The result has no `common`, `patch`, `root_path` and no null members.
Document load_document(const std::filesystem::path& file, const std::vector<Override>& overrides);

/// Parses a text that a program has made: paths in it are relative to the working directory, and errors call it `name`.
Document parse_document(const std::string& text, const std::string& name, const std::vector<Override>& overrides);

}  // namespace itr::scene
