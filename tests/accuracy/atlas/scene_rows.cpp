#include <functional>

#include "tests/accuracy/atlas/rows.hpp"
#include "tests/accuracy/atlas/scripts.hpp"

namespace dtact::atlas {
namespace {

/// The object at the swept depth or size, under a clean image.
std::function<Script(double)> object(const std::function<Pose(double)>& pose) {
  return [pose](double value) { return press(solve({pose(value)}), value, {}); };
}

}  // namespace

// NOLINTBEGIN(clang-analyzer-cplusplus.NewDeleteLeaks): the rows' functions are copied from a LUT
// of temporaries, whose destructors the analyser does not follow
std::vector<Row> scene_rows() {
  return {
      {"scene",
       "deep",
       "pressed deeper than the LUT, and than the gel",
       "mm",
       {1.0, 1.2, 1.4, 1.5, 1.6, 1.7, 1.79},
       object([](double depth) { return Pose{hal::sim::ball(5), 2, -1, depth}; }),
       ""},
      {"scene",
       "full_field",
       "a flat disc until no border is free",
       "radius, mm",
       {3, 4, 6, 8, 10, 12, 14, 16},
       object([](double radius) { return Pose{hal::sim::disc(radius), 0, 0, 0.5}; }),
       "a press of the whole field darkens it as a dimmer light does"},
      {"scene",
       "texture",
       "grooves 0.4 mm deep under a plate",
       "pitch, mm",
       {4, 3, 2, 1.5, 1, 0.6},
       object([](double pitch) { return Pose{hal::sim::grating(pitch, 0.4, 6), 0, 0, 0.6}; }),
       "what the gel's scattering has blurred away is not in the image"},
      {"scene",
       "walls",
       "a cube's steep walls",
       "depth, mm",
       {0.2, 0.4, 0.6, 0.8, 1.0, 1.2},
       object([](double depth) { return Pose{hal::sim::cube(6), 1, 1, depth}; }),
       "sloping walls make the same image, as for the texture"},
      {"scene",
       "bulge",
       "a large bulge round a long object",
       "depth, mm",
       {0.2, 0.5, 0.8, 1.1, 1.4, 1.6},
       object([](double depth) { return Pose{hal::sim::cylinder(6, 12), 0, 0, depth}; }),
       ""},
  };
}
// NOLINTEND(clang-analyzer-cplusplus.NewDeleteLeaks)

}  // namespace dtact::atlas
