#include "hal/sim/scene.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "hal/base/atomic_file.hpp"
#include "hal/sim/calibrated.hpp"
#include "hal/sim/optics.hpp"
#include "tests/fakes/own_path.hpp"
#include "tests/unit/sim/small_scene.hpp"

namespace dtact::hal::sim {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::string error_of(const std::string& toml) {
  try {
    (void)parse_scene(toml, "scenes/x.toml");
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no error";
}

TEST(Scene, DefaultIsThePapersField) {
  const Scene scene = default_scene();
  EXPECT_EQ(scene.camera.width, 800);
  EXPECT_EQ(scene.camera.height, 600);
  EXPECT_EQ(scene.camera.fps, 60);
  EXPECT_NEAR(scene.camera.mm_per_px * 580, 24, 1e-4);
  EXPECT_EQ(scene.gel.thickness_mm, 2);
  ASSERT_EQ(scene.presses.size(), 3U);
  EXPECT_EQ(scene.presses[0].object.kind, "ball");
  EXPECT_GE(scene.presses[0].keys.front().time_s, 2.5);
}

TEST(Scene, EverySceneOfTheFolderLoads) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(DTACT_SOURCE_DIR "/config/scenes")) {
    if (entry.path().extension() != ".toml") continue;
    EXPECT_NO_THROW((void)load_scene(entry.path())) << entry.path();
    ++count;
  }
  EXPECT_GE(count, 5);
}

TEST(Scene, WhatIsLeftOutIsTheBuiltInSensorsButNotItsPresses) {
  const Scene scene = parse_scene("[gel]\nthickness_mm = 1.5\n", "x.toml");
  EXPECT_EQ(scene.gel.thickness_mm, 1.5);
  EXPECT_EQ(scene.camera.width, 800);
  EXPECT_EQ(scene.optics.pressed_slope, default_scene().optics.pressed_slope);
  EXPECT_TRUE(scene.presses.empty());
  EXPECT_EQ(scene.loop_to_s, 0);
}

TEST(Scene, KeysInheritFromTheOneBefore) {
  const Scene scene = parse_scene(
      "[[press]]\nobject = \"disc\"\nradius_mm = 2.0\n"
      "keys = [ { t = 1.0, x = 3.0, rotation = 10.0 }, { t = 2.0, depth = 0.5 } ]\n",
      "x.toml");
  const PressKey& key = scene.presses.at(0).keys.at(1);
  EXPECT_EQ(key.x_mm, 3);
  EXPECT_EQ(key.rotation_deg, 10);
  EXPECT_EQ(key.tilt_x_deg, 0);
  EXPECT_EQ(key.depth_mm, 0.5);
}

TEST(Scene, TakesAnotherLaw) {
  const Scene scene = parse_scene(
      "[gel]\npoisson = 0.49\n[optics]\nnarrow_weight = 0.6\nfar_mm = 3.0\nfar_weight = 0.1\n"
      "growth = 1.0\nknots = [-0.2, 0.0, 0.5]\nslopes = [1.0, 0.5, 0.4]\n"
      "[[press]]\nobject = \"two_pillars\"\nradius_mm = 0.5\nspacing_mm = 1.5\n"
      "keys = [ { t = 1.0 } ]\n",
      "x.toml");
  EXPECT_EQ(scene.gel.poisson, 0.49);
  EXPECT_EQ(scene.optics.far_mm, 3);
  EXPECT_EQ(scene.optics.growth, 1);
  EXPECT_EQ(scene.optics.slopes.at(2), 0.4);
  EXPECT_EQ(scene.presses.at(0).object.reach_mm, 1.25);
}

TEST(Scene, RefusesAResponseThatIsNone) {
  EXPECT_THAT(error_of("[optics]\nnarrow_weight = 0.9\nfar_weight = 0.2\n"),
              AllOf(HasSubstr("optics.far_weight"), HasSubstr("together at most 1")));
  EXPECT_THAT(error_of("[optics]\nknots = [0.0, 0.5, 0.5]\nslopes = [1, 1, 1]\n"),
              AllOf(HasSubstr("x.toml:2: optics.knots"), HasSubstr("ascending")));
  EXPECT_THAT(error_of("[optics]\nknots = [0.0, 0.5]\nslopes = [1.0]\n"),
              AllOf(HasSubstr("x.toml:3: optics.slopes"), HasSubstr("as many as knots: 2")));
  EXPECT_THAT(error_of("[optics]\nknots = [0.0, 0.5]\n"), HasSubstr("optics.slopes"));
}

class CalibratedScene : public ::testing::Test {
 public:
  ~CalibratedScene() override { std::filesystem::remove_all(folder_); }

 protected:
  void write(const std::string& toml) {
    std::filesystem::create_directories(folder_);
    base::write_file_atomically(folder_ / "calibration.toml", toml);
  }

  std::filesystem::path folder_ = fakes::own_path();
};

// dtact-calibrate writes this form, errors beside the numbers.
std::string model(double bulge_factor) {
  return fmt::format(
      "[gel]\nthickness_mm = [2.4, 0.1]\nnarrow_mm = [0.12, 0.01]\nwide_mm = [1.16, 0.1]\n"
      "narrow_weight = [0.7, 0.02]\nindentation = [-0.24, -0.12, 0, 0.4, 0.8]\n"
      "slope = [2.5, 2.4, 0.6, 0.4, 0.5]\nslope_error = [1, 1, 0.1, 0.1, 0.2]\n"
      "bulge_factor = {}\nresidual_levels = 0.2\n",
      bulge_factor);
}

TEST_F(CalibratedScene, IsThatSensor) {
  write(model(1));
  const Scene scene = parse_scene(
      fmt::format("calibration = \"{}\"\n[optics]\nwide_mm = 1.5\n", folder_.string()), "x.toml");
  EXPECT_EQ(scene.gel.thickness_mm, 2.4);
  EXPECT_EQ(scene.optics.narrow_mm, 0.12);
  EXPECT_EQ(scene.optics.wide_mm, 1.5);  // the scene's own
  // A tenth of the thickness in: half of (0.6 + 0.55) · 0.1.
  EXPECT_NEAR(response(scene.optics, 0.24, scene.gel.thickness_mm), 0.0575, 1e-12);
}

TEST_F(CalibratedScene, MayHaveAKinkAtZero) {
  write(model(2));
  Scene scene = default_scene();
  take_from_calibration(folder_, scene);
  EXPECT_NEAR(response(scene.optics, 0.24, 2.4), 0.0575, 1e-6);
  // A tenth out: slopes from 2 · 0.6 to 2 · 2.1.
  EXPECT_NEAR(response(scene.optics, -0.24, 2.4), -0.27, 1e-5);
}

TEST_F(CalibratedScene, NeedsAModel) {
  write("[lut]\nfirst_q6 = 0\n");
  Scene scene = default_scene();
  EXPECT_THROW(take_from_calibration(folder_, scene), std::runtime_error);
  EXPECT_THROW(take_from_calibration(folder_ / "absent", scene), std::exception);
}

TEST(Scene, ErrorsNameFileLineKeyAndWhatIsAllowed) {
  EXPECT_THAT(error_of("[camera]\nwidth = 10\n"),
              AllOf(HasSubstr("scenes/x.toml:2: camera.width"), HasSubstr("from 64 to 4096")));
  EXPECT_THAT(error_of("\n\n[optics]\nnarrow_weight = 1.5\n"),
              AllOf(HasSubstr("scenes/x.toml:4: optics.narrow_weight"), HasSubstr("from 0 to 1")));
  EXPECT_THAT(error_of("[camera]\nfps = \"fast\"\n"),
              AllOf(HasSubstr("x.toml:2: camera.fps"), HasSubstr("a number from 1 to 240")));
  EXPECT_THAT(error_of("[light]\narrangement = \"top\"\n"),
              AllOf(HasSubstr("x.toml:2: light.arrangement"), HasSubstr("\"ring\", \"sides\"")));
  EXPECT_THAT(error_of("[[press]]\nobject = \"brick\"\n"),
              AllOf(HasSubstr("x.toml:2: press[0].object"), HasSubstr("usb_c_plug")));
  EXPECT_THAT(error_of("[[fault]]\nkind = \"drop\"\n"),
              AllOf(HasSubstr("x.toml:1: fault[0].frame"), HasSubstr("missing")));
  EXPECT_THAT(error_of("a = [\n"), HasSubstr("scenes/x.toml:"));
}

/// A key's range as config/scenes/default.toml states it, with the next values outside.
struct Range {
  const char* table;
  const char* key;
  const char* below;
  const char* least;
  const char* most;
  const char* above;
};

TEST(Scene, EveryNumberHasTheRangeThatTheBuiltInSceneStates) {
  constexpr Range kRanges[] = {{"camera", "barrel", "-0.01", "0", "0.5", "0.51"},
                               {"camera", "exposure", "0.049", "0.05", "4", "4.1"},
                               {"camera", "gamma", "0.49", "0.5", "3", "3.1"},
                               {"camera", "read_noise", "-0.1", "0", "3", "3.1"},
                               {"camera", "shot_noise", "-0.1", "0", "3", "3.1"},
                               {"camera", "light_delay_frames", "1", "2", "8", "9"},
                               {"gel", "thickness_mm", "0.49", "0.5", "4.5", "4.6"},
                               {"gel", "youngs_modulus_mpa", "0.0009", "0.001", "10", "10.1"},
                               {"gel", "poisson", "0.39", "0.4", "0.5", "0.51"},
                               {"gel", "grid_mm", "0.049", "0.05", "0.5", "0.51"},
                               {"gel", "solve_step_mm", "0.019", "0.02", "5", "5.1"},
                               {"gel", "taper_x", "-0.021", "-0.02", "0.02", "0.021"},
                               {"gel", "taper_y", "-0.021", "-0.02", "0.02", "0.021"},
                               {"gel", "texture", "-0.001", "0", "0.02", "0.021"},
                               {"gel", "texture_mm", "0.049", "0.05", "5", "5.1"},
                               {"surface", "camera_mm", "-1", "0", "1000", "1001"},
                               {"optics", "narrow_weight", "-0.1", "0", "1", "1.1"},
                               {"optics", "far_mm", "-0.1", "0", "12", "12.1"},
                               {"optics", "growth", "-0.1", "0", "1", "1.1"},
                               {"light", "level", "0.9", "1", "255", "256"},
                               {"light", "fill", "-0.1", "0", "1", "1.1"},
                               {"light", "vignetting", "-0.1", "0", "0.9", "0.91"}};
  for (const Range& range : kRanges) {
    const auto error_at = [&](const char* value) {
      return error_of(fmt::format("[{}]\n{} = {}\n", range.table, range.key, value));
    };
    EXPECT_EQ(error_at(range.least), "no error") << range.key;
    EXPECT_EQ(error_at(range.most), "no error") << range.key;
    for (const char* value : {range.below, range.above}) {
      EXPECT_THAT(error_at(value),
                  AllOf(HasSubstr(fmt::format("x.toml:2: {}.{}:", range.table, range.key)),
                        HasSubstr(fmt::format("from {} to {}", range.least, range.most))))
          << value;
    }
  }
}

// Of two keys the range of the second depends on the first.
TEST(Scene, RangesThatDependOnOthersReachTheirEnds) {
  const auto sphere = [](const char* radius, const char* camera) {
    return error_of(fmt::format("[surface]\nshape = \"sphere\"\nradius_mm = {}\ncamera_mm = {}\n",
                                radius, camera));
  };
  EXPECT_EQ(sphere("5", "1"), "no error");
  EXPECT_EQ(sphere("5", "5"), "no error");
  EXPECT_EQ(sphere("500", "500"), "no error");
  EXPECT_THAT(sphere("4.9", "1"), HasSubstr("from 5 to 500"));
  EXPECT_THAT(sphere("501", "1"), HasSubstr("from 5 to 500"));
  EXPECT_THAT(sphere("30", "0.9"), HasSubstr("from 1 to 30"));
  EXPECT_EQ(error_of("[optics]\nnarrow_weight = 0.75\nfar_weight = 0.25\n"), "no error");
  EXPECT_EQ(error_of("[optics]\nnarrow_weight = 0\nfar_weight = 1\n"), "no error");

  const auto cube = [](const char* key) {
    return error_of(
        fmt::format("[gel]\nthickness_mm = 3.0\n[[press]]\nobject = \"cube\"\n"
                    "side_mm = 4.0\nkeys = [ {{ t = 0.0, {} }} ]\n",
                    key));
  };
  for (const char* key :
       {"depth = 2.7", "depth = -10", "tilt_x = -60", "tilt_x = 60", "tilt_y = -60", "tilt_y = 60",
        "drag_x = -3", "drag_x = 3", "drag_y = -3", "drag_y = 3"}) {
    EXPECT_EQ(cube(key), "no error") << key;
  }
  EXPECT_THAT(cube("depth = 2.71"), HasSubstr("from -10 to 2.7"));
  for (const char* key : {"tilt_x = -61", "tilt_x = 61", "tilt_y = -61"}) {
    EXPECT_THAT(cube(key), HasSubstr("from -60 to 60")) << key;
  }
  for (const char* key : {"drag_x = -3.1", "drag_x = 3.1", "drag_y = -3.1", "drag_y = 3.1"}) {
    EXPECT_THAT(cube(key), HasSubstr("from -3 to 3")) << key;
  }
  // The response must rise up to the deepest press: 0.9 of the 2 mm, here 1.8 mm.
  EXPECT_EQ(error_of("[optics]\npressed_slope = 0.37\npressed_curve = -0.1\n"), "no error");
  EXPECT_THAT(error_of("[optics]\npressed_slope = 0.35\npressed_curve = -0.1\n"),
              HasSubstr("optics.pressed_curve"));
  // The loop's end must be later, and without one it may begin anywhere.
  EXPECT_THAT(error_of("[loop]\nfrom_s = 2.0\nto_s = 2.0\n"), HasSubstr("later than from_s"));
  EXPECT_EQ(error_of("[loop]\nfrom_s = 2.0\nto_s = 2.1\n"), "no error");
}

TEST(Scene, UnknownKeysAreErrorsEverywhere) {
  EXPECT_THAT(error_of("colour = 1\n"),
              AllOf(HasSubstr("x.toml:1: colour"), HasSubstr("camera, fault, gel")));
  EXPECT_THAT(error_of("[gel]\nthickness = 2.0\n"),
              AllOf(HasSubstr("x.toml:2: gel.thickness:"), HasSubstr("thickness_mm")));
  EXPECT_THAT(error_of("[[press]]\nobject = \"m4_nut\"\nradius_mm = 2.0\nkeys = [ { t = 1.0 } ]\n"),
              HasSubstr("x.toml:3: press[0].radius_mm"));
  EXPECT_THAT(error_of("[[press]]\nobject = \"m4_nut\"\nkeys = [ { t = 1.0, z = 2.0 } ]\n"),
              HasSubstr("x.toml:3: press[0].keys[0].z"));
}

TEST(Scene, RefusesWhatCannotBe) {
  const std::string nut = "[[press]]\nobject = \"m4_nut\"\n";
  EXPECT_THAT(error_of(nut + "keys = [ { t = 1.0, depth = 0.5 } ]\n"),
              HasSubstr("must begin at the surface"));
  EXPECT_THAT(error_of(nut + "keys = [ { t = 1.0 }, { t = 1.0, depth = 0.5 } ]\n"),
              HasSubstr("must be later"));
  EXPECT_THAT(error_of(nut + "keys = [ { t = 0.0, depth = 1.9 } ]\n"),
              HasSubstr("from -10 to 1.8"));  // nine tenths of 2 mm
  EXPECT_THAT(error_of(nut + "keys = []\n"), HasSubstr("at least one key"));
  EXPECT_THAT(error_of(nut + "keys = [ { t = 0.0, tilt_y = 61.0 } ]\n"),
              AllOf(HasSubstr("tilt_y"), HasSubstr("from -60 to 60")));
  EXPECT_THAT(error_of("[optics]\npressed_slope = 0.1\npressed_curve = -0.1\n"),
              AllOf(HasSubstr("x.toml:3: optics.pressed_curve"), HasSubstr("response fall")));
  EXPECT_THAT(error_of("[surface]\nshape = \"sphere\"\n"),
              AllOf(HasSubstr("surface.radius_mm"), HasSubstr("missing")));
  EXPECT_THAT(error_of("[surface]\nshape = \"sphere\"\nradius_mm = 20.0\ncamera_mm = 21.0\n"),
              AllOf(HasSubstr("surface.camera_mm"), HasSubstr("from 1 to 20")));
  EXPECT_THAT(error_of("[loop]\nfrom_s = 3.0\nto_s = 2.0\n"), HasSubstr("later than from_s"));
  EXPECT_THAT(error_of("[[press]]\nobject = \"height_map\"\nimage = \"none.png\"\n"
                       "mm_per_px = 0.1\nrelief_mm = 1.0\nkeys = [ { t = 1.0 } ]\n"),
              AllOf(HasSubstr("x.toml:3: press[0].image"), HasSubstr("none.png")));
}

TEST(Scene, TimeRunsThenLoops) {
  Scene scene = small_scene("[loop]\nfrom_s = 2.0\nto_s = 5.0\n");  // 10 frames a second
  EXPECT_DOUBLE_EQ(scene.time_s(0), 0);
  EXPECT_DOUBLE_EQ(scene.time_s(49), 4.9);
  EXPECT_DOUBLE_EQ(scene.time_s(50), 2.0);
  EXPECT_NEAR(scene.time_s(81), 2.1, 1e-9);
  scene.loop_to_s = 0;
  EXPECT_DOUBLE_EQ(scene.time_s(81), 8.1);
}

TEST(Scene, FaultsStrikeTheirFrames) {
  const Scene scene = small_scene("[[fault]]\nkind = \"stall\"\nframe = 5\nframes = 2\n");
  EXPECT_FALSE(scene.strikes(FaultKind::stall, 4));
  EXPECT_TRUE(scene.strikes(FaultKind::stall, 5));
  EXPECT_TRUE(scene.strikes(FaultKind::stall, 6));
  EXPECT_FALSE(scene.strikes(FaultKind::drop, 6));
  EXPECT_FALSE(scene.strikes(FaultKind::stall, 7));
}

TEST(Scene, AnotherModeKeepsTheFieldOfView) {
  const Scene scene = at_mode(default_scene(), 400, 300, 30);
  EXPECT_EQ(scene.camera.height, 300);
  EXPECT_EQ(scene.camera.fps, 30);
  EXPECT_NEAR(scene.camera.mm_per_px, 2 * 0.0413793, 1e-9);
  EXPECT_THROW((void)at_mode(default_scene(), 0, 300, 30), std::runtime_error);
}

}  // namespace
}  // namespace dtact::hal::sim
