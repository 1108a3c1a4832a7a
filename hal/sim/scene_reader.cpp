#include "hal/sim/scene_reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <utility>

namespace dtact::hal::sim {
namespace {

const toml::table kEmptyTable;

}  // namespace

SceneReader::SceneReader(const toml::table& table, std::string file, std::string name)
    : table_(table), file_(std::move(file)), name_(std::move(name)) {}

void SceneReader::fail(std::string_view key, const std::string& problem) const {
  const toml::node* node = table_.get(key);
  const auto line = (node != nullptr ? *node : static_cast<const toml::node&>(table_)).source();
  throw std::runtime_error(fmt::format("{}:{}: {}{}{}: {}", file_, line.begin.line, name_,
                                       name_.empty() ? "" : ".", key, problem));
}

const toml::node* SceneReader::find(std::string_view key) {
  known_.emplace(key);
  return table_.get(key);
}

void SceneReader::number(std::string_view key, double& value, double lowest, double highest) {
  const toml::node* node = find(key);
  if (node == nullptr) return;
  const auto read = node->is_number() ? node->value<double>() : std::nullopt;
  // Written so that NaN fails too.
  if (!read || !(*read >= lowest && *read <= highest)) {
    fail(key, fmt::format("must be a number from {} to {}", lowest, highest));
  }
  value = *read;
}

void SceneReader::integer(std::string_view key, std::int64_t& value, std::int64_t lowest,
                          std::int64_t highest) {
  const toml::node* node = find(key);
  if (node == nullptr) return;
  const auto read = node->is_integer() ? node->value<std::int64_t>() : std::nullopt;
  if (!read || *read < lowest || *read > highest) {
    fail(key, fmt::format("must be a whole number from {} to {}", lowest, highest));
  }
  value = *read;
}

void SceneReader::integer(std::string_view key, int& value, int lowest, int highest) {
  std::int64_t wide = value;
  integer(key, wide, std::int64_t{lowest}, std::int64_t{highest});
  value = static_cast<int>(wide);
}

void SceneReader::text(std::string_view key, std::string& value) {
  const toml::node* node = find(key);
  if (node == nullptr) return;
  const auto read = node->is_string() ? node->value<std::string>() : std::nullopt;
  if (!read || read->empty()) fail(key, "must be a text that is not empty");
  value = *read;
}

void SceneReader::choice(std::string_view key, int& index,
                         const std::vector<std::string>& allowed) {
  const toml::node* node = find(key);
  if (node == nullptr) return;
  const auto read = node->is_string() ? node->value<std::string>() : std::nullopt;
  const auto found = read ? std::find(allowed.begin(), allowed.end(), *read) : allowed.end();
  if (found == allowed.end()) {
    fail(key, fmt::format("must be one of \"{}\"", fmt::join(allowed, "\", \"")));
  }
  index = static_cast<int>(found - allowed.begin());
}

void SceneReader::require(std::string_view key) const {
  if (!has(key)) fail(key, "is missing");
}

SceneReader SceneReader::table(std::string_view key) {
  const toml::node* node = find(key);
  if (node != nullptr && !node->is_table()) fail(key, "must be a table");
  const std::string name = fmt::format("{}{}{}", name_, name_.empty() ? "" : ".", key);
  return {node != nullptr ? *node->as_table() : kEmptyTable, file_, name};
}

std::vector<SceneReader> SceneReader::tables(std::string_view key) {
  std::vector<SceneReader> readers;
  const toml::node* node = find(key);
  if (node == nullptr) return readers;
  if (!node->is_array()) fail(key, "must be an array of tables");
  for (const toml::node& entry : *node->as_array()) {
    if (!entry.is_table()) fail(key, "must be an array of tables");
    readers.emplace_back(
        *entry.as_table(), file_,
        fmt::format("{}{}{}[{}]", name_, name_.empty() ? "" : ".", key, readers.size()));
  }
  return readers;
}

void SceneReader::finish() const {
  for (const auto& [key, node] : table_) {
    if (known_.find(key.str()) == known_.end()) {
      fail(key.str(), fmt::format("no such key; allowed here are {}", fmt::join(known_, ", ")));
    }
  }
}

}  // namespace dtact::hal::sim
