#include "clients/calibrate/objects/teaching.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include "clients/common/depth_message.hpp"
#include "clients/cpp/client.hpp"
#include "clients/cpp/errors.hpp"
#include "clients/perceive/recognition/taught_objects.hpp"
#include "hal/files/png.hpp"

namespace dtact::objects {
namespace {

using ctl::guided::Answer;
using ctl::guided::Console;
using ctl::guided::Scene;
using ctl::guided::Typed;
using perceive::TaughtObject;
using perceive::TouchMap;

const Answer kBack{"b", "take the last press back"};
const Answer kQuit{"q", "end without storing anything"};

/// Follows one press after the other.
class PressTaker {
 public:
  /// The press that this frame completes; mostly nothing.
  [[nodiscard]] std::optional<TouchMap> add(const v1::Frame& frame) {
    measured_ = frame.has_contact();
    if (measured_ && !frame.contact().in_contact()) {
      taken_ = false;
      still_ = 0;
      deepest_mm_ = 0;
    }
    if (taken_ || !frame.contact().in_contact() || !frame.has_depth()) return std::nullopt;
    // The daemon may change its resolution at any frame: the press goes on with finer maps.
    coarse_ = frame.depth().mm_per_px() > TouchMap::kCellMm;
    if (coarse_) return std::nullopt;
    TouchMap map = touch_map_of(frame.depth());
    constexpr double kStillMm = 0.02;
    still_ = std::abs(map.deepest_mm - deepest_mm_) < kStillMm ? still_ + 1 : 0;
    deepest_mm_ = map.deepest_mm;
    fault_ = fault_of(map);
    constexpr int kStillFrames = 5;  // half a second
    if (still_ < kStillFrames || !fault_.empty()) return std::nullopt;
    taken_ = true;
    return map;
  }

  /// What the user has to do now.
  [[nodiscard]] std::string wanted(bool first) const {
    if (!measured_) return "Wait: the daemon measures no contact at present";
    if (coarse_)
      return "Wait: the depth maps are too coarse: dtactctl reconstruction --resolution full";
    if (taken_) return "Lift it";
    if (deepest_mm_ > 0) return fault_.empty() ? "Hold it still" : fault_;
    return first ? "Press the object in" : "Press again: turned, or with another side";
  }

 private:
  bool measured_ = true;
  bool coarse_ = false;
  bool taken_ = false;
  int still_ = 0;
  double deepest_mm_ = 0;  ///< 0: no contact.
  std::string fault_;
};

image::Grey8 picture_of(const v1::DepthMap& depth) {
  const std::vector<std::int16_t> values = cli::depths_of(depth);
  image::Grey8 picture{static_cast<int>(depth.width()), static_cast<int>(depth.height()), {}};
  picture.pixels.reserve(values.size());
  for (const std::int16_t value : values) {
    const double mm = value == depth.untrusted_value() ? 0 : 1e-3 * value * depth.um_per_unit();
    constexpr double kWhiteMm = 1.5;
    picture.pixels.push_back(
        static_cast<std::uint8_t>(std::lround(255 * std::clamp(mm / kWhiteMm, 0.0, 1.0))));
  }
  return picture;
}

std::vector<TouchMap> take_presses(const Lesson& lesson, const client::Options& target,
                                   Console& console) {
  client::Options options = target;
  options.reconnect.emplace();  // the presses so far outlive a restart of the daemon
  client::Client client(options);
  const v1::Status status = client.status();
  if (!status.has_calibration()) {
    throw std::runtime_error(
        "the daemon has no calibration, and so no depth: dtact-calibrate guided makes one");
  }
  // Fine enough for touch_map(), and no finer.
  unsigned decimation = 4;
  while (decimation > 1 && decimation * status.calibration().mm_per_px() > TouchMap::kCellMm) {
    decimation /= 2;
  }
  v1::Subscribe wanted;
  wanted.set_depth(v1::DEPTH_PREDICT_ZSTD);
  wanted.set_depth_hz(10);
  wanted.set_decimation(decimation);
  wanted.set_events(false);
  client.subscribe(wanted);
  console.say(
      fmt::format("Press {} into the gel {} times, each time turned or with another side that you "
                  "want known. Hold it until the press is taken, then lift it.",
                  lesson.name, lesson.presses));
  std::vector<TouchMap> presses;
  Scene scene;
  scene.presses_required = lesson.presses;
  PressTaker taker;
  int silent = 0;  // waits without a frame, one after the other
  while (static_cast<int>(presses.size()) < lesson.presses) {
    const Typed typed = console.typed();
    if (typed.kind == Typed::Kind::interrupted || typed.line == kQuit.key) {
      throw std::runtime_error("ended before all presses were taken; nothing is stored");
    }
    if (typed.line == kBack.key && !presses.empty()) {
      presses.pop_back();
      scene.presses.pop_back();
    }
    const auto item = client.next(std::chrono::milliseconds(200));
    const auto* frame = item ? std::get_if<v1::Frame>(&*item) : nullptr;
    if (frame == nullptr) {
      constexpr int kSilent = 10;
      if (++silent == kSilent) {
        console.say("no frames come from the daemon: the presses so far are kept until they do");
      }
      continue;
    }
    silent = 0;
    if (const auto press = taker.add(*frame)) {
      presses.push_back(*press);
      scene.presses.push_back(
          {.name = fmt::format("press {}", presses.size()), .depth_mm = press->deepest_mm});
      console.say(fmt::format("press {} of {} taken, {:.2f} mm deep", presses.size(),
                              lesson.presses, press->deepest_mm));
    }
    if (scene.prompt.text != taker.wanted(presses.empty())) {
      scene.prompt.text = taker.wanted(presses.empty());
      if (!console.interactive()) console.say(scene.prompt.text);
    }
    if (!console.interactive()) continue;
    std::optional<image::Grey8> picture;
    if (frame->has_depth()) {
      picture = picture_of(frame->depth());
      scene.mm_per_px = frame->depth().mm_per_px();
    }
    scene.picture = picture ? &*picture : nullptr;
    scene.words = fmt::format("{:.2f} mm deep", frame->contact().deepest_mm());
    scene.prompt.answers = {kBack, kQuit};
    if (presses.empty()) scene.prompt.answers = {kQuit};
    console.live(scene);
  }
  return presses;
}

/// Each press against the others: what it would be taken for without itself, by the recogniser's
/// rule: the object of which it is nearest as a share of the radius, and no object beyond it.
std::string left_out(const TaughtObject& object, const std::vector<TaughtObject>& others) {
  std::map<std::string, int> like;
  int alone = 0;
  for (std::size_t i = 0; i < object.features.size(); ++i) {
    const double own = perceive::nearest(object, object.features[i], i) / object.radius;
    const TaughtObject* best = nullptr;
    double least = own;
    for (const TaughtObject& other : others) {
      const double there = perceive::nearest(other, object.features[i]) / other.radius;
      if (there > 1 || there >= least) continue;
      least = there;
      best = &other;
    }
    if (best != nullptr) {
      ++like[best->name];
    } else if (own > 1) {
      ++alone;
    }
  }
  const std::size_t count = object.features.size();
  std::string text;
  for (const auto& [name, presses] : like) {
    text += fmt::format(
        "{} of {} look like {}: teach again and press where they differ, too; what differs by "
        "less than the gel's blur cannot be distinguished\n",
        presses, count, name);
  }
  if (alone > 0) {
    text +=
        fmt::format("{} of {} are like no other press: press that side more often\n", alone, count);
  }
  return text.empty() ? fmt::format("all {} look like {}\n", count, object.name) : text;
}

}  // namespace

TouchMap touch_map_of(const v1::DepthMap& depth) {
  const std::vector<std::int16_t> values = cli::depths_of(depth);
  const perceive::DepthGrid grid = cli::grid_of(depth, values);
  if (grid.mm_per_px > TouchMap::kCellMm) {
    throw client::ProtocolError(
        fmt::format("{} mm a pixel of the depth map: objects are recognised with at most {} mm; "
                    "choose a finer resolution, and check the calibration's scale",
                    grid.mm_per_px, TouchMap::kCellMm));
  }
  return perceive::touch_map(grid);
}

std::string fault_of(const TouchMap& press) {
  if (press.deepest_mm < TouchMap::kMinDeepestMm) {
    return fmt::format("Press deeper: at least {} mm", TouchMap::kMinDeepestMm);
  }
  return press.cut > TouchMap::kMaxCut ? "Press nearer to the middle: most of it is outside the map"
                                       : "";
}

void teach(const Lesson& lesson, const client::Options& target, Console& console) {
  perceive::prepare_to_write(lesson.folder, lesson.name);
  perceive::Network network;
  auto [others, damaged] = perceive::load_taught(network, lesson.folder);
  for (const std::string& sentence : damaged) console.say("warning: " + sentence);
  std::erase_if(others, [&](const TaughtObject& one) { return one.name == lesson.name; });
  const std::vector<TouchMap> presses = take_presses(lesson, target, console);
  perceive::write_presses(lesson.folder, lesson.name, presses);
  console.say(fmt::format(
      "stored; dtact-perceive names it from the next contact on if it was started with: serve "
      "--taught {}",
      std::filesystem::absolute(lesson.folder).lexically_normal().string()));
  console.say(left_out(perceive::teach(network, lesson.name, presses), others));
}

}  // namespace dtact::objects
