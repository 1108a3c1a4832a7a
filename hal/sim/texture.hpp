#pragma once

#include "hal/sim/grid.hpp"

namespace dtact::hal::sim {

/// What a real layer shows untouched beside smooth light: bubbles, dust under the paint, old dents.
/// Random numbers on a lattice, joined by cubic B-splines; always the same ones, for they belong to
/// the sensor. Immutable.
class Texture {
 public:
  /// `rms`: share of the light; `size_mm`: the lattice's pitch, about the width of a mark.
  Texture(double rms, double size_mm) noexcept;

  /// Share of the light by which this place is brighter (or, negative, darker).
  [[nodiscard]] double at(const Place& place) const noexcept;

 private:
  double scale_;
  double size_mm_;
};

}  // namespace dtact::hal::sim
