#include "clients/ctl/light_delay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <optional>
#include <ostream>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "clients/common/exit_codes.hpp"
#include "clients/common/interruptible.hpp"
#include "clients/common/json.hpp"
#include "clients/common/reports.pb.h"
#include "clients/cpp/maps.hpp"
#include "clients/ctl/light_step.hpp"
#include "clients/ctl/light_text.hpp"

namespace dtact::ctl {
namespace {

using std::chrono::milliseconds;

/// Each way. The steps fall at places spread over a frame's time, the worst of them within a tenth
/// of it of the worst there is.
constexpr int kSteps = 10;
constexpr int kTries = 5;  // of a step in which frames went missing
constexpr milliseconds kTimeout{5000};
constexpr std::uint32_t kDim = 64;  // a brightness below is too little to step down from
/// Successive multiples of the golden ratio fill a frame's time evenly, however many there are.
constexpr double kGolden = 0.6180339887;

cli::Failure failure(const std::string& sentence) { return {cli::kFailed, sentence}; }

v1::SetLight change_to(const v1::LightState& light) {
  v1::SetLight change;
  change.set_brightness(light.brightness());
  *change.mutable_leds() = light.leds();
  return change;
}

/// Whether the ring shows the same, since whenever.
bool same(v1::LightState a, v1::LightState b) {
  a.clear_since_ns();
  b.clear_since_ns();
  return a.SerializeAsString() == b.SerializeAsString();
}

double mean_grey(const v1::LumaMap& map) {
  const std::vector<std::uint8_t> pixels = client::pixels_of(map);
  const auto sum = std::accumulate(pixels.begin(), pixels.end(), std::uint64_t{0});
  return static_cast<double>(sum) / static_cast<double>(std::max<std::size_t>(1, pixels.size()));
}

class Measurement {
 public:
  Measurement(client::Client& client, const v1::Status& status)
      : client_(client), period_s_(1 / std::max(0.1, status.camera().fps())) {
    bright_ = status.light();
    if (bright_.brightness() < kDim) bright_.set_brightness(255);
    dark_ = bright_;
    dark_.set_brightness(bright_.brightness() / 2);
  }

  /// All steps; the frames that each took.
  void run(std::vector<std::uint32_t>& darker, std::vector<std::uint32_t>& brighter) {
    v1::Subscribe luma;
    luma.set_luma(v1::LUMA_GREY8);
    client_.subscribe(luma);
    (void)client_.set_light(change_to(bright_));
    rest(bright_);
    for (int i = 0; i < kSteps; ++i) {
      darker.push_back(step(bright_, dark_));
      brighter.push_back(step(dark_, bright_));
    }
  }

 private:
  v1::Frame next_frame() {
    const auto deadline = std::chrono::steady_clock::now() + kTimeout;
    while (std::chrono::steady_clock::now() < deadline) {
      if (cli::Interruptible::happened()) {
        throw failure("interrupted: nothing was measured, the light is as before");
      }
      auto message = client_.next(milliseconds(100));
      if (!message) continue;
      if (auto* frame = std::get_if<v1::Frame>(&*message); frame != nullptr && frame->has_luma()) {
        return std::move(*frame);
      }
    }
    throw failure("no frames come: " + client_.status().advice());
  }

  /// Waits until the picture rests under this light, which has just been set.
  void rest(const v1::LightState& light) {
    std::vector<double> greys;
    std::size_t lit = 0;
    for (std::size_t i = 0; i < LightStep::kMaxFrames; ++i) {
      const v1::Frame frame = next_frame();
      // The first of them may rest under the light before.
      if (same(frame.light(), light)) ++lit;
      if (lit <= 2 * LightStep::kRest) continue;
      if (frame.contact().in_contact()) {
        throw failure("there is contact: lift the object and measure again");
      }
      greys.push_back(mean_grey(frame.luma()));
      before_ = greys.back();
      sequence_ = frame.sequence();
      if (greys.size() < LightStep::kRest) continue;
      const auto [least, most] = std::minmax_element(
          greys.end() - static_cast<std::ptrdiff_t>(LightStep::kRest), greys.end());
      if (*most - *least < 1) return;
    }
    throw restless();
  }

  static cli::Failure restless() {
    return failure(
        "the picture does not come to rest: free the sensor's surface; if it is free, the camera's "
        "exposure or gain runs automatically (dtactctl status shows its controls)");
  }

  std::uint32_t step(const v1::LightState& from, const v1::LightState& to) {
    for (int i = 0; i < kTries; ++i) {
      if (const auto frames = try_step(from, to)) return *frames;
      (void)client_.set_light(change_to(from));
      rest(from);
    }
    throw failure(
        "frames are missing between the camera and here: measure on the daemon's own machine, "
        "while "
        "it has little else to do");
  }

  std::optional<std::uint32_t> try_step(const v1::LightState& from, const v1::LightState& to) {
    phase_ = std::fmod(phase_ + kGolden, 1.0);
    std::this_thread::sleep_for(std::chrono::duration<double>(phase_ * period_s_));
    LightStep seen(before_, sequence_);
    (void)client_.set_light(change_to(to));
    for (;;) {
      const v1::Frame frame = next_frame();
      const bool lit = same(frame.light(), to);
      if (!lit && !same(frame.light(), from)) {
        throw failure("another client changes the light: measure again when none does");
      }
      before_ = mean_grey(frame.luma());
      sequence_ = frame.sequence();
      switch (seen.add(sequence_, lit, before_)) {
        case LightStep::Verdict::going_on:
          break;
        case LightStep::Verdict::settled:
          before_ = seen.grey();
          return static_cast<std::uint32_t>(seen.frames());
        case LightStep::Verdict::gap:
          return std::nullopt;
        case LightStep::Verdict::restless:
          throw restless();
        case LightStep::Verdict::unseen:
          throw failure(fmt::format(
              "the picture stays as it is when the brightness goes from {} to {}: is this the "
              "camera that looks at the ring, is the ring lit, and does its light reach the "
              "picture? (dtactctl status names both)",
              from.brightness(), to.brightness()));
      }
    }
  }

  client::Client& client_;
  double period_s_;
  v1::LightState bright_;
  v1::LightState dark_;
  double phase_ = 0;            // of a frame's time, where the next step is taken
  double before_ = 0;           // mean grey of the newest frame
  std::uint64_t sequence_ = 0;  // and its number
};

/// Whatever has happened to the connection.
void restore(const cli::Context& context, client::Client& client, const v1::LightState& light) {
  const v1::SetLight change = change_to(light);
  try {
    (void)client.set_light(change);
  } catch (const client::ConnectionError&) {
    (void)client::Client(context.target).set_light(change);
  }
}

std::string line_of(const char* name, std::vector<std::uint32_t> frames) {
  std::ranges::sort(frames);
  return fmt::format("{:<9} median {}, worst {} frames of {} steps\n", name,
                     frames[frames.size() / 2], frames.back(), frames.size());
}

}  // namespace

void measure_light_delay(const cli::Context& context) {
  const cli::Interruptible while_measuring;
  client::Client client(context.target);
  const v1::Status status = client.status();
  if (status.ring().backend() == "null") {
    throw failure(
        "the ring's backend is \"null\", which lights nothing: set ring.backend to the ring's");
  }
  std::vector<std::uint32_t> darker;
  std::vector<std::uint32_t> brighter;
  try {
    Measurement(client, status).run(darker, brighter);
  } catch (...) {
    restore(context, client, status.light());
    throw;
  }
  restore(context, client, status.light());
  cli::LightDelayReport report;
  report.mutable_darker()->Add(darker.begin(), darker.end());
  report.mutable_brighter()->Add(brighter.begin(), brighter.end());
  report.set_light_delay_frames(std::max(std::ranges::max(darker), std::ranges::max(brighter)));
  if (context.json) {
    context.out << cli::json_line(report);
    return;
  }
  context.out << line_of("darker", darker) << line_of("brighter", brighter)
              << fmt::format("For the configuration:\n[camera]\nlight_delay_frames = {}\n",
                             report.light_delay_frames());
}

}  // namespace dtact::ctl
