#pragma once

#include <vector>

#include "daemon/recon/depth_lut.hpp"
#include "hal/files/png.hpp"

namespace dtact::calibration {

/// A circle in pixels.
struct Circle {
  double col = 0;
  double row = 0;
  double radius = 0;
};

struct Pixel {
  int col = 0;
  int row = 0;
};

/// The smallest circle that holds all points (Welzl 1991, without the recursion). No points: empty.
[[nodiscard]] Circle enclosing_circle(std::vector<Pixel> points);

/// The contact in the published method: the smallest circle about the largest patch of
/// pixels darker than the reference by more than 3 grey levels, centre and radius cut to whole
/// pixels; radius 0 without a patch. `reference`, `ball`: the depth map's part of the images.
[[nodiscard]] Circle published_circle(const image::Grey8& reference, const image::Grey8& ball);

/// The LUT of a table as the authors keep it (Pixel_to_Depth.npy): the depth of each whole
/// difference from 0 on, millimetres, not empty. At run time the entry at the threshold of 2 grey
/// levels is subtracted from all and nothing is below zero; both are done here once. The LUT has 64
/// equal entries for each level.
[[nodiscard]] recon::DepthLut published_lut(const std::vector<double>& depth_mm);

/// The single-image LUT as published, with its weaknesses, for comparison:
///
/// - The difference is unsigned: a pixel brighter than the reference counts as 0.
/// - The contact is published_circle(); the indentation at its edge is zeroed.
/// - An entry is the mean depth of the circle's pixels with exactly that difference. Without pixels
///   the entry is interpolated. (The authors average three colour channels and keep the third
///   of the pixels whose mean is whole; luma is whole everywhere.)
/// - What happens at run time is done here once: published_lut().
///
/// `reference`, `ball`: the depth map's part of the images. Throws std::runtime_error when nothing
/// is darker than the threshold or the ball is smaller than the circle.
[[nodiscard]] recon::DepthLut fit_published(const image::Grey8& reference, const image::Grey8& ball,
                                            double ball_radius_mm, double mm_per_px);

}  // namespace dtact::calibration
