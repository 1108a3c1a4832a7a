#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "hal/sim/scene.hpp"

namespace dtact::whole {

/// A rigid object and its first pose in contact.
struct MovingObject {
  const char* name;   ///< Name in a file's name.
  const char* lines;  ///< Lines of a scene's press: its shape.
  double depth_mm;    ///< Depth at the beginning of the motions.
  double start_deg;   ///< Rotation there.
};
inline constexpr std::array kMovingObjects{
    MovingObject{"m3_long_nut", "object = \"m3_long_nut\"", 0.7, 23},
    MovingObject{"cube", "object = \"cube\"\nside_mm = 5.0", 0.6, 17},
    MovingObject{"star", "object = \"star\"\nradius_mm = 4.0", 0.6, 31},
    MovingObject{"usb_c_plug", "object = \"usb_c_plug\"", 0.7, -14},
    MovingObject{"key", "object = \"key\"", 0.6, 37},
    MovingObject{"cylinder", "object = \"cylinder\"\nradius_mm = 2.5\nlength_mm = 8.0", 0.8, 13},
    MovingObject{"m4_nut", "object = \"m4_nut\"", 0.7, 19},
    MovingObject{"ball", "object = \"ball\"\nradius_mm = 4.0", 0.9, 41},
    MovingObject{"ball_array",
                 "object = \"ball_array\"\nradius_mm = 1.5\npitch_mm = 4.0\nrows = 2\ncolumns = 3",
                 0.7, 11},
    MovingObject{"disc", "object = \"disc\"\nradius_mm = 4.0", 0.5, 29},
    MovingObject{"grating", "object = \"grating\"\npitch_mm = 2.0\ngroove_mm = 1.0\nside_mm = 8.0",
                 0.6, 16},
    MovingObject{"pin_board", "object = \"pin_board\"", 0.6, 7},
    MovingObject{"m5_hexagon_screw", "object = \"m5_hexagon_screw\"", 0.8, 33},
    MovingObject{"three_set_screws", "object = \"three_set_screws\"", 0.7, -21},
    MovingObject{"screw_cap", "object = \"screw_cap\"", 0.6, 5},
};

/// A motion from that pose.
struct ObjectMotion {
  const char* name;
  double seconds;
  /// How far each value has moved at a part, 0 … 1, of that time; `time_s` is not set.
  hal::sim::PressKey (*moved)(double part);
};

/// Motions of every object: turn by 60°, slide by 4 mm, roll by 15°, be pressed 0.3 mm deeper; and
/// all of it at once.
[[nodiscard]] std::span<const ObjectMotion> common_motions();
/// `minute`: a loop of twelve seconds, five times, back to its beginning. `drag`: the object
/// sticks, drags the gel along by 0.3 mm, slips and slides on; then the same backwards.
[[nodiscard]] std::span<const ObjectMotion> long_motions();

/// The camera frames of a choreography that belong to one motion.
struct MotionFrames {
  std::uint64_t first = 0;   ///< The object is above the surface and begins to come down.
  std::uint64_t motion = 0;  ///< The last one before it moves, pressed in and at rest.
  std::uint64_t end = 0;     ///< The first one in which it rests again, moved.
  std::uint64_t last = 0;    ///< The last one before it is lifted.
};

/// Frames before the first object: enough for the reference.
inline constexpr std::uint64_t kReferenceFrames = 60;

/// Gives `scene`, which has one press with any keys, a press for each of `motions`, one after the
/// other: the object comes from above within a second, rests for a tenth of a second, moves, rests,
/// and is lifted. It has a key in every frame, so that each is solved by itself.
[[nodiscard]] std::vector<MotionFrames> choreograph(const MovingObject& object,
                                                    std::span<const ObjectMotion> motions,
                                                    hal::sim::Scene& scene);

}  // namespace dtact::whole
