#include "daemon/recon/reconstructor.hpp"

#include <optional>
#include <stdexcept>
#include <utility>

#include "daemon/recon/reconstructor_impl.hpp"
#include "daemon/recon/sharpener.hpp"

namespace dtact::recon {

std::vector<int> sharpening_steps(const Model& model) {
  std::vector<int> steps;
  const double mm_per_px = kSharpenedAt * model.mm_per_px / model.frame_scale;
  if (!model.scattering || !Sharpener::reaches(*model.scattering, mm_per_px)) return steps;
  for (const Model::Sharpened& sharpened : model.sharpened) steps.push_back(sharpened.steps);
  return steps;
}

Reconstructor::Reconstructor(std::shared_ptr<const Model> model, int sharpen_steps) {
  if (!model) throw std::invalid_argument("model: missing");
  check(*model);
  impl_ = std::make_unique<Impl>(std::move(model), sharpen_steps);
}

Reconstructor::~Reconstructor() = default;
Reconstructor::Reconstructor(Reconstructor&&) noexcept = default;
Reconstructor& Reconstructor::operator=(Reconstructor&&) noexcept = default;

const Model& Reconstructor::model() const noexcept { return *impl_->model; }

int Reconstructor::sharpen_steps() const noexcept { return impl_->steps; }

int Reconstructor::beyond_pixels() const noexcept { return impl_->beyond; }

void Reconstructor::set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
  impl_->reference.set(reference_q8);
}

void Reconstructor::set_light(double factor) noexcept { impl_->reference.set_light(factor); }

void Reconstructor::run(const std::uint8_t* luma, std::ptrdiff_t stride,
                        std::span<std::int16_t> depth_um, StepTimes* times) noexcept {
  StepTimes spent;
  Stopwatch watch(times != nullptr);
  impl_->beyond = 0;
  impl_->plan.set_stride(stride);
  if (impl_->model->method == Method::lut) {
    impl_->apply_lut(luma, impl_->all_tiles, depth_um.data(), nullptr, spent, watch);
  } else {
    impl_->run_published(luma, depth_um.data(), spent, watch);
  }
  if (times != nullptr) *times = spent;
}

void Reconstructor::run_active(const std::uint8_t* luma, std::ptrdiff_t stride,
                               const TileRows& tiles, std::span<std::int16_t> depth_um,
                               DrawnTiles& drawn, StepTimes* times, DepthSums* sums) noexcept {
  StepTimes spent;
  Stopwatch watch(times != nullptr);
  impl_->beyond = 0;
  impl_->plan.set_stride(stride);
  std::optional<StripSums> strips;
  if (impl_->model->method == Method::lut) {
    impl_->clear_rest(tiles, drawn, depth_um.data());
    if (sums != nullptr) strips.emplace(impl_->grid, tiles, depth_um.data(), *sums);
    if (count_tiles(tiles) > 0) {
      impl_->apply_lut(luma, tiles, depth_um.data(), strips ? &*strips : nullptr, spent, watch);
    }
  } else {
    impl_->clear_rest(impl_->all_tiles, drawn, depth_um.data());
    impl_->run_published(luma, depth_um.data(), spent, watch);
    if (sums != nullptr) {
      strips.emplace(impl_->grid, impl_->all_tiles, depth_um.data(), *sums);
      for (int row = 0; row < impl_->grid.rows(); ++row) strips->finished(row);
      spent.sums_ns = watch.lap();
    }
  }
  if (times != nullptr) *times = spent;
}

const TileGrid& Reconstructor::grid() const noexcept { return impl_->grid; }

int Reconstructor::radius() const noexcept {
  const std::optional<Sharpener>& sharpener = impl_->sharpener;
  return impl_->smoother.radius() + (sharpener ? sharpener->reach() : 0);
}

}  // namespace dtact::recon
