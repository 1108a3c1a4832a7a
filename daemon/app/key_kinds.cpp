#include "daemon/app/key_kinds.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "hal/files/key_reader.hpp"

namespace dtact::app {

namespace fs = std::filesystem;

Key one_of(std::string path, int& field, std::vector<std::int64_t> allowed) {
  const std::string words = fmt::format("one of {}", fmt::join(allowed, ", "));
  return {std::move(path), words,
          [&field, allowed = std::move(allowed)](const toml::node& node, const fs::path&) {
            const auto value = node.value_exact<std::int64_t>();
            if (!value || std::find(allowed.begin(), allowed.end(), *value) == allowed.end()) {
              return false;
            }
            field = static_cast<int>(*value);
            return true;
          },
          [&field] { return fmt::format("{}", field); }};
}

Key real(std::string path, double& field, double least, double most, const std::string& unit) {
  return {std::move(path), fmt::format("a number, {} … {} {}", least, most, unit),
          [&field, least, most](const toml::node& node, const fs::path&) {
            if (!node.is_number()) return false;
            const double value = node.value<double>().value_or(NAN);
            if (!(value >= least && value <= most)) return false;
            field = value;
            return true;
          },
          [&field] { return fmt::format("{}", field); }};
}

Key boolean(std::string path, bool& field) {
  return {std::move(path), "true or false",
          [&field](const toml::node& node, const fs::path&) {
            const auto value = node.value_exact<bool>();
            if (value) field = *value;
            return value.has_value();
          },
          [&field] { return field ? "true" : "false"; }};
}

Key text(std::string path, std::string& field, const std::string& allowed) {
  return {std::move(path), allowed,
          [&field](const toml::node& node, const fs::path&) {
            const auto value = node.value_exact<std::string>();
            if (value) field = *value;
            return value.has_value();
          },
          [&field] { return tomlfile::quoted(field); }};
}

Key choice(std::string path, std::string& field, std::vector<std::string> allowed) {
  const std::string words = fmt::format("one of \"{}\"", fmt::join(allowed, "\", \""));
  return {std::move(path), words,
          [&field, allowed = std::move(allowed)](const toml::node& node, const fs::path&) {
            const auto value = node.value_exact<std::string>();
            if (!value || std::find(allowed.begin(), allowed.end(), *value) == allowed.end()) {
              return false;
            }
            field = *value;
            return true;
          },
          [&field] { return tomlfile::quoted(field); }};
}

Key named(std::string path, int& field, const std::vector<std::pair<std::string, int>>& names) {
  std::vector<std::string> words;
  words.reserve(names.size());
  for (const auto& [name, value] : names) words.push_back(tomlfile::quoted(name));
  return {std::move(path), fmt::format("one of {}", fmt::join(words, ", ")),
          [&field, names](const toml::node& node, const fs::path&) {
            const auto text = node.value_exact<std::string>();
            const auto it =
                std::ranges::find_if(names, [&](const auto& entry) { return text == entry.first; });
            if (it == names.end()) return false;
            field = it->second;
            return true;
          },
          [&field, names] {
            return tomlfile::quoted(std::ranges::find_if(names, [&](const auto& entry) {
                                      return entry.second == field;
                                    })->first);
          }};
}

Key named_or(std::string path, int& field, const std::vector<std::pair<std::string, int>>& names,
             std::vector<std::int64_t> numbers) {
  Key name = named(path, field, names);
  const Key number = one_of(std::move(path), field, numbers);
  return {name.path, fmt::format("{}, or {}", name.allowed, fmt::join(numbers, " or ")),
          [name, number](const toml::node& node, const fs::path& folder) {
            return name.assign(node, folder) || number.assign(node, folder);
          },
          [&field, name, number, numbers] {
            return std::ranges::find(numbers, field) == numbers.end() ? name.show() : number.show();
          }};
}

Key path(std::string key, fs::path& field, const std::string& allowed) {
  return {std::move(key), allowed,
          [&field](const toml::node& node, const fs::path& folder) {
            const auto value = node.value_exact<std::string>();
            if (!value) return false;
            field = value->empty() ? fs::path() : (folder / *value).lexically_normal();
            return true;
          },
          [&field] { return tomlfile::quoted(field.string()); }};
}

Key secret(std::string key, fs::path& field, const std::string& allowed) {
  Key other = path(std::move(key), field, allowed + ", or \"credential:NAME\"");
  other.assign = [&field, assign = other.assign](const toml::node& node, const fs::path& folder) {
    const auto value = node.value_exact<std::string>();
    if (!value || !value->starts_with(kCredential)) return assign(node, folder);
    const std::string name = value->substr(kCredential.size());
    if (name.empty() || name.find('/') != std::string::npos) return false;
    field = *value;
    return true;
  };
  return other;
}

Key optional_integer(std::string path, std::optional<int>& field, int least, int most,
                     const std::string& unit) {
  return {std::move(path), fmt::format("a whole number, {} … {} {}, or false", least, most, unit),
          [&field, least, most](const toml::node& node, const fs::path&) {
            if (node.value_exact<bool>() == false) {
              field.reset();
              return true;
            }
            const auto value = node.value_exact<std::int64_t>();
            if (!value || *value < least || *value > most) return false;
            field = static_cast<int>(*value);
            return true;
          },
          [&field] { return field ? fmt::format("{}", *field) : std::string("false"); }};
}

Key milliseconds(std::string path, std::chrono::milliseconds& field, std::int64_t least,
                 std::int64_t most) {
  return {std::move(path), fmt::format("a whole number, {} … {} (milliseconds)", least, most),
          [&field, least, most](const toml::node& node, const fs::path&) {
            const auto value = node.value_exact<std::int64_t>();
            if (!value || *value < least || *value > most) return false;
            field = std::chrono::milliseconds(*value);
            return true;
          },
          [&field] { return fmt::format("{}", field.count()); }};
}

}  // namespace dtact::app
