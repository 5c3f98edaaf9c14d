// SPDX-License-Identifier: MIT
// Files that are complete or absent, whatever ends the process: written under a temporary name, then renamed.
#pragma once

#include <filesystem>
#include <string>

namespace itr::output {

/// The name under which `path` is written before it is complete; same folder, so that the rename is atomic.
std::filesystem::path temporary_name(const std::filesystem::path& path);
/// Renames temporary_name(path) to path. Throws InputError.
void publish(const std::filesystem::path& path);
/// Replaces the file by `text`. Throws InputError.
void write_text(const std::filesystem::path& path, const std::string& text);

}  // namespace itr::output
