#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/pipeline/reference/luma_grid.hpp"

namespace dtact::pipeline {

/// Light now over light then, for each cell.
using LightField = std::array<float, kGridCells>;

/// What two images of one sensor differ in, once smooth light is taken out.
struct ContactVerdict {
  /// The deepest local darkening: that of the second darkest cell, as a share of the light that
  /// the fit expects there. A press of 1 mm gives about 0.19 (31 grey levels of 161, sensor_a); two
  /// references of one sensor, taken apart, at most 0.006 (sensors a and b). The second darkest, so
  /// that a single odd cell is not taken for contact.
  float darkening = 0;
  /// Share of the cells that the fit explains to within 1 %. Low where most of the field changed.
  float explained = 0;
};

/// Distinguishes a press from a light change, without depth. Light and drift multiply the image by
/// a smooth, wide field; a press darkens a compact spot and brightens the ring around it.
/// The field is a polynomial, fitted with weights that fall off for cells that disagree
/// (Geman–McClure), so that a press does not pull it far.
class ContactCheck {
 public:
  ContactCheck();

  /// Degrees of the field. A dimmed ring and drift need one number. Another set of LEDs needs a
  /// shape, which also bends a little towards the contact: on the simulated sensor, under a ball
  /// pressed 1 mm, by up to 3 % or 0.15 mm.
  static constexpr int kSameShape = 0;
  static constexpr int kAnyShape = 4;

  /// Compares within `region` only (the calibrated part: beyond it may lie the housing). `field`
  /// receives the fitted light for all cells, 1/16 … 16. Takes up to half a millisecond and does
  /// not allocate.
  [[nodiscard]] ContactVerdict compare(const LumaGrid& then, const LumaGrid& now,
                                       const CellRegion& region, int degree,
                                       LightField& field) noexcept;

 private:
  static constexpr int kTerms = 15;
  using Terms = std::array<double, kTerms>;

  [[nodiscard]] Terms solve(const LumaGrid& then, const LumaGrid& now, const CellRegion& region,
                            int count) const noexcept;
  void reweigh(const LumaGrid& then, const LumaGrid& now, const CellRegion& region,
               const Terms& terms) noexcept;

  std::vector<Terms> basis_;  // of each cell
  std::array<double, kGridCells> weight_{};
  std::array<float, kGridCells> scratch_{};
};

/// `then` brought to the light of now: each pixel times the field, bilinear between cell centres,
/// rounded and saturated. All Q8 luma, width × height.
void relight(std::span<const std::uint16_t> then, int width, int height, const LightField& field,
             std::span<std::uint16_t> out) noexcept;

}  // namespace dtact::pipeline
