#pragma once

#include <toml++/toml.h>

#include <cstdint>
#include <functional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace dtact::tomlfile {

/// Reads typed values from a TOML table and, at the end, rejects keys that were not read. Every
/// error is a std::runtime_error "FILE:LINE: KEY: what is wrong; what is allowed".
class KeyReader {
 public:
  /// `where`: the file's name. `prefix`: the table's own key with a dot, empty at the top.
  KeyReader(const toml::table& table, std::string where, std::string prefix = "")
      : table_(table), where_(std::move(where)), prefix_(std::move(prefix)) {}

  // The key has to be there.
  [[nodiscard]] std::int64_t integer(const std::string& key, std::int64_t low, std::int64_t high);
  [[nodiscard]] double number(const std::string& key, double low, double high);
  [[nodiscard]] std::string text(const std::string& key);
  [[nodiscard]] std::vector<std::int64_t> integers(const std::string& key, std::int64_t low,
                                                   std::int64_t high);
  [[nodiscard]] std::vector<double> numbers(const std::string& key, double low, double high);
  [[nodiscard]] KeyReader table(const std::string& key);

  // The value stays as it is when the key is absent.
  void integer_if(const std::string& key, std::int64_t& value, std::int64_t low, std::int64_t high);
  void integer_if(const std::string& key, int& value, int low, int high);
  void number_if(const std::string& key, double& value, double low, double high);
  /// A text that is not empty.
  void text_if(const std::string& key, std::string& value);
  /// One of `allowed`; writes its index.
  void choice_if(const std::string& key, int& index, const std::vector<std::string>& allowed);
  /// An empty table when the key is absent.
  [[nodiscard]] KeyReader table_if(const std::string& key);
  /// An array of tables, or nothing when the key is absent.
  [[nodiscard]] std::vector<KeyReader> tables(const std::string& key);

  [[nodiscard]] bool has(const std::string& key) const { return table_.contains(key); }
  /// Throws unless the key is there.
  void require(const std::string& key) const;
  [[nodiscard]] std::vector<std::string> keys() const;

  /// Refuses every key that was not taken.
  void finish() const;
  /// Ends the reading with an error at `key`, or at the table when `key` is empty or absent.
  [[noreturn]] void fail(const std::string& key, const std::string& what) const;

 private:
  /// Notes that the key is known. False when it is absent.
  bool know(const std::string& key);
  [[nodiscard]] const toml::node& take(const std::string& key, const std::string& expected);
  template <typename Value>
  [[nodiscard]] std::vector<Value> array(const std::string& key, const std::string& allowed,
                                         const std::function<bool(Value)>& fits);

  const toml::table& table_;
  std::string where_;
  std::string prefix_;
  std::set<std::string> taken_;
};

/// Parses TOML text. Throws std::runtime_error "WHERE:LINE: what is wrong".
[[nodiscard]] toml::table parse(std::string_view text, const std::string& where);

/// A string as TOML writes it.
[[nodiscard]] std::string quoted(std::string_view text);

}  // namespace dtact::tomlfile
