#include "clients/calibrate/guided/live_view.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <sstream>
#include <utility>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/guided/preview.hpp"

namespace dtact::ctl::guided {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr int kColumns = 44;

}  // namespace

void LiveView::use(const calibration::Calibration& empty, CellMeans untouched, double cell_mm) {
  model_ = empty.model;
  untouched_.reset();
  if (!untouched.empty()) {
    untouched_ = calibration::rectified_reference(
        model_->rectify, image::Grey16{model_->rectify.frame_width, model_->rectify.frame_height,
                                       model_->reference_q8});
  }
  untouched_cells_ = std::move(untouched);
  cell_mm_ = cell_mm;
}

void LiveView::set_prompt(const std::string& prompt) {
  prompt_.clear();
  std::istringstream lines(prompt);
  for (std::string line; std::getline(lines, line);) prompt_.push_back(line);
  if (!prompt_.empty()) console_.live(prompt_);
}

image::Grey8 LiveView::picture(const image::Grey8& frame) const {
  const image::Grey8 map = calibration::rectified_mean(model_->rectify, {frame});
  return untouched_ ? darkening_picture(*untouched_, map) : map;
}

std::string LiveView::words_on(const Look& look, const std::string& words) const {
  if (untouched_cells_.empty()) return words;
  const Seen seen = compare(untouched_cells_, look.cells);
  if (seen.darkest < kTouchLevels) return "untouched; " + words;
  const double width_mm = 2 * cell_mm_ * std::sqrt(seen.dark_cells / std::numbers::pi);
  return fmt::format("contact {:.1f} mm wide, darkest {:.0f} grey levels; {}", width_mm,
                     seen.darkest, words);
}

void LiveView::show(const Look& look, const std::string& words) {
  if (!console_.interactive()) return;
  const std::int64_t now_ns = look.time_ns;
  if (now_ns - drawn_ns_ < kSecond / 4) return;
  drawn_ns_ = now_ns;
  const image::Grey8 shown = picture(look.image);
  std::vector<std::string> lines = half_blocks(shown, kColumns);
  lines.push_back(words_on(look, words));
  lines.insert(lines.end(), prompt_.begin(), prompt_.end());
  console_.live(lines);
  if (now_ns - saved_ns_ < kSecond) return;
  saved_ns_ = now_ns;
  folder_.save_preview(annotated(shown, model_->mm_per_px, std::nullopt));
}

void LiveView::still(const image::Grey8& frame, const std::optional<calibration::Contact>& contact,
                     bool touched) {
  const image::Grey8 shown = picture(frame);
  folder_.save_preview(annotated(shown, model_->mm_per_px, contact));
  if (!touched || !console_.interactive()) return;
  std::string text;
  for (const std::string& line : half_blocks(shown, kColumns)) text += line + "\n";
  console_.say(text);
}

}  // namespace dtact::ctl::guided
