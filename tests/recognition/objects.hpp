#pragma once

#include <array>
#include <string>
#include <vector>

#include "hal/sim/objects.hpp"
#include "tests/accuracy/whole/random_draw.hpp"

namespace dtact::recognition {

/// Kinds of objects: first the twelve classes of the paper, then families of other shapes.
inline constexpr int kClasses = 12;
[[nodiscard]] const std::vector<std::string>& kinds();

/// One side of an object, drawn at random. Kind and variant fix the object and its dimensions;
/// `press` draws the side that is pressed in.
[[nodiscard]] hal::sim::Object draw_object(int kind, int variant, whole::Draw& press);

/// The same of a family of other shapes, counted from 0; `d` draws its dimensions.
[[nodiscard]] hal::sim::Object other_shape(int family, whole::Draw& d, whole::Draw& press);

/// An object's place on the gel: x and y from the gel's centre, mm; turned by `rotation`, radians;
/// slopes of its tilt.
struct Placing {
  double x_mm = 0;
  double y_mm = 0;
  double rotation = 0;
  double slope_x = 0;
  double slope_y = 0;
};
/// The object's lower side in the gel's frame, with its lowest point on the gel at zero. The
/// tilt is a shear: exact to first order. The gel ends half_width_mm and half_height_mm from its
/// centre.
[[nodiscard]] hal::sim::Object placed(const hal::sim::Object& object, const Placing& placing,
                                      double half_width_mm, double half_height_mm);

}  // namespace dtact::recognition
