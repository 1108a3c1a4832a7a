#pragma once

#include <concepts>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace dtact::ctl {

/// Writes one JSON text (RFC 8259) on one line. The caller opens and closes; commas come by
/// themselves.
class Json {
 public:
  Json& open(char bracket);   ///< '{' or '['
  Json& close(char bracket);  ///< '}' or ']'
  Json& key(std::string_view name);
  Json& value(std::string_view text);
  Json& value(const char* text) { return value(std::string_view(text)); }
  Json& value(bool flag);
  Json& value(double number);  ///< Shortest text that reads back the same; null unless finite.
  template <std::integral Number>
    requires(!std::same_as<Number, bool>)
  Json& value(Number number) {
    return raw(std::to_string(number));
  }
  Json& value(const std::vector<std::string>& texts);
  Json& null() { return raw("null"); }

  /// A key with its value.
  template <typename Value>
  Json& member(std::string_view name, const Value& of) {
    return key(name).value(of);
  }

  [[nodiscard]] const std::string& text() const noexcept { return text_; }

 private:
  Json& raw(std::string_view text);
  void separate();
  void quote(std::string_view text);

  std::string text_;
  bool first_ = true;  ///< Nothing stands before the next value in its object or array.
};

}  // namespace dtact::ctl
