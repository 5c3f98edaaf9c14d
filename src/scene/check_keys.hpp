// SPDX-License-Identifier: MIT
#pragma once

#include "node.hpp"

namespace itr::scene {

/// Throws InputError for the first key of the document that we do not know, whose value is not what it must be, or that asks
/// for something unsupported. Warns of what is asked for in vain.
void check_keys(const Document& document, std::vector<std::string>& warnings);

}  // namespace itr::scene
