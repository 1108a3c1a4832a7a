#include "daemon/recon/reconstructor.hpp"

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <string>
#include <utility>

#include "daemon/recon/kernels.hpp"
#include "daemon/recon/smoother.hpp"

namespace dtact::recon {
namespace {

constexpr int kStrip = Smoother::kStrip;

/// The authors call OpenCV's GaussianBlur with a 7×7 kernel and no sigma, which means this fixed
/// table (getSmallGaussianKernel in its smooth.cpp): 1/32, 7/64, 7/32, 9/32, in Q14.
std::vector<std::int16_t> published_taps() { return {4608, 3584, 1792, 512}; }

void require(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument(what);
}

void check(const Model& model) {
  const RectifyTable& table = model.rectify;
  require(
      table.frame_width >= 2 && table.frame_height >= 2 && table.width >= 1 && table.height >= 1,
      "rectify: frame and depth map must have pixels");
  const auto frame =
      static_cast<std::size_t>(table.frame_width) * static_cast<std::size_t>(table.frame_height);
  const auto map = static_cast<std::size_t>(table.width) * static_cast<std::size_t>(table.height);
  require(table.entries.size() == map, "rectify: " + std::to_string(table.entries.size()) +
                                           " entries for a map of " + std::to_string(map));
  for (const RectifyTable::Entry& e : table.entries) {
    require(e.x >= 0 && e.x <= table.frame_width - 2 && e.y >= 0 && e.y <= table.frame_height - 2 &&
                e.fx <= 128 && e.fy <= 128,
            "rectify: an entry reads outside the frame");
  }
  require(model.reference_q8.size() == frame, "reference: not the size of the frame");
  require(model.untrusted.empty() || model.untrusted.size() == map,
          "untrusted: not the size of the depth map");
  require(model.mm_per_px > 0, "scale: mm_per_px must be positive");
  check(model.list, model.method == Method::list);
}

/// Splits the time of a run into steps. Reads no clock when nobody asks.
class Stopwatch {
 public:
  explicit Stopwatch(bool on) : on_(on), last_(on ? Clock::now() : Clock::time_point{}) {}
  /// The time since the last call.
  std::int64_t lap() noexcept {
    if (!on_) return 0;
    const auto now = Clock::now();
    return std::chrono::nanoseconds(now - std::exchange(last_, now)).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  bool on_;
  Clock::time_point last_;
};

}  // namespace

struct Reconstructor::Impl {
  explicit Impl(std::shared_ptr<const Model> the_model);

  [[nodiscard]] std::size_t at(int y) const noexcept {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
  }
  void rectify_reference(std::span<const std::uint16_t> reference_q8, std::int16_t* out) noexcept;
  void set_reference(std::span<const std::uint16_t> reference_q8) noexcept;
  void run_list(const std::uint8_t* luma, std::ptrdiff_t stride, std::int16_t* depth,
                StepTimes& times, Stopwatch& watch) noexcept;
  void run_published(const std::uint8_t* luma, std::ptrdiff_t stride, std::int16_t* depth,
                     StepTimes& times, Stopwatch& watch) noexcept;

  std::shared_ptr<const Model> model;
  int width;
  int height;
  Smoother smoother;
  Smoother second;  ///< The second filter of the published method.
  RowBuffer in;     ///< A strip before smoothing.
  RowBuffer between;
  RowBuffer out;                     ///< A strip after smoothing.
  std::vector<std::int16_t> lookup;  ///< The list as the kernel reads it.
  kernels::LookUp list;
  std::vector<std::int16_t> calibration_q6;  ///< Smoothed reference of the calibration.
  std::vector<std::int16_t> reference_q6;    ///< Present reference, map sized.
  std::vector<std::int16_t> gain_q12;
  std::vector<std::uint8_t> untrusted;
  int beyond = 0;

 private:
  void smooth_reference(std::span<const std::int16_t> q6,
                        std::span<std::int16_t> smoothed) noexcept;
};

Reconstructor::Impl::Impl(std::shared_ptr<const Model> the_model)
    : model(std::move(the_model)),
      width(model->rectify.width),
      height(model->rectify.height),
      smoother(
          model->method == Method::list ? gaussian_taps(model->smoothing_px) : published_taps(),
          width, height),
      second(published_taps(), width, height),
      in(kStrip, width),
      between(kStrip, width),
      out(kStrip, width),
      lookup(model->list.um),
      calibration_q6(at(height)),
      reference_q6(at(height)),
      gain_q12(at(height)),
      untrusted(at(height)) {
  const DepthList& from = model->list;
  list.first_q6 = from.first_q6;
  list.covered_q6 = from.covered_to_q6;
  if (model->method == Method::list) {
    // Everything beyond the covered range looks up the marker: no comparison per pixel is needed.
    lookup.resize(static_cast<std::size_t>(from.covered_to_q6 - from.first_q6) + 1);
    lookup.push_back(kUntrusted);
  }
  list.um = lookup.data();
  list.last_q6 = from.first_q6 + static_cast<int>(lookup.size()) - 1;

  rectify_reference(model->reference_q8, reference_q6.data());
  smooth_reference(reference_q6, calibration_q6);
  set_reference(model->reference_q8);
}

void Reconstructor::Impl::rectify_reference(std::span<const std::uint16_t> reference_q8,
                                            std::int16_t* q6) noexcept {
  const RectifyTable& table = model->rectify;
  for (int y = 0; y < height; ++y) {
    kernels::rectify_reference_row(reference_q8.data(), table.frame_width,
                                   table.entries.data() + at(y), width, q6 + at(y));
  }
}

void Reconstructor::Impl::smooth_reference(std::span<const std::int16_t> q6,
                                           std::span<std::int16_t> smoothed) noexcept {
  smoother.start();
  int done = 0;
  for (int y = 0; y < height; ++y) {
    std::copy_n(q6.begin() + static_cast<std::ptrdiff_t>(at(y)), width, in.row(0));
    smoother.push(in.row(0));
    for (; done < smoother.ready(); ++done) {
      smoother.take(done, out.row(0));
      std::copy_n(out.row(0), width, smoothed.begin() + static_cast<std::ptrdiff_t>(at(done)));
    }
  }
}

void Reconstructor::Impl::set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
  rectify_reference(reference_q8, reference_q6.data());
  // The gain's plane holds the smoothed reference until each of its rows is divided.
  smooth_reference(reference_q6, gain_q12);
  if (model->untrusted.empty()) {
    std::ranges::fill(untrusted, std::uint8_t{0});
  } else {
    std::ranges::copy(model->untrusted, untrusted.begin());
  }
  for (int y = 0; y < height; ++y) {
    kernels::gain_row(calibration_q6.data() + at(y), gain_q12.data() + at(y), width,
                      gain_q12.data() + at(y), untrusted.data() + at(y));
  }
  if (model->method == Method::published) {
    // The published method subtracts 8-bit images.
    for (std::int16_t& q6 : reference_q6) q6 = static_cast<std::int16_t>((q6 + 32) / 64 * 64);
  }
}

void Reconstructor::Impl::run_list(const std::uint8_t* luma, std::ptrdiff_t stride,
                                   std::int16_t* depth, StepTimes& times,
                                   Stopwatch& watch) noexcept {
  smoother.start();
  int done = 0;
  for (int top = 0; top < height; top += kStrip) {
    const int rows = std::min(kStrip, height - top);
    for (int i = 0; i < rows; ++i) {
      const std::size_t row = at(top + i);
      kernels::rectify_difference_row(luma, stride, model->rectify.entries.data() + row,
                                      reference_q6.data() + row, width, in.row(i));
    }
    times.rectify_ns += watch.lap();
    for (int i = 0; i < rows; ++i) smoother.push(in.row(i));
    while (done < smoother.ready()) {
      const int ready = std::min(kStrip, smoother.ready() - done);
      for (int i = 0; i < ready; ++i) smoother.take(done + i, out.row(i));
      times.smooth_ns += watch.lap();
      for (int i = 0; i < ready; ++i) {
        const std::size_t row = at(done + i);
        beyond += kernels::gain_list_mask_row(out.row(i), gain_q12.data() + row,
                                              untrusted.data() + row, list, width, depth + row);
      }
      times.list_ns += watch.lap();
      done += ready;
    }
  }
}

void Reconstructor::Impl::run_published(const std::uint8_t* luma, std::ptrdiff_t stride,
                                        std::int16_t* depth, StepTimes& times,
                                        Stopwatch& watch) noexcept {
  smoother.start();
  second.start();
  int first_done = 0;
  int done = 0;
  for (int y = 0; y < height; ++y) {
    const std::size_t row = at(y);
    kernels::rectify_difference_row(luma, stride, model->rectify.entries.data() + row,
                                    reference_q6.data() + row, width, in.row(0));
    times.rectify_ns += watch.lap();
    beyond += kernels::gain_list_mask_row(in.row(0), nullptr, nullptr, list, width, in.row(0));
    times.list_ns += watch.lap();
    smoother.push(in.row(0));
    for (; first_done < smoother.ready(); ++first_done) {
      smoother.take(first_done, between.row(0));
      second.push(between.row(0));
      for (; done < second.ready(); ++done) {
        second.take(done, out.row(0));
        std::copy_n(out.row(0), width, depth + at(done));
        kernels::mask_row(untrusted.data() + at(done), width, depth + at(done));
      }
    }
    times.smooth_ns += watch.lap();
  }
}

Reconstructor::Reconstructor(std::shared_ptr<const Model> model) {
  if (!model) throw std::invalid_argument("model: missing");
  check(*model);
  impl_ = std::make_unique<Impl>(std::move(model));
}

Reconstructor::~Reconstructor() = default;
Reconstructor::Reconstructor(Reconstructor&&) noexcept = default;
Reconstructor& Reconstructor::operator=(Reconstructor&&) noexcept = default;

const Model& Reconstructor::model() const noexcept { return *impl_->model; }

int Reconstructor::beyond_pixels() const noexcept { return impl_->beyond; }

void Reconstructor::set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
  impl_->set_reference(reference_q8);
}

void Reconstructor::run(const std::uint8_t* luma, std::ptrdiff_t stride,
                        std::span<std::int16_t> depth_um, StepTimes* times) noexcept {
  StepTimes spent;
  Stopwatch watch(times != nullptr);
  impl_->beyond = 0;
  if (impl_->model->method == Method::list) {
    impl_->run_list(luma, stride, depth_um.data(), spent, watch);
  } else {
    impl_->run_published(luma, stride, depth_um.data(), spent, watch);
  }
  if (times != nullptr) *times = spent;
}

}  // namespace dtact::recon
