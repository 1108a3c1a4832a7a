#include "clients/calibrate/force/force_pairs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "clients/calibrate/offline/images.hpp"
#include "clients/recording/channels.hpp"
#include "clients/recording/read_recording.hpp"
#include "daemon/recon/decimate.hpp"
#include "daemon/recon/kernels.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/scattering.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::force {
namespace {

namespace fs = std::filesystem;

/// Pixels darker than the list reaches that noise may leave, as the daemon allows them.
constexpr int kBeyondPixels = 64;
constexpr std::string_view kRecording = ".mcap";

bool number(std::string_view text, auto& value) {
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), value);
  return parsed.ec == std::errc() && parsed.ptr == text.data() + text.size();
}

std::string_view trimmed(std::string_view text) {
  const auto from = text.find_first_not_of(" \t\r");
  if (from == std::string_view::npos) return {};
  return text.substr(from, text.find_last_not_of(" \t\r") - from + 1);
}

bool same_sharpening(const recon::Model& a, const recon::Model& b) {
  return a.scattering == b.scattering &&
         std::ranges::equal(a.sharpened, b.sharpened, [](const auto& one, const auto& other) {
           return one.steps == other.steps && one.list.first_q6 == other.list.first_q6 &&
                  one.list.um == other.list.um;
         });
}

// Depth by both calibrations is the same; what either says of force does not matter.
bool same_depth(const recon::Model& a, const recon::Model& b) {
  return a.method == b.method && a.mm_per_px == b.mm_per_px && a.smoothing_px == b.smoothing_px &&
         a.list.first_q6 == b.list.first_q6 && a.list.um == b.list.um &&
         a.rectify.width == b.rectify.width && a.rectify.height == b.rectify.height &&
         a.reference_q8 == b.reference_q8 && a.gain.polynomial == b.gain.polynomial &&
         same_sharpening(a, b);
}

void require_same_calibration(const mcap::Reader& file, const std::string& path,
                              const calibration::Calibration& calibration) {
  const auto toml = recording::find_attachment(file, recording::kCalibrationToml);
  const auto png = recording::find_attachment(file, recording::kReferencePng);
  if (toml && png) {
    const auto recorded =
        calibration::parse(file.attachment(*toml).data, file.attachment(*png).data, path);
    if (same_depth(*recorded.model, *calibration.model)) return;
  }
  throw std::runtime_error(fmt::format(
      "{} was not measured with the calibration {}: dtact-calibrate reprocess {} --calibration {} "
      "-o anew.mcap makes its depth anew",
      path, calibration.name, path, calibration.name));
}

[[noreturn]] void fail_beyond(const std::string& name) {
  throw std::runtime_error(fmt::format(
      "{}: pressed deeper than the calibration covers, so that its volume is not known: "
      "take the pair out",
      name));
}

}  // namespace

Reading parse_reading(const std::string& text) {
  Reading reading;
  const auto at = text.rfind('@');
  if (at == std::string::npos || at == 0 ||
      !number(std::string_view(text).substr(at + 1), reading.value)) {
    throw std::runtime_error("--pair " + text +
                             ": must be FRAMES@NEWTONS, as in press.png@0.52 or press.mcap@0.52");
  }
  reading.frames = text.substr(0, at);
  return reading;
}

std::vector<Reading> read_readings(const fs::path& csv) {
  std::istringstream lines(base::read_file(csv));
  std::vector<Reading> readings;
  std::string line;
  bool headed = false;
  for (int at = 1; std::getline(lines, line); ++at) {
    const std::string_view text = trimmed(line);
    if (text.empty() || text.front() == '#') continue;
    if (!std::exchange(headed, true)) {
      if (text == "frames,force") continue;
      throw std::runtime_error(
          fmt::format("{}:{}: the first line must be frames,force", csv.string(), at));
    }
    Reading reading;
    const auto comma = text.rfind(',');
    if (comma == std::string_view::npos || comma == 0 ||
        !number(trimmed(text.substr(comma + 1)), reading.value)) {
      throw std::runtime_error(fmt::format(
          "{}:{}: must be frames, a comma and a number, as in press.png,0.52", csv.string(), at));
    }
    reading.frames = (csv.parent_path() / trimmed(text.substr(0, comma))).string();
    readings.push_back(std::move(reading));
  }
  return readings;
}

ContactReader::ContactReader(const calibration::Calibration& calibration,
                             std::span<const std::uint16_t> reference_q8, double threshold_mm,
                             int sharpen_steps)
    : calibration_(calibration),
      model_(calibration.model),
      reference_q8_(reference_q8),
      threshold_mm_(threshold_mm),
      sharpen_steps_(sharpen_steps) {
  if (sharpen_steps == 0) return;
  const std::vector<int> all = recon::sharpening_steps(*model_);
  if (std::ranges::find(all, sharpen_steps) == all.end()) {
    throw std::runtime_error(
        fmt::format("--sharpen {}: the calibration has no list for levels sharpened so often: "
                    "calibrate with --method model, or leave --sharpen out",
                    sharpen_steps));
  }
  model_ = std::make_shared<const recon::Model>(recon::decimate(*model_, recon::kSharpenedAt));
}

Pair ContactReader::measure(const std::string& frames) const {
  const auto found = frames.rfind(kRecording);
  if (found == std::string::npos) {
    return measure(ctl::load_images({frames}, "--pair").frames(), frames);
  }
  const std::size_t after = found + kRecording.size();
  std::uint64_t first = 0;
  std::uint64_t end = UINT64_MAX;
  if (after != frames.size()) {
    const std::string_view range = std::string_view(frames).substr(after + 1);
    const auto colon = range.find(':');
    const bool single = colon == std::string_view::npos;
    const bool parsed = frames[after] == ':' && number(range.substr(0, colon), first) &&
                        (single || number(range.substr(colon + 1), end));
    if (single) end = first + 1;
    if (!parsed || end <= first) {
      throw std::runtime_error(frames +
                               ": frames of a recording are press.mcap, press.mcap:120 or, "
                               "without the end, press.mcap:120:180");
    }
  }
  Pair pair = measure_recording(frames.substr(0, after), first, end);
  pair.name = frames;
  return pair;
}

Pair ContactReader::measure(std::span<const image::Grey8> frames, const std::string& name) const {
  const recon::Model& model = *model_;
  const int decimation = model.rectify.decimation;
  recon::Reconstructor reconstructor(model_, sharpen_steps_);
  reconstructor.set_reference(reference_q8_);
  recon::SumRules rules;
  rules.made_um = rules.lost_um = static_cast<std::int16_t>(std::lround(threshold_mm_ * 1000));
  recon::DepthSums sums(rules);
  std::vector<std::int16_t> depth(model.rectify.entries.size());
  std::vector<std::uint8_t> padded(model.reference_q8.size() + recon::kLumaPadding);
  for (const image::Grey8& frame : frames) {
    if (frame.width != model.rectify.frame_width || frame.height != model.rectify.frame_height) {
      throw std::runtime_error(fmt::format("{} is {}x{} but the calibration is for {}x{}", name,
                                           frame.width, frame.height, model.rectify.frame_width,
                                           model.rectify.frame_height));
    }
    std::ranges::copy(frame.pixels, padded.begin());
    reconstructor.run(padded.data(), frame.width, depth);
    if (reconstructor.beyond_pixels() * decimation * decimation > kBeyondPixels) {
      fail_beyond(name);
    }
    for (int y = 0; y < model.rectify.height; ++y) {
      recon::kernels::sum_row(depth.data() + std::ptrdiff_t{y} * model.rectify.width, y, 0,
                              model.rectify.width, sums);
    }
  }
  const double px_mm2 = model.mm_per_px * model.mm_per_px / static_cast<double>(frames.size());
  return {name, static_cast<double>(sums.um) / 1000 * px_mm2,
          static_cast<double>(sums.made) * px_mm2, 0};
}

Pair ContactReader::measure_recording(const std::string& path, std::uint64_t first,
                                      std::uint64_t end) const {
  const mcap::Reader file(path);
  require_same_calibration(file, path, calibration_);
  Pair pair;
  std::uint64_t at = 0;
  int touching = 0;
  recording::Takers takers;
  takers.frame = [&](const v1::Frame& frame, std::uint64_t) {
    if (const std::uint64_t index = at++; index < first) return true;
    if (!frame.contact().touching()) return at < end;
    const auto steps = static_cast<int>(frame.depth().sharpen_steps());
    if (frame.has_depth() && steps != sharpen_steps_) {
      throw std::runtime_error(fmt::format(
          "{}:{}: its depth was made with {} steps of sharpening, not {}: set the daemon's "
          "reconstruction.sharpen to \"off\", \"1\" or \"2\" as it will measure, record again, "
          "and give --sharpen as many",
          path, at - 1, steps, sharpen_steps_));
    }
    if (std::ranges::find(frame.health(), v1::HEALTH_BEYOND_CALIBRATION) != frame.health().end()) {
      fail_beyond(fmt::format("{}:{}", path, at - 1));
    }
    ++touching;
    pair.volume_mm3 += frame.contact().volume_mm3();
    pair.area_mm2 += frame.contact().area_mm2();
    return at < end;
  };
  recording::read_recording(file, takers);
  pair.volume_mm3 /= std::max(touching, 1);
  pair.area_mm2 /= std::max(touching, 1);
  return pair;
}

}  // namespace dtact::force
