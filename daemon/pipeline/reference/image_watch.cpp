#include "daemon/pipeline/reference/image_watch.hpp"

#include <algorithm>
#include <cmath>

namespace dtact::pipeline {

void ExposureWatch::forget() noexcept {
  last_no_contact_ns_.reset();
  since_ns_.reset();
}

void ExposureWatch::look(const LightSeen& light, const std::optional<LightCompared>& compared,
                         std::int64_t timestamp_ns) noexcept {
  // Never below 0: what looks like a dimmer light may be a press of the whole field.
  if (light.from == LightSeen::From::all) {
    excess_ = std::max(0.0, light.change);
    last_no_contact_ns_ = timestamp_ns;
  }
  if (!compared) return;
  const double brighter = compared->brighter - excess_;
  const double keeps_mean = compared->lost / (1 - compared->lost);
  const bool seen = compared->lost >= kLost && brighter >= kBrighter &&
                    brighter >= kMinShare * keeps_mean && brighter <= kMaxShare * keeps_mean;
  if (!seen) {
    since_ns_.reset();
    return;
  }
  const bool soon = last_no_contact_ns_ && timestamp_ns - *last_no_contact_ns_ < kSoonNs;
  if (!since_ns_ && soon) since_ns_ = timestamp_ns;
  follows_ = follows_ || (since_ns_ && timestamp_ns - *since_ns_ >= kLastsNs);
}

namespace {

/// Mean change of the light, as a share. 1 % is 1.6 grey levels or 0.05 mm on the sensors known. A
/// plane is fitted, with weights that leave out what a press changes: a ball, a nut, a bar and a
/// disc of 8 mm move it by up to 0.55 % (simulated sensor).
constexpr double kDriftShare = 0.01;
/// A press whose bulge covers most of the field moves it further, but only up: by 2 % in two
/// hundred random scenes (tests/accuracy/whole), by more than 3 % in others. The plane then
/// explains 34 to 70 % of the cells. Nothing is reported about the light then: a brightening this
/// small under a press that wide shows only after its release.
constexpr double kMaxBulge = 0.05;
constexpr float kLightExplains = 0.75F;
constexpr int kDriftDegree = 1;
/// A light change makes most cells active; below this share nothing is compared.
constexpr int kActiveShare = 4;
constexpr int kCheckEvery = 16;
/// Grey levels. Noise makes 0.05, a press in motion up to 0.3 for as long as it moves.
constexpr double kRipple = 0.5;
/// The same of fine bands, of which smoothing leaves less: noise makes 0.07, 4 are bands of 0.7 %.
constexpr double kFineRipple = 4;
/// A press that comes down at once ripples in one or two frames.
constexpr int kBandedFrames = 6;
constexpr int kBandedMost = 12;
/// Share of the pixels; the LEDs' own reflections are smaller.
constexpr int kSaturatedShare = 100;
/// Mean grey: an eighth of what the sensors known show; the reconstruction marks pixels below 8.
constexpr double kDarkGrey = 20;
/// Grey levels; the sensors known have 1.0.
constexpr double kNoise = 2.5;
/// Rows of cells; one alone may be a static test picture's border.
constexpr int kUnchangedRows = 2;

}  // namespace

void ImageWatch::set_reference(std::span<const std::uint16_t> reference_q8, int width, int height,
                               const CellRegion& region) noexcept {
  measure(reference_q8, width, height, reference_);
  region_ = region;
  have_reference_ = true;
  forget();
}

void ImageWatch::forget() noexcept {
  drifted_ = false;
  until_check_ = 0;
  active_then_ = 0;
  banded_ = 0;
  health_flags_ = {};
}

std::optional<LightCompared> ImageWatch::look(const CellReport& report, const hal::LumaView& luma,
                                              double light) noexcept {
  if (report.cells == 0) return std::nullopt;
  const auto compared = compare_light(report, luma, light);
  const bool bands = report.frame.ripple > kRipple || report.frame.fine_ripple > kFineRipple;
  banded_ = std::clamp(banded_ + (bands ? 1 : -1), 0, kBandedMost);
  health_flags_.set(Health::light_drifted, drifted_);
  health_flags_.set(Health::light_banded, banded_ >= kBandedFrames);
  health_flags_.set(Health::image_saturated,
                    report.frame.saturated * kSaturatedShare > report.frame.pixels);
  health_flags_.set(Health::image_dark, report.mean_grey < kDarkGrey);
  health_flags_.set(Health::image_noisy, report.frame.rough_noise > kNoise);
  health_flags_.set(Health::image_repeated, report.frame.unchanged_rows >= kUnchangedRows);
  return compared;
}

std::optional<LightCompared> ImageWatch::compare_light(const CellReport& report,
                                                       const hal::LumaView& luma,
                                                       double light) noexcept {
  if (!have_reference_ || report.active_cells * kActiveShare < report.cells) {
    drifted_ = false;
    until_check_ = 0;
    active_then_ = 0;
    return std::nullopt;
  }
  // Light that changes during contact is not left untold until the next look is due.
  const bool jumps = (report.active_cells - active_then_) * kActiveShare >= report.cells;
  if (until_check_-- > 0 && !jumps) return std::nullopt;
  until_check_ = kCheckEvery - 1;
  active_then_ = report.active_cells;
  measure(luma, now_);
  const ContactVerdict verdict = check_.compare(reference_, now_, region_, kDriftDegree, field_);
  double change = 0;
  double brighter = 0;
  double expected = 0;
  double shown = 0;
  int cells = 0;
  for (int y = region_.y0; y < region_.y1; ++y) {
    for (int x = region_.x0; x < region_.x1; ++x) {
      const std::size_t cell = cell_at(x, y);
      const double more = field_[cell] / light - 1;
      change += std::abs(more);
      brighter += more;
      expected += static_cast<double>(reference_.cells[cell] * field_[cell]);
      shown += static_cast<double>(now_.cells[cell]);
      ++cells;
    }
  }
  const double count = std::max(1, cells);
  const bool bulges =
      brighter > 0 && change < kMaxBulge * count && verdict.explained < kLightExplains;
  drifted_ = change > kDriftShare * count && !bulges;
  if (bulges) return std::nullopt;
  return LightCompared{brighter / count, 1 - shown / std::max(1.0, expected)};
}

}  // namespace dtact::pipeline
