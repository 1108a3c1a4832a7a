#include "clients/calibrate/guided/live_view.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <utility>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/guided/preview.hpp"

namespace dtact::ctl::guided {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

}  // namespace

void LiveView::use(const calibration::Calibration& empty, CellMeans reference, double cell_mm) {
  model_ = empty.model;
  scene_.mm_per_px = model_->mm_per_px;
  reference_.reset();
  if (!reference.empty()) {
    reference_ = calibration::rectified_reference(
        model_->rectify, image::Grey16{model_->rectify.frame_width, model_->rectify.frame_height,
                                       model_->reference_q8});
  }
  reference_cells_ = std::move(reference);
  cell_mm_ = cell_mm;
}

void LiveView::set_prompt(const Prompt& prompt) {
  scene_.prompt = prompt;
  scene_.words.clear();
  console_.live(scene_);
}

void LiveView::set_presses(std::vector<CapturedPress> presses, double covered_mm) {
  scene_.presses = std::move(presses);
  scene_.covered_mm = covered_mm;
}

image::Grey8 LiveView::picture(const image::Grey8& frame) const {
  const image::Grey8 map = calibration::rectified_mean(model_->rectify, {frame});
  return reference_ ? darkening_picture(*reference_, map) : map;
}

std::string LiveView::words_on(const ObservedFrame& look, const std::string& words) const {
  if (reference_cells_.empty()) return words;
  const ContactEvidence seen = compare(reference_cells_, look.cells);
  if (seen.darkest < kContactLevels) return "no contact; " + words;
  const double width_mm = 2 * cell_mm_ * std::sqrt(seen.dark_cells / std::numbers::pi);
  return fmt::format("contact {:.1f} mm wide, darkest {:.0f} grey levels; {}", width_mm,
                     seen.darkest, words);
}

void LiveView::show(const ObservedFrame& look, const std::string& words) {
  if (!console_.interactive()) return;
  const std::int64_t now_ns = look.time_ns;
  if (now_ns - drawn_ns_ < kSecond / 4) return;
  drawn_ns_ = now_ns;
  const image::Grey8 shown = picture(look.image);
  Scene scene = scene_;
  scene.picture = &shown;
  scene.words = words_on(look, words);
  console_.live(scene);
  if (now_ns - saved_ns_ < kSecond) return;
  saved_ns_ = now_ns;
  folder_.save_preview(annotated(shown, model_->mm_per_px, std::nullopt));
}

void LiveView::still(const image::Grey8& frame, const std::optional<calibration::Contact>& contact,
                     bool in_contact) {
  const image::Grey8 shown = picture(frame);
  folder_.save_preview(annotated(shown, model_->mm_per_px, contact));
  if (in_contact) console_.keep(shown);
}

}  // namespace dtact::ctl::guided
