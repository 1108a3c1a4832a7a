#include "hal/files/key_reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <type_traits>

#include "hal/files/toml_bounds.hpp"

namespace dtact::tomlfile {
namespace {

const toml::table kEmptyTable;

}  // namespace

void KeyReader::fail(const std::string& key, const std::string& what) const {
  const toml::node* node = table_.get(key);
  const auto line = (node == nullptr ? table_.source() : node->source()).begin.line;
  std::string name = prefix_ + key;
  if (name.ends_with('.')) name.pop_back();
  throw std::runtime_error(fmt::format("{}:{}: {}: {}", where_, line == 0 ? 1 : line, name, what));
}

bool KeyReader::know(const std::string& key) {
  taken_.insert(key);
  return has(key);
}

const toml::node& KeyReader::take(const std::string& key, const std::string& expected) {
  if (!know(key)) fail(key, "missing; expected " + expected);
  return *table_.get(key);
}

std::int64_t KeyReader::integer(const std::string& key, std::int64_t low, std::int64_t high) {
  const std::string allowed = fmt::format("a whole number from {} to {}", low, high);
  const auto* value = take(key, allowed).as_integer();
  if (value == nullptr) fail(key, "wrong type; expected " + allowed);
  if (value->get() < low || value->get() > high) {
    fail(key, fmt::format("{} is not allowed; expected {}", value->get(), allowed));
  }
  return value->get();
}

double KeyReader::number(const std::string& key, double low, double high) {
  const std::string allowed = fmt::format("a number from {} to {}", low, high);
  const toml::node& node = take(key, allowed);
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

template <typename Value>
std::vector<Value> KeyReader::array(const std::string& key, const std::string& allowed,
                                    const std::function<bool(Value)>& fits) {
  const auto* array = take(key, allowed).as_array();
  if (array == nullptr) fail(key, "wrong type; expected an array of " + allowed);
  std::vector<Value> values;
  values.reserve(array->size());
  for (const toml::node& node : *array) {
    const bool typed = std::is_integral_v<Value> ? node.is_integer() : node.is_number();
    const auto value = typed ? node.value<Value>() : std::nullopt;
    if (!value || !fits(*value)) {
      throw std::runtime_error(fmt::format("{}:{}: {}{}: entry {} is not allowed; expected {}",
                                           where_, node.source().begin.line, prefix_, key,
                                           values.size() + 1, allowed));
    }
    values.push_back(*value);
  }
  return values;
}

std::vector<std::int64_t> KeyReader::integers(const std::string& key, std::int64_t low,
                                              std::int64_t high) {
  return array<std::int64_t>(key, fmt::format("whole numbers from {} to {}", low, high),
                             [&](std::int64_t value) { return value >= low && value <= high; });
}

std::vector<double> KeyReader::numbers(const std::string& key, double low, double high) {
  return array<double>(key, fmt::format("numbers from {} to {}", low, high),
                       [&](double value) { return value >= low && value <= high; });
}

KeyReader KeyReader::table(const std::string& key) {
  const auto* table = take(key, "a table").as_table();
  if (table == nullptr) fail(key, "wrong type; expected a table");
  return {*table, where_, prefix_ + key + "."};
}

void KeyReader::integer_if(const std::string& key, std::int64_t& value, std::int64_t low,
                           std::int64_t high) {
  if (know(key)) value = integer(key, low, high);
}

void KeyReader::integer_if(const std::string& key, int& value, int low, int high) {
  if (know(key)) value = static_cast<int>(integer(key, low, high));
}

void KeyReader::number_if(const std::string& key, double& value, double low, double high) {
  if (know(key)) value = number(key, low, high);
}

void KeyReader::text_if(const std::string& key, std::string& value) {
  if (!know(key)) return;
  value = text(key);
  if (value.empty()) fail(key, "is empty; expected a string that is not");
}

void KeyReader::choice_if(const std::string& key, int& index,
                          const std::vector<std::string>& allowed) {
  if (!know(key)) return;
  const std::string value = text(key);
  const auto found = std::ranges::find(allowed, value);
  if (found == allowed.end()) {
    fail(key, fmt::format("\"{}\" is not allowed; expected one of \"{}\"", value,
                          fmt::join(allowed, "\", \"")));
  }
  index = static_cast<int>(found - allowed.begin());
}

KeyReader KeyReader::table_if(const std::string& key) {
  if (know(key)) return table(key);
  return {kEmptyTable, where_, prefix_ + key + "."};
}

void KeyReader::require(const std::string& key) const {
  if (!has(key)) fail(key, "missing");
}

std::vector<KeyReader> KeyReader::tables(const std::string& key) {
  std::vector<KeyReader> readers;
  if (!know(key)) return readers;
  const auto* array = take(key, "an array of tables").as_array();
  if (array == nullptr) fail(key, "wrong type; expected an array of tables");
  for (const toml::node& node : *array) {
    if (!node.is_table()) fail(key, "wrong type; expected an array of tables");
    readers.emplace_back(*node.as_table(), where_,
                         fmt::format("{}{}[{}].", prefix_, key, readers.size()));
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

toml::table parse(std::string_view text, const std::string& where) {
  (void)check_bounds(text, where);
  try {
    return toml::parse(text, where);
  } catch (const toml::parse_error& e) {
    throw std::runtime_error(
        fmt::format("{}:{}: {}", where, e.source().begin.line, e.description()));
  }
}

std::string quoted(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) {
      out += fmt::format("\\u{:04X}", static_cast<unsigned>(static_cast<unsigned char>(c)));
    } else {
      out += c;
    }
  }
  return out + "\"";
}

}  // namespace dtact::tomlfile
