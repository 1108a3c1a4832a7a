#include "daemon/calibration/key_reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <stdexcept>

namespace dtact::calibration {

void KeyReader::fail(const std::string& key, const std::string& what) const {
  const toml::node* node = table_.get(key);
  const auto line = (node == nullptr ? table_.source() : node->source()).begin.line;
  std::string name = prefix_ + key;
  if (name.ends_with('.')) name.pop_back();
  throw std::runtime_error(fmt::format("{}:{}: {}: {}", where_, line == 0 ? 1 : line, name, what));
}

const toml::node& KeyReader::take(const std::string& key, const char* expected) {
  taken_.insert(key);
  const toml::node* node = table_.get(key);
  if (node == nullptr) fail(key, fmt::format("missing; expected {}", expected));
  return *node;
}

std::int64_t KeyReader::integer(const std::string& key, std::int64_t low, std::int64_t high) {
  const std::string allowed = fmt::format("a whole number from {} to {}", low, high);
  const auto* value = take(key, allowed.c_str()).as_integer();
  if (value == nullptr) fail(key, "wrong type; expected " + allowed);
  if (value->get() < low || value->get() > high) {
    fail(key, fmt::format("{} is not allowed; expected {}", value->get(), allowed));
  }
  return value->get();
}

double KeyReader::number(const std::string& key, double low, double high) {
  const std::string allowed = fmt::format("a number from {} to {}", low, high);
  const toml::node& node = take(key, allowed.c_str());
  if (!node.is_number()) fail(key, "wrong type; expected " + allowed);
  const double value = node.value<double>().value_or(std::nan(""));
  if (!(value >= low && value <= high)) {
    fail(key, fmt::format("{} is not allowed; expected {}", value, allowed));
  }
  return value;
}

std::string KeyReader::text(const std::string& key) {
  const auto* value = take(key, "a string").as_string();
  if (value == nullptr) fail(key, "wrong type; expected a string");
  return value->get();
}

std::vector<std::int64_t> KeyReader::integers(const std::string& key, std::int64_t low,
                                              std::int64_t high) {
  const std::string allowed = fmt::format("whole numbers from {} to {}", low, high);
  const auto* array = take(key, allowed.c_str()).as_array();
  if (array == nullptr) fail(key, "wrong type; expected an array of " + allowed);
  std::vector<std::int64_t> values;
  values.reserve(array->size());
  for (const toml::node& node : *array) {
    const auto* value = node.as_integer();
    if (value == nullptr || value->get() < low || value->get() > high) {
      throw std::runtime_error(fmt::format("{}:{}: {}{}: entry {} is not allowed; expected {}",
                                           where_, node.source().begin.line, prefix_, key,
                                           values.size() + 1, allowed));
    }
    values.push_back(value->get());
  }
  return values;
}

std::vector<double> KeyReader::numbers(const std::string& key, double low, double high) {
  const std::string allowed = fmt::format("numbers from {} to {}", low, high);
  const auto* array = take(key, allowed.c_str()).as_array();
  if (array == nullptr) fail(key, "wrong type; expected an array of " + allowed);
  std::vector<double> values;
  values.reserve(array->size());
  for (const toml::node& node : *array) {
    const double value =
        node.is_number() ? node.value<double>().value_or(std::nan("")) : std::nan("");
    if (!(value >= low && value <= high)) {
      throw std::runtime_error(fmt::format("{}:{}: {}{}: entry {} is not allowed; expected {}",
                                           where_, node.source().begin.line, prefix_, key,
                                           values.size() + 1, allowed));
    }
    values.push_back(value);
  }
  return values;
}

KeyReader KeyReader::table(const std::string& key) {
  const auto* table = take(key, "a table").as_table();
  if (table == nullptr) fail(key, "wrong type; expected a table");
  return {*table, where_, prefix_ + key + "."};
}

std::vector<KeyReader> KeyReader::tables(const std::string& key) {
  std::vector<KeyReader> readers;
  if (!has(key)) return readers;
  const auto* array = take(key, "an array of tables").as_array();
  if (array == nullptr) fail(key, "wrong type; expected an array of tables");
  for (const toml::node& node : *array) {
    if (!node.is_table()) fail(key, "wrong type; expected an array of tables");
    readers.emplace_back(*node.as_table(), where_, prefix_ + key + ".");
  }
  return readers;
}

std::vector<std::string> KeyReader::keys() const {
  std::vector<std::string> names;
  for (const auto& [key, node] : table_) names.emplace_back(key.str());
  return names;
}

void KeyReader::finish() const {
  for (const std::string& key : keys()) {
    if (!taken_.contains(key)) {
      fail(key, fmt::format("unknown key; allowed here: {}", fmt::join(taken_, ", ")));
    }
  }
}

toml::table parse_toml(const std::string& text, const std::string& where) {
  try {
    return toml::parse(text, where);
  } catch (const toml::parse_error& e) {
    throw std::runtime_error(
        fmt::format("{}:{}: {}", where, e.source().begin.line, e.description()));
  }
}

}  // namespace dtact::calibration
