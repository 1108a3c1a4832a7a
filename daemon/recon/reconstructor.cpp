#include "daemon/recon/reconstructor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "daemon/recon/reconstructor_impl.hpp"

namespace dtact::recon {
namespace {

/// The authors call OpenCV's GaussianBlur with a 7×7 kernel and no sigma, which means this fixed
/// table (getSmallGaussianKernel in its smooth.cpp): 1/32, 7/64, 7/32, 9/32, in Q14.
std::vector<std::int16_t> published_taps() { return {4608, 3584, 1792, 512}; }

const DepthList& list_for(const Model& model, int steps) {
  if (steps == 0) return model.list;
  const auto found = std::ranges::find(model.sharpened, steps, &Model::Sharpened::steps);
  if (found == model.sharpened.end()) {
    throw std::invalid_argument("sharpened: the calibration has no list for " +
                                std::to_string(steps) + (steps == 1 ? " step" : " steps") +
                                " of sharpening");
  }
  return found->list;
}

}  // namespace

Reconstructor::Impl::Impl(std::shared_ptr<const Model> the_model, int the_steps)
    : model(std::move(the_model)),
      steps(the_steps),
      grid(model->rectify.width, model->rectify.height),
      all_tiles(static_cast<std::size_t>(grid.rows()), grid.all()),
      plan(model->rectify),
      smoother(
          model->method == Method::list ? gaussian_taps(model->smoothing_px) : published_taps(),
          grid.width, grid.height),
      second(published_taps(), grid.width, grid.height),
      in(2 * kStrip, grid.width),
      fine(model->rectify.decimation, model->rectify.fine_width()),
      between(2, grid.width),
      out(2 * kStrip, grid.width),
      sharpener_tiles(static_cast<std::size_t>(grid.rows())),
      list(list_for(*model, steps), model->method),
      calibration_q6(at(grid.height)),
      taken_q6(at(grid.height)),
      taken_gain_q12(at(grid.height)),
      reference_q6(at(grid.height)),
      gain_q12(at(grid.height)),
      untrusted(at(grid.height)) {
  // check() wants the scattering where there are lists for steps.
  if (const auto& scattering = model->scattering; steps > 0 && scattering) {
    sharpener.emplace(*scattering, steps, model->mm_per_px, grid.width, grid.height);
    marks_q12.resize(at(grid.height));
  }
  rectify_reference(model->reference_q8);
  smooth_reference(calibration_q6);
  apply(model->gain, {grid.width, grid.height, vec::padded(grid.width), model->mm_per_px},
        calibration_q6);
  set_reference(model->reference_q8);
}

void Reconstructor::Impl::rectify_reference(std::span<const std::uint16_t> reference_q8) noexcept {
  const RectifyTable& table = model->rectify;
  std::array<const std::int16_t*, kMaxDecimation> rows{};
  for (int y = 0; y < grid.height; ++y) {
    for (int k = 0; k < table.decimation; ++k) {
      kernels::rectify_reference_row(reference_q8.data(), table.frame_width,
                                     entries(y * table.decimation + k), table.fine_width(),
                                     fine.row(k));
      rows[static_cast<std::size_t>(k)] = fine.row(k);
    }
    kernels::average_reference_row(rows.data(), table.decimation, grid.width,
                                   taken_q6.data() + at(y));
  }
}

void Reconstructor::Impl::smooth_reference(std::span<std::int16_t> smoothed) noexcept {
  const int blocks = grid.blocks();
  const auto copy_row = [this](const std::int16_t* from, std::int16_t* to) {
    std::copy_n(from, vec::padded(grid.width), to);
  };
  int pushed = 0;
  for (int pair = 0; pair < smoother.pairs(); ++pair) {
    for (; pushed < std::min(smoother.pairs(), pair + smoother.reach() + 1); ++pushed) {
      copy_row(taken_q6.data() + at(2 * pushed), in.row(0));
      copy_row(taken_q6.data() + at(std::min(2 * pushed + 1, grid.height - 1)), in.row(1));
      smoother.push(pushed, in.row(0), in.row(1), 0, blocks);
    }
    smoother.take(pair, out.row(0), out.row(1), 0, blocks);
    copy_row(out.row(0), smoothed.data() + at(2 * pair));
    if (2 * pair + 1 < grid.height) copy_row(out.row(1), smoothed.data() + at(2 * pair + 1));
  }
}

void Reconstructor::Impl::set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
  ++rest;
  rectify_reference(reference_q8);
  // The gain's plane holds the smoothed reference until each of its rows is divided.
  smooth_reference(taken_gain_q12);
  for (int y = 0; y < grid.height; ++y) {
    std::uint8_t* const marks = untrusted.data() + at(y);
    std::int16_t* const gain = taken_gain_q12.data() + at(y);
    if (model->untrusted.empty()) {
      std::fill_n(marks, grid.width, std::uint8_t{0});
    } else {
      std::copy_n(model->untrusted.data() + packed(y), grid.width, marks);
    }
    kernels::gain_row(calibration_q6.data() + at(y), gain, grid.width, gain, marks);
    for (int x = 0; x < grid.width; ++x) {
      if (marks[x] != 0) gain[x] = 0;
    }
  }
  if (model->method == Method::published) {
    // The published method subtracts 8-bit images.
    for (std::int16_t& q6 : taken_q6) q6 = static_cast<std::int16_t>((q6 + 32) / 64 * 64);
  }
  std::ranges::copy(taken_q6, reference_q6.begin());
  std::ranges::copy(taken_gain_q12, gain_q12.begin());
  if (sharpener) {
    std::ranges::transform(gain_q12, marks_q12.begin(), [](std::int16_t gain) {
      return static_cast<std::int16_t>(gain == 0 ? 0 : kernels::kGainOne);
    });
  }
}

void Reconstructor::Impl::set_light(double factor) noexcept {
  if (model->method == Method::published) return;
  const auto q15 = [](double f) {
    return static_cast<std::int32_t>(std::lround(f * kernels::kFactorOne));
  };
  const auto count = static_cast<int>(taken_q6.size());
  kernels::scale_row(taken_q6.data(), q15(factor), count, reference_q6.data());
  kernels::scale_row(taken_gain_q12.data(), q15(1 / factor), count, gain_q12.data());
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
  impl_->set_reference(reference_q8);
}

void Reconstructor::set_light(double factor) noexcept { impl_->set_light(factor); }

void Reconstructor::run(const std::uint8_t* luma, std::ptrdiff_t stride,
                        std::span<std::int16_t> depth_um, StepTimes* times) noexcept {
  StepTimes spent;
  Stopwatch watch(times != nullptr);
  impl_->beyond = 0;
  impl_->plan.set_stride(stride);
  if (impl_->model->method == Method::list) {
    impl_->run_list(luma, impl_->all_tiles, depth_um.data(), nullptr, spent, watch);
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
  if (impl_->model->method == Method::list) {
    impl_->clear_rest(tiles, drawn, depth_um.data());
    if (sums != nullptr) strips.emplace(impl_->grid, tiles, depth_um.data(), *sums);
    if (count_tiles(tiles) > 0) {
      impl_->run_list(luma, tiles, depth_um.data(), strips ? &*strips : nullptr, spent, watch);
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
