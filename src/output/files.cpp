// SPDX-License-Identifier: MIT
#include "files.hpp"

#include <fstream>
#include <system_error>

#include "itr/core/error.hpp"

namespace itr::output {

std::filesystem::path temporary_name(const std::filesystem::path& path) { return path.string() + ".tmp"; }

void publish(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::rename(temporary_name(path), path, error);
  if (error) throw InputError({path.string(), "file", error.message(), "a folder that can be written"});
}

void write_text(const std::filesystem::path& path, const std::string& text) {
  std::ofstream file(temporary_name(path), std::ios::binary | std::ios::trunc);
  file << text;
  file.close();
  if (!file) throw InputError({path.string(), "file", "writing failed", "a folder that can be written, with space left"});
  publish(path);
}

}  // namespace itr::output
