#include "tests/accuracy/study/study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <map>
#include <memory>
#include <tuple>

#include "tests/accuracy/table/another_law.hpp"
#include "tests/accuracy/thickness/thickness.hpp"

namespace dtact::study {
namespace {

constexpr double kBallRadius_mm = 2;
constexpr double kPillarRadius_mm = 0.5;
constexpr int kShrink = 3;  // the study's 640 of 1920 pixels

/// Presses by gel: a press that is solved once serves all optics.
class Presses {
 public:
  std::vector<Darkening> photographed(const hal::sim::Scene& sensor, const std::string& what,
                                      const Ladder& ladder, int shrink = 1) {
    auto& truth = solved_[{sensor.gel.thickness_mm, sensor.gel.poisson, what}];
    if (!truth) truth = press(sensor, ladder);
    return photograph(truth, sensor, ladder.depths_mm, shrink);
  }

 private:
  std::map<std::tuple<double, double, std::string>, std::shared_ptr<const hal::sim::Truth>> solved_;
};

StudyLut list_of(const std::vector<Darkening>& balls, double zero_mm) {
  std::vector<KnownPress> presses;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    presses.push_back({&balls[i], kDepths_mm[i] + zero_mm});
  }
  return make_lut(presses, kBallRadius_mm);
}

void measure_shapes(const Specimen& specimen, Presses& presses, Result& result) {
  const hal::sim::Scene& sensor = specimen.sensor;
  const std::vector<double> depths(kDepths_mm.begin(), kDepths_mm.end());
  const Ladder ball{hal::sim::ball(kBallRadius_mm), depths, kBallZero_mm, false};
  const Ladder cylinder{hal::sim::disc(kBallRadius_mm), depths, 0, true};
  const Ladder cube{hal::sim::cube(2 * kBallRadius_mm), depths, 0, true};
  const auto balls = presses.photographed(sensor, "ball", ball);
  const auto cylinders = presses.photographed(sensor, "cylinder", cylinder);
  const auto cubes = presses.photographed(sensor, "cube", cube);
  // Where noise adds specks to parts hardly darker than the threshold, it would determine the
  // radius.
  const auto smooth_balls = presses.photographed(sensor, "ball", ball, kShrink);
  const auto smooth_cylinders = presses.photographed(sensor, "cylinder", cylinder, kShrink);
  const StudyLut lut = list_of(balls, kBallZero_mm);
  const StudyLut uncorrected = list_of(balls, 0);
  result.mm_per_level = (kDepths_mm.back() + kBallZero_mm) / lut.deepest_level;
  for (std::size_t i = 0; i < kDepths_mm.size(); ++i) {
    result.resolutions.push_back({.depth_mm = kDepths_mm[i],
                                  .cylinder = read_flat(cylinders[i], lut),
                                  .cylinder_uncorrected = read_flat(cylinders[i], uncorrected),
                                  .cube = read_flat(cubes[i], lut),
                                  .ball_patch = patch_above(smooth_balls[i], kThreshold),
                                  .cylinder_patch = patch_above(smooth_cylinders[i], kThreshold)});
  }
}

void measure_upright(const Specimen& specimen, const Protocol& protocol, Presses& presses,
                     Result& result) {
  for (const double spacing : protocol.spacings_mm) {
    const Ladder ladder{hal::sim::two_pillars(kPillarRadius_mm, spacing), protocol.depths_mm, 0,
                        true};
    const std::string name = fmt::format("pillars {}", spacing);
    const auto sharp = presses.photographed(specimen.sensor, name, ladder);
    const auto averaged = presses.photographed(specimen.sensor, name, ladder, kShrink);
    for (std::size_t i = 0; i < ladder.depths_mm.size(); ++i) {
      result.pillars.push_back({spacing, 0, ladder.depths_mm[i], read_pillars(sharp[i], spacing),
                                read_pillars(averaged[i], spacing)});
    }
  }
}

void measure_leaning(const Specimen& specimen, const Protocol& protocol, Presses& presses,
                     Result& result) {
  for (const double tilt : protocol.tilts_deg) {
    for (const double spacing : protocol.leaning_spacings_mm) {
      const hal::sim::Object upright = hal::sim::two_pillars(kPillarRadius_mm, spacing);
      const Ladder ladder{askew(upright, tilt), protocol.leaning_depths_mm,
                          lowest_of_askew(upright, tilt), false};
      const auto seen = presses.photographed(specimen.sensor,
                                             fmt::format("pillars {} {}", spacing, tilt), ladder);
      for (std::size_t i = 0; i < seen.size(); ++i) {
        result.pillars.push_back(
            {spacing, tilt, ladder.depths_mm[i], read_pillars(seen[i], spacing), std::nullopt});
      }
    }
  }
}

}  // namespace

std::vector<Specimen> specimens(double thickness_mm) {
  const hal::sim::Scene scaled = thickness::sensor_of(thickness_mm);
  hal::sim::Scene kept = scaled;
  const hal::sim::OpticsModel built_in = hal::sim::default_scene().optics;
  kept.optics.narrow_mm = built_in.narrow_mm;
  kept.optics.wide_mm = built_in.wide_mm;
  const auto scaled_to = [&](hal::sim::Scene sensor) {
    const double scale = thickness_mm / sensor.gel.thickness_mm;
    sensor.gel.thickness_mm = thickness_mm;
    sensor.optics.narrow_mm *= scale;
    sensor.optics.wide_mm *= scale;
    return sensor;
  };
  const hal::sim::Scene c =
      hal::sim::load_scene(DTACT_SOURCE_DIR "/tests/accuracy/sim/sensor_c.toml");
  return {{"built-in", scaled},
          {"built-in with the widths of 2 mm", kept},
          {"as sensor_c scatters", scaled_to(c)},
          {"another law", scaled_to(table::another_law())}};
}

int Result::resolved_of_four(double tilt_deg) const {
  int count = 0;
  for (const double spacing : {1.25, 1.5, 1.75, 2.0}) {
    count += std::ranges::any_of(pillars, [&](const PillarPress& p) {
      return p.spacing_mm == spacing && p.tilt_deg == tilt_deg && p.depth_mm <= 0.3 &&
             p.seen.resolved();
    });
  }
  return count;
}

std::vector<Result> measure(const std::vector<Specimen>& specimens, const Protocol& protocol) {
  Presses presses;
  std::vector<Result> results;
  for (const Specimen& specimen : specimens) {
    Result result{.law = specimen.law,
                  .thickness_mm = specimen.sensor.gel.thickness_mm,
                  .resolutions = {},
                  .pillars = {}};
    if (protocol.shapes) measure_shapes(specimen, presses, result);
    measure_upright(specimen, protocol, presses, result);
    measure_leaning(specimen, protocol, presses, result);
    results.push_back(std::move(result));
  }
  return results;
}

std::string to_csv(const std::vector<Result>& results) {
  std::string out = "thickness_mm,law,object,spacing_mm,tilt_deg,depth_mm,what,value\n";
  auto to = std::back_inserter(out);
  for (const Result& r : results) {
    const auto row = [&](std::string_view object, const std::string& where, std::string_view what,
                         double value) {
      fmt::format_to(to, "{},{},{},{},{},{:.4f}\n", r.thickness_mm, r.law, object, where, what,
                     value);
    };
    if (!r.resolutions.empty()) row("ball", ",,", "mm a grey level", r.mm_per_level);
    for (const Rung& resolution_index : r.resolutions) {
      const std::string where = fmt::format(",,{}", resolution_index.depth_mm);
      row("cylinder", where, "depth (mm)", resolution_index.cylinder.depth_mm);
      row("cylinder", where, "depth by the uncorrected LUT (mm)",
          resolution_index.cylinder_uncorrected.depth_mm);
      row("cylinder", where, "width at half depth (mm)", resolution_index.cylinder.diameter_mm);
      row("cube", where, "side at half depth (mm)", resolution_index.cube.side_mm);
      row("cylinder", where, "radius above 5 levels (mm)",
          resolution_index.cylinder_patch.radius_mm);
      row("cylinder", where, "mean above 5 levels", resolution_index.cylinder_patch.mean);
      row("ball", where, "radius above 5 levels (mm)", resolution_index.ball_patch.radius_mm);
      row("ball", where, "mean above 5 levels", resolution_index.ball_patch.mean);
    }
    for (const PillarPress& p : r.pillars) {
      const std::string where = fmt::format("{},{},{}", p.spacing_mm, p.tilt_deg, p.depth_mm);
      row("pillars", where, "dip", p.seen.dip);
      row("pillars", where, "weaker peak (levels)", p.seen.peak);
      row("pillars", where, "weaker over stronger", p.seen.symmetry);
      row("pillars", where, "resolved", p.seen.resolved() ? 1 : 0);
      if (p.averaged) row("pillars", where, "dip (averaged)", p.averaged->dip);
    }
  }
  return out;
}

}  // namespace dtact::study
