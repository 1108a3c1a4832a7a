#include "clients/ctl/calibration_text.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <iterator>
#include <stdexcept>

namespace dtact::ctl {
namespace {

constexpr const char* kConfigured = "configured";

std::string size_text(std::uint32_t width, std::uint32_t height) {
  return fmt::format("{}x{}", width, height);
}

char mark_of(const v1::StoredCalibration& stored) {
  if (stored.in_use()) return '*';
  return stored.current() ? '>' : ' ';
}

}  // namespace

std::string text_of(const v1::CalibrationSummary& summary) {
  const std::string sharpens =
      summary.sharpen_steps().empty()
          ? ""
          : fmt::format(", sharpens by {}", fmt::join(summary.sharpen_steps(), " or "));
  return fmt::format("{}, method {}, {} of {} at {:.4f} mm/px, covers {:.2f} to {:.2f} mm{}, {}",
                     summary.name(), summary.method(), size_text(summary.width(), summary.height()),
                     size_text(summary.frame_width(), summary.frame_height()), summary.mm_per_px(),
                     summary.covered_from_mm(), summary.covered_to_mm(), sharpens,
                     summary.created());
}

std::string id_of(std::uint64_t number) {
  return number == client::kConfiguredCalibration ? kConfigured : std::to_string(number);
}

std::uint64_t parse_id(const std::string& text) {
  if (text == kConfigured) return client::kConfiguredCalibration;
  std::uint64_t number = 0;
  const char* const last = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), last, number);
  if (error != std::errc{} || end != last || number == 0) {
    throw std::invalid_argument("\"" + text +
                                "\" is no calibration: give a number that dtactctl calibration "
                                "list shows, or \"configured\"");
  }
  return number;
}

std::string text_of(const std::vector<v1::StoredCalibration>& calibrations) {
  std::size_t id_width = 2;
  std::size_t name_width = 4;
  for (const auto& stored : calibrations) {
    id_width = std::max(id_width, id_of(stored.number()).size());
    name_width = std::max(name_width, stored.name().size());
  }
  std::string text =
      fmt::format("  {:>{}}  {:<20}  {:<{}}  {:>9}  {:>9}  {:>7}  {:<9}  range\n", "id", id_width,
                  "uploaded", "name", name_width, "image", "map", "mm/px", "method");
  const auto out = std::back_inserter(text);
  for (const auto& stored : calibrations) {
    fmt::format_to(out, "{} {:>{}}  {:<20}  {:<{}}  ", mark_of(stored), id_of(stored.number()),
                   id_width, stored.uploaded().empty() ? "-" : stored.uploaded(), stored.name(),
                   name_width);
    if (stored.has_summary()) {
      const auto& summary = stored.summary();
      fmt::format_to(out, "{:>9}  {:>9}  {:>7.4f}  {:<9}  {:.2f} to {:.2f} mm{}\n",
                     size_text(summary.frame_width(), summary.frame_height()),
                     size_text(summary.width(), summary.height()), summary.mm_per_px(),
                     summary.method(), summary.covered_from_mm(), summary.covered_to_mm(),
                     stored.pinned() ? ", pinned" : "");
    } else {
      fmt::format_to(out, "cannot be read: {}\n", stored.damage());
    }
  }
  return text;
}

}  // namespace dtact::ctl
