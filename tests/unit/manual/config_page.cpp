#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "daemon/app/config_keys.hpp"
#include "tests/unit/manual/pages.hpp"
#include "tests/unit/manual/roff.hpp"

namespace dtact::manual {
namespace {

/// A key of config/dtactd.toml.
struct Entry {
  std::string path;
  std::string comment;  ///< Behind the value.
  bool set = true;      ///< Not commented out: the default is the same on all machines.
};

/// Keys below a common comment, or with none.
struct Group {
  std::string comment;
  std::vector<Entry> entries;
};

/// A key's default and allowed values in the daemon, by path.
struct Fact {
  std::string allowed;
  std::string preset;
};

std::map<std::string, Fact> facts() {
  app::Config config;
  std::map<std::string, Fact> result;
  for (const app::Key& key : app::bind_keys(config)) {
    std::string allowed = key.allowed;
    // Keys without a unit leave a blank in its place.
    allowed = std::regex_replace(allowed, std::regex(" +(,|$)"), "$1");
    result[key.path] = {std::move(allowed), key.show()};
  }
  return result;
}

std::set<std::string> words_of(const std::string& text) {
  static const std::regex word(R"([^\s,;()]+[^\s,;().:]|[^\s,;()])");
  return {std::sregex_token_iterator(text.begin(), text.end(), word), std::sregex_token_iterator()};
}

/// The page's text for a key; its comment and its allowed values do not repeat each other.
std::string body(const Entry& key, const std::string& above, const Fact& fact) {
  std::string text = above.empty() ? "" : sentence(above) + " ";
  const std::set<std::string> comment = words_of(above + " " + key.comment);
  const std::set<std::string> allowed = words_of(fact.allowed);
  if (!std::ranges::includes(allowed, words_of(key.comment))) text += sentence(key.comment) + " ";
  const bool explained = std::ranges::all_of(allowed, [&](const std::string& word) {
    return word == "one" || word == "of" || comment.contains(word);
  });
  if (!explained) text += sentence(fact.allowed) + " ";
  if (key.set) text += "Default: `" + fact.preset + "`.";
  return escaped(text);
}

class Page {
 public:
  explicit Page(const std::string& toml) {
    std::istringstream lines(toml);
    for (std::string line; std::getline(lines, line);) read(line);
    end_group();
    if (missing_.empty()) return;
    throw std::runtime_error("config/dtactd.toml lacks the key " + missing_.begin()->first);
  }

  [[nodiscard]] const std::string& introduction() const { return introduction_; }
  [[nodiscard]] const std::string& keys() const { return text_; }

 private:
  void read(const std::string& line) {
    static const std::regex table(R"(\[(.*)\])");
    // A value has no '#'. A key that is commented out has a line of its own.
    static const std::regex key(R"((# )?(\w+) = ([^#]*?)\s*(?:# (.*))?)");
    std::smatch match;
    if (line.empty()) {
      end_group();
    } else if (std::regex_match(line, match, table)) {
      table_ = match[1].str() + ".";
      text_ += heading(escaped("[" + match[1].str() + "]"), "SS");
      after_heading_ = true;
      paragraph();
    } else if (std::regex_match(line, match, key) &&
               (!match[1].matched || missing_.contains(table_ + match[2].str()))) {
      add({table_ + match[2].str(), match[4].str(), !match[1].matched});
    } else if (line.starts_with("# ")) {
      if (!group_.entries.empty()) end_group();
      group_.comment += (group_.comment.empty() ? "" : " ") + line.substr(2);
    } else {
      throw std::runtime_error("config/dtactd.toml: neither comment nor key: " + line);
    }
  }

  void add(const Entry& key) {
    if (missing_.erase(key.path) == 0) {
      throw std::runtime_error("config/dtactd.toml has " + key.path + ", which dtactd has not");
    }
    // A comment above keys without comments describes them; else it describes the table.
    if (!key.comment.empty()) {
      if (group_.entries.empty()) paragraph();
      end_group();
    }
    after_heading_ = false;
    group_.entries.push_back(key);
    if (!key.comment.empty()) end_group();
  }

  void paragraph() {
    if (group_.comment.empty()) return;
    if (!text_.empty() && !after_heading_) text_ += ".PP\n";
    text_ += filled(escaped(sentence(group_.comment)));
    group_.comment.clear();
  }

  void end_group() {
    if (group_.entries.empty()) {
      // The first lines of the file describe all of it.
      if (introduction_.empty()) {
        introduction_ = std::exchange(group_.comment, {});
      }
      return;
    }
    const auto alike = [this](const Entry& other) {
      const Fact& first = facts_.at(group_.entries[0].path);
      const Fact& fact = facts_.at(other.path);
      return fact.allowed == first.allowed && fact.preset == first.preset;
    };
    if (std::ranges::all_of(group_.entries, alike)) {
      std::string tags;
      for (const Entry& key : group_.entries)
        tags += (tags.empty() ? "" : "\n.TQ\n") + bold(key.path);
      const Entry& first = group_.entries[0];
      text_ += entry(tags, body(first, group_.comment, facts_.at(first.path)));
    } else {
      paragraph();
      for (const Entry& key : group_.entries) {
        text_ += entry(bold(key.path), body(key, "", facts_.at(key.path)));
      }
    }
    group_ = {};
  }

  const std::map<std::string, Fact> facts_ = facts();
  std::map<std::string, Fact> missing_ = facts_;  ///< Keys that have not come yet.
  Group group_;
  std::string table_;  ///< With a full stop; empty before the first.
  std::string introduction_;
  bool after_heading_ = false;
  std::string text_;
};

}  // namespace

std::string config_page(const std::string& toml) {
  const Page page(toml);
  return page_head("dtactd.toml", 5, "File Formats") + heading("NAME") +
         "dtactd.toml \\- configuration of dtactd\n" + heading("SYNOPSIS") +
         italic("/etc/dtactd/dtactd.toml") + "\n" + heading("DESCRIPTION") +
         filled(escaped(page.introduction())) + ".PP\n" +
         filled(escaped(
             "The file is TOML (https://toml.io). Keys are written here with their table, as "
             "`dtactd --set` takes them: `camera.fps` is `fps` below the line `[camera]`. Strings "
             "stand in double quotes.")) +
         heading("KEYS") + page.keys() + heading("FILES") +
         entry(italic("/etc/dtactd/dtactd.toml"),
               escaped("The file that the unit dtactd.service names.")) +
         heading("SEE ALSO") + reference("dtactd", 8) + ", " + reference("dtactctl", 1) + ", " +
         reference("dtact-calibrate", 1) + "\n";
}

}  // namespace dtact::manual
