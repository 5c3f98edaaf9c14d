// SPDX-License-Identifier: MIT
#pragma once

#include "node.hpp"

namespace itr::scene {

/// Refuses unknown keys (naming the nearest known one), and known ones that ask for what is not supported yet. After it,
/// every key of the document is one that a reader of this module honours, or one that cannot change a result.
void check_keys(const Document& document);

}  // namespace itr::scene
