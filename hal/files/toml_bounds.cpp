#include "hal/files/toml_bounds.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>

namespace dtact::tomlfile {
namespace {

/// One walk through a text. It has to know strings and comments, whose characters mean nothing, and
/// whether it is in a key or a value.
class Walk {
 public:
  Walk(std::string_view text, const std::string& where) : text_(text), where_(where) {}

  Counts run() {
    while (at_ < text_.size()) step(text_[at_]);
    return counts_;
  }

 private:
  void step(char c) {
    if (c == '"' || c == '\'') return skip_string(c);
    if (c == '#') return skip_to(text_.find('\n', at_));
    ++at_;
    if (c == '\n') return end_line();
    if (c == ' ' || c == '\t' || c == '\r') {
      word_ = 0;
    } else if (std::string_view("=.,[]{}").find(c) != std::string_view::npos) {
      word_ = 0;
      mark(c);
    } else if (++word_ > kMaxWord) {
      fail("a word", kMaxWord, "bytes");
    }
  }

  void mark(char c) {
    switch (c) {
      case '=':
        count_key();
        in_value_ = true;
        dots_ = 0;
        return;
      case '.':
        // Counted in a value, too: one or none there, whatever the walk takes for a value.
        if (++dots_ >= kMaxDepth) fail("a key", kMaxDepth, "parts");
        if (!in_value_) count_key();
        return;
      case ',':
        dots_ = 0;
        count_value();
        if (depth_ > 0 && open_[depth_ - 1] == '{') in_value_ = false;
        return;
      case '[':
      case '{':
        dots_ = 0;
        return in_value_ ? open(c) : count_key();
      default:
        // A header's brackets are not counted as open.
        if (depth_ > 0 && (in_value_ || c == '}')) --depth_;
        in_value_ = in_value_ || c == '}';
    }
  }

  void open(char c) {
    count_value();
    if (depth_ == kMaxDepth) fail("a value", kMaxDepth, "arrays and tables within each other");
    open_[depth_++] = c;
    in_value_ = c == '[';
  }

  void end_line() {
    ++line_;
    word_ = 0;
    dots_ = 0;
    if (depth_ == 0) in_value_ = false;
  }

  void skip_to(std::size_t end) { at_ = std::min(end, text_.size()); }

  /// From the quotation mark at_ to behind the one that ends the string.
  void skip_string(char quote) {
    const std::size_t begin = at_;
    const bool many_lines = text_.substr(at_).starts_with(std::string(3, quote));
    at_ += many_lines ? 3 : 1;
    while (at_ < text_.size()) {
      const char c = text_[at_];
      // No string of one line goes on here: the parser ends at this place with an error.
      if (c == '\n' && !many_lines) return;
      if (c == '\\' && quote == '"') {
        if (at_ + 1 < text_.size() && text_[at_ + 1] == '\n') ++line_;
        at_ += 2;
      } else if (c == quote && ends_string(quote, many_lines)) {
        break;
      } else {
        if (c == '\n') ++line_;
        ++at_;
      }
    }
    skip_to(at_);
    word_ = 0;
    if (at_ - begin > kMaxWord) fail("a string", kMaxWord, "bytes");
  }

  /// At a quotation mark: goes behind the marks that end the string, if these do.
  bool ends_string(char quote, bool many_lines) {
    if (!many_lines) {
      ++at_;
      return true;
    }
    const std::size_t end = std::min(text_.find_first_not_of(quote, at_), text_.size());
    // Up to two marks before the three that end it belong to the string.
    const std::size_t marks = std::min<std::size_t>(end - at_, 5);
    at_ += marks;
    return marks >= 3;
  }

  void count_key() {
    if (++counts_.keys > kMaxKeys) fail("the file", kMaxKeys, "keys");
  }
  void count_value() {
    if (++counts_.values > kMaxValues) fail("the file", kMaxValues, "values in arrays");
  }

  [[noreturn]] void fail(std::string_view what, std::size_t most, std::string_view unit) const {
    throw std::runtime_error(fmt::format("{}:{}: {} has more than {} {}, the limit of what is read",
                                         where_, line_, what, most, unit));
  }

  std::string_view text_;
  const std::string& where_;
  std::size_t at_ = 0;
  std::size_t line_ = 1;
  std::size_t word_ = 0;  ///< Bytes since the last mark or blank.
  std::size_t dots_ = 0;  ///< Since the last other mark.
  Counts counts_;
  bool in_value_ = false;
  std::array<char, kMaxDepth> open_{};  ///< '[' and '{' of the value, the outermost first.
  std::size_t depth_ = 0;
};

/// TOML has no control characters but these three, and its parser does not expect them in a key.
void check_characters(std::string_view text, const std::string& where) {
  const auto found = std::ranges::find_if(text, [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return (byte < 0x20 && c != '\t' && c != '\n' && c != '\r') || byte == 0x7F;
  });
  if (found == text.end()) return;
  throw std::runtime_error(
      fmt::format("{}:{}: holds a control character, U+{:04X}, which no TOML may", where,
                  1 + std::count(text.begin(), found, '\n'), static_cast<unsigned>(*found)));
}

}  // namespace

Counts check_bounds(std::string_view text, const std::string& where) {
  if (text.size() > kMaxBytes) {
    throw std::runtime_error(fmt::format("{}:1: the file has {} bytes; at most {} are read", where,
                                         text.size(), kMaxBytes));
  }
  check_characters(text, where);
  return Walk(text, where).run();
}

}  // namespace dtact::tomlfile
