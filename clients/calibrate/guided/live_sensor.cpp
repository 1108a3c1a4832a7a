#include <utility>

#include "clients/calibrate/guided/sensor.hpp"

namespace dtact::ctl::guided {

LiveSensor::LiveSensor(const client::Options& target) : client_(target) {
  v1::Subscribe luma;
  luma.set_luma(v1::LUMA_GREY8);
  client_.subscribe(luma);
}

std::optional<v1::Frame> LiveSensor::next(std::chrono::milliseconds timeout) {
  const auto end = std::chrono::steady_clock::now() + timeout;
  for (;;) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() <= 0) return std::nullopt;
    auto message = client_.next(left);
    if (!message.has_value()) return std::nullopt;
    auto* frame = std::get_if<v1::Frame>(&*message);
    if (frame != nullptr && frame->has_luma()) return std::move(*frame);
  }
}

}  // namespace dtact::ctl::guided
