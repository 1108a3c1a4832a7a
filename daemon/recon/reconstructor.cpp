#include "daemon/recon/reconstructor.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "daemon/recon/kernels.hpp"
#include "daemon/recon/smoother.hpp"
#include "daemon/recon/tiles.hpp"
#include "daemon/recon/vector_kernels.hpp"

namespace dtact::recon {
namespace {

/// Pairs of rows that a step works on before the next step: one row of tiles.
constexpr int kStrip = Smoother::kStrip;
static_assert(2 * kStrip == TileGrid::kRows);
constexpr int kMaxDecimation = 4;

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
  require(table.decimation == 1 || table.decimation == 2 || table.decimation == 4,
          "rectify: decimation must be 1, 2 or 4");
  const auto map = static_cast<std::size_t>(table.width) * static_cast<std::size_t>(table.height);
  const auto fine = map * static_cast<std::size_t>(table.decimation * table.decimation);
  require(table.entries.size() == fine, "rectify: " + std::to_string(table.entries.size()) +
                                            " entries for a map of " + std::to_string(fine));
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
  Impl(std::shared_ptr<const Model> the_model, const ActivitySettings& settings);

  /// Where row y begins in the planes below, whose rows are whole blocks.
  [[nodiscard]] std::size_t at(int y) const noexcept {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(vec::padded(grid.width));
  }
  /// Where row y begins in a depth map.
  [[nodiscard]] std::ptrdiff_t packed(int y) const noexcept {
    return std::ptrdiff_t{y} * grid.width;
  }
  void rectify_reference(std::span<const std::uint16_t> reference_q8) noexcept;
  void smooth_reference(std::span<std::int16_t> smoothed) noexcept;
  void set_reference(std::span<const std::uint16_t> reference_q8) noexcept;
  void set_light(double factor) noexcept;
  void run_list(const std::uint8_t* luma, const TileRows& tiles, std::int16_t* depth,
                StepTimes& times, Stopwatch& watch) noexcept;
  void clear_rest(const TileRows& tiles, DrawnTiles& drawn, std::int16_t* depth) const noexcept;
  void run_published(const std::uint8_t* luma, std::int16_t* depth, StepTimes& times,
                     Stopwatch& watch) noexcept;

  std::shared_ptr<const Model> model;
  TileGrid grid;
  TileRows all_tiles;
  RectifyPlan plan;
  Smoother smoother;
  Smoother second;  ///< The second filter of the published method.
  Activity activity;
  RowBuffer in;                    ///< A strip before smoothing.
  RowBuffer fine;                  ///< The rows of one row of a coarse map.
  std::vector<std::int16_t> zero;  ///< As long as one of them.
  RowBuffer between;
  RowBuffer out;                     ///< A strip after smoothing.
  std::vector<std::int16_t> lookup;  ///< The list as the kernel reads it.
  kernels::LookUp list;
  std::vector<std::int16_t> calibration_q6;  ///< Smoothed reference of the calibration.
  // The reference as it was taken and its gain, 0 where untrusted; and both in the present light.
  std::vector<std::int16_t> taken_q6;
  std::vector<std::int16_t> taken_gain_q12;
  std::vector<std::int16_t> reference_q6;
  std::vector<std::int16_t> gain_q12;
  std::vector<std::uint8_t> untrusted;
  std::uint64_t rest = 0;  ///< Counts the references: each has its own untouched map.
  int beyond = 0;

 private:
  /// The table's row `y` of fine pixels.
  [[nodiscard]] const RectifyTable::Entry* entries(int y) const noexcept {
    return model->rectify.entries.data() + std::ptrdiff_t{y} * model->rectify.fine_width();
  }
  /// The map's pixels [x0, x1) of row `y` before smoothing.
  void rectify(const std::uint8_t* luma, int y, int x0, int x1, std::int16_t* row) noexcept;
  /// Fetches what the last step on a row of tiles reads and writes. Whole maps are fetched by the
  /// processor itself; the short rows of a few tiles are not (5 % of a small press's time).
  void prefetch(const TileRows& tiles, int row, const std::int16_t* depth) const noexcept;
  /// The tiles whose depth needs any row of the pairs [begin, end).
  [[nodiscard]] std::uint64_t readers(const TileRows& tiles, int begin, int end) const noexcept;
  void rectify_pair(const std::uint8_t* luma, int pair, std::uint64_t tiles, int slot) noexcept;
  void push_pair(int pair, std::uint64_t tiles, int slot) noexcept;
  void clear(std::uint64_t tiles, int row, std::int16_t* depth) const noexcept;
};

Reconstructor::Impl::Impl(std::shared_ptr<const Model> the_model, const ActivitySettings& settings)
    : model(std::move(the_model)),
      grid(model->rectify.width, model->rectify.height),
      all_tiles(static_cast<std::size_t>(grid.rows()), grid.all()),
      plan(model->rectify),
      smoother(
          model->method == Method::list ? gaussian_taps(model->smoothing_px) : published_taps(),
          grid.width, grid.height),
      second(published_taps(), grid.width, grid.height),
      activity(model->rectify, smoother.radius(), settings),
      in(2 * kStrip, grid.width),
      fine(model->rectify.decimation, model->rectify.fine_width()),
      zero(static_cast<std::size_t>(vec::padded(model->rectify.fine_width()))),
      between(2, grid.width),
      out(2 * kStrip, grid.width),
      lookup(model->list.um),
      calibration_q6(at(grid.height)),
      taken_q6(at(grid.height)),
      taken_gain_q12(at(grid.height)),
      reference_q6(at(grid.height)),
      gain_q12(at(grid.height)),
      untrusted(at(grid.height)) {
  const DepthList& from = model->list;
  list.first_q6 = from.first_q6;
  list.covered_q6 = from.covered_to_q6;
  if (model->method == Method::list) {
    // Everything beyond the covered range looks up the marker: no comparison per pixel is needed.
    lookup.resize(static_cast<std::size_t>(from.covered_to_q6 - from.first_q6) + 1);
    lookup.push_back(kUntrusted);
  }
  list.last_q6 = from.first_q6 + static_cast<int>(lookup.size()) - 1;
  lookup.push_back(kUntrusted);  // what the vector kernel's marked pixels look up
  list.um = lookup.data();

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
  activity.set_reference(reference_q8);
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
}

void Reconstructor::Impl::set_light(double factor) noexcept {
  if (model->method == Method::published) return;
  const auto q15 = [](double f) {
    return static_cast<std::int32_t>(std::lround(f * kernels::kFactorOne));
  };
  const auto count = static_cast<int>(taken_q6.size());
  kernels::scale_row(taken_q6.data(), q15(factor), count, reference_q6.data());
  kernels::scale_row(taken_gain_q12.data(), q15(1 / factor), count, gain_q12.data());
  activity.set_light(factor);
}

void Reconstructor::Impl::prefetch(const TileRows& tiles, int row,
                                   const std::int16_t* depth) const noexcept {
  constexpr int kForWriting = 1;
  constexpr int kToL2 = 2;
  const int end = std::min((row + 1) * TileGrid::kRows, grid.height);
  for_each_run(tiles[static_cast<std::size_t>(row)], [&](int first, int last) {
    last = std::min(last * grid.blocks_per_tile, grid.blocks());
    for (int y = row * TileGrid::kRows; y < end; ++y) {
      for (int block = first * grid.blocks_per_tile; block < last; ++block) {
        const std::size_t x = static_cast<std::size_t>(block) * vec::kBlock;
        __builtin_prefetch(gain_q12.data() + at(y) + x, 0, kToL2);
        __builtin_prefetch(depth + packed(y) + x, kForWriting, kToL2);
      }
    }
  });
}

std::uint64_t Reconstructor::Impl::readers(const TileRows& tiles, int begin,
                                           int end) const noexcept {
  const int first = std::max(0, begin - smoother.reach()) / kStrip;
  const int last = std::min(smoother.pairs() - 1, end - 1 + smoother.reach()) / kStrip;
  std::uint64_t any = 0;
  for (int row = first; row <= last; ++row) any |= tiles[static_cast<std::size_t>(row)];
  return any;
}

void Reconstructor::Impl::rectify(const std::uint8_t* luma, int y, int x0, int x1,
                                  std::int16_t* row) noexcept {
  const RectifyTable& table = model->rectify;
  const int decimation = table.decimation;
  const int first = x0 * decimation / RectifyPlan::kGroup;
  const int last = std::min((x1 * decimation + RectifyPlan::kGroup - 1) / RectifyPlan::kGroup,
                            plan.blocks() * RectifyPlan::kGroups);
  if (decimation == 1) {
    vec::rectify_difference(plan, y, first, last, luma, entries(y), table.fine_width(),
                            reference_q6.data() + at(y), row);
    return;
  }
  std::array<const std::int16_t*, kMaxDecimation> rows{};
  for (int k = 0; k < decimation; ++k) {
    const int fine_y = y * decimation + k;
    vec::rectify_difference(plan, fine_y, first, last, luma, entries(fine_y), table.fine_width(),
                            zero.data(), fine.row(k));
    rows[static_cast<std::size_t>(k)] = fine.row(k) + std::ptrdiff_t{x0} * decimation;
  }
  kernels::average_difference_row(rows.data(), decimation, reference_q6.data() + at(y) + x0,
                                  std::min(x1, grid.width) - x0, row + x0);
}

void Reconstructor::Impl::rectify_pair(const std::uint8_t* luma, int pair, std::uint64_t tiles,
                                       int slot) noexcept {
  for (int i = 0; i < std::min(2, grid.height - 2 * pair); ++i) {
    for_each_run(tiles, [&](int first, int last) {
      rectify(luma, 2 * pair + i, std::max(0, first * grid.tile_width() - smoother.radius()),
              last * grid.tile_width() + smoother.radius(), in.row(2 * slot + i));
    });
  }
}

void Reconstructor::Impl::push_pair(int pair, std::uint64_t tiles, int slot) noexcept {
  for_each_run(tiles, [&](int first, int last) {
    smoother.push(pair, in.row(2 * slot), in.row(2 * slot + 1), first * grid.blocks_per_tile,
                  std::min(last * grid.blocks_per_tile, grid.blocks()));
  });
}

void Reconstructor::Impl::run_list(const std::uint8_t* luma, const TileRows& tiles,
                                   std::int16_t* depth, StepTimes& times,
                                   Stopwatch& watch) noexcept {
  int pushed = 0;
  for (int row = 0; row < grid.rows(); ++row) {
    const int begin = row * kStrip;
    const int end = std::min(begin + kStrip, smoother.pairs());
    const int needed = std::min(end + smoother.reach(), smoother.pairs());
    prefetch(tiles, row, depth);
    while (pushed < needed) {
      const int strip = pushed;
      const int strip_end = std::min(strip + kStrip, needed);
      pushed = strip_end;
      if (readers(tiles, strip, strip_end) == 0) continue;
      for (int pair = strip; pair < strip_end; ++pair) {
        rectify_pair(luma, pair, readers(tiles, pair, pair + 1), pair - strip);
      }
      times.rectify_ns += watch.lap();
      for (int pair = strip; pair < strip_end; ++pair) {
        push_pair(pair, readers(tiles, pair, pair + 1), pair - strip);
      }
      times.smooth_ns += watch.lap();
    }
    for_each_run(tiles[static_cast<std::size_t>(row)], [&](int first, int last) {
      first *= grid.blocks_per_tile;
      last = std::min(last * grid.blocks_per_tile, grid.blocks());
      for (int pair = begin; pair < end; ++pair) {
        const int slot = 2 * (pair - begin);
        smoother.take(pair, out.row(slot), out.row(slot + 1), first, last);
      }
      times.smooth_ns += watch.lap();
      const int x = first * vec::kBlock;
      const int columns = std::min(last * vec::kBlock, grid.width) - x;
      const int y = 2 * begin;
      const std::size_t here = at(y) + static_cast<std::size_t>(x);
      beyond += vec::gain_list_mask(
          {out.row(0) + x, out.stride(), gain_q12.data() + here, vec::padded(grid.width),
           depth + packed(y) + x, grid.width, columns, std::min(2 * end, grid.height) - y},
          list);
      times.list_ns += watch.lap();
    });
  }
}

void Reconstructor::Impl::run_published(const std::uint8_t* luma, std::int16_t* depth,
                                        StepTimes& times, Stopwatch& watch) noexcept {
  const int blocks = grid.blocks();
  const int pairs = smoother.pairs();
  const int reach = smoother.reach();
  int pushed = 0;
  int passed_on = 0;
  for (int pair = 0; pair < pairs; ++pair) {
    for (; pushed < std::min(pairs, pair + 2 * reach + 1); ++pushed) {
      rectify_pair(luma, pushed, grid.all(), 0);
      times.rectify_ns += watch.lap();
      beyond += vec::gain_list_mask({in.row(0), in.stride(), nullptr, 0, in.row(0), in.stride(),
                                     grid.width, std::min(2, grid.height - 2 * pushed)},
                                    list);
      times.list_ns += watch.lap();
      smoother.push(pushed, in.row(0), in.row(1), 0, blocks);
    }
    for (; passed_on < std::min(pairs, pair + reach + 1); ++passed_on) {
      smoother.take(passed_on, between.row(0), between.row(1), 0, blocks);
      second.push(passed_on, between.row(0), between.row(1), 0, blocks);
    }
    second.take(pair, out.row(0), out.row(1), 0, blocks);
    for (int y = 2 * pair; y < std::min(2 * pair + 2, grid.height); ++y) {
      std::copy_n(out.row(y - 2 * pair), grid.width, depth + packed(y));
      kernels::mask_row(untrusted.data() + at(y), grid.width, depth + packed(y));
    }
    times.smooth_ns += watch.lap();
  }
}

void Reconstructor::Impl::clear(std::uint64_t tiles, int row, std::int16_t* depth) const noexcept {
  for_each_run(tiles, [&](int first, int last) {
    const int x0 = first * grid.tile_width();
    const int x1 = std::min(last * grid.tile_width(), grid.width);
    for (int y = row * TileGrid::kRows; y < std::min((row + 1) * TileGrid::kRows, grid.height);
         ++y) {
      std::fill_n(depth + packed(y) + x0, x1 - x0, std::int16_t{0});
      kernels::mask_row(untrusted.data() + at(y) + static_cast<std::size_t>(x0), x1 - x0,
                        depth + packed(y) + x0);
    }
  });
}

void Reconstructor::Impl::clear_rest(const TileRows& tiles, DrawnTiles& drawn,
                                     std::int16_t* depth) const noexcept {
  if (drawn.rest != rest || drawn.tiles.size() != tiles.size()) {
    drawn.tiles = all_tiles;
    drawn.rest = rest;
  }
  for (int row = 0; row < grid.rows(); ++row) {
    std::uint64_t& was = drawn.tiles[static_cast<std::size_t>(row)];
    const std::uint64_t now = tiles[static_cast<std::size_t>(row)];
    clear(was & ~now, row, depth);
    was = now;
  }
}

Reconstructor::Reconstructor(std::shared_ptr<const Model> model, const ActivitySettings& activity) {
  if (!model) throw std::invalid_argument("model: missing");
  check(*model);
  impl_ = std::make_unique<Impl>(std::move(model), activity);
}

Reconstructor::~Reconstructor() = default;
Reconstructor::Reconstructor(Reconstructor&&) noexcept = default;
Reconstructor& Reconstructor::operator=(Reconstructor&&) noexcept = default;

const Model& Reconstructor::model() const noexcept { return *impl_->model; }

int Reconstructor::beyond_pixels() const noexcept { return impl_->beyond; }

void Reconstructor::set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
  impl_->set_reference(reference_q8);
}

void Reconstructor::set_light(double factor) noexcept { impl_->set_light(factor); }

void Reconstructor::follow(const Reconstructor& other) noexcept {
  impl_->activity.follow(other.impl_->activity);
}

void Reconstructor::run(const std::uint8_t* luma, std::ptrdiff_t stride,
                        std::span<std::int16_t> depth_um, StepTimes* times) noexcept {
  StepTimes spent;
  Stopwatch watch(times != nullptr);
  impl_->beyond = 0;
  impl_->plan.set_stride(stride);
  if (impl_->model->method == Method::list) {
    impl_->run_list(luma, impl_->all_tiles, depth_um.data(), spent, watch);
  } else {
    impl_->run_published(luma, depth_um.data(), spent, watch);
  }
  if (times != nullptr) *times = spent;
}

void Reconstructor::run_active(const std::uint8_t* luma, std::ptrdiff_t stride,
                               std::span<std::int16_t> depth_um, DrawnTiles& drawn,
                               ActivityReport& report, StepTimes* times) noexcept {
  StepTimes spent;
  Stopwatch watch(times != nullptr);
  impl_->beyond = 0;
  impl_->plan.set_stride(stride);
  const TileRows& tiles = impl_->activity.look(luma, stride, report);
  spent.activity_ns = watch.lap();
  if (impl_->model->method == Method::list) {
    impl_->clear_rest(tiles, drawn, depth_um.data());
    if (report.active_tiles > 0) impl_->run_list(luma, tiles, depth_um.data(), spent, watch);
  } else {
    report.active_tiles = report.tiles;
    impl_->clear_rest(impl_->all_tiles, drawn, depth_um.data());
    impl_->run_published(luma, depth_um.data(), spent, watch);
  }
  if (times != nullptr) *times = spent;
}

const TileGrid& Reconstructor::grid() const noexcept { return impl_->grid; }

FrameRegion Reconstructor::region() const noexcept { return impl_->activity.region(); }

}  // namespace dtact::recon
