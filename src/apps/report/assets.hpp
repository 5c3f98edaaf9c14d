// SPDX-License-Identifier: MIT
// The files of src/apps/report/page, which CMake puts into the program.
#pragma once

#include <string_view>

namespace itr::report::assets {

extern const std::string_view page;    ///< page.html: where `{{NAME}}` stands, something is put in
extern const std::string_view style;   ///< style.css
extern const std::string_view script;  ///< all scripts, one after another

}  // namespace itr::report::assets
