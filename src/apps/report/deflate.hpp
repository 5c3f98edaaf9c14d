// SPDX-License-Identifier: MIT
// Bytes as text of a page: compressed by zlib, in base64.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace itr::output {

/// In zlib's format, which browsers call "deflate".
std::string deflate(std::string_view bytes);
std::string base64(std::string_view bytes);
/// The check sum of PNG's chunks.
std::uint32_t crc32_of(std::string_view bytes);

}  // namespace itr::output
