#include "clients/calibrate/guided/capture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "clients/calibrate/guided/sensor_checks.hpp"
#include "clients/cpp/maps.hpp"
#include "clients/cpp/names.hpp"

namespace dtact::ctl::guided {
namespace {

constexpr std::chrono::milliseconds kFrameWait{100};
/// Frames that must agree before the first is used. A press that moves down slower than 0.2 mm a
/// second passes as still; the drift of the captured frames reveals it.
constexpr int kSettleFrames = 10;
/// Change of a cell that counts as still, grey levels (about 0.05 mm). The largest noise that the
/// daemon tolerates, 2.5 a pixel, moves the worst of all cells by 1.
constexpr double kStill = 1.5;
/// Grey levels between the means of the first and the last half.
constexpr double kDrift = 0.5;
/// A press that differs less from the one before in every cell is the same.
constexpr double kSamePress = 2.0;
constexpr int kBrighterFrames = 5;
/// Time without a usable frame before the user gets a message.
constexpr std::chrono::seconds kMaxUnusable{2};

/// Measures a wait by the frames' times, or without frames by the number of waits. Frames that
/// cannot be used count by their times too: each ends next() at once.
class WaitTime {
 public:
  /// `frame_ns`: time of the frame that came; empty: none in kFrameWait.
  void add(const std::optional<std::int64_t>& frame_ns) {
    if (!frame_ns) {
      without_ += kFrameWait;
      return;
    }
    if (!first_ns_) first_ns_ = frame_ns;
    with_ = std::chrono::nanoseconds(*frame_ns - *first_ns_);
  }
  void restart() {
    with_ = without_ = std::chrono::nanoseconds(0);
    first_ns_.reset();
  }
  [[nodiscard]] std::chrono::nanoseconds length() const { return std::max(with_, without_); }

 private:
  std::chrono::nanoseconds with_{0};
  std::chrono::nanoseconds without_{0};
  std::optional<std::int64_t> first_ns_;
};

CellMeans mean_of(const std::vector<CellMeans>& all, std::size_t first, std::size_t last) {
  CellMeans mean(all[first].size());
  for (std::size_t i = first; i < last; ++i) {
    for (std::size_t c = 0; c < mean.size(); ++c) mean[c] += all[i][c];
  }
  for (float& value : mean) value /= static_cast<float>(last - first);
  return mean;
}

/// Noise from the differences of neighbouring frames, at every 61st pixel.
double noise_of(const std::vector<image::Grey8>& frames) {
  double sum = 0;
  double count = 0;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    for (std::size_t p = 0; p < frames[i].pixels.size(); p += 61) {
      const double change = frames[i].pixels[p] - frames[i - 1].pixels[p];
      sum += change * change;
      count += 1;
    }
  }
  return count > 0 ? std::sqrt(sum / count / 2) : 0;
}

}  // namespace

Capture::Capture(Sensor& sensor, Console& console, const CellGrid& grid, const Rules& rules,
                 std::function<void(const ObservedFrame&, const std::string&)> shown)
    : sensor_(sensor), console_(console), grid_(grid), rules_(rules), shown_(std::move(shown)) {}

const ObservedFrame* Capture::next() {
  if (console_.interrupted()) throw Ended{Ended::Why::interrupt};
  auto frame = sensor_.next(kFrameWait);
  read_ns_.reset();
  if (frame) read_ns_ = frame->monotonic_ns();
  if (!frame || !frame->has_luma() || passing_trouble(frame->health())) return nullptr;
  if (!leds_.empty() && leds_of(frame->light()) != leds_) {
    throw std::runtime_error(
        "the light is another than when the reference was taken: set it back with dtactctl led, or "
        "begin again in another --folder");
  }
  observed_.image = {static_cast<int>(frame->luma().width()),
                     static_cast<int>(frame->luma().height()), client::pixels_of(frame->luma())};
  observed_.time_ns = frame->monotonic_ns();
  observed_.cells = grid_.of(observed_.image.pixels, observed_.image.width);
  return &observed_;
}

std::string Capture::trouble() {
  const v1::Status status = sensor_.status();
  return fmt::format("no usable frame came; the daemon's state is {}. {}",
                     client::name_of(status.state()), status.advice());
}

bool Capture::enter_typed() {
  if (!console_.interactive()) return false;
  const Typed typed = console_.typed();
  if (typed.kind == Typed::Kind::interrupted) throw Ended{Ended::Why::interrupt};
  if (typed.kind == Typed::Kind::end) throw Ended{Ended::Why::input};
  if (typed.line == "q") throw Ended{Ended::Why::quit};
  if (typed.kind != Typed::Kind::line) return false;
  if (!typed.line.empty()) console_.say("\"" + typed.line + "\" means nothing here");
  return typed.line.empty();
}

SteadyFrames Capture::hold(int count, bool forcible, const Objection& objection) {
  Steadiness steadiness(kStill);
  const std::chrono::duration<double> timeout(rules_.timeout_s);
  WaitTime waited;
  WaitTime unusable;  // since the last usable frame
  SteadyFrames still;
  std::vector<CellMeans> cells;
  std::string why;
  bool force = false;
  bool reported = false;
  const auto restart = [&](std::string reason) {
    why = std::move(reason);
    still.frames.clear();
    cells.clear();
  };
  for (;;) {
    const ObservedFrame* look = next();
    waited.add(read_ns_);
    if (waited.length() > timeout) {
      throw CaptureTimeout(fmt::format("not taken within {:g} s: {}", rules_.timeout_s,
                                       look == nullptr ? trouble() : why));
    }
    force = (enter_typed() && forcible) || force;
    if (look == nullptr) {
      unusable.add(read_ns_);
      if (unusable.length() >= kMaxUnusable && !reported) {
        console_.say(trouble());
        reported = true;
      }
      restart("");
      steadiness.restart();
      continue;
    }
    unusable.restart();
    unusable.add(read_ns_);
    reported = false;
    std::string against = objection(*look);
    if (!against.empty()) {
      shown_(*look, against);
      restart(std::move(against));
      steadiness.restart();
      force = false;  // Enter was meant for what was seen before
      continue;
    }
    const int row = steadiness.add(look->cells);
    if (row <= kSettleFrames && !force) {
      restart(fmt::format("the picture does not hold still (a place moves by {:.1f} grey levels)",
                          steadiness.broke_at()));
      shown_(*look, "not still");
      continue;
    }
    still.frames.push_back(look->image);
    cells.push_back(look->cells);
    shown_(*look, fmt::format("still, {} of {} frames", still.frames.size(), count));
    if (still.frames.size() < static_cast<std::size_t>(count)) continue;
    const std::size_t half = cells.size() / 2;
    still.drift_levels =
        half == 0 ? 0 : largest_change(mean_of(cells, 0, half), mean_of(cells, half, cells.size()));
    if (still.drift_levels > kDrift && !force) {
      restart(fmt::format("the picture still creeps (a place by {:.1f} grey levels)",
                          still.drift_levels));
      steadiness.restart();
      continue;
    }
    still.cells = mean_of(cells, 0, cells.size());
    still.noise_levels = noise_of(still.frames);
    return still;
  }
}

SteadyFrames Capture::reference(int count) {
  return hold(count, false, [](const ObservedFrame&) { return std::string(); });
}

SteadyFrames Capture::press(int count, const CellMeans& reference, const CellMeans& last) {
  int brighter = 0;
  return hold(count, true, [&](const ObservedFrame& look) -> std::string {
    const ContactEvidence seen = compare(reference, look.cells);
    brighter = reference_in_contact(seen) ? brighter + 1 : 0;
    if (brighter == kBrighterFrames) throw ReferenceInContact{};
    if (brighter > 0) return "brighter than the reference somewhere";
    if (seen.darkest < kContactLevels) return "there is no contact";
    if (!last.empty() && largest_change(last, look.cells) < kSamePress) {
      return "this press is taken already, press elsewhere";
    }
    return {};
  });
}

}  // namespace dtact::ctl::guided
