#include "daemon/calibration/map_table.hpp"

#include <algorithm>

namespace dtact::calibration {

recon::RectifyTable map_table(const std::optional<recon::Lens>& lens, int frame_width,
                              int frame_height, const recon::MapPlace& place,
                              std::vector<std::uint8_t>& outside) {
  if (lens) return recon::make_lens_table(*lens, frame_width, frame_height, place, outside);
  outside.clear();
  return recon::make_crop_table(frame_width, frame_height, place.col, place.row, place.width,
                                place.height);
}

void add_untrusted(recon::Model& model, const std::vector<std::uint8_t>& outside) {
  if (std::ranges::none_of(outside, [](std::uint8_t mark) { return mark != 0; })) return;
  model.untrusted.resize(outside.size());
  std::ranges::transform(model.untrusted, outside, model.untrusted.begin(),
                         [](std::uint8_t a, std::uint8_t b) { return a != 0 || b != 0; });
}

}  // namespace dtact::calibration
