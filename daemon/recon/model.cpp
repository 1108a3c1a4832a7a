#include "daemon/recon/model.hpp"

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <string>

namespace dtact::recon {

void check(const Scattering& scattering) {
  if (!(scattering.narrow_mm >= kNarrowestMm && scattering.narrow_mm <= kWidestNarrowMm)) {
    throw std::invalid_argument("scattering.narrow_mm: must be 0.01 to 5 millimetres");
  }
  if (!(scattering.wide_mm > scattering.narrow_mm && scattering.wide_mm <= kWidestMm)) {
    throw std::invalid_argument(
        "scattering.wide_mm: must be above narrow_mm and at most 20 millimetres");
  }
  if (!(scattering.narrow_weight >= 0 && scattering.narrow_weight <= 1)) {
    throw std::invalid_argument("scattering.narrow_weight: must be 0 to 1");
  }
}

namespace {

void require(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument(what);
}

}  // namespace

void check(const Model& model) {
  const RectifyTable& table = model.rectify;
  require(
      table.frame_width >= 2 && table.frame_height >= 2 && table.width >= 1 && table.height >= 1,
      "rectify: frame and depth map must have pixels");
  const auto frame =
      static_cast<std::size_t>(table.frame_width) * static_cast<std::size_t>(table.frame_height);
  require(table.decimation == 1 || table.decimation == 2 || table.decimation == 4,
          "rectify: decimation must be 1, 2 or 4");
  const auto map = static_cast<std::size_t>(table.width) * static_cast<std::size_t>(table.height);
  const auto fine = map * static_cast<std::size_t>(table.decimation * table.decimation);
  require(table.entries.size() == fine, "rectify: " + std::to_string(table.entries.size()) +
                                            " entries for a map of " + std::to_string(fine));
  for (const RectifyTable::Entry& e : table.entries) {
    require(e.x >= 0 && e.x <= table.frame_width - 2 && e.y >= 0 && e.y <= table.frame_height - 2 &&
                e.fx <= 128 && e.fy <= 128,
            "rectify: an entry reads outside the frame");
  }
  require(model.reference_q8.size() == frame, "reference: not the size of the frame");
  require(model.untrusted.empty() || model.untrusted.size() == map,
          "untrusted: not the size of the depth map");
  require(model.mm_per_px > 0, "scale: mm_per_px must be positive");
  check(model.lut, model.method == Method::lut);
  if (model.scattering) check(*model.scattering);
  int before = 0;
  for (const Model::Sharpened& sharpened : model.sharpened) {
    require(model.method == Method::lut, "sharpened: the published method has no sharpened LUTs");
    require(model.scattering.has_value(),
            "sharpened: its LUTs need the scattering that their levels were sharpened by");
    require(sharpened.steps >= 1 && sharpened.steps <= kMaxSharpeningSteps,
            "sharpened: steps must be 1 or 2");
    require(sharpened.steps > before, "sharpened: steps must rise from one LUT to the next");
    before = sharpened.steps;
    check(sharpened.lut, true);
  }
}

Model decimate(const Model& model, int factor) {
  const RectifyTable& from = model.rectify;
  if (factor != 1 && factor != 2 && factor != 4) {
    throw std::invalid_argument("decimation: must be 1, 2 or 4");
  }
  if (from.decimation != 1) throw std::invalid_argument("decimation: the map is decimated already");
  if (from.width < factor || from.height < factor) {
    throw std::invalid_argument("decimation: the map is smaller than one pixel of the result");
  }
  Model coarse = model;
  RectifyTable& table = coarse.rectify;
  table.width = from.width / factor;
  table.height = from.height / factor;
  table.decimation = factor;
  table.entries.clear();
  coarse.untrusted.assign(model.untrusted.empty() ? 0
                                                  : static_cast<std::size_t>(table.width) *
                                                        static_cast<std::size_t>(table.height),
                          0);
  const int left = (from.width - table.fine_width()) / 2;
  const int top = (from.height - table.fine_height()) / 2;
  for (int y = 0; y < table.fine_height(); ++y) {
    const auto row = static_cast<std::ptrdiff_t>(y + top) * from.width + left;
    table.entries.insert(table.entries.end(), from.entries.begin() + row,
                         from.entries.begin() + row + table.fine_width());
    if (model.untrusted.empty()) continue;
    for (int x = 0; x < table.fine_width(); ++x) {
      const auto at = static_cast<std::size_t>(y / factor) * static_cast<std::size_t>(table.width) +
                      static_cast<std::size_t>(x / factor);
      coarse.untrusted[at] |= model.untrusted[static_cast<std::size_t>(row + x)];
    }
  }
  coarse.mm_per_px = model.mm_per_px * factor;
  coarse.smoothing_px = model.smoothing_px / factor;
  return coarse;
}

}  // namespace dtact::recon
