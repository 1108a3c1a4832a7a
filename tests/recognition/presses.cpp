#include "tests/recognition/presses.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "clients/calibrate/fit/darkening_map.hpp"
#include "clients/calibrate/fit/model/auto_build.hpp"
#include "hal/sim/renderer.hpp"
#include "tests/recognition/objects.hpp"

namespace dtact::recognition {
namespace {

namespace sim = hal::sim;

constexpr double kMaxNewtons = 80;
constexpr double kMinDeepestMm = 0.15;
constexpr int kFramesEach = 60;  // from one press to the next
constexpr int kReferenceFrames = 16;

std::uint64_t frame_of(std::size_t press) {
  return kFramesEach * (static_cast<std::uint64_t>(press) + 1) + 20;
}

void add_press(sim::Scene& scene, const sim::Object& object, double depth_mm, double x_mm,
               double y_mm) {
  const double begin = static_cast<double>(scene.presses.size()) + 1;
  const auto key = [&](double after, double depth) {
    return sim::PressKey{.time_s = begin + after, .x_mm = x_mm, .y_mm = y_mm, .depth_mm = depth};
  };
  scene.presses.push_back(
      {object, {key(0, 0), key(0.1, depth_mm), key(0.6, depth_mm), key(0.65, 0)}});
}

/// The light of a frame: LEDs and gain differ from the calibration's.
struct Light {
  sim::LedLevels levels = sim::led_levels({});
  double gain = 1;
};

class Camera {
 public:
  Camera(const sim::Scene& scene, std::uint64_t seed) : renderer_(scene, seed) {
    const sim::CameraModel& camera = scene.camera;
    picture_ = {camera.width, camera.height, {}};
    picture_.pixels.resize(static_cast<std::size_t>(camera.width) *
                           static_cast<std::size_t>(camera.height));
  }
  const image::Grey8& frame(std::uint64_t sequence, const Light& light) {
    renderer_.set_gain(light.gain);
    renderer_.render(sequence, light.levels, picture_.pixels.data(), picture_.width,
                     picture_.height);
    return picture_;
  }
  std::vector<std::uint16_t> reference_q8(const Light& light) {
    std::vector<std::uint32_t> sums(picture_.pixels.size());
    for (int i = 0; i < kReferenceFrames; ++i) {
      const auto& pixels = frame(static_cast<std::uint64_t>(i), light).pixels;
      for (std::size_t p = 0; p < sums.size(); ++p) sums[p] += pixels[p];
    }
    std::vector<std::uint16_t> reference;
    for (const std::uint32_t sum : sums) {
      reference.push_back(static_cast<std::uint16_t>(sum * 256 / kReferenceFrames));
    }
    return reference;
  }
  [[nodiscard]] const sim::Truth& truth() const { return renderer_.truth(); }

 private:
  sim::Renderer renderer_;
  image::Grey8 picture_;
};

/// The calibration of a user with a ball of 4 mm; nothing when it is refused.
std::shared_ptr<const recon::Model> calibrated(Camera& camera, std::size_t ball) {
  const sim::CameraModel& mode = camera.truth().scene().camera;
  calibration::BallPresses set;
  set.reference_q8 = {mode.width, mode.height, camera.reference_q8({})};
  set.ball_radius_mm = 4;
  set.mm_per_px = mode.mm_per_px;
  const int side = static_cast<int>(24 / mode.mm_per_px);  // the paper's field
  set.crop = calibration::Crop{(mode.width - side) / 2, (mode.height - side) / 2, side, side};
  calibration::BallPresses::Press press;
  for (std::uint64_t i = 0; i < 8; ++i)
    press.frames.push_back(camera.frame(frame_of(ball) + i, {}));
  set.presses.push_back(std::move(press));
  try {
    calibration::PressReport report;
    return calibration::build_auto(set, {}, report).model;
  } catch (const std::runtime_error&) {
    return nullptr;
  }
}

/// Depths are from 0.2 mm to 0.8 of the gel, or to 1.95 mm where that is more and the gel allows
/// it.
double draw_depth(whole::Draw& draw, double thickness_mm) {
  const double most = std::max(0.8 * thickness_mm, std::min(1.95, 0.92 * thickness_mm));
  return draw.chance(0.8) ? draw.uniform(0.4, most) : draw.log_uniform(0.2, most);
}

}  // namespace

bool make_presses(const Wanted& wanted, const TakePress& take) {
  const whole::RandomSensor sensor = whole::draw_sensor(wanted.seed, wanted.sensor);
  whole::Draw draw(whole::seed_of(sensor.seed, 7));
  sim::Scene scene = sensor.scene;
  scene.camera.barrel = 0;  // a user measures the lens
  const int full_width = scene.camera.width;
  scene = sim::at_mode(scene, wanted.camera_width,
                       wanted.camera_width * scene.camera.height / full_width, scene.camera.fps);
  scene.gel.grid_mm = wanted.grid_mm;
  scene.gel.solve_step_mm = 10;
  // The gel ends somewhat outside the depth map.
  const double half_width = draw.uniform(12.5, 15.5);
  const double half_height = std::min(half_width, draw.uniform(12, 13));

  std::vector<Press> presses;
  const double thickness = scene.gel.thickness_mm;
  add_press(scene, sim::ball(4), 0.8 * thickness, draw.uniform(-1, 1), draw.uniform(-1, 1));
  for (int i = 0; i < wanted.presses; ++i) {
    Press press;
    press.number = i;
    press.thickness_mm = thickness;
    std::tie(press.kind, press.variant) = wanted.object(draw);
    const sim::Object object = draw_object(press.kind, press.variant, draw);
    press.depth_mm = draw_depth(draw, thickness);
    const double reach = draw.chance(0.25) ? 9 : 4;
    press.x_mm = draw.uniform(-reach, reach);
    press.y_mm = draw.uniform(-reach, reach);
    const double tilt =
        std::tan(std::numbers::pi / 180 * draw.uniform(0, draw.chance(0.25) ? 10 : 2.5));
    const double axis = draw.uniform(0, 2 * std::numbers::pi);
    const sim::Object pressed =
        placed(object,
               {press.x_mm, press.y_mm, draw.uniform(0, 2 * std::numbers::pi),
                tilt * std::cos(axis), tilt * std::sin(axis)},
               half_width, half_height);
    for (int frame = 0; frame < wanted.frames; ++frame) {
      if (frame > 0) press.depth_mm = draw_depth(draw, thickness);
      add_press(scene, pressed, press.depth_mm, 0, 0);
      presses.push_back(press);
    }
  }

  Camera camera(scene, sensor.seed);
  const auto model = calibrated(camera, 0);
  if (!model) return false;
  calibration::DepthReader reader(model);
  for (int light = 0; light < wanted.lights; ++light) {
    Light lit;
    if (light > 0) lit.gain = draw.uniform(0.7, 1.2);
    if (light > 1) lit.levels.at(static_cast<std::size_t>(draw.index(hal::kLedCount))) = 0;
    const std::vector<std::uint16_t> reference = camera.reference_q8(lit);
    reader.set_reference(reference);
    for (std::size_t i = static_cast<std::size_t>(light); i < presses.size();
         i += static_cast<std::size_t>(wanted.lights)) {
      const std::uint64_t sequence = frame_of(i + 1);
      presses[i].newtons = camera.truth().force_n(sequence);
      if (presses[i].newtons > kMaxNewtons) continue;
      Light drifted = lit;
      drifted.gain *= draw.uniform(0.995, 1.005);  // not followed by the reference
      const image::Grey8& image = camera.frame(sequence, drifted);
      const auto um = reader.read(image);
      perceive::DepthGrid grid;
      grid.width = grid.full_width = model->rectify.width;
      grid.height = grid.full_height = model->rectify.height;
      grid.mm_per_px = model->mm_per_px;
      grid.untrusted = recon::kUntrusted;
      grid.values = um;
      const perceive::TouchMap map = perceive::touch_map(grid);
      if (map.deepest_mm >= kMinDeepestMm) take(presses[i], map, image);
    }
  }
  return true;
}

}  // namespace dtact::recognition
