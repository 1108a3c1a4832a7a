#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "clients/calibrate/fit/build.hpp"
#include "daemon/pipeline/active_calibration.hpp"
#include "daemon/pipeline/depth/uncertainty.hpp"
#include "hal/sim/renderer.hpp"
#include "tests/accuracy/chart/scenes.hpp"
#include "tests/accuracy/chart/settings.hpp"

namespace dtact::chart {
namespace {

/// One frame of the scripted run, worked by every resolution and by the chosen one.
struct Judged {
  int chosen = 0;            ///< Decimation.
  double error_um = 0;       ///< Of the chosen, true.
  double full_error_um = 0;  ///< Of full resolution, true.
};

calibration::Calibration from_one_press(const image::Grey16& reference) {
  return calibration::build({.reference_q8 = reference,
                             .frames = make_calibration_press().frames,
                             .ball_radius_mm = 4.0,
                             .mm_per_px = kMmPerPx,
                             .lens = {},
                             .crop = calibration::Crop{kCropCol, kCropRow, kSide, kSide}});
}

/// All objects one after the other (config/scenes/all_objects.toml), as the capture loop works:
/// each frame's resolution is chosen by the one before.
std::vector<Judged> scripted_run(double max_error_um, const image::Grey16& reference,
                                 const calibration::Calibration& made) {
  const auto calibration = std::make_shared<const calibration::Calibration>(made);
  hal::CameraInfo camera;
  camera.width = kWidth;
  camera.height = kHeight;
  camera.fps = 60;
  const auto active =
      pipeline::activate(calibration, camera, {.decimation = 0, .max_error_um = max_error_um});
  pipeline::Cells& cells = active->image.cells;
  cells.set_reference(reference.pixels);
  pipeline::Resolutions& maps = active->maps;
  maps.set_reference(reference.pixels);
  maps.use_decimation(4);
  recon::Reconstructor full(calibration->model);
  full.set_reference(reference.pixels);
  pipeline::ResolutionChooser chooser(max_error_um);

  const hal::sim::Scene scene =
      hal::sim::load_scene(DTACT_SOURCE_DIR "/config/scenes/all_objects.toml");
  hal::sim::Renderer renderer(scene, 11);
  std::vector<std::uint8_t> luma(std::size_t{kWidth} * kHeight + recon::kLumaPadding);
  std::vector<std::int16_t> depth(std::size_t{kSide} * kSide);
  std::vector<std::int16_t> full_depth(depth);
  std::array<recon::DrawnTiles, 5> drawn;  // by decimation
  std::vector<Judged> run;
  for (std::uint64_t sequence = 0; sequence < 1920; sequence += 6) {
    renderer.render(sequence, hal::sim::led_levels(hal::Light{}), luma.data(), kWidth, kHeight);
    pipeline::Resolution& resolution = maps.in_use();
    recon::Reconstructor& reconstructor = resolution.reconstructor;
    const int decimation = resolution.decimation();
    recon::DrawnTiles& marks = drawn[static_cast<std::size_t>(decimation)];
    marks.rest = 0;  // one buffer for all resolutions
    const recon::TileGrid& grid = reconstructor.grid();
    depth.resize(static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height));
    const double mm_per_px = reconstructor.model().mm_per_px;
    recon::DepthSums sums({.made_um = 100,
                           .lost_um = 50,
                           .bend_reach = pipeline::bend_reach(mm_per_px),
                           .bend_from_um = 100});
    (void)cells.look({luma.data(), kWidth, kHeight, kWidth});
    resolution.readers.mark(cells.active(), resolution.tiles);
    reconstructor.run_active(luma.data(), kWidth, resolution.tiles, depth, marks, nullptr, &sums);
    const double bend = pipeline::bend_um(sums, mm_per_px);
    // As the capture loop has it: half of the deepest is about the mean over a contact.
    const double list_um = maps.list_um(0.0005 * std::max<int>(0, std::ranges::max(depth)));
    Judged judged{.chosen = decimation, .error_um = 0, .full_error_um = 0};
    maps.use_decimation(chooser.next(list_um, bend));

    const Shot shot = truth_of(renderer, sequence);
    if (std::ranges::count_if(shot.judged, [](std::uint8_t c) { return c != 0; }) < 300) continue;
    full.run(luma.data(), kWidth, full_depth);
    judged.error_um = 1000 * error_of(depth, decimation, shot).mean_absolute_mm;
    judged.full_error_um = 1000 * error_of(full_depth, 1, shot).mean_absolute_mm;
    run.push_back(judged);
  }
  return run;
}

template <typename Predicate>
double share(const std::vector<Judged>& run, Predicate predicate) {
  return static_cast<double>(std::ranges::count_if(run, predicate)) /
         static_cast<double>(run.size());
}

TEST(Auto, KeepsTheBoundWhereverFullResolutionDoesAndSavesPixels) {
  const image::Grey16 reference = make_reference();
  const calibration::Calibration calibration = from_one_press(reference);
  for (const double bound : {60.0, 100.0, 150.0, 250.0}) {
    const std::vector<Judged> run = scripted_run(bound, reference, calibration);
    ASSERT_GT(run.size(), 150U);
    const double full_inside =
        share(run, [&](const Judged& j) { return j.full_error_um <= bound; });
    const double inside = share(run, [&](const Judged& j) { return j.error_um <= bound; });
    double pixels = 0;
    for (const Judged& j : run) pixels += 1.0 / (j.chosen * j.chosen);
    std::printf(
        "bound %3.0f um: inside %.1f %% (full resolution %.1f %%), full %.0f %%, half %.0f "
        "%%, quarter %.0f %% of frames, pixels %.0f %%\n",
        bound, 100 * inside, 100 * full_inside,
        100 * share(run, [](const Judged& j) { return j.chosen == 1; }),
        100 * share(run, [](const Judged& j) { return j.chosen == 2; }),
        100 * share(run, [](const Judged& j) { return j.chosen == 4; }),
        100 * pixels / static_cast<double>(run.size()));
    EXPECT_GE(inside, 0.95 * full_inside);
    if (bound == 250.0) {
      EXPECT_GE(inside, 0.95);
    }
  }
}

}  // namespace
}  // namespace dtact::chart
