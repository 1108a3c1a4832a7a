#include "daemon/recon/model.hpp"

#include <cstddef>
#include <stdexcept>
#include <string>

namespace dtact::recon {
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
  check(model.list, model.method == Method::list);
  if (model.scattering) check(*model.scattering);
  int before = 0;
  for (const Model::Sharpened& sharpened : model.sharpened) {
    require(model.method == Method::list, "sharpened: the published method has no such lists");
    require(model.scattering.has_value(),
            "sharpened: its lists need the scattering that their levels were sharpened by");
    require(sharpened.steps >= 1 && sharpened.steps <= kMostSharpeningSteps,
            "sharpened: steps must be 1 or 2");
    require(sharpened.steps > before, "sharpened: steps must rise from one list to the next");
    before = sharpened.steps;
    check(sharpened.list, true);
  }
}

}  // namespace dtact::recon
