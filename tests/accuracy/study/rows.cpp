#include "tests/accuracy/study/rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <string>

#include "hal/sim/objects.hpp"
#include "tests/accuracy/study/comparison.hpp"
#include "tests/accuracy/study/figures.hpp"
#include "tests/accuracy/study/force.hpp"

namespace dtact::study {
namespace {

using figures::Spread;

/// Linear between depths.
double between(std::span<const Rung> resolutions, double depth_mm,
               const std::function<double(const Rung&)>& value) {
  std::size_t i = 1;
  while (i + 1 < resolutions.size() && resolutions[i].depth_mm < depth_mm) ++i;
  const Rung& a = resolutions[i - 1];
  const Rung& b = resolutions[i];
  return std::lerp(value(a), value(b), (depth_mm - a.depth_mm) / (b.depth_mm - a.depth_mm));
}

Value deep_mean(const Result& result, const std::function<double(const Rung&)>& value) {
  double sum = 0;
  int count = 0;
  for (const Rung& resolution_index : result.resolutions) {
    if (resolution_index.depth_mm < 0.35) continue;  // the study judges sizes from here on
    sum += value(resolution_index);
    ++count;
  }
  return count > 0 ? Value(sum / count) : std::nullopt;
}

void add_shapes(Comparison& comparison) {
  comparison.by_gel(
      "micrometres a grey level", figures::kUmPerLevel, 0,
      [](const Result& r) {
        return r.resolutions.empty() ? std::nullopt : Value(1000 * r.mm_per_level);
      },
      "The simulator's block does not yield, so that a press takes twice the share of a gel "
      "of "
      "1 mm. The study's units of 1 mm darken like those of 3 mm, and are as soft under a flat "
      "face "
      "as if half of the depth went into the block: see Young's modulus.");
  for (std::size_t i = 0; i < figures::kBias_mm.size(); ++i) {
    const Spread& study = figures::kBias_mm[i];
    comparison.add(
        fmt::format("flat cylinder at {} mm by the published LUT, less its depth, mm",
                    kDepths_mm[i]),
        fmt::format("{:+.3f} ± {:.3f}", study.median, study.sd), 3,
        [&](const std::string& law) {
          return comparison.over_gels(law, [&](const Result& r) {
            return r.resolutions.empty()
                       ? std::nullopt
                       : Value(r.resolutions[i].cylinder.depth_mm - r.resolutions[i].depth_mm);
          });
        },
        [&](Value v) { return within(v, study); },
        "The LUT of a ball reads a flat face by the light that reaches its middle from beyond "
        "the contact: with the depth the simulator's bias moves more than the study's.");
  }
  comparison.add(
      "the same, the ball's zero not corrected, mean over depths",
      fmt::format("{:+.3f} ({:+.3f} … {:+.3f})", figures::kBiasUncorrected_mm.median,
                  figures::kBiasUncorrected_mm.least, figures::kBiasUncorrected_mm.greatest),
      3,
      [&](const std::string& law) {
        return comparison.over_gels(law, [&](const Result& r) -> Value {
          if (r.resolutions.empty()) return std::nullopt;
          double sum = 0;
          for (const Rung& resolution_index : r.resolutions) {
            sum += resolution_index.cylinder_uncorrected.depth_mm - resolution_index.depth_mm;
          }
          return sum / static_cast<double>(r.resolutions.size());
        });
      },
      [](Value v) { return within(v, figures::kBiasUncorrected_mm); },
      "A LUT whose presses are each called 0.155 mm too shallow loses more in the simulator.");
  comparison.by_gel(
      "width of the flat cylinder at half depth, less 4.00 mm", figures::kCylinderWidth_mm, 2,
      [](const Result& r) {
        return deep_mean(r, [](const Rung& resolution_index) {
          return resolution_index.cylinder.diameter_mm - 4;
        });
      },
      "The wide scattering of a thick gel smears edges evenly: half of the depth stays where "
      "the edge is. The study's units of 3 mm, whose scale it trusts least, read the dent "
      "wider.");
  comparison.by_gel(
      "side of the cube at half depth, less 4.00 mm", figures::kCubeSide_mm, 2,
      [](const Result& r) {
        return deep_mean(
            r, [](const Rung& resolution_index) { return resolution_index.cube.side_mm - 4; });
      },
      "The study's cube reads half a millimetre wider than its cylinder of the same width on the "
      "same units; here both are as wide as they are. It fits a rectangle about the dent's "
      "outline, which leans as the probe does.");
  for (const double gel : figures::kGelThicknesses_mm) {
    const Result* const result = comparison.find(comparison.laws().front(), gel);
    if (result == nullptr || result->resolutions.empty()) continue;
    const auto& study = figures::kBallZero_mm;
    comparison.add(
        fmt::format("where F ∝ d^1.5 puts a ball's zero, mm too deep, gel of {} mm", gel),
        fmt::format("{:.3f} ± {:.3f}", study.median, study.sd), 3,
        [&](const std::string& law) -> Value {
          if (law != comparison.laws().front()) return std::nullopt;
          const std::vector<double> depths = {0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45};
          return hertz_zero_mm(
              depths, force_over_modulus({.thickness_mm = gel}, hal::sim::ball(2), depths));
        },
        [&](Value v) { return within(v, study); },
        "A bonded gel answers a ball more steeply than a half-space, which by itself puts the "
        "zero too deep by this much. The rest is not the gel's: the study's own forces grow "
        "with the power 1.25 to 1.6 of the depth, below what a linear bonded gel can show.");
  }
}

void add_forces(Comparison& comparison) {
  for (const figures::ForceCurve& study : figures::kForces) {
    std::vector<double> depths;
    for (const auto& point : study.points) {
      depths.push_back(point.depth_mm + (study.ball ? figures::kBallZero_mm.median : 0));
    }
    const auto forces =
        force_over_modulus({.thickness_mm = study.thickness_mm},
                           study.ball ? hal::sim::ball(2) : hal::sim::disc(2), depths);
    double least = INFINITY;
    double greatest = 0;
    for (std::size_t i = 0; i < forces.size(); ++i) {
      const double modulus = study.points[i].force_n / forces[i];
      least = std::min(least, modulus);
      greatest = std::max(greatest, modulus);
    }
    Row row{fmt::format("Young's modulus from force at {:.2f} to {:.2f} mm, {}, MPa",
                        depths.front(), depths.back(), study.unit),
            "one value", std::vector<std::string>(comparison.laws().size(), "–"),
            greatest <= 1.25 * least,
            study.ball ? "The force of a real ball grows more slowly with the depth than a linear "
                         "bonded gel's; a zero that is less than 0.155 mm off on this unit, or "
                         "a block that yields, would do that."
                       : "The force of a flat face is linear in depth here by construction."};
    row.simulated.front() = fmt::format("{:.3f} … {:.3f}", least, greatest);
    comparison.add(std::move(row));
  }
}

void add_patch(Comparison& comparison, const std::string& what,
               std::span<const figures::PatchPoint> study, Patch Rung::* which) {
  for (const figures::PatchPoint& point : study) {
    const auto value = [&](double Patch::* member) {
      return [&comparison, &point, which, member](const std::string& law) -> Value {
        const Result* const r = comparison.find(law, 2);
        if (r == nullptr || r->resolutions.empty()) return std::nullopt;
        return between(r->resolutions, point.depth_mm, [&](const Rung& resolution_index) {
          return resolution_index.*which.*member;
        });
      };
    };
    comparison.add(
        fmt::format("{} at {:.2f} mm: radius above 5 levels, mm", what, point.depth_mm),
        fmt::format("{:.2f}", point.radius_mm), 2, value(&Patch::radius_mm),
        [&](Value v) { return v && std::abs(*v / point.radius_mm - 1) <= 0.1; },
        "More than a tenth off: the study's scale is another unit's, and its light reaches "
        "farther.");
    comparison.add(
        "the same: mean there, grey levels", fmt::format("{:.1f}", point.mean), 1,
        value(&Patch::mean), [&](Value v) { return v && std::abs(*v / point.mean - 1) <= 0.25; },
        "More than a quarter off: units differ by two in grey levels a millimetre.");
  }
}

void add_patches(Comparison& comparison) {
  add_patch(comparison, "flat cylinder, hard 2 mm", figures::kCylinderPatch, &Rung::cylinder_patch);
  add_patch(comparison, "ball, soft 2 mm", figures::kBallPatch, &Rung::ball_patch);
}

}  // namespace

std::vector<Row> compare(const std::vector<Result>& results) {
  Comparison comparison(results);
  add_shapes(comparison);
  add_pillars(comparison);
  add_forces(comparison);
  add_patches(comparison);
  return comparison.take();
}

std::string to_markdown(std::span<const Row> rows, std::span<const std::string> laws) {
  std::string out = "| | study |";
  std::string rule = "| --- | --- |";
  for (const std::string& law : laws) {
    out += fmt::format(" {} |", law);
    rule += " --- |";
  }
  out += " agrees | where not |\n" + rule + " --- | --- |\n";
  for (const Row& row : rows) {
    out += fmt::format("| {} | {} |", row.what, row.study);
    for (const std::string& value : row.simulated) out += fmt::format(" {} |", value);
    out += row.agrees ? " yes | |\n" : fmt::format(" no | {} |\n", row.remark);
  }
  return out;
}

}  // namespace dtact::study
