#include "tests/bench/encodings/maps.hpp"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <stdexcept>

#include "clients/calibrate/fit/build.hpp"
#include "daemon/pipeline/reference/cells.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/tile_readers.hpp"
#include "hal/files/png.hpp"
#include "hal/luma/luma.hpp"
#include "hal/mjpeg/grey_decoder.hpp"
#include "hal/sim/payload.hpp"
#include "hal/sim/renderer.hpp"
#include "hal/sim/scene.hpp"

namespace dtact::bench {
namespace {

namespace sim = hal::sim;

constexpr int kReferenceFrames = 32;

/// The simulated camera's frames, decoded.
class Camera {
 public:
  explicit Camera(const sim::Scene& scene)
      : renderer_(scene, 1),
        luma_(scene.camera.width, scene.camera.height),
        encoder_(sim::Output::mjpeg, luma_.width(), luma_.height()),
        decoder_(luma_.width(), luma_.height()),
        payload_(encoder_.capacity()) {}

  image::Grey8 take(std::uint64_t sequence) {
    renderer_.render(sequence, sim::led_levels({}), luma_.data(), luma_.stride(), luma_.height());
    const std::size_t size = encoder_.encode(luma_.view(), payload_);
    if (decoder_.decode(std::span(payload_).first(size), luma_.data(), luma_.stride()) !=
        hal::mjpeg::Status::ok) {
      throw std::runtime_error("the simulated camera sent no JPEG");
    }
    image::Grey8 image{luma_.width(), luma_.height(), {}};
    for (int y = 0; y < luma_.height(); ++y) {
      image.pixels.insert(image.pixels.end(), luma_.row(y), luma_.row(y) + luma_.width());
    }
    return image;
  }
  /// The mean of the first frames, Q8.
  image::Grey16 take_reference() {
    std::vector<std::uint32_t> sums;
    for (std::uint64_t i = 0; i < kReferenceFrames; ++i) {
      const image::Grey8 frame = take(i);
      sums.resize(frame.pixels.size());
      for (std::size_t p = 0; p < sums.size(); ++p) sums[p] += frame.pixels[p];
    }
    image::Grey16 mean{luma_.width(), luma_.height(), {}};
    for (const std::uint32_t sum : sums) {
      mean.pixels.push_back(static_cast<std::uint16_t>(sum * 256 / kReferenceFrames));
    }
    return mean;
  }

 private:
  sim::Renderer renderer_;
  hal::luma::LumaBuffer luma_;
  sim::PayloadEncoder encoder_;
  hal::mjpeg::GreyDecoder decoder_;
  std::vector<std::uint8_t> payload_;
};

/// Depth of frames against one reference image.
class DepthOf {
 public:
  DepthOf(std::shared_ptr<const recon::Model> model, const image::Grey16& reference_q8)
      : model_(std::move(model)),
        reconstructor_(model_),
        cells_(recon::CellLattice(model_->rectify)),
        readers_(cells_.lattice(), model_->rectify, reconstructor_.radius()) {
    reconstructor_.set_reference(reference_q8.pixels);
    cells_.set_reference(reference_q8.pixels);
  }

  pipeline::DepthFrame operator()(image::Grey8 luma) {
    luma.pixels.resize(luma.pixels.size() + recon::kLumaPadding);
    (void)cells_.look({luma.pixels.data(), luma.width, luma.height, luma.width});
    recon::TileRows tiles(static_cast<std::size_t>(readers_.grid().rows()));
    readers_.mark(cells_.active(), tiles);
    pipeline::DepthFrame frame;
    frame.has_depth = true;
    frame.width = model_->rectify.width;
    frame.height = model_->rectify.height;
    frame.mm_per_px = model_->mm_per_px;
    frame.depth_um.resize(model_->rectify.entries.size());
    reconstructor_.run_active(luma.pixels.data(), luma.width, tiles, frame.depth_um, frame.drawn);
    return frame;
  }

 private:
  std::shared_ptr<const recon::Model> model_;
  recon::Reconstructor reconstructor_;
  pipeline::Cells cells_;
  recon::TileReaders readers_;
};

}  // namespace

Recording simulated_ball(int frames) {
  constexpr std::uint64_t kHeld = 300;         // of calibrate_ball.toml: still from frame 180 on
  constexpr std::uint64_t kHeldDefault = 240;  // of the built-in scene: held from 3.5 to 5.5 s
  Camera calibrator(sim::load_scene(DTACT_SOURCE_DIR "/config/scenes/calibrate_ball.toml"));
  calibration::BallPress press;
  press.reference_q8 = calibrator.take_reference();
  for (std::uint64_t i = 0; i < 8; ++i) press.frames.push_back(calibrator.take(kHeld + i));
  press.ball_radius_mm = 4;
  press.mm_per_px = 0.0413793;
  press.crop = calibration::Crop{110, 10, 580, 580};
  const auto calibration = calibration::build(press);

  Camera camera(sim::default_scene());
  DepthOf depth_of(calibration.model, camera.take_reference());
  Recording recording{"simulated sensor", {}};
  for (int i = 0; i < frames; ++i) {
    recording.frames.push_back(depth_of(camera.take(kHeldDefault + static_cast<std::uint64_t>(i))));
  }
  return recording;
}

Recording real_ball(const std::filesystem::path& folder, double mm_per_px) {
  calibration::BallPress press;
  press.frames.push_back(image::read_png_grey8(folder / "ball.png"));
  const image::Grey8 reference = image::read_png_grey8(folder / "ball_reference.png");
  press.reference_q8 = {reference.width, reference.height, {}};
  for (const std::uint8_t grey : reference.pixels) {
    press.reference_q8.pixels.push_back(static_cast<std::uint16_t>(grey * 256));
  }
  press.ball_radius_mm = 4;
  press.mm_per_px = mm_per_px;
  const auto calibration = calibration::build(press);
  DepthOf depth_of(calibration.model, press.reference_q8);
  return {folder.filename().string(), {depth_of(press.frames.front())}};
}

}  // namespace dtact::bench
