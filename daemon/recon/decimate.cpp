#include "daemon/recon/decimate.hpp"

#include <algorithm>
#include <cstddef>
#include <stdexcept>

namespace dtact::recon {

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
