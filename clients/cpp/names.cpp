#include "clients/cpp/names.hpp"

#include <algorithm>
#include <cctype>
#include <string_view>

namespace dtact::client {
namespace {

std::string plain(std::string_view name, std::string_view prefix, int value) {
  if (name.empty()) return std::to_string(value);
  std::string text(name.substr(prefix.size()));
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace

std::string name_of(v1::State state) { return plain(v1::State_Name(state), "STATE_", state); }

std::string name_of(v1::TimestampMeaning meaning) {
  return plain(v1::TimestampMeaning_Name(meaning), "TIMESTAMP_", meaning);
}

std::string name_of(v1::Health flag) { return plain(v1::Health_Name(flag), "HEALTH_", flag); }

std::string name_of(v1::ForceAbsence absence) {
  return plain(v1::ForceAbsence_Name(absence), "FORCE_ABSENCE_", absence);
}

std::vector<std::string> names_of(const google::protobuf::RepeatedField<int>& health) {
  std::vector<std::string> names;
  for (const int value : health) names.push_back(name_of(static_cast<v1::Health>(value)));
  return names;
}

}  // namespace dtact::client
