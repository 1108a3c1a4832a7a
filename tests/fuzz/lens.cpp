// A lens file. An accepted one can be written again and makes a table that stays in the frame.
#include <algorithm>
#include <stdexcept>

#include "daemon/calibration/sensor_files.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace dtact::fuzz {
namespace {

void use(const calibration::LensFile& file) {
  const MemoryFile copy(calibration::format(file));
  const recon::Lens again = calibration::load_lens(copy.path()).lens;
  require(again.homography == file.lens.homography && again.radial == file.lens.radial &&
              again.centre_col == file.lens.centre_col &&
              again.centre_row == file.lens.centre_row && again.radius_px == file.lens.radius_px,
          "a lens that is read can be written and is the same again");
  std::vector<std::uint8_t> outside;
  const recon::MapPlace place{file.frame_width / 2, file.frame_height / 2, 24, 16,
                              recon::central_mm_per_px(file.lens)};
  const auto table =
      recon::make_lens_table(file.lens, file.frame_width, file.frame_height, place, outside);
  require(std::ranges::all_of(table.entries,
                              [&](const auto& entry) {
                                return entry.x >= 0 && entry.x <= file.frame_width - 2 &&
                                       entry.y >= 0 && entry.y <= file.frame_height - 2 &&
                                       entry.fx <= 128 && entry.fy <= 128;
                              }),
          "all four source pixels of an entry lie in the frame");
}

}  // namespace
}  // namespace dtact::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  const fuzz::MemoryFile file({reinterpret_cast<const char*>(data), size});
  try {
    fuzz::use(calibration::load_lens(file.path()));
  } catch (const std::runtime_error& e) {
    fuzz::require(*e.what() != 0, "an error says something");
  }
  return 0;
}
