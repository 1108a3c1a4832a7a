#include "tests/accuracy/atlas/run.hpp"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "daemon/pipeline/capture_loop.hpp"
#include "hal/null/null.hpp"
#include "proto/dtact.pb.h"
#include "tests/accuracy/table/configuration.hpp"
#include "tests/accuracy/table/judge.hpp"
#include "tests/fakes/fake_clock.hpp"

namespace dtact::atlas {
namespace {

std::uint64_t true_moment(const Script& script, int n) {
  return script.moment ? script.moment(n) : script.shot(n).moment;
}

/// Adds up the loop's results of the judged frames.
class Judge {
 public:
  explicit Judge(const Script& script) : script_(script) {}

  void take(int n, const pipeline::DepthFrame* frame, std::uint32_t health) {
    if (n < script_.frames - script_.judged) return;
    ++outcome_.frames;
    for (std::size_t i = 0; i < outcome_.health_flags.size(); ++i) {
      outcome_.health_flags[i] += static_cast<int>(health >> i & 1U);
    }
    flagged_ += health != 0 ? 1 : 0;
    if (frame == nullptr || !frame->has_depth) {
      ++withheld_;
      return;
    }
    ++depths_;
    stated_um_ += frame->uncertainty_um;
    look_up(true_moment(script_, n));
    const Errors errors = compare(frame->depth_um, truth_);
    if (errors.inside.untrusted > 0) {
      withheld_ += static_cast<double>(errors.inside.untrusted) /
                   static_cast<double>(errors.inside.untrusted + errors.inside.pixels);
    }
    placed_ += errors;
    if (const Shot shot = script_.shot(n); moved(shot)) {
      along_ += compare(frame->depth_um, moved_along(truth_, shot));
    }
  }

  [[nodiscard]] Outcome outcome() {
    const double frames = std::max(1, outcome_.frames);
    outcome_.inside_mm = placed_.inside.mean_mm();
    outcome_.outside_mm = placed_.outside.mean_mm();
    outcome_.along_mm = std::max(along_.inside.mean_mm(), along_.outside.mean_mm());
    outcome_.withheld = withheld_ / frames;
    outcome_.flagged = flagged_ / frames;
    outcome_.stated_mm = 0.001 * stated_um_ / std::max(1, depths_);
    return outcome_;
  }

 private:
  struct Errors {
    table::Error inside;
    table::Error outside;
    Errors& operator+=(const Errors& other) {
      inside += other.inside;
      outside += other.outside;
      return *this;
    }
  };

  static Errors compare(const std::vector<std::int16_t>& depth_um, const table::TruePress& truth) {
    Errors errors;
    for (std::size_t i = 0; i < depth_um.size(); ++i) {
      table::Error& error = truth.contact[i] != 0 ? errors.inside : errors.outside;
      if (depth_um[i] == recon::kUntrusted) {
        ++error.untrusted;
      } else {
        error.add(0.001 * depth_um[i] - static_cast<double>(truth.indentation_mm[i]));
      }
    }
    return errors;
  }

  /// Rounded to the nearest pixel; beyond the crop its edge is repeated, outside the contact.
  static table::TruePress moved_along(const table::TruePress& truth, const Shot& shot) {
    table::TruePress moved;
    for (int y = 0; y < table::kCrop; ++y) {
      for (int x = 0; x < table::kCrop; ++x) {
        const Place from = unmoved(shot, x + table::kCropCol, y + table::kCropRow,
                                   table::kFrameWidth, table::kFrameHeight);
        const auto within = [](double at, int first) {
          return std::clamp<std::int64_t>(std::lround(at) - first, 0, table::kCrop - 1);
        };
        const auto i = static_cast<std::size_t>(within(from.y, table::kCropRow) * table::kCrop +
                                                within(from.x, table::kCropCol));
        moved.indentation_mm.push_back(truth.indentation_mm[i]);
        moved.contact.push_back(truth.contact[i]);
      }
    }
    return moved;
  }

  void look_up(std::uint64_t moment) {
    if (std::exchange(moment_, moment) == moment) return;
    truth_ = table::true_press(*script_.truth, moment);
  }

  const Script& script_;
  Outcome outcome_;
  Errors placed_;
  Errors along_;
  table::TruePress truth_;
  std::optional<std::uint64_t> moment_;
  double withheld_ = 0;
  double flagged_ = 0;
  double stated_um_ = 0;
  int depths_ = 0;
};

/// Between two frames it passes the previous one to the judge; its clock is the loop's.
class ScriptedCamera final : public hal::Camera, private hal::FrameOwner {
 public:
  ScriptedCamera(const Script& script, fakes::FakeClock& clock)
      : script_(script), clock_(clock), spoiler_(script.truth, 5), judge_(script) {}

  void attach(pipeline::Exchange& exchange) { exchange_ = &exchange; }
  void attach(const pipeline::ReferenceTracker& tracker) { tracker_ = &tracker; }
  [[nodiscard]] Outcome outcome() { return judge_.outcome(); }

  [[nodiscard]] hal::CameraInfo info() const override {
    hal::CameraInfo info;
    info.backend = "sim";
    info.identity = "sim:atlas";
    info.width = script_.truth->scene().camera.width;
    info.height = script_.truth->scene().camera.height;
    info.fps = script_.fps;
    return info;
  }
  [[nodiscard]] hal::CameraReport report() const override { return {}; }
  void start() override {}

  [[nodiscard]] hal::GrabStatus grab(hal::Frame& out,
                                     std::chrono::nanoseconds /*timeout*/) noexcept override {
    tracker_->settle();  // otherwise its result may come a frame sooner or later
    harvest();
    const int n = next_++;
    if (n >= script_.frames) {
      exchange_->stop = true;
      return hal::GrabStatus::timeout;
    }
    const auto due_ns = static_cast<std::int64_t>((n + 1) * 1e9 / script_.fps);
    clock_.now = std::max(clock_.now.load() + 1, due_ns);
    const Shot shot = script_.shot(n);
    const hal::LumaView view = spoiler_.make(shot, static_cast<std::uint64_t>(n));
    if (shot.damaged) return hal::GrabStatus::damaged;
    hal::FrameInfo info;
    info.sequence = static_cast<std::uint64_t>(n);
    info.timestamp_ns = clock_.now;
    info.ready_ns = clock_.now;
    info.meaning = hal::TimestampMeaning::end_of_frame;
    out = hal::Frame(*this, 0, view, info);
    return hal::GrabStatus::ok;
  }

 private:
  void give_back(int /*index*/) noexcept override {}

  void harvest() {
    if (next_ > 0) {
      const pipeline::DepthFrame* const frame = exchange_->slot.fetch();
      judge_.take(next_ - 1, frame,
                  frame != nullptr ? frame->health.bits() : exchange_->health.load());
    }
    pipeline::Event event;
    while (exchange_->events.pop(event)) {
    }
    if (script_.rezero == next_) {
      (void)exchange_->commands.push(pipeline::Command{pipeline::Rezero{script_.force}});
    }
  }

  const Script& script_;
  fakes::FakeClock& clock_;
  Spoiler spoiler_;
  Judge judge_;
  pipeline::Exchange* exchange_ = nullptr;
  const pipeline::ReferenceTracker* tracker_ = nullptr;
  int next_ = 0;
};

}  // namespace

double Outcome::error_mm() const noexcept {
  if (std::isnan(inside_mm)) return outside_mm;
  if (std::isnan(outside_mm)) return inside_mm;
  return std::max(inside_mm, outside_mm);
}

Outcome run(const Method& method, const Script& script) {
  fakes::FakeClock clock;
  ScriptedCamera camera(script, clock);
  pipeline::DepthFrame prototype;
  const recon::RectifyTable& table = method.calibration->model->rectify;
  prototype.depth_um.resize(static_cast<std::size_t>(table.width) *
                            static_cast<std::size_t>(table.height));
  pipeline::Exchange exchange(prototype);
  exchange.wanted = pipeline::Wanted{.contact = true, .depth = true};
  camera.attach(exchange);
  pipeline::PipelineConfig config;
  config.reference.frames = 16;
  config.reconstruction.decimation = 1;
  config.reconstruction.sharpen = method.sharpen_steps;
  if (!script.follow) config.drift.limit_percent = 0;
  pipeline::LightDriver light(std::make_unique<hal::null::NullRing>(), config.light, clock,
                              exchange);
  pipeline::CaptureLoop loop(
      {camera, light, exchange, clock}, config,
      pipeline::activate(method.calibration, camera.info(), config.reconstruction), false);
  camera.attach(loop.tracker());
  loop.tracker().start();
  while (!exchange.stop) loop.step();
  return camera.outcome();
}

std::string health_flags_of(const Outcome& outcome) {
  std::string names;
  for (std::size_t i = 0; i < outcome.health_flags.size(); ++i) {
    if (outcome.health_flags[i] * 10 < outcome.frames || outcome.health_flags[i] == 0) continue;
    std::string name = v1::Health_Name(static_cast<v1::Health>(i + 1)).substr(7);
    std::ranges::transform(name, name.begin(),
                           [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    names += (names.empty() ? "" : ", ") + name;
  }
  return names;
}

}  // namespace dtact::atlas
