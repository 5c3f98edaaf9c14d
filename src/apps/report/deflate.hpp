// SPDX-License-Identifier: MIT
// Bytes as text of a page: compressed by zlib, in base64.
#pragma once

#include <string>
#include <string_view>

namespace itr::report {

/// In zlib's format, which browsers call "deflate".
std::string deflate(std::string_view bytes);
std::string base64(std::string_view bytes);

}  // namespace itr::report
