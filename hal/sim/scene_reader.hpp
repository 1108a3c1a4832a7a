#pragma once

#include <toml++/toml.h>

#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace dtact::hal::sim {

/// One table of a scene file. Reads the keys it is asked for, leaves the variable alone when a key
/// is not there, and at the end refuses keys nobody asked for. Every error is a std::runtime_error
/// "file:line: table.key: what is wrong; what is allowed".
class SceneReader {
 public:
  SceneReader(const toml::table& table, std::string file, std::string name);

  /// A number within [lowest, highest].
  void number(std::string_view key, double& value, double lowest, double highest);
  /// A whole number within [lowest, highest].
  void integer(std::string_view key, std::int64_t& value, std::int64_t lowest,
               std::int64_t highest);
  void integer(std::string_view key, int& value, int lowest, int highest);
  void text(std::string_view key, std::string& value);
  /// One of `allowed`; writes its index.
  void choice(std::string_view key, int& index, const std::vector<std::string>& allowed);

  [[nodiscard]] bool has(std::string_view key) const { return table_.contains(key); }
  /// Throws unless the key is there.
  void require(std::string_view key) const;
  /// The table below `key`, empty when it is not there.
  [[nodiscard]] SceneReader table(std::string_view key);
  /// The tables of the array below `key`, none when it is not there.
  [[nodiscard]] std::vector<SceneReader> tables(std::string_view key);
  /// Throws naming the first key nobody asked for and those somebody did.
  void finish() const;

  [[noreturn]] void fail(std::string_view key, const std::string& problem) const;

 private:
  const toml::node* find(std::string_view key);

  const toml::table& table_;
  std::string file_;
  std::string name_;  // dotted, empty for the file itself
  std::set<std::string, std::less<>> known_;
};

}  // namespace dtact::hal::sim
