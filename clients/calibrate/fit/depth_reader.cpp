#include "clients/calibrate/fit/depth_reader.hpp"

#include <algorithm>

#include "daemon/recon/model.hpp"

namespace dtact::calibration {
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
