#include "clients/web/foxglove/protocol.hpp"

#include <fmt/format.h>
#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>

#include <array>
#include <cmath>
#include <stdexcept>

#include "clients/common/json.hpp"
#include "clients/recording/pictures.hpp"

namespace dtact::web::foxglove {
namespace {

namespace util = google::protobuf::util;

constexpr char kMessageData = 1;
constexpr char kServiceResponse = 3;
constexpr char kServiceRequest = 2;
constexpr const char* kJson = "json";

struct ServiceInfo {
  const char* name;
  const char* type;
  const char* request;   ///< A JSON schema.
  const char* response;  ///< The same.
};

constexpr const char* kColour =
    R"({"type":"object","properties":{"r":{"type":"integer","minimum":0,"maximum":255},)"
    R"("g":{"type":"integer","minimum":0,"maximum":255},)"
    R"("b":{"type":"integer","minimum":0,"maximum":255}}})";

/// In the order of Service.
const std::array<ServiceInfo, kServices>& services() {
  static const std::string set_light =
      fmt::format(R"({{"type":"object","properties":{{)"
                  R"("brightness":{{"type":"integer","minimum":0,"maximum":255}},)"
                  R"("scheme":{{"type":"string"}},"leds":{{"type":"array","items":{}}}}}}})",
                  kColour);
  static const std::array<ServiceInfo, kServices> all{{
      {"/dtact/set_light", "dtact.v1.SetLight", set_light.c_str(), set_light.c_str()},
      {"/dtact/rezero", "dtact.v1.Rezero",
       R"({"type":"object","properties":{"force":{"type":"boolean"}}})", R"({"type":"object"})"},
  }};
  return all;
}

template <typename Number>
void append_little(std::string& bytes, Number number) {
  for (std::size_t i = 0; i < sizeof number; ++i) {
    bytes += static_cast<char>(number >> (8 * i) & 0xff);
  }
}

std::optional<std::uint32_t> take_little(std::string_view& bytes) {
  if (bytes.size() < 4) return std::nullopt;
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    number |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[i])) << (8 * i);
  }
  bytes.remove_prefix(4);
  return number;
}

/// A number of JSON that an id can be.
std::optional<std::uint32_t> id_of(const google::protobuf::Value& value) {
  const double number = value.number_value();
  const bool fits = value.has_number_value() && number >= 0 && number <= 4294967295.0 &&
                    number == std::floor(number);
  if (!fits) return std::nullopt;
  return static_cast<std::uint32_t>(number);
}

std::optional<std::uint32_t> id_of(const google::protobuf::Struct& object, const char* key) {
  const auto found = object.fields().find(key);
  return found == object.fields().end() ? std::nullopt : id_of(found->second);
}

const google::protobuf::ListValue& list_of(const google::protobuf::Struct& object,
                                           const char* key) {
  const auto found = object.fields().find(key);
  return found == object.fields().end() ? google::protobuf::ListValue::default_instance()
                                        : found->second.list_value();
}

std::string schema_part(const std::string& type, const char* schema) {
  return fmt::format(
      R"({{"encoding":"json","schemaName":{},"schemaEncoding":"jsonschema","schema":{}}})",
      cli::json_string(type), cli::json_string(schema));
}

}  // namespace

std::string server_info(std::string_view program) {
  return fmt::format(
      R"({{"op":"serverInfo","name":{},"capabilities":["services"],"supportedEncodings":["json"],)"
      R"("metadata":{{}}}})",
      cli::json_string(program));
}

std::string advertise(const std::vector<Channels>& all) {
  std::string channels;
  for (const Channels& of : all) {
    for (const TopicInfo& info : topics()) {
      if (!of.topics.test(index(info.topic))) continue;
      if (!channels.empty()) channels += ',';
      channels += fmt::format(
          R"({{"id":{},"topic":{},"encoding":"protobuf","schemaName":{},)"
          R"("schemaEncoding":"protobuf","schema":"{}"}})",
          channel_id(of.sensor, info.topic), cli::json_string(of.prefix + info.name),
          cli::json_string(info.type->full_name()), cli::base64(recording::schema_of(*info.type)));
    }
  }
  return fmt::format(R"({{"op":"advertise","channels":[{}]}})", channels);
}

std::string unadvertise(const std::vector<Channels>& all) {
  std::vector<std::uint32_t> ids;
  for (const Channels& of : all) {
    for (const TopicInfo& info : topics()) {
      if (of.topics.test(index(info.topic))) ids.push_back(channel_id(of.sensor, info.topic));
    }
  }
  return fmt::format(R"({{"op":"unadvertise","channelIds":[{}]}})", fmt::join(ids, ","));
}

std::string advertise_services(std::size_t first, const std::vector<std::string>& prefixes) {
  std::string all;
  for (std::size_t sensor = 0; sensor < prefixes.size(); ++sensor) {
    for (std::size_t i = 0; i < kServices; ++i) {
      const ServiceInfo& info = services()[i];
      if (!all.empty()) all += ',';
      all +=
          fmt::format(R"({{"id":{},"name":{},"type":{},"request":{},"response":{}}})",
                      service_id(first + sensor, static_cast<Service>(i)),
                      cli::json_string(prefixes[sensor] + info.name), cli::json_string(info.type),
                      schema_part(std::string(info.type) + "_Request", info.request),
                      schema_part(std::string(info.type) + "_Response", info.response));
    }
  }
  return fmt::format(R"({{"op":"advertiseServices","services":[{}]}})", all);
}

std::string status(int level, std::string_view sentence, std::string_view id) {
  const std::string named = id.empty() ? "" : fmt::format(R"(,"id":{})", cli::json_string(id));
  return fmt::format(R"({{"op":"status","level":{},"message":{}{}}})", level,
                     cli::json_string(sentence), named);
}

std::string remove_status(std::string_view id) {
  return fmt::format(R"({{"op":"removeStatus","statusIds":[{}]}})", cli::json_string(id));
}

std::string service_failure(std::uint32_t service, std::uint32_t call, std::string_view sentence) {
  return fmt::format(R"({{"op":"serviceCallFailure","serviceId":{},"callId":{},"message":{}}})",
                     service, call, cli::json_string(sentence));
}

std::string service_response(std::uint32_t service, std::uint32_t call, std::string_view json) {
  std::string bytes(1, kServiceResponse);
  append_little(bytes, service);
  append_little(bytes, call);
  append_little(bytes, static_cast<std::uint32_t>(std::string_view(kJson).size()));
  bytes += kJson;
  bytes += json;
  return bytes;
}

std::string message_head(std::uint32_t subscription, std::uint64_t time_ns) {
  std::string bytes(1, kMessageData);
  append_little(bytes, subscription);
  append_little(bytes, time_ns);
  return bytes;
}

std::optional<Operation> parse_operation(const std::string& json) {
  google::protobuf::Struct object;
  if (!util::JsonStringToMessage(json, &object).ok()) return std::nullopt;
  const auto op = object.fields().find("op");
  if (op == object.fields().end() || !op->second.has_string_value()) return std::nullopt;
  Operation operation{op->second.string_value()};
  for (const auto& entry : list_of(object, "subscriptions").values()) {
    const auto subscription = id_of(entry.struct_value(), "id");
    const auto channel = id_of(entry.struct_value(), "channelId");
    if (subscription && channel) operation.subscribed.push_back({*subscription, *channel});
  }
  for (const auto& entry : list_of(object, "subscriptionIds").values()) {
    if (const auto id = id_of(entry)) operation.ended.push_back(*id);
  }
  return operation;
}

std::optional<Call> parse_call(std::string_view bytes) {
  if (bytes.empty() || bytes[0] != kServiceRequest) return std::nullopt;
  bytes.remove_prefix(1);
  const auto service = take_little(bytes);
  const auto call = take_little(bytes);
  const auto length = take_little(bytes);
  if (!service || !call || !length || *length > bytes.size()) return std::nullopt;
  return Call{*service, *call, bytes.substr(0, *length), bytes.substr(*length)};
}

v1::ClientMessage request_of(Service service, std::string_view json) {
  v1::ClientMessage message;
  google::protobuf::Message& request =
      service == Service::set_light
          ? static_cast<google::protobuf::Message&>(*message.mutable_set_light())
          : static_cast<google::protobuf::Message&>(*message.mutable_rezero());
  const std::string text(json.empty() ? "{}" : json);
  if (const auto result = util::JsonStringToMessage(text, &request); !result.ok()) {
    throw std::runtime_error(fmt::format("the request is no JSON of {}: {}", request.GetTypeName(),
                                         std::string(result.message())));
  }
  return message;
}

std::string answer_of(const v1::Reply& reply) {
  return reply.has_light() ? cli::json_line(reply.light()) : "{}";
}

}  // namespace dtact::web::foxglove
