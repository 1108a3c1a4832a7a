#pragma once

#include <cstdint>
#include <optional>

#include "daemon/net/calibration_store.hpp"
#include "daemon/pipeline/port.hpp"

namespace dtact::v1 {
class CalibrationSummary;
class CameraSettings;
class Contact;
class Event;
class Frame;
class LightState;
class ServerMessage;
class StagePercentiles;
class StageTimes;
class Status;
class StoredCalibration;
}  // namespace dtact::v1

// The pipeline's types as messages. Each function fills a message that is empty.
namespace dtact::net {

void fill(const hal::Light& light, std::optional<std::int64_t> since_ns, v1::LightState& out);
void fill(const hal::CameraSettings& settings, v1::CameraSettings& out);
void fill(const pipeline::ContactSummary& contact, v1::Contact& out);
/// Everything but the maps, `dropped`, `times` and `calibration`.
void fill(const pipeline::DepthFrame& frame, v1::Frame& out);
void fill(const pipeline::StageTimes& times, std::int64_t encode_ns, v1::StageTimes& out);
/// With the advice; without what the network part itself knows: its stages, clients, version, …
void fill(const pipeline::Status& status, v1::Status& out);
void fill(const CalibrationSummary& summary, v1::CalibrationSummary& out);
void fill(const StoredCalibration& stored, v1::StoredCalibration& out);
void fill(const pipeline::StageStatistics& stage, v1::StagePercentiles& out);
/// When it happened.
void fill(const pipeline::Stamp& at, v1::Event& out);
/// False for CommandDone, which is an answer to one client and not an event.
[[nodiscard]] bool fill(const pipeline::Event& event, v1::Event& out);

}  // namespace dtact::net
