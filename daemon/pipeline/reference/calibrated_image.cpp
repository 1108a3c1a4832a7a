#include "daemon/pipeline/reference/calibrated_image.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

namespace dtact::pipeline {
namespace {

CellRegion cells_within(const recon::RectifyTable& table) {
  const recon::FrameRegion read = recon::region_read(table);
  const auto first = [](int pixel, int cells, int pixels) {
    return std::min(cells, (pixel * cells + pixels - 1) / pixels);
  };
  CellRegion region{.x0 = first(read.x, kGridWidth, table.frame_width),
                    .y0 = first(read.y, kGridHeight, table.frame_height),
                    .x1 = (read.x + read.width) * kGridWidth / table.frame_width,
                    .y1 = (read.y + read.height) * kGridHeight / table.frame_height};
  region.x1 = std::min(region.x1, kGridWidth);
  region.y1 = std::min(region.y1, kGridHeight);
  return region;
}

}  // namespace

void require_coverage(const recon::RectifyTable& table, const std::string& name) {
  constexpr int kMinCells = 8;
  const CellRegion region = cells_within(table);
  if (region.x1 - region.x0 >= kMinCells && region.y1 - region.y0 >= kMinCells) return;
  // A crop of nine cells has eight whole ones wherever it lies.
  throw std::invalid_argument(
      fmt::format("calibration \"{}\" covers {}x{} pixels of the frame, too little to tell light "
                  "from contact: calibrate with a crop of at least a quarter of the frame's width "
                  "and three tenths of its height",
                  name, table.width, table.height));
}

CalibratedImage::CalibratedImage(std::shared_ptr<const calibration::Calibration> of)
    : calibration(std::move(of)),
      region(cells_within(calibration->model->rectify)),
      cells(recon::CellLattice(calibration->model->rectify)) {
  const recon::RectifyTable& table = calibration->model->rectify;
  require_coverage(table, calibration->name);
  const std::vector<std::uint16_t>& reference_q8 = calibration->model->reference_q8;
  measure(reference_q8, table.frame_width, table.frame_height, grid);
  const int x = cell_edge(region.x0, kGridWidth, table.frame_width);
  const int y = cell_edge(region.y0, kGridHeight, table.frame_height);
  marks = std::make_shared<const GelMarks>(
      reference_q8, table.frame_width,
      recon::FrameRegion{x, y, cell_edge(region.x1, kGridWidth, table.frame_width) - x,
                         cell_edge(region.y1, kGridHeight, table.frame_height) - y});
}

bool light_differs(const calibration::Calibration& calibration, const hal::Light& light) noexcept {
  const auto& then = calibration.origin.leds;
  if (then.empty()) return false;
  if (then.size() != light.leds.size() * 3) return true;
  const auto differs = [](std::uint8_t emitted, std::uint8_t recorded) {
    return std::abs(int{emitted} - int{recorded}) > 1;
  };
  const auto now = light.emitted();
  for (std::size_t i = 0; i < now.size(); ++i) {
    const hal::Rgb& led = now[i];
    if (differs(led.r, then[3 * i]) || differs(led.g, then[3 * i + 1]) ||
        differs(led.b, then[3 * i + 2])) {
      return true;
    }
  }
  return false;
}

}  // namespace dtact::pipeline
