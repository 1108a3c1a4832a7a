#include "tests/accuracy/study/rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>

#include "hal/sim/objects.hpp"
#include "tests/accuracy/study/figures.hpp"
#include "tests/accuracy/study/force.hpp"

namespace dtact::study {
namespace {

using figures::Range;
using figures::Spread;

/// Nothing where a law was not put through that.
using Value = std::optional<double>;

std::string text(Value value, int digits) {
  return value ? fmt::format("{:.{}f}", *value, digits) : "–";
}

bool within(Value value, const Range& range) {
  return value && *value >= range.least && *value <= range.greatest;
}

/// Within two standard deviations of the units.
bool within(Value value, const Spread& spread) {
  return value && std::abs(*value - spread.median) <= 2 * spread.sd;
}

Value median(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// Linear between rungs.
double between(std::span<const Rung> rungs, double depth_mm,
               const std::function<double(const Rung&)>& value) {
  std::size_t i = 1;
  while (i + 1 < rungs.size() && rungs[i].depth_mm < depth_mm) ++i;
  const Rung& a = rungs[i - 1];
  const Rung& b = rungs[i];
  return std::lerp(value(a), value(b), (depth_mm - a.depth_mm) / (b.depth_mm - a.depth_mm));
}

/// Builds the rows; knows which results belong to which law and layer.
class Comparison {
 public:
  explicit Comparison(const std::vector<Result>& results) : results_(results) {
    for (const Result& r : results) {
      if (std::ranges::find(laws_, r.law) == laws_.end()) laws_.push_back(r.law);
    }
  }

  std::vector<Row> rows() {
    shapes();
    pillars();
    forces();
    patches();
    return std::move(rows_);
  }

 private:
  [[nodiscard]] const Result* find(const std::string& law, double thickness_mm) const {
    const auto found = std::ranges::find_if(
        results_, [&](const Result& r) { return r.law == law && r.thickness_mm == thickness_mm; });
    return found == results_.end() ? nullptr : &*found;
  }

  /// A row whose figure is `value` of a law.
  void add(const std::string& what, const std::string& study, int digits,
           const std::function<Value(const std::string&)>& value,
           const std::function<bool(Value)>& agrees, const std::string& remark) {
    Row row{what, study, {}, agrees(value(laws_.front())), remark};
    for (const std::string& law : laws_) row.simulated.push_back(text(value(law), digits));
    rows_.push_back(std::move(row));
  }

  /// One row a layer.
  void by_layer(const std::string& what, std::span<const Range> study, int digits,
                const std::function<Value(const Result&)>& value, const std::string& remark) {
    for (std::size_t i = 0; i < study.size(); ++i) {
      const double layer = figures::kLayers_mm[i];
      add(
          fmt::format("{}, layer of {} mm", what, layer),
          fmt::format("{:.{}f} ({:.{}f} … {:.{}f})", study[i].median, digits, study[i].least,
                      digits, study[i].greatest, digits),
          digits,
          [&](const std::string& law) {
            const Result* const result = find(law, layer);
            return result == nullptr ? std::nullopt : value(*result);
          },
          [&](Value v) { return within(v, study[i]); }, remark);
    }
  }

  /// Mean over the layers.
  [[nodiscard]] Value over_layers(const std::string& law,
                                  const std::function<Value(const Result&)>& value) const {
    double sum = 0;
    int count = 0;
    for (const double layer : figures::kLayers_mm) {
      const Result* const result = find(law, layer);
      const Value v = result == nullptr ? std::nullopt : value(*result);
      if (!v) continue;
      sum += *v;
      ++count;
    }
    return count > 0 ? Value(sum / count) : std::nullopt;
  }

  static Value deep_mean(const Result& result, const std::function<double(const Rung&)>& value) {
    double sum = 0;
    int count = 0;
    for (const Rung& rung : result.rungs) {
      if (rung.depth_mm < 0.35) continue;  // where the study judges sizes
      sum += value(rung);
      ++count;
    }
    return count > 0 ? Value(sum / count) : std::nullopt;
  }

  void shapes() {
    by_layer(
        "micrometres a grey level", figures::kUmPerLevel, 0,
        [](const Result& r) {
          return r.rungs.empty() ? std::nullopt : Value(1000 * r.mm_per_level);
        },
        "The simulator's block does not give way, so that a press takes twice the share of a layer "
        "of "
        "1 mm. The study's units of 1 mm darken like those of 3 mm, and are as soft under a flat "
        "face "
        "as if half of the depth went into the block: see Young's modulus.");
    for (std::size_t i = 0; i < figures::kBias_mm.size(); ++i) {
      const Spread& study = figures::kBias_mm[i];
      add(
          fmt::format("flat cylinder at {} mm by the published list, less its depth, mm",
                      kDepths_mm[i]),
          fmt::format("{:+.3f} ± {:.3f}", study.median, study.sd), 3,
          [&](const std::string& law) {
            return over_layers(law, [&](const Result& r) {
              return r.rungs.empty() ? std::nullopt
                                     : Value(r.rungs[i].cylinder.depth_mm - r.rungs[i].depth_mm);
            });
          },
          [&](Value v) { return within(v, study); },
          "The list of a ball reads a flat face by the light that reaches its middle from beyond "
          "the contact: with the depth the simulator's bias moves more than the study's.");
    }
    add(
        "the same, the ball's zero not corrected, mean over depths",
        fmt::format("{:+.3f} ({:+.3f} … {:+.3f})", figures::kBiasUncorrected_mm.median,
                    figures::kBiasUncorrected_mm.least, figures::kBiasUncorrected_mm.greatest),
        3,
        [&](const std::string& law) {
          return over_layers(law, [&](const Result& r) -> Value {
            if (r.rungs.empty()) return std::nullopt;
            double sum = 0;
            for (const Rung& rung : r.rungs) {
              sum += rung.cylinder_uncorrected.depth_mm - rung.depth_mm;
            }
            return sum / static_cast<double>(r.rungs.size());
          });
        },
        [](Value v) { return within(v, figures::kBiasUncorrected_mm); },
        "A list whose presses are each called 0.155 mm too shallow loses more in the simulator.");
    by_layer(
        "width of the flat cylinder at half depth, less 4.00 mm", figures::kCylinderWidth_mm, 2,
        [](const Result& r) {
          return deep_mean(r, [](const Rung& rung) { return rung.cylinder.diameter_mm - 4; });
        },
        "The wide scattering of a thick layer smears edges evenly: half of the depth stays where "
        "the edge is. The study's units of 3 mm, whose scale it trusts least, read the dent "
        "wider.");
    by_layer(
        "side of the cube at half depth, less 4.00 mm", figures::kCubeSide_mm, 2,
        [](const Result& r) {
          return deep_mean(r, [](const Rung& rung) { return rung.cube.side_mm - 4; });
        },
        "The study's cube reads half a millimetre wider than its cylinder of the same width on the "
        "same units; here both are as wide as they are. It fits a rectangle about the dent's "
        "outline, which leans as the probe does.");
    for (const double layer : figures::kLayers_mm) {
      const Result* const result = find(laws_.front(), layer);
      if (result == nullptr || result->rungs.empty()) continue;
      const auto& study = figures::kBallZero_mm;
      add(
          fmt::format("where F ∝ d^1.5 puts a ball's zero, mm too deep, layer of {} mm", layer),
          fmt::format("{:.3f} ± {:.3f}", study.median, study.sd), 3,
          [&](const std::string& law) -> Value {
            if (law != laws_.front()) return std::nullopt;
            const std::vector<double> depths = {0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45};
            return hertz_zero_mm(
                depths, force_over_modulus({.thickness_mm = layer}, hal::sim::ball(2), depths));
          },
          [&](Value v) { return within(v, study); },
          "A bonded layer answers a ball more steeply than a half-space, which by itself puts the "
          "zero too deep by this much. The rest is not the layer's: the study's own forces grow "
          "with the power 1.25 to 1.6 of the depth, below what a linear bonded layer can show.");
    }
  }

  [[nodiscard]] Value dip(const Result& result, double spacing_mm, double tilt_deg, double depth_mm,
                          const std::function<double(const PillarPress&)>& value) const {
    for (const PillarPress& p : result.pillars) {
      if (p.spacing_mm == spacing_mm && p.tilt_deg == tilt_deg && p.depth_mm == depth_mm) {
        if (p.seen.peak <= 0) break;  // too faint to be found: the study leaves those out, too
        return value(p);
      }
    }
    return std::nullopt;
  }

  static constexpr const char* kUprightRemark =
      "Upright pillars stay apart too well. The study's own lean (see the weaker peak over the "
      "stronger), and the rows for 1 and 2 degrees lie on either side of it. On a bonded layer of "
      "1 "
      "mm the ground between them also bulges until it is brighter than the untouched image, which "
      "the study's layers do not: see Young's modulus.";
  static constexpr const char* kLeaningRemark =
      "By the weaker peak over the stronger, units of 2 mm lean by about 1 degree, the others by 2 "
      "and more; and they scatter farther than sensor_a.";
  static constexpr const char* kSymmetryRemark =
      "Units of 2 mm lean by about 1 degree, those of 1 and 3 mm by more than 2, or their posts "
      "differ in length, on which the study puts a quarter of it.";

  void pillars() {
    for (const double tilt : {1.0, 2.0}) {
      by_layer(
          fmt::format("pillars {}: weaker peak over stronger", leaning(tilt)), figures::kSymmetry,
          2,
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
      by_layer(
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
        add(
            fmt::format("pillars {}, {:.2f} mm apart: median dip, 0.1 to 0.3 mm deep",
                        leaning(tilt), study.spacing_mm),
            fmt::format("{:.2f}", study.dip), 2,
            [&](const std::string& law) { return shallow_dip(law, study.spacing_mm, tilt); },
            [&](Value v) { return v && std::abs(*v - study.dip) <= 0.1; },
            tilt == 0 ? kUprightRemark : kLeaningRemark);
      }
    }
    for (const auto& study : figures::kNearestDips) {
      const auto on_2mm = [&](const std::function<double(const PillarPress&)>& value) {
        return [this, &study, value](const std::string& law) {
          const Result* const r = find(law, 2);
          return r == nullptr ? std::nullopt : dip(*r, 1.10, 0, study.depth_mm, value);
        };
      };
      add(
          fmt::format("pillars 1.10 mm apart, {} mm deep, layer of 2 mm: dip", study.depth_mm),
          fmt::format("{:.2f}", study.dip), 2,
          on_2mm([](const PillarPress& p) { return p.seen.dip; }),
          [&](Value v) { return v && std::abs(*v - study.dip) <= 0.1; },
          "At 0.1 mm the dip is the noise's, which greatest and least of a profile make out of "
          "three grey levels, in the study (it says so) and here.");
      add(
          fmt::format("the same: weaker peak, grey levels"), fmt::format("{:.1f}", study.peak), 1,
          on_2mm([](const PillarPress& p) { return p.seen.peak; }),
          [&](Value v) { return v && std::abs(*v / study.peak - 1) <= 0.25; },
          "More than a quarter off: units differ by two in grey levels a millimetre.");
    }
    for (const auto& study : figures::kAveragedDips) {
      by_layer(
          fmt::format("upright pillars {:.2f} mm apart, {} mm deep, noise averaged away: dip",
                      study.spacing_mm, study.depth_mm),
          study.by_layer, 2,
          [&](const Result& r) {
            const Value peak =
                dip(r, study.spacing_mm, 0, study.depth_mm,
                    [](const PillarPress& p) { return p.averaged.value_or(Pillars{}).peak; });
            if (!peak || *peak <= 0) return Value();
            return dip(r, study.spacing_mm, 0, study.depth_mm,
                       [](const PillarPress& p) { return p.averaged.value_or(Pillars{}).dip; });
          },
          "Neither lean nor noise does that where the peaks are high: these units scatter farther "
          "than sensor_a, whose light the built-in simulator has. On 1 mm see Young's modulus, "
          "too: "
          "a layer that is squeezed less bulges less between the pillars.");
    }
  }

  /// Median over layers and the depths 0.1, 0.2 and 0.3 mm.
  [[nodiscard]] Value shallow_dip(const std::string& law, double spacing_mm,
                                  double tilt_deg) const {
    std::vector<double> dips;
    for (const double layer : figures::kLayers_mm) {
      const Result* const r = find(law, layer);
      for (const double depth : {0.1, 0.2, 0.3}) {
        if (r == nullptr) continue;
        const Value v =
            dip(*r, spacing_mm, tilt_deg, depth, [](const PillarPress& p) { return p.seen.dip; });
        if (v) dips.push_back(*v);
      }
    }
    return median(dips);
  }

  static std::string leaning(double tilt_deg) {
    return tilt_deg == 0 ? "upright" : fmt::format("leaning by {}°", tilt_deg);
  }

  void forces() {
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
              "one value", std::vector<std::string>(laws_.size(), "–"), greatest <= 1.25 * least,
              study.ball
                  ? "The force of a real ball grows more slowly with the depth than a linear "
                    "bonded layer's; a zero that is less than 0.155 mm off on this unit, or "
                    "a block that gives way, would do that."
                  : "The force of a flat face is linear in depth here by construction."};
      row.simulated.front() = fmt::format("{:.3f} … {:.3f}", least, greatest);
      rows_.push_back(std::move(row));
    }
  }

  void patch(const std::string& what, std::span<const figures::PatchPoint> study,
             Patch Rung::* which) {
    for (const figures::PatchPoint& point : study) {
      const auto value = [&](double Patch::* member) {
        return [this, &point, which, member](const std::string& law) -> Value {
          const Result* const r = find(law, 2);
          if (r == nullptr || r->rungs.empty()) return std::nullopt;
          return between(r->rungs, point.depth_mm,
                         [&](const Rung& rung) { return rung.*which.*member; });
        };
      };
      add(
          fmt::format("{} at {:.2f} mm: radius above 5 levels, mm", what, point.depth_mm),
          fmt::format("{:.2f}", point.radius_mm), 2, value(&Patch::radius_mm),
          [&](Value v) { return v && std::abs(*v / point.radius_mm - 1) <= 0.1; },
          "More than a tenth off: the study's scale is another unit's, and its light reaches "
          "farther.");
      add(
          "the same: mean there, grey levels", fmt::format("{:.1f}", point.mean), 1,
          value(&Patch::mean), [&](Value v) { return v && std::abs(*v / point.mean - 1) <= 0.25; },
          "More than a quarter off: units differ by two in grey levels a millimetre.");
    }
  }

  void patches() {
    patch("flat cylinder, hard 2 mm", figures::kCylinderPatch, &Rung::cylinder_patch);
    patch("ball, soft 2 mm", figures::kBallPatch, &Rung::ball_patch);
  }

  const std::vector<Result>& results_;
  std::vector<std::string> laws_;
  std::vector<Row> rows_;
};

}  // namespace

std::vector<Row> compare(const std::vector<Result>& results) { return Comparison(results).rows(); }

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
