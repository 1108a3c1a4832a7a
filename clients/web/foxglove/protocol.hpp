#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/web/foxglove/topics.hpp"
#include "proto/dtact.pb.h"

// The Foxglove WebSocket protocol as far as this gateway speaks it: its JSON and its binary
// messages (github.com/foxglove/ws-protocol, docs/spec.md).
namespace dtact::web::foxglove {

/// Under both names it is the same here.
inline constexpr const char* kSubprotocol = "foxglove.websocket.v1";
inline constexpr const char* kSdkSubprotocol = "foxglove.sdk.v1";
/// Longest message of a client's, bytes.
inline constexpr std::size_t kMaxMessage = 65536;

enum class Service : std::uint8_t { set_light, rezero };
inline constexpr std::size_t kServices = 2;

/// A sensor's number among a client's, and what of it is meant: the ids that the protocol counts
/// from 1.
[[nodiscard]] constexpr std::uint32_t channel_id(std::size_t sensor, Topic topic) {
  return static_cast<std::uint32_t>(sensor * kTopics + index(topic) + 1);
}
[[nodiscard]] constexpr std::uint32_t service_id(std::size_t sensor, Service service) {
  return static_cast<std::uint32_t>(sensor * kServices + static_cast<std::size_t>(service) + 1);
}

/// A sensor's channels.
struct Channels {
  std::size_t sensor = 0;
  std::string prefix;  ///< Stands before the topics.
  Topics topics;
};

// Messages of the server. `prefixes`: prefix of the services of each sensor from the `first` on.

[[nodiscard]] std::string server_info(std::string_view program);
[[nodiscard]] std::string advertise(const std::vector<Channels>& all);
[[nodiscard]] std::string unadvertise(const std::vector<Channels>& all);
[[nodiscard]] std::string advertise_services(std::size_t first,
                                             const std::vector<std::string>& prefixes);
/// `level`: 0 information, 1 warning, 2 error. One of the same `id` replaces the one before.
[[nodiscard]] std::string status(int level, std::string_view sentence, std::string_view id = "");
/// Withdraws the status of this id.
[[nodiscard]] std::string remove_status(std::string_view id);
[[nodiscard]] std::string service_failure(std::uint32_t service, std::uint32_t call,
                                          std::string_view sentence);
/// Binary.
[[nodiscard]] std::string service_response(std::uint32_t service, std::uint32_t call,
                                           std::string_view json);
/// What stands before the payload of a message.
[[nodiscard]] std::string message_head(std::uint32_t subscription, std::uint64_t time_ns);

// Messages of a client.

struct SubscriptionRequest {
  std::uint32_t subscription = 0;
  std::uint32_t channel = 0;
};
struct Operation {
  std::string name;                                  ///< "subscribe"
  std::vector<SubscriptionRequest> subscribed = {};  ///< By subscribe.
  std::vector<std::uint32_t> ended = {};             ///< Subscriptions, of unsubscribe.
};
/// Empty when it is no JSON object with an "op"; entries that make no sense are left out.
[[nodiscard]] std::optional<Operation> parse_operation(const std::string& json);

struct Call {
  std::uint32_t service = 0;
  std::uint32_t call = 0;
  std::string_view encoding;  ///< Part of what was parsed, …
  std::string_view payload;   ///< … as this.
};
/// Empty when the bytes are no call of a service.
[[nodiscard]] std::optional<Call> parse_call(std::string_view bytes);

/// The request that a service's JSON stands for. Throws std::runtime_error saying what is wrong.
[[nodiscard]] v1::ClientMessage request_of(Service service, std::string_view json);
/// What a service answers: JSON.
[[nodiscard]] std::string answer_of(const v1::Reply& reply);

}  // namespace dtact::web::foxglove
