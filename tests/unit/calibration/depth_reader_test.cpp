#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "clients/calibrate/fit/darkening_map.hpp"
#include "daemon/pipeline/depth/resolutions.hpp"
#include "daemon/pipeline/reference/calibrated_image.hpp"
#include "tests/fakes/scattering_toy.hpp"

namespace dtact::calibration {
namespace {

/// The depth map that the daemon computes from a frame with `steps` of sharpening, micrometres.
std::vector<std::int16_t> served(const std::shared_ptr<const Calibration>& calibration,
                                 const std::vector<std::uint16_t>& reference_q8,
                                 const fakes::ToyFrame& frame, int steps) {
  pipeline::CalibratedImage image(calibration);
  pipeline::Resolutions maps(calibration->model, image.cells.lattice(), {.sharpen = steps});
  maps.set_reference(reference_q8);
  pipeline::Resolution& way = maps.in_use();
  std::vector<std::int16_t> um(calibration->model->rectify.entries.size());
  way.reconstructor.run(frame.pixels.data(), fakes::kToyWidth,
                        way.coarse ? way.coarse->depth_um : um);
  if (way.coarse) way.coarse->upsampler.run(way.coarse->depth_um, um);
  return um;
}

TEST(DepthReader, MakesTheMapsThatTheDaemonServes) {
  const std::shared_ptr<const Calibration> calibration = fakes::scattering_toy_calibration(15);
  const fakes::ToyFrame frame({.light = 1.02, .press_mm = 1});
  const auto reference_q8 = fakes::toy_reference_q8({.light = 1.02});
  image::Grey8 image{fakes::kToyWidth, fakes::kToyHeight, frame.pixels};
  image.pixels.resize(std::size_t{fakes::kToyWidth} * fakes::kToyHeight);
  for (int steps = 0; steps <= 2; ++steps) {
    const std::vector<std::int16_t> um = served(calibration, reference_q8, frame, steps);
    DepthReader reader(calibration->model, steps);
    reader.set_reference(reference_q8);
    EXPECT_TRUE(std::ranges::equal(reader.read(image), um)) << steps;
    EXPECT_TRUE(std::ranges::equal(
        mean_depth_um(*calibration->model, reference_q8, {&image, 1}, steps), um))
        << steps;
  }
}

}  // namespace
}  // namespace dtact::calibration
