#include "clients/common/json.hpp"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <openssl/evp.h>

#include <algorithm>
#include <cmath>

#include "hal/base/utf8.hpp"

namespace dtact::cli {
namespace {

using google::protobuf::EnumValueDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

template <class Number>
std::string number(Number value) {
  return std::isfinite(value) ? fmt::format("{}", value) : "null";
}

std::string object(const Message& message);

std::string named(const EnumValueDescriptor& value) {
  return json_string(std::string(value.name()));
}

/// `at`: the place in a repeated field; -1: the field is singular.
std::string value_of(const Message& message, const FieldDescriptor& field, int at) {
  const Reflection& values = *message.GetReflection();
  const auto get = [&](auto single, auto repeated) {
    return at < 0 ? (values.*single)(message, &field) : (values.*repeated)(message, &field, at);
  };
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT32:
      return fmt::to_string(get(&Reflection::GetInt32, &Reflection::GetRepeatedInt32));
    case FieldDescriptor::CPPTYPE_INT64:
      return fmt::to_string(get(&Reflection::GetInt64, &Reflection::GetRepeatedInt64));
    case FieldDescriptor::CPPTYPE_UINT32:
      return fmt::to_string(get(&Reflection::GetUInt32, &Reflection::GetRepeatedUInt32));
    case FieldDescriptor::CPPTYPE_UINT64:
      return fmt::to_string(get(&Reflection::GetUInt64, &Reflection::GetRepeatedUInt64));
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return number(get(&Reflection::GetDouble, &Reflection::GetRepeatedDouble));
    case FieldDescriptor::CPPTYPE_FLOAT:
      return number(get(&Reflection::GetFloat, &Reflection::GetRepeatedFloat));
    case FieldDescriptor::CPPTYPE_BOOL:
      return get(&Reflection::GetBool, &Reflection::GetRepeatedBool) ? "true" : "false";
    case FieldDescriptor::CPPTYPE_ENUM:
      return named(*get(&Reflection::GetEnum, &Reflection::GetRepeatedEnum));
    case FieldDescriptor::CPPTYPE_STRING: {
      const std::string text = get(&Reflection::GetString, &Reflection::GetRepeatedString);
      return field.type() == FieldDescriptor::TYPE_BYTES ? '"' + base64(text) + '"'
                                                         : json_string(text);
    }
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return object(at < 0 ? values.GetMessage(message, &field)
                           : values.GetRepeatedMessage(message, &field, at));
  }
  return "null";
}

std::string object(const Message& message) {
  const Reflection& values = *message.GetReflection();
  std::string text = "{";
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor& field = *message.GetDescriptor()->field(i);
    if (field.has_presence() && !values.HasField(message, &field)) continue;
    text += fmt::format("{}\"{}\":", text.size() > 1 ? "," : "", field.name());
    if (!field.is_repeated()) {
      text += value_of(message, field, -1);
      continue;
    }
    text += '[';
    for (int at = 0; at < values.FieldSize(message, &field); ++at) {
      text += (at > 0 ? "," : "") + value_of(message, field, at);
    }
    text += ']';
  }
  return text + '}';
}

}  // namespace

std::string json_line(const Message& message) { return object(message) + '\n'; }

std::string json_string(std::string_view text) {
  std::string json = "\"";
  while (!text.empty()) {
    const std::size_t size = base::character_size(text);
    const char sign = text.front();
    if (size == 0) {
      json += "\xef\xbf\xbd";
    } else if (sign == '"' || sign == '\\') {
      json += '\\';
      json += sign;
    } else if (static_cast<unsigned char>(sign) < 0x20) {
      json += fmt::format("\\u{:04x}", static_cast<unsigned char>(sign));
    } else {
      json += text.substr(0, size);
    }
    text.remove_prefix(std::max<std::size_t>(size, 1));
  }
  return json + '"';
}

std::string base64(std::string_view bytes) {
  std::string text((bytes.size() + 2) / 3 * 4 + 1, '\0');
  const int size = ::EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                                     reinterpret_cast<const unsigned char*>(bytes.data()),
                                     static_cast<int>(bytes.size()));
  text.resize(static_cast<std::size_t>(size));
  return text;
}

}  // namespace dtact::cli
