#pragma once

#include <array>

/// Figures of the study about 17 real sensors with gels of 1, 2 and 3 mm: the public repository
/// hqhan03/VBTS_test, docs/shape_reconstruction.md, docs/spatial_resolution.md and result/, figures
/// only. Nothing in the simulator or in a method is tuned on them.
namespace dtact::study::figures {

inline constexpr std::array<double, 3> kGelThicknesses_mm = {1, 2, 3};

/// Median, least and greatest of the units.
struct Range {
  double median = 0;
  double least = 0;
  double greatest = 0;
};

/// By gel. Widths and sides: units with a scale of their own, error against 4.00 mm at 0.4 mm and
/// deeper.
inline constexpr std::array<Range, 3> kUmPerLevel = {{{53.5, 40, 64}, {38, 31, 46}, {55, 40, 64}}};
inline constexpr std::array<Range, 3> kCylinderWidth_mm = {
    {{0.11, -0.16, 0.28}, {-0.07, -0.07, 0.26}, {0.96, 0.74, 1.17}}};
inline constexpr std::array<Range, 3> kCubeSide_mm = {
    {{0.43, 0.10, 0.98}, {0.44, 0.18, 0.71}, {1.42, 1.08, 1.75}}};

/// A median over units and their standard deviation.
struct Spread {
  double median = 0;
  double sd = 0;
};
/// Bias on the flat cylinder at 0.1 … 0.6 mm, mm; with the ball's zero corrected.
inline constexpr std::array<Spread, 6> kBias_mm = {{{-0.072, 0.027},
                                                    {-0.073, 0.034},
                                                    {-0.031, 0.045},
                                                    {-0.012, 0.052},
                                                    {-0.028, 0.056},
                                                    {-0.090, 0.067}}};
/// Over all six depths, with the zero not corrected.
inline constexpr Range kBiasUncorrected_mm = {-0.107, -0.170, -0.045};
/// Depth below the surface at which F ∝ d^1.5 puts a ball's first contact.
inline constexpr Spread kBallZero_mm = {0.155, 0.029};

/// How many of the spacings 1.25, 1.5, 1.75 and 2 mm a unit resolves, by gel: mean over units.
inline constexpr std::array<Range, 3> kResolvedOfFour = {{{1.83, 0, 3}, {3.0, 2, 4}, {0.67, 0, 2}}};
/// The weaker peak over the stronger, by gel: median over a unit's presses. It shows how far the
/// study's pillars lean.
inline constexpr std::array<Range, 3> kSymmetry = {
    {{0.73, 0.53, 0.84}, {0.89, 0.74, 0.91}, {0.64, 0.57, 0.74}}};
/// Median dip over units and the depths 0.1, 0.2 and 0.3 mm.
struct DipBySpacing {
  double spacing_mm = 0;
  double dip = 0;
};
inline constexpr std::array<DipBySpacing, 4> kDips = {
    {{1.25, 0.208}, {1.5, 0.230}, {1.75, 0.289}, {2.0, 0.384}}};
/// 1.10 mm apart, eight units: medians.
struct DipByDepth {
  double depth_mm = 0;
  double dip = 0;
  double peak = 0;
};
inline constexpr std::array<DipByDepth, 4> kNearestDips = {
    {{0.1, 0.391, 2.99}, {0.2, 0.178, 4.44}, {0.3, 0.121, 7.96}, {0.6, 0.044, 16.0}}};
/// On 3 × 3 pixels averaged, where noise no longer makes dips, of units whose weaker peak is high
/// result/extra/data/resolution_sweep_9DTact_pair*.csv at 640 pixels. One to three units a gel:
/// at least 0.05 either way, which one reading of a dip scatters by.
struct AveragedDips {
  double spacing_mm = 0;
  double depth_mm = 0;
  std::array<Range, 3> by_gel;
};
inline constexpr std::array<AveragedDips, 2> kAveragedDips = {
    {{2.0, 0.3, {{{0.56, 0.51, 0.59}, {0.49, 0.44, 0.54}, {0.34, 0.29, 0.39}}}},
     {2.5, 0.6, {{{0.69, 0.64, 0.74}, {0.58, 0.53, 0.63}, {0.62, 0.57, 0.67}}}}}};

/// Depth (for a ball: above its zero), force, and the patch darker than 5 grey levels: radius and
/// mean.
struct ForcePoint {
  double depth_mm = 0;
  double force_n = 0;
};
struct ForceCurve {
  const char* unit = nullptr;
  double thickness_mm = 0;
  bool ball = false;
  std::array<ForcePoint, 5> points;
};
inline constexpr std::array<ForceCurve, 5> kForces = {{
    {"soft 1 mm, flat cylinder",
     1,
     false,
     {{{0.174, 0.353}, {0.275, 0.553}, {0.379, 0.767}, {0.476, 0.999}, {0.579, 1.197}}}},
    {"hard 2 mm, flat cylinder",
     2,
     false,
     {{{0.173, 0.598}, {0.279, 0.973}, {0.376, 1.323}, {0.476, 1.667}, {0.577, 2.071}}}},
    {"medium 1 mm, ball",
     1,
     true,
     {{{0.176, 0.140}, {0.283, 0.220}, {0.380, 0.301}, {0.486, 0.382}, {0.585, 0.487}}}},
    {"soft 2 mm, ball",
     2,
     true,
     {{{0.178, 0.068}, {0.282, 0.138}, {0.382, 0.146}, {0.486, 0.215}, {0.591, 0.304}}}},
    {"hard 3 mm, ball",
     3,
     true,
     {{{0.180, 0.104}, {0.283, 0.244}, {0.383, 0.375}, {0.479, 0.540}, {0.579, 0.678}}}},
}};

struct PatchPoint {
  double depth_mm = 0;
  double radius_mm = 0;
  double mean = 0;
};
/// Hard 2 mm r2 under the flat cylinder (89.0 pixels a millimetre, its twin's) and soft 2 mm r1
/// under the ball (88.7).
inline constexpr std::array<PatchPoint, 4> kCylinderPatch = {
    {{0.279, 2.09, 9.3}, {0.376, 2.33, 11.5}, {0.476, 2.47, 13.2}, {0.577, 2.60, 15.0}}};
inline constexpr std::array<PatchPoint, 4> kBallPatch = {
    {{0.282, 0.88, 8.7}, {0.382, 1.13, 9.8}, {0.486, 1.31, 11.2}, {0.591, 1.45, 12.7}}};

}  // namespace dtact::study::figures
