#include "clients/calibrate/fit/darkening_map.hpp"

#include <algorithm>
#include <limits>
#include <memory>
#include <stdexcept>

#include "daemon/recon/model.hpp"

namespace dtact::calibration {

std::vector<float> mean_depth_um(const recon::Model& model,
                                 std::span<const std::uint16_t> reference_q8,
                                 std::span<const image::Grey8> frames, int sharpen_steps) {
  if (frames.empty()) throw std::invalid_argument("no frame to reconstruct");
  if (reference_q8.size() != model.reference_q8.size()) {
    throw std::invalid_argument("the reference has not the size of the calibration's frame");
  }
  DepthReader reader(std::make_shared<recon::Model>(model), sharpen_steps);
  reader.set_reference(reference_q8);
  std::vector<float> mean(model.rectify.entries.size());
  const auto share = 1.0F / static_cast<float>(frames.size());
  for (const image::Grey8& frame : frames) {
    if (frame.width != model.rectify.frame_width || frame.height != model.rectify.frame_height) {
      throw std::invalid_argument("a frame has not the size of the calibration's frame");
    }
    std::ranges::transform(
        mean, reader.read(frame), mean.begin(), [share](float sum, std::int16_t um) {
          return um == recon::kUntrusted ? std::numeric_limits<float>::quiet_NaN()
                                         : sum + share * static_cast<float>(um);
        });
  }
  return mean;
}

void answer_darkening(recon::Model& model) {
  constexpr int kReach = 255 * recon::kEntriesPerLevel;
  model.method = recon::Method::lut;
  model.lut = {-kReach, {}, -kReach, kReach};
  for (int q6 = -kReach; q6 <= kReach; ++q6) {
    model.lut.um.push_back(static_cast<std::int16_t>(q6));
  }
}

DarkeningMap smoothed_darkening(const recon::Model& model,
                                std::span<const std::uint16_t> reference_q8,
                                std::span<const image::Grey8> frames) {
  recon::Model identity = model;
  answer_darkening(identity);
  DarkeningMap map{model.rectify.width, model.rectify.height, model.mm_per_px,
                   mean_depth_um(identity, reference_q8, frames)};
  for (float& level : map.levels) level /= recon::kEntriesPerLevel;
  return map;
}

namespace {

std::shared_ptr<const recon::Model> made_with(const std::shared_ptr<const recon::Model>& model,
                                              int sharpen_steps) {
  if (sharpen_steps == 0) return model;
  return std::make_shared<const recon::Model>(recon::decimate(*model, recon::kSharpenedAt));
}

}  // namespace

DepthReader::DepthReader(const std::shared_ptr<const recon::Model>& model, int sharpen_steps)
    : reconstructor_(made_with(model, sharpen_steps), sharpen_steps) {
  const recon::RectifyTable& made = reconstructor_.model().rectify;
  made_um_.resize(static_cast<std::size_t>(made.width) * static_cast<std::size_t>(made.height));
  if (sharpen_steps == 0) return;
  const recon::RectifyTable& fine = model->rectify;
  upsampler_.emplace(fine.width, fine.height, recon::kSharpenedAt, 1);
  fine_um_.resize(static_cast<std::size_t>(fine.width) * static_cast<std::size_t>(fine.height));
}

std::span<const std::int16_t> DepthReader::read(const image::Grey8& frame) {
  luma_.assign(frame.pixels.size() + recon::kLumaPadding, 0);
  std::ranges::copy(frame.pixels, luma_.begin());
  reconstructor_.run(luma_.data(), frame.width, made_um_);
  if (!upsampler_) return made_um_;
  upsampler_->run(made_um_, fine_um_);
  return fine_um_;
}

}  // namespace dtact::calibration
