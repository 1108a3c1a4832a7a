#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "daemon/recon/list.hpp"

namespace dtact::chart {

/// Undoing a part of the layer's blur: level + strength · (level − its Gaussian mean), to first
/// order the inverse of a blur that keeps 1 / (1 + strength) of the light and spreads the rest with
/// that width.
struct Sharpening {
  double sigma_mm = 0;
  double strength = 0;
};

/// Sharpens a map of darkening and looks it up. The mean is taken on a grid as coarse as its width
/// allows (a quarter of it) and read bilinearly, as a daemon would.
class Sharpener {
 public:
  Sharpener(int width, int height, double mm_per_px, const Sharpening& sharpening);

  /// `level_q6`, `out`: width × height; recon::kUntrusted stays untrusted, and so does what lies
  /// beyond the list.
  void look_up(std::span<const std::int16_t> level_q6, const recon::DepthList& list,
               std::span<std::int16_t> out_um);
  /// The sharpened darkening itself, Q6; untrusted stays untrusted.
  void sharpen(std::span<const std::int16_t> level_q6, std::span<std::int16_t> out_q6);

 private:
  template <typename Store>
  void run(std::span<const std::int16_t> level_q6, const Store& store);
  void take_mean(std::span<const std::int16_t> level_q6);

  /// Where a fine row or column lies between two coarse ones.
  struct Place {
    int first = 0;
    int second = 0;
    float part = 0;
  };

  int width_;
  int height_;
  int factor_;
  int coarse_width_;
  int coarse_height_;
  float strength_;
  std::vector<float> taps_;     // one side, the middle first
  std::vector<float> coarse_;   // box means
  std::vector<float> between_;  // blurred along rows
  std::vector<float> mean_;     // blurred
  std::vector<float> line_;     // one coarse row at a fine row's height
  std::vector<std::int32_t> sums_;
  std::vector<Place> columns_;
  std::vector<Place> rows_;
};

}  // namespace dtact::chart
