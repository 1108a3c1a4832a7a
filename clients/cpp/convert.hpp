#pragma once

#include "clients/cpp/types.hpp"

namespace dtact::v1 {
class Event;
class Frame;
class LightState;
class Status;
class StoredCalibration;
}  // namespace dtact::v1

// Messages as the library's types. Not part of its interface.
namespace dtact::client {

[[nodiscard]] Light to_light(const v1::LightState& message);
/// Throws ProtocolError for maps that do not decode.
[[nodiscard]] Frame to_frame(const v1::Frame& message);
/// Nothing for a kind of event that this library does not know.
[[nodiscard]] std::optional<Event> to_event(const v1::Event& message);
[[nodiscard]] StoredCalibration to_stored(const v1::StoredCalibration& message);
[[nodiscard]] Status to_status(const v1::Status& message);

}  // namespace dtact::client
