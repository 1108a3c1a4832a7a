#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "tests/accuracy/study/comparison.hpp"
#include "tests/accuracy/study/median.hpp"

namespace dtact::study {
namespace {

Value dip(const Result& result, double spacing_mm, double tilt_deg, double depth_mm,
          const std::function<double(const PillarPress&)>& value) {
  for (const PillarPress& p : result.pillars) {
    if (p.spacing_mm == spacing_mm && p.tilt_deg == tilt_deg && p.depth_mm == depth_mm) {
      if (p.seen.peak <= 0) break;  // too faint to be found: the study skips these, too
      return value(p);
    }
  }
  return std::nullopt;
}

/// Median over gels and the depths 0.1, 0.2 and 0.3 mm.
Value shallow_dip(const Comparison& comparison, const std::string& law, double spacing_mm,
                  double tilt_deg) {
  std::vector<double> dips;
  for (const double gel : figures::kGelThicknesses_mm) {
    const Result* const r = comparison.find(law, gel);
    for (const double depth : {0.1, 0.2, 0.3}) {
      if (r == nullptr) continue;
      const Value v =
          dip(*r, spacing_mm, tilt_deg, depth, [](const PillarPress& p) { return p.seen.dip; });
      if (v) dips.push_back(*v);
    }
  }
  return median(dips);
}

std::string leaning(double tilt_deg) {
  return tilt_deg == 0 ? "upright" : fmt::format("leaning by {}°", tilt_deg);
}

constexpr const char* kUprightRemark =
    "Upright pillars stay apart too well. The study's own lean (see the weaker peak over the "
    "stronger), and the rows for 1 and 2 degrees lie on either side of it. On a bonded gel of "
    "1 "
    "mm the ground between them also bulges until it is brighter than the reference image, which "
    "the study's gels do not: see Young's modulus.";
constexpr const char* kLeaningRemark =
    "By the weaker peak over the stronger, units of 2 mm lean by about 1 degree, the others by 2 "
    "and more; and they scatter farther than sensor_a.";
constexpr const char* kSymmetryRemark =
    "Units of 2 mm lean by about 1 degree, those of 1 and 3 mm by more than 2, or their posts "
    "differ in length, on which the study puts a quarter of it.";

}  // namespace

void add_pillars(Comparison& comparison) {
  for (const double tilt : {1.0, 2.0}) {
    comparison.by_gel(
        fmt::format("pillars {}: weaker peak over stronger", leaning(tilt)), figures::kSymmetry, 2,
        [&](const Result& r) {
          std::vector<double> ratios;
          for (const PillarPress& p : r.pillars) {
            if (p.tilt_deg == tilt && p.seen.peak > 0) ratios.push_back(p.seen.symmetry);
          }
          return median(ratios);
        },
        kSymmetryRemark);
  }
  for (const double tilt : {0.0, 1.0, 2.0}) {
    comparison.by_gel(
        fmt::format("pillars {}: spacings resolved of four", leaning(tilt)),
        figures::kResolvedOfFour, 1,
        [&](const Result& r) -> Value {
          if (!dip(r, 2.0, tilt, 0.3, [](const PillarPress&) { return 0.0; })) {
            return std::nullopt;
          }
          return r.resolved_of_four(tilt);
        },
        tilt == 0 ? kUprightRemark : kLeaningRemark);
  }
  for (const double tilt : {0.0, 1.0, 2.0}) {
    for (const auto& study : figures::kDips) {
      comparison.add(
          fmt::format("pillars {}, {:.2f} mm apart: median dip, 0.1 to 0.3 mm deep", leaning(tilt),
                      study.spacing_mm),
          fmt::format("{:.2f}", study.dip), 2,
          [&](const std::string& law) {
            return shallow_dip(comparison, law, study.spacing_mm, tilt);
          },
          [&](Value v) { return v && std::abs(*v - study.dip) <= 0.1; },
          tilt == 0 ? kUprightRemark : kLeaningRemark);
    }
  }
  for (const auto& study : figures::kNearestDips) {
    const auto on_2mm = [&](const std::function<double(const PillarPress&)>& value) {
      return [&comparison, &study, value](const std::string& law) {
        const Result* const r = comparison.find(law, 2);
        return r == nullptr ? std::nullopt : dip(*r, 1.10, 0, study.depth_mm, value);
      };
    };
    comparison.add(
        fmt::format("pillars 1.10 mm apart, {} mm deep, gel of 2 mm: dip", study.depth_mm),
        fmt::format("{:.2f}", study.dip), 2,
        on_2mm([](const PillarPress& p) { return p.seen.dip; }),
        [&](Value v) { return v && std::abs(*v - study.dip) <= 0.1; },
        "At 0.1 mm the dip is the noise's, which greatest and least of a profile make out of "
        "three grey levels, in the study (it says so) and here.");
    comparison.add(
        fmt::format("the same: weaker peak, grey levels"), fmt::format("{:.1f}", study.peak), 1,
        on_2mm([](const PillarPress& p) { return p.seen.peak; }),
        [&](Value v) { return v && std::abs(*v / study.peak - 1) <= 0.25; },
        "More than a quarter off: units differ by two in grey levels a millimetre.");
  }
  for (const auto& study : figures::kAveragedDips) {
    comparison.by_gel(
        fmt::format("upright pillars {:.2f} mm apart, {} mm deep, noise averaged away: dip",
                    study.spacing_mm, study.depth_mm),
        study.by_gel, 2,
        [&](const Result& r) {
          const Value peak = dip(r, study.spacing_mm, 0, study.depth_mm, [](const PillarPress& p) {
            return p.averaged.value_or(Pillars{}).peak;
          });
          if (!peak || *peak <= 0) return Value();
          return dip(r, study.spacing_mm, 0, study.depth_mm,
                     [](const PillarPress& p) { return p.averaged.value_or(Pillars{}).dip; });
        },
        "Neither lean nor noise does that where the peaks are high: these units scatter farther "
        "than sensor_a, whose light the built-in simulator has. On 1 mm see Young's modulus, "
        "too: "
        "a gel that is squeezed less bulges less between the pillars.");
  }
}

}  // namespace dtact::study
