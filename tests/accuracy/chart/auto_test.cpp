#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include "clients/calibrate/fit/build.hpp"
#include "daemon/pipeline/active_calibration.hpp"
#include "daemon/pipeline/depth/uncertainty.hpp"
#include "hal/sim/renderer.hpp"
#include "tests/accuracy/chart/scenes.hpp"
#include "tests/accuracy/chart/settings.hpp"
#include "tests/accuracy/chart/virtual_balls.hpp"

namespace dtact::chart {
namespace {

/// The map that a resolution of the ladder makes of a frame.
struct Made {
  double bend_um = 0;
  double lut_um = 0;
  double error_um = 0;  ///< True error.
};

/// One frame of the scripted run, reconstructed at every resolution.
struct Judged {
  std::size_t chosen = 0;  ///< Index of the resolution.
  std::array<Made, pipeline::Resolutions::kMaxResolutions> by_resolution;

  [[nodiscard]] double error_um() const { return by_resolution.at(chosen).error_um; }
};

calibration::Calibration from_one_press(const image::Grey16& reference) {
  return calibration::build({.reference_q8 = reference,
                             .frames = make_calibration_press().frames,
                             .ball_radius_mm = 4.0,
                             .mm_per_px = kMmPerPx,
                             .lens = {},
                             .crop = calibration::Crop{kCropCol, kCropRow, kSide, kSide},
                             .view = kView});
}

/// The scripted run under one bound of the error.
struct BoundedRun {
  double bound_um;
  pipeline::ResolutionChooser chooser{bound_um};
  std::size_t chosen = 0;
  std::vector<Judged> frames;
};

/// All objects one after the other (config/scenes/all_objects.toml), processed like in the capture
/// loop: each frame chooses the resolution of the next. The maps at each resolution do not depend
/// on the bound, so each is made once for all bounds.
std::vector<BoundedRun> scripted_runs(const std::vector<double>& bounds_um,
                                      const pipeline::ReconstructionRules& rules,
                                      const image::Grey16& reference,
                                      const calibration::Calibration& made) {
  const auto calibration = std::make_shared<const calibration::Calibration>(made);
  hal::CameraInfo camera;
  camera.width = kWidth;
  camera.height = kHeight;
  camera.fps = 60;
  const auto active = pipeline::activate(calibration, camera, rules);
  pipeline::Cells& cells = active->image.cells;
  cells.set_reference(reference.pixels);
  pipeline::Resolutions& maps = active->maps;
  maps.set_reference(reference.pixels);
  std::vector<BoundedRun> runs;
  for (const double bound_um : bounds_um) {
    runs.push_back(
        BoundedRun{.bound_um = bound_um, .chosen = maps.resolution_index(), .frames = {}});
  }

  const hal::sim::Scene scene =
      hal::sim::load_scene(DTACT_SOURCE_DIR "/config/scenes/all_objects.toml");
  hal::sim::Renderer renderer(scene, 11);
  std::vector<std::uint8_t> luma(std::size_t{kWidth} * kHeight + recon::kLumaPadding);
  std::vector<std::int16_t> depth;
  for (std::uint64_t sequence = 0; sequence < 1920; sequence += 6) {
    renderer.render(sequence, hal::sim::led_levels(hal::Light{}), luma.data(), kWidth, kHeight);
    (void)cells.look({luma.data(), kWidth, kHeight, kWidth});
    const Shot shot = truth_of(renderer, sequence);
    Judged judged;
    for (std::size_t resolution_index = 0; resolution_index < maps.resolutions().size();
         ++resolution_index) {
      maps.use(resolution_index);
      pipeline::Resolution& resolution = maps.in_use();
      recon::Reconstructor& reconstructor = resolution.reconstructor;
      recon::DrawnTiles marks;  // one buffer for all
      const recon::TileGrid& grid = reconstructor.grid();
      depth.resize(static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height));
      const double mm_per_px = reconstructor.model().mm_per_px;
      recon::DepthSums sums({.threshold_um = 100,
                             .release_um = 50,
                             .bend_reach = pipeline::bend_reach(mm_per_px),
                             .bend_from_um = 100});
      resolution.readers.mark(cells.active(), resolution.tiles);
      reconstructor.run_active(luma.data(), kWidth, resolution.tiles, depth, marks, nullptr, &sums);
      judged.by_resolution.at(resolution_index) = {
          .bend_um = pipeline::bend_um(sums, mm_per_px),
          // The capture loop does the same: half of the deepest is about the mean over a contact.
          .lut_um =
              maps.lut_um(0.0005 * std::max<int>(0, std::ranges::max(depth)), resolution.steps()),
          .error_um = 1000 * error_of(depth, resolution.decimation(), shot).mean_absolute_mm};
    }
    const bool counts =
        std::ranges::count_if(shot.judged, [](std::uint8_t c) { return c != 0; }) >= 300;
    for (BoundedRun& run : runs) {
      judged.chosen = run.chosen;
      const Made& seen = judged.by_resolution.at(judged.chosen);
      const double plain_um =
          pipeline::plain_bend_um(seen.bend_um, maps.resolutions()[judged.chosen].steps());
      std::vector<double> expected;
      for (const pipeline::Resolution& each : maps.resolutions()) {
        expected.push_back(
            pipeline::uncertainty_at_um(judged.by_resolution.at(expected.size()).lut_um, plain_um,
                                        each.decimation(), each.steps()));
      }
      run.chosen = run.chooser.next(expected);
      if (counts) run.frames.push_back(judged);
    }
  }
  return runs;
}

template <typename Predicate>
double share(const std::vector<Judged>& run, Predicate predicate) {
  return static_cast<double>(std::ranges::count_if(run, predicate)) /
         static_cast<double>(run.size());
}

/// Shares of frames in which the chosen resolution and each one alone are within the bound.
void print_shares(const char* what, double bound_um, const std::vector<Judged>& run,
                  std::size_t resolutions) {
  std::printf("%s, bound %3.0f um: inside %.1f %%; alone and chosen", what, bound_um,
              100 * share(run, [&](const Judged& j) { return j.error_um() <= bound_um; }));
  for (std::size_t resolution_index = 0; resolution_index < resolutions; ++resolution_index) {
    std::printf(", rung %zu: %.1f %%, %.0f %%", resolution_index,
                100 * share(run,
                            [&](const Judged& j) {
                              return j.by_resolution.at(resolution_index).error_um <= bound_um;
                            }),
                100 * share(run, [&](const Judged& j) { return j.chosen == resolution_index; }));
  }
  std::printf(" of frames\n");
}

TEST(Auto, KeepsTheBoundWhereverFullResolutionDoesAndSavesPixels) {
  const image::Grey16 reference = make_reference();
  const calibration::Calibration calibration = from_one_press(reference);
  for (const BoundedRun& each :
       scripted_runs({60, 100, 150, 250}, {.decimation = 0}, reference, calibration)) {
    const double bound = each.bound_um;
    const std::vector<Judged>& run = each.frames;
    ASSERT_GT(run.size(), 150U);
    constexpr std::size_t kFull = 2;
    const double full_inside =
        share(run, [&](const Judged& j) { return j.by_resolution[kFull].error_um <= bound; });
    const double inside = share(run, [&](const Judged& j) { return j.error_um() <= bound; });
    print_shares("resolution", bound, run, kFull + 1);
    EXPECT_GE(inside, 0.95 * full_inside);
    if (bound == 250.0) {
      EXPECT_GE(inside, 0.95);
    }
  }
}

/// Median of a value over all frames.
template <typename Value>
double median(const std::vector<Judged>& run, Value value) {
  std::vector<double> values;
  for (const Judged& j : run) values.push_back(value(j));
  std::ranges::nth_element(values, values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2));
  return values[values.size() / 2];
}

TEST(Auto, SharpensWhereTheBoundAsksForItAndNotElsewhere) {
  const image::Grey16 reference = make_reference();
  calibration::Calibration calibration = from_one_press(reference);
  calibration.model = std::make_shared<const recon::Model>(
      with_luts_of_virtual_balls(*calibration.model, reference));
  for (const BoundedRun& each : scripted_runs(
           {30, 60, 120}, {.decimation = 0, .sharpen = pipeline::ReconstructionRules::kAutoSharpen},
           reference, calibration)) {
    const double bound = each.bound_um;
    const std::vector<Judged>& run = each.frames;
    ASSERT_GT(run.size(), 150U);
    print_shares("sharpening", bound, run, 3);
    if (bound == 30.0) {
      // daemon/pipeline/depth/uncertainty.cpp relies on this.
      for (int steps = 0; steps <= 2; ++steps) {
        const auto resolution_index = static_cast<std::size_t>(steps);
        const double bends = median(run, [&](const Judged& j) {
          return j.by_resolution[resolution_index].bend_um /
                 std::max(j.by_resolution[0].bend_um, 0.1);
        });
        const auto honesty = [&](double left) {
          return median(run, [&](const Judged& j) {
            const Made& made = j.by_resolution[resolution_index];
            const double plain_um = j.by_resolution[0].bend_um;
            return made.error_um /
                   (std::hypot(made.lut_um, pipeline::kBlurPerBend * left * plain_um) +
                    0.31 * plain_um);
          });
        };
        double left = 0;
        while (left < 2 && honesty(left) > 1) left += 0.01;
        std::printf("%d steps: bends %.2f times as much, %.2f of the blur is left, error %.1f um\n",
                    steps, bends, left, median(run, [&](const Judged& j) {
                      return j.by_resolution[resolution_index].error_um;
                    }));
      }
    }
    const double two =
        share(run, [&](const Judged& j) { return j.by_resolution[2].error_um <= bound; });
    const double inside = share(run, [&](const Judged& j) { return j.error_um() <= bound; });
    EXPECT_GE(inside, 0.9 * two);
    if (bound == 120.0) {
      EXPECT_GT(share(run, [](const Judged& j) { return j.chosen == 0; }), 0.2);
    }
  }
}

}  // namespace
}  // namespace dtact::chart
