#include "clients/calibrate/force/force_pairs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "clients/calibrate/offline/images.hpp"
#include "clients/cpp/maps.hpp"
#include "clients/recording/channels.hpp"
#include "clients/recording/read_recording.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::force {
namespace {

namespace fs = std::filesystem;

/// Pixels beyond the LUT that noise may cause, as in the daemon.
constexpr int kBeyondPixels = 64;
constexpr std::string_view kRecording = ".mcap";

bool number(std::string_view text, auto& value) {
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), value);
  return parsed.ec == std::errc() && parsed.ptr == text.data() + text.size();
}

/// Position in `frames` where the path of a recording ends, before the range of its frames; npos
/// for images, also in a folder whose name ends like a recording's.
std::size_t end_of_recording(const std::string& frames) {
  const auto found = frames.rfind(kRecording);
  if (found == std::string::npos) return found;
  const std::size_t end = found + kRecording.size();
  const bool named = end == frames.size() || frames[end] == ':';
  return named && !fs::is_directory(frames) ? end : std::string::npos;
}

std::string_view trimmed(std::string_view text) {
  const auto from = text.find_first_not_of(" \t\r");
  if (from == std::string_view::npos) return {};
  return text.substr(from, text.find_last_not_of(" \t\r") - from + 1);
}

bool same_sharpening(const recon::Model& a, const recon::Model& b) {
  return a.scattering == b.scattering &&
         std::ranges::equal(a.sharpened, b.sharpened, [](const auto& one, const auto& other) {
           return one.steps == other.steps && one.lut.first_q6 == other.lut.first_q6 &&
                  one.lut.um == other.lut.um;
         });
}

// Whether depth is the same with both calibrations, whatever their force.
bool same_depth(const recon::Model& a, const recon::Model& b) {
  return a.method == b.method && a.mm_per_px == b.mm_per_px && a.smoothing_px == b.smoothing_px &&
         a.lut.first_q6 == b.lut.first_q6 && a.lut.um == b.lut.um &&
         a.rectify.width == b.rectify.width && a.rectify.height == b.rectify.height &&
         a.reference_q8 == b.reference_q8 && a.gain.polynomial == b.gain.polynomial &&
         same_sharpening(a, b);
}

void require_same_calibration(const mcap::Reader& file, const std::string& path,
                              const calibration::Calibration& calibration,
                              const std::string& folder) {
  const auto toml = recording::find_attachment(file, recording::kCalibrationToml);
  const auto png = recording::find_attachment(file, recording::kReferencePng);
  if (toml && png) {
    const auto recorded =
        calibration::parse(file.attachment(*toml).data, file.attachment(*png).data, path);
    if (same_depth(*recorded.model, *calibration.model)) return;
  }
  throw std::runtime_error(fmt::format(
      "{} was not measured with the calibration {}: dtact-calibrate reprocess {} --calibration {} "
      "-o {}-anew.mcap makes its depth anew",
      path, calibration.name, path, folder, path.substr(0, path.size() - kRecording.size())));
}

[[noreturn]] void fail_beyond(const std::string& name) {
  throw std::runtime_error(fmt::format(
      "{}: pressed deeper than the calibration covers, so that its volume is not known: "
      "take the pair out",
      name));
}

/// The mean of depth maps of one size, micrometres; untrusted where one of them is.
class MeanMap {
 public:
  void add(const std::vector<std::int16_t>& depth_um) {
    sums_.resize(std::max(sums_.size(), depth_um.size()));
    trusted_.resize(sums_.size());
    for (std::size_t i = 0; i < depth_um.size(); ++i) {
      sums_[i] += depth_um[i];
      trusted_[i] += depth_um[i] == recon::kUntrusted ? 0 : 1;
    }
    ++count_;
  }
  [[nodiscard]] recon::CellMap cells(int width, int height, double mm_per_px) const {
    std::vector<std::int16_t> mean(sums_.size());
    for (std::size_t i = 0; i < mean.size(); ++i) {
      mean[i] =
          trusted_[i] == count_ ? static_cast<std::int16_t>(sums_[i] / count_) : recon::kUntrusted;
    }
    recon::CellMap cells(width, height, mm_per_px);
    cells.read(mean);
    return cells;
  }

 private:
  std::vector<int> sums_;
  std::vector<int> trusted_;
  int count_ = 0;
};

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
  std::istringstream lines(base::read_text_file(csv));
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

Pair ContactReader::measure(const std::string& frames) const {
  const std::size_t after = end_of_recording(frames);
  if (after == std::string::npos) {
    return measure(ctl::load_images({frames}, "--pair").frames(), frames);
  }
  std::uint64_t first = 0;
  std::uint64_t end = UINT64_MAX;
  if (after != frames.size()) {
    const std::string_view range = std::string_view(frames).substr(after + 1);
    const auto colon = range.find(':');
    const bool single = colon == std::string_view::npos;
    const bool parsed =
        number(range.substr(0, colon), first) && (single || number(range.substr(colon + 1), end));
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
  const recon::Model& model = *calibration_.model;
  recon::Reconstructor reconstructor(calibration_.model);
  reconstructor.set_reference(reference_q8_);
  MeanMap mean;
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
    if (reconstructor.beyond_pixels() > kBeyondPixels) fail_beyond(name);
    mean.add(depth);
  }
  return {name, mean.cells(model.rectify.width, model.rectify.height, model.mm_per_px), 0};
}

Pair ContactReader::measure_recording(const std::string& path, std::uint64_t first,
                                      std::uint64_t end) const {
  const mcap::Reader file(path);
  require_same_calibration(file, path, calibration_, folder_);
  MeanMap mean;
  v1::DepthMap map;
  std::uint64_t at = 0;
  recording::RecordingHandlers handlers;
  handlers.frame = [&](const v1::Frame& frame, std::uint64_t) {
    if (const std::uint64_t index = at++; index < first) return true;
    if (!frame.contact().in_contact() || !frame.has_depth()) return at < end;
    if (std::ranges::find(frame.health(), v1::HEALTH_BEYOND_CALIBRATION) != frame.health().end()) {
      fail_beyond(fmt::format("{}:{}", path, at - 1));
    }
    if (!map.data().empty() &&
        (map.width() != frame.depth().width() || map.height() != frame.depth().height())) {
      throw std::runtime_error(
          fmt::format("{}:{}: its depth map has another size than those before: the resolution "
                      "was changed meanwhile; take frames of one, {}:FIRST:END",
                      path, at - 1, path));
    }
    map = frame.depth();
    mean.add(client::values_of(map));
    return at < end;
  };
  recording::read_recording(file, handlers);
  if (const std::string damage = file.damage(); !damage.empty()) {
    fmt::print(stderr, "{}: not all of it could be read ({}): the rest is used\n", path, damage);
  }
  if (map.data().empty()) {
    throw std::runtime_error(fmt::format(
        "{}: there is no contact in its frames, or they have no depth: take the pair out, or "
        "record while the scale shows the load",
        path));
  }
  return {
      path,
      mean.cells(static_cast<int>(map.width()), static_cast<int>(map.height()), map.mm_per_px()),
      0};
}

}  // namespace dtact::force
