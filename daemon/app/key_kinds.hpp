#pragma once

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "daemon/app/config_keys.hpp"

// A key for each kind of value that the configuration has: what is allowed, how it is set and
// shown.
namespace dtact::app {

template <typename Integer>
[[nodiscard]] Key integer(std::string path, Integer& field, std::int64_t least, std::int64_t most,
                          const std::string& unit) {
  return {std::move(path), fmt::format("a whole number, {} … {} {}", least, most, unit),
          [&field, least, most](const toml::node& node, const std::filesystem::path&) {
            const auto value = node.value_exact<std::int64_t>();
            if (!value || *value < least || *value > most) return false;
            field = static_cast<Integer>(*value);
            return true;
          },
          [&field] { return fmt::format("{}", field); }};
}

[[nodiscard]] Key one_of(std::string path, int& field, std::vector<std::int64_t> allowed);
[[nodiscard]] Key real(std::string path, double& field, double least, double most,
                       const std::string& unit);
[[nodiscard]] Key boolean(std::string path, bool& field);
[[nodiscard]] Key text(std::string path, std::string& field, const std::string& allowed);
[[nodiscard]] Key choice(std::string path, std::string& field, std::vector<std::string> allowed);
/// A number that goes by a name.
[[nodiscard]] Key named(std::string path, int& field,
                        const std::vector<std::pair<std::string, int>>& names);
/// A number of `numbers`, or one that goes by a name.
[[nodiscard]] Key named_or(std::string path, int& field,
                           const std::vector<std::pair<std::string, int>>& names,
                           std::vector<std::int64_t> numbers);
[[nodiscard]] Key path(std::string key, std::filesystem::path& field, const std::string& allowed);
/// A path, or the name of a credential (kCredential), which stays as it is.
[[nodiscard]] Key secret(std::string key, std::filesystem::path& field, const std::string& allowed);
/// A number, or false for "none".
[[nodiscard]] Key optional_integer(std::string path, std::optional<int>& field, int least, int most,
                                   const std::string& unit);
[[nodiscard]] Key milliseconds(std::string path, std::chrono::milliseconds& field,
                               std::int64_t least, std::int64_t most);

/// An entry of a table of controls: a number, or "default" for none.
template <typename Number>
[[nodiscard]] Key control(const std::string& table, const char* name,
                          std::map<std::string, Number>& controls) {
  return {fmt::format("{}.{}", table, name), "a number in the camera's own units, or \"default\"",
          [&controls, name](const toml::node& node, const std::filesystem::path&) {
            if (node.value_exact<std::string>() == "default") {
              controls.erase(name);
              return true;
            }
            const bool typed = std::is_integral_v<Number> ? node.is_integer() : node.is_number();
            const auto value = typed ? node.value<Number>() : std::nullopt;
            if (!value || !std::isfinite(static_cast<double>(*value))) return false;
            controls[name] = *value;
            return true;
          },
          [&controls, name] {
            const auto it = controls.find(name);
            return it == controls.end() ? "\"default\"" : fmt::format("{}", it->second);
          }};
}

}  // namespace dtact::app
