// SPDX-License-Identifier: MIT
#include "warnings.hpp"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <utility>

namespace itr::output {

std::string kind_of_warning(std::string_view text) {
  std::string kind;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto is_digit = [&](std::size_t k) {
      return k < text.size() && std::isdigit(static_cast<unsigned char>(text[k]));
    };
    if (!is_digit(i)) {
      kind += text[i];
      continue;
    }
    const auto goes_on = [&](std::size_t k) {
      const bool is_exponent = (text[k] == 'e') && (is_digit(k + 1) || (k + 1 < text.size() && is_digit(k + 2)));
      const bool is_sign = (text[k] == '-' || text[k] == '+') && text[k - 1] == 'e';
      return is_digit(k) || (text[k] == '.' && is_digit(k + 1)) || is_exponent || is_sign;
    };
    while (i + 1 < text.size() && goes_on(i + 1)) ++i;
    kind += '#';
  }
  return kind;
}

void WarningList::count(const std::string& text) {
  ++count_;
  const std::string kind = kind_of_warning(text);
  const auto found = std::find_if(kinds_.begin(), kinds_.end(), [&](const Kind& k) { return k.kind == kind; });
  if (found != kinds_.end())
    ++found->count;
  else
    kinds_.push_back({kind, text, 1});
}

void WarningList::add(const std::string& text) {
  if (stored_.contains(text)) return;
  count(text);
  new_.push_back(text);
}

void WarningList::restore(const std::filesystem::path& log) {
  std::ifstream file(log);
  for (std::string line; std::getline(file, line);) {
    if (line.find("\"warnings\":[") == std::string::npos) continue;
    const auto json = nlohmann::json::parse(line, nullptr, false);
    if (json.is_discarded()) continue;
    for (const auto& text : json["warnings"]) {
      stored_.insert(text.get<std::string>());
      count(text.get<std::string>());
    }
  }
}

nlohmann::ordered_json WarningList::take_new() { return std::exchange(new_, {}); }

nlohmann::ordered_json WarningList::summary_members() const {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Kind& kind : kinds_) list.push_back({{"text", kind.text}, {"count", kind.count}});
  return {{"warning_count", count_}, {"warnings", list}};
}

}  // namespace itr::output
