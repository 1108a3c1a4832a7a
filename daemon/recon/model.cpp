#include "daemon/recon/model.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

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

namespace {

/// Where one axis of a frame of 1/scale the size is read.
struct ScaledPlace {
  std::int16_t pixel = 0;   ///< 0 … pixels − 2.
  std::uint8_t weight = 0;  ///< Of the next pixel, 0 … 128.
};

/// `sum`: of `count` places in the whole frame, 1/128 pixel. `pixels`: of the scaled frame.
ScaledPlace scaled_place(std::int64_t sum, int count, int scale, int pixels) {
  // The middle of a scaled pixel is the middle of the scale pixels that it is the mean of.
  const double whole = static_cast<double>(sum) / (128.0 * count);
  const double at = std::clamp((whole - 0.5 * (scale - 1)) / scale, 0.0, pixels - 1.0);
  const int pixel = std::min(static_cast<int>(at), pixels - 2);
  return {static_cast<std::int16_t>(pixel),
          static_cast<std::uint8_t>(std::lround((at - pixel) * 128))};
}

std::vector<std::uint16_t> scaled_image(const std::vector<std::uint16_t>& image, int width,
                                        int height, int scale) {
  std::vector<std::uint16_t> scaled;
  scaled.reserve(image.size() / static_cast<std::size_t>(scale * scale));
  const auto pixels = static_cast<std::uint32_t>(scale * scale);
  for (int y = 0; y < height; y += scale) {
    for (int x = 0; x < width; x += scale) {
      std::uint32_t sum = pixels / 2;
      for (int k = 0; k < scale; ++k) {
        const std::uint16_t* const row = image.data() + std::ptrdiff_t{y + k} * width + x;
        sum = std::accumulate(row, row + scale, sum);
      }
      scaled.push_back(static_cast<std::uint16_t>(sum / pixels));
    }
  }
  return scaled;
}

}  // namespace

Model for_scaled_frames(const Model& model, int scale) {
  const int width = model.rectify.frame_width;
  const int height = model.rectify.frame_height;
  Model scaled = decimate(model, scale);
  if (width % scale != 0 || height % scale != 0 || width < 2 * scale || height < 2 * scale) {
    throw std::invalid_argument("frames: " + std::to_string(width) + "x" + std::to_string(height) +
                                " pixels are no multiples of " + std::to_string(scale));
  }
  RectifyTable& table = scaled.rectify;
  table.frame_width = width / scale;
  table.frame_height = height / scale;
  const std::vector<RectifyTable::Entry> fine = std::exchange(table.entries, {});
  const int fine_width = table.fine_width();
  table.decimation = 1;
  table.entries.reserve(fine.size() / static_cast<std::size_t>(scale * scale));
  for (int y = 0; y < table.height; ++y) {
    for (int x = 0; x < table.width; ++x) {
      std::int64_t column = 0;
      std::int64_t row = 0;
      for (int k = 0; k < scale; ++k) {
        const auto first =
            fine.begin() + std::ptrdiff_t{y * scale + k} * fine_width + std::ptrdiff_t{x} * scale;
        for (auto entry = first; entry != first + scale; ++entry) {
          column += entry->x * 128 + entry->fx;
          row += entry->y * 128 + entry->fy;
        }
      }
      const ScaledPlace across = scaled_place(column, scale * scale, scale, table.frame_width);
      const ScaledPlace down = scaled_place(row, scale * scale, scale, table.frame_height);
      table.entries.push_back({across.pixel, down.pixel, across.weight, down.weight});
    }
  }
  scaled.reference_q8 = scaled_image(model.reference_q8, width, height, scale);
  scaled.frame_scale = scale;
  return scaled;
}

}  // namespace dtact::recon
