#include "clients/ctl/json/json.hpp"

#include <fmt/format.h>

#include <cmath>
#include <iterator>

namespace dtact::ctl {

void Json::separate() {
  if (!first_) text_ += ',';
  first_ = false;
}

void Json::quote(std::string_view text) {
  text_ += '"';
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      text_ += '\\';
      text_ += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      fmt::format_to(std::back_inserter(text_), "\\u{:04x}", static_cast<unsigned>(c));
    } else {
      text_ += c;
    }
  }
  text_ += '"';
}

Json& Json::raw(std::string_view text) {
  separate();
  text_ += text;
  return *this;
}

Json& Json::open(char bracket) {
  separate();
  text_ += bracket;
  first_ = true;
  return *this;
}

Json& Json::close(char bracket) {
  text_ += bracket;
  first_ = false;
  return *this;
}

Json& Json::key(std::string_view name) {
  separate();
  quote(name);
  text_ += ':';
  first_ = true;  // no comma between a key and its value
  return *this;
}

Json& Json::value(std::string_view text) {
  separate();
  quote(text);
  return *this;
}

Json& Json::value(bool flag) { return raw(flag ? "true" : "false"); }

Json& Json::value(double number) {
  return std::isfinite(number) ? raw(fmt::format("{}", number)) : null();
}

Json& Json::value(const std::vector<std::string>& texts) {
  open('[');
  for (const auto& text : texts) value(std::string_view(text));
  return close(']');
}

}  // namespace dtact::ctl
