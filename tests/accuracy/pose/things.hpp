#pragma once

#include <array>

namespace dtact::pose {

/// What the study looks at: a name, and the lines of a scene's press.
struct Thing {
  const char* name;
  const char* lines;
};
inline constexpr std::array kThings{
    Thing{"ball", "object = \"ball\"\nradius_mm = 4.0"},
    Thing{"ball array",
          "object = \"ball_array\"\nradius_mm = 1.5\npitch_mm = 4.0\nrows = 2\ncolumns = 3"},
    Thing{"disc", "object = \"disc\"\nradius_mm = 4.0"},
    Thing{"cube", "object = \"cube\"\nside_mm = 5.0"},
    Thing{"cylinder", "object = \"cylinder\"\nradius_mm = 2.5\nlength_mm = 8.0"},
    Thing{"grating", "object = \"grating\"\npitch_mm = 2.0\ngroove_mm = 1.0\nside_mm = 8.0"},
    Thing{"pin board", "object = \"pin_board\""},
    Thing{"M4 nut", "object = \"m4_nut\""},
    Thing{"M3 long nut", "object = \"m3_long_nut\""},
    Thing{"M5 screw", "object = \"m5_hexagon_screw\""},
    Thing{"set screws", "object = \"three_set_screws\""},
    Thing{"star", "object = \"star\"\nradius_mm = 4.0"},
    Thing{"screw cap", "object = \"screw_cap\""},
    Thing{"USB-C plug", "object = \"usb_c_plug\""},
    Thing{"key", "object = \"key\""},
};

}  // namespace dtact::pose
