#include "daemon/recon/reconstructor_impl.hpp"

#include <algorithm>
#include <bit>
#include <stdexcept>
#include <string>
#include <utility>

#include "daemon/recon/kernels.hpp"

namespace dtact::recon {
namespace {

const DepthLut& lut_for(const Model& model, int steps) {
  if (steps == 0) return model.lut;
  const auto found = std::ranges::find(model.sharpened, steps, &Model::Sharpened::steps);
  if (found == model.sharpened.end()) {
    throw std::invalid_argument("sharpened: the calibration has no LUT for " +
                                std::to_string(steps) + (steps == 1 ? " step" : " steps") +
                                " of sharpening");
  }
  return found->lut;
}

}  // namespace

Reconstructor::Impl::Impl(std::shared_ptr<const Model> the_model, int the_steps)
    : model(std::move(the_model)),
      steps(the_steps),
      grid(model->rectify.width, model->rectify.height),
      all_tiles(static_cast<std::size_t>(grid.rows()), grid.all()),
      plan(model->rectify),
      smoother(taps_of(*model), grid.width, grid.height),
      second(published_taps(), grid.width, grid.height),
      in(2 * kStrip, grid.width),
      between(2, grid.width),
      out(2 * kStrip, grid.width),
      sharpener_tiles(static_cast<std::size_t>(grid.rows())),
      lut(lut_for(*model, steps), model->method),
      reference(model) {
  // check() wants the scattering where there are LUTs for steps.
  if (const auto& scattering = model->scattering; steps > 0 && scattering) {
    sharpener.emplace(*scattering, steps, model->mm_per_px, grid.width, grid.height);
  }
}

void Reconstructor::Impl::prefetch(const TileRows& tiles, int row,
                                   const std::int16_t* depth) const noexcept {
  constexpr int kForWriting = 1;
  constexpr int kToL2 = 2;
  const int end = std::min((row + 1) * TileGrid::kRows, grid.height);
  for_each_run(tiles[static_cast<std::size_t>(row)], [&](int first, int last) {
    last = std::min(last * grid.blocks_per_tile, grid.blocks());
    for (int y = row * TileGrid::kRows; y < end; ++y) {
      const std::int16_t* const gain = reference.gain_q12(y);
      for (int block = first * grid.blocks_per_tile; block < last; ++block) {
        const std::size_t x = static_cast<std::size_t>(block) * vec::kBlock;
        __builtin_prefetch(gain + x, 0, kToL2);
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
                            reference.q6(y), row);
    return;
  }
  vec::rectify_mean_difference(plan, decimation, y, first, last, luma, entries(y * decimation),
                               table.fine_width(), reference.q6(y), row);
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

template <typename Begin, typename Made, typename Done>
void Reconstructor::Impl::smooth_tiles(const std::uint8_t* luma, const TileRows& tiles,
                                       StepTimes& times, Stopwatch& watch, Begin begin_row,
                                       Made made, Done done) noexcept {
  int pushed = 0;
  for (int row = 0; row < grid.rows(); ++row) {
    const int begin = row * kStrip;
    const int end = std::min(begin + kStrip, smoother.pairs());
    const int needed = std::min(end + smoother.reach(), smoother.pairs());
    begin_row(row);
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
      made(row, first, last);
    });
    done(row);
  }
}

void Reconstructor::Impl::apply_lut(const std::uint8_t* luma, const TileRows& tiles,
                                    std::int16_t* depth, StripSums* sums, StepTimes& times,
                                    Stopwatch& watch) noexcept {
  if (sharpener) return run_sharpened(*sharpener, luma, tiles, depth, sums, times, watch);
  const auto view = [&](int row, int first, int last) {
    apply_lut_rows({out.row(0), out.stride(), reference.gain_q12(row * TileGrid::kRows),
                    vec::padded(grid.width)},
                   row, first, last, depth);
    times.lut_ns += watch.lap();
  };
  smooth_tiles(
      luma, tiles, times, watch, [&](int row) { prefetch(tiles, row, depth); }, view,
      [&](int row) { finish(row, sums, times, watch); });
}

void Reconstructor::Impl::apply_lut_rows(vec::LutRows rows, int row, int first, int last,
                                         std::int16_t* depth) noexcept {
  const int x = first * vec::kBlock;
  const int y = row * TileGrid::kRows;
  rows.difference_q6 += x;
  rows.gain_q12 += x;
  rows.depth_um = depth + packed(y) + x;
  rows.depth_stride = grid.width;
  rows.width = std::min(last * vec::kBlock, grid.width) - x;
  rows.height = std::min(TileGrid::kRows, grid.height - y);
  beyond += vec::gain_lut_mask(rows, lut.view());
}

void Reconstructor::Impl::finish(int row, StripSums* sums, StepTimes& times,
                                 Stopwatch& watch) const noexcept {
  if (sums == nullptr) return;
  sums->finished(row);
  times.sums_ns += watch.lap();
}

MapArea Reconstructor::Impl::area_of(const TileRows& tiles) const noexcept {
  std::uint64_t columns = 0;
  int first = grid.rows();
  int last = 0;
  for (int row = 0; row < grid.rows(); ++row) {
    if (tiles[static_cast<std::size_t>(row)] == 0) continue;
    columns |= tiles[static_cast<std::size_t>(row)];
    first = std::min(first, row);
    last = row + 1;
  }
  if (columns == 0) return {};
  return {
      first * TileGrid::kRows, std::min(last * TileGrid::kRows, grid.height),
      std::countr_zero(columns) * grid.blocks_per_tile,
      std::min(static_cast<int>(std::bit_width(columns)) * grid.blocks_per_tile, grid.blocks())};
}

void Reconstructor::Impl::set_tiles(const MapArea& area, TileRows& tiles) const noexcept {
  const int first = area.first / grid.blocks_per_tile;
  const int last = (area.last + grid.blocks_per_tile - 1) / grid.blocks_per_tile;
  const std::uint64_t columns = grid.all() << first & grid.all() >> (grid.columns() - last);
  for (int row = 0; row < grid.rows(); ++row) {
    const bool inside = row * TileGrid::kRows < area.y1 && (row + 1) * TileGrid::kRows > area.y0;
    tiles[static_cast<std::size_t>(row)] = inside ? columns : 0;
  }
}

void Reconstructor::Impl::run_sharpened(Sharpener& filter, const std::uint8_t* luma,
                                        const TileRows& tiles, std::int16_t* depth, StripSums* sums,
                                        StepTimes& times, Stopwatch& watch) noexcept {
  // The filter reaches over several tiles: what it reads is nearly a rectangle anyway.
  const MapArea area = area_of(tiles);
  set_tiles(filter.needed(area), sharpener_tiles);
  const auto take_levels = [&](int row, int first, int last) {
    const int y0 = row * TileGrid::kRows;
    for (int y = y0; y < std::min(y0 + TileGrid::kRows, grid.height); ++y) {
      vec::lit_row(out.row(y - y0), reference.gain_q12(y), first, last, filter.level(y));
    }
    times.lut_ns += watch.lap();
  };
  const auto nothing = [](int) {};
  smooth_tiles(luma, sharpener_tiles, times, watch, nothing, take_levels, nothing);
  filter.run(area);
  times.smooth_ns += watch.lap();
  for (int row = 0; row < grid.rows(); ++row) {
    const int y = row * TileGrid::kRows;
    for_each_run(tiles[static_cast<std::size_t>(row)], [&](int first, int last) {
      apply_lut_rows(
          {filter.sharpened(y), filter.stride(), reference.marks_q12(y), vec::padded(grid.width)},
          row, first * grid.blocks_per_tile, std::min(last * grid.blocks_per_tile, grid.blocks()),
          depth);
    });
    times.lut_ns += watch.lap();
    finish(row, sums, times, watch);
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
      beyond += vec::gain_lut_mask({in.row(0), in.stride(), nullptr, 0, in.row(0), in.stride(),
                                    grid.width, std::min(2, grid.height - 2 * pushed)},
                                   lut.view());
      times.lut_ns += watch.lap();
      smoother.push(pushed, in.row(0), in.row(1), 0, blocks);
    }
    for (; passed_on < std::min(pairs, pair + reach + 1); ++passed_on) {
      smoother.take(passed_on, between.row(0), between.row(1), 0, blocks);
      second.push(passed_on, between.row(0), between.row(1), 0, blocks);
    }
    second.take(pair, out.row(0), out.row(1), 0, blocks);
    for (int y = 2 * pair; y < std::min(2 * pair + 2, grid.height); ++y) {
      std::copy_n(out.row(y - 2 * pair), grid.width, depth + packed(y));
      kernels::mask_row(reference.untrusted(y), grid.width, depth + packed(y));
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
      kernels::mask_row(reference.untrusted(y) + x0, x1 - x0, depth + packed(y) + x0);
    }
  });
}

void Reconstructor::Impl::clear_rest(const TileRows& tiles, DrawnTiles& drawn,
                                     std::int16_t* depth) const noexcept {
  if (drawn.rest != reference.count() || drawn.tiles.size() != tiles.size()) {
    drawn.tiles = all_tiles;
    drawn.rest = reference.count();
  }
  for (int row = 0; row < grid.rows(); ++row) {
    std::uint64_t& was = drawn.tiles[static_cast<std::size_t>(row)];
    const std::uint64_t now = tiles[static_cast<std::size_t>(row)];
    clear(was & ~now, row, depth);
    was = now;
  }
}

}  // namespace dtact::recon
