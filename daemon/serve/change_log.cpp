#include "daemon/serve/change_log.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <vector>

#include "daemon/serve/session.hpp"
#include "hal/base/utf8.hpp"
#include "proto/defaults.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {
namespace {

/// A word that the client chose.
std::string quoted(const std::string& word) {
  return fmt::format("\"{}\"", base::printable(base::first_bytes(word, wire::kMaxCalibrationName)));
}

std::string values_of(const v1::SetLight& request) {
  std::vector<std::string> values;
  if (request.has_brightness()) {
    values.push_back(fmt::format("brightness {}", request.brightness()));
  }
  if (request.has_scheme()) values.push_back("scheme " + quoted(request.scheme()));
  if (!request.leds().empty()) {
    std::vector<std::string> leds;
    // Valid are as many as the ring has, which is fewer.
    for (int i = 0; i < std::min(request.leds_size(), 16); ++i) {
      const v1::Rgb& led = request.leds(i);
      leds.push_back(fmt::format("{}/{}/{}", led.r(), led.g(), led.b()));
    }
    values.push_back(fmt::format("leds {}", fmt::join(leds, " ")));
  }
  return fmt::format("{}", fmt::join(values, ", "));
}

std::string values_of(const v1::SetCamera& request) {
  std::vector<std::string> values;
  if (request.has_exposure_us())
    values.push_back(fmt::format("exposure_us {}", request.exposure_us()));
  if (request.has_gain()) values.push_back(fmt::format("gain {}", request.gain()));
  return fmt::format("{}", fmt::join(values, ", "));
}

std::string values_of(const v1::SetReconstruction& request) {
  std::vector<std::string> values;
  if (request.has_resolution()) values.push_back("resolution " + quoted(request.resolution()));
  if (request.has_sharpen()) values.push_back("sharpen " + quoted(request.sharpen()));
  if (request.has_max_error_um()) {
    values.push_back(fmt::format("max_error_um {}", request.max_error_um()));
  }
  return fmt::format("{}", fmt::join(values, ", "));
}

/// The request's name and its values; empty for one that changes nothing.
std::string request_of(const v1::ClientMessage& message) {
  switch (message.request_case()) {
    case v1::ClientMessage::kSetLight:
      return "set_light " + values_of(message.set_light());
    case v1::ClientMessage::kSetCamera:
      return "set_camera " + values_of(message.set_camera());
    case v1::ClientMessage::kRezero:
      return message.rezero().force() ? "rezero force" : "rezero";
    case v1::ClientMessage::kSetReconstruction:
      return "set_reconstruction " + values_of(message.set_reconstruction());
    case v1::ClientMessage::kUploadCalibration:
      return fmt::format("upload_calibration {}, {} and {} bytes",
                         quoted(message.upload_calibration().name()),
                         message.upload_calibration().calibration_toml().size(),
                         message.upload_calibration().reference_png().size());
    case v1::ClientMessage::kActivateCalibration:
      return fmt::format("activate_calibration {}", message.activate_calibration().number());
    case v1::ClientMessage::kPinCalibration:
      return fmt::format("pin_calibration {} {}", message.pin_calibration().number(),
                         message.pin_calibration().pinned());
    case v1::ClientMessage::kHello:
    case v1::ClientMessage::kSubscribe:
    case v1::ClientMessage::kGetStatus:
    case v1::ClientMessage::kGetCalibration:
    case v1::ClientMessage::kListCalibrations:
    case v1::ClientMessage::kGetReference:
    case v1::ClientMessage::kPing:
    case v1::ClientMessage::REQUEST_NOT_SET:
      return {};
  }
  return {};
}

}  // namespace

ChangeRecord describe_change(const Session& session, const v1::ClientMessage& message) {
  const std::string request = request_of(message);
  if (request.empty()) return {};
  std::string who = session.identity();
  if (!message.on_behalf_of().empty()) {
    who += " on behalf of " +
           base::printable(base::first_bytes(message.on_behalf_of(), wire::kMaxOnBehalfOf));
  }
  return {fmt::format("{}: {}", who, request), session.peer().address, session.token_name()};
}

void log_change(const Log& log, const ChangeRecord& change, const std::string& result,
                LogSubject subject) {
  if (change.text.empty()) return;
  log({LogLevel::info, fmt::format("{}: {}", change.text, result), change.client, subject,
       change.token});
}

}  // namespace dtact::net
