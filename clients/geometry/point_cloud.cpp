#include "clients/geometry/point_cloud.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "clients/geometry/rows.hpp"

namespace dtact::perceive {
namespace {

constexpr std::size_t kMaxTables = 3;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

/// The first pixel of the whole map that is taken, as of blocks that leave both sides out alike.
int first_of(int full, int stride) { return full % stride / 2 + stride / 2; }

/// The first and the number of those that lie in [begin, begin + size).
struct Taken {
  int first = 0;
  int count = 0;
};
Taken taken(int begin, int size, int full, int stride) {
  const int first = first_of(full, stride);
  const int skipped = begin <= first ? 0 : (begin - first + stride - 1) / stride;
  const int start = first + skipped * stride;
  const int end = begin + size;
  return {start, start >= end ? 0 : (end - start + stride - 1) / stride};
}

/// For the tables of all makers, since a cloud may go from one to another.
std::uint64_t next_number() {
  static std::atomic<std::uint64_t> number{0};
  return ++number;
}

}  // namespace

struct CloudMaker::Work {
  Work(const DepthGrid& of, PointCloud& to)
      : depth(of),
        out(to),
        tile(kTilePixels * (1 + (of.width - 1) / (kMaxTiles * kTilePixels))),
        reach(std::max(1, static_cast<int>(std::lround(kReachMm / of.mm_per_px)))),
        // Where 0 is no depth nothing is at rest.
        rests(of.untrusted != 0),
        unit{static_cast<float>(of.um_per_unit * 1e-6), of.untrusted} {}

  [[nodiscard]] const std::int16_t* values(int row) const {
    return depth.values.data() + std::ptrdiff_t{row} * depth.width;
  }
  [[nodiscard]] float* part(PointCloud::Part part, int row) const {
    return out.values.data() + part * out.size() + std::ptrdiff_t{row} * depth.width;
  }
  [[nodiscard]] PointCloud::Drawn::Row& drawn(int row) const {
    return out.drawn.rows[static_cast<std::size_t>(row)];
  }
  /// Calls back(begin, end) with the pixels of each run of tiles that are set.
  template <typename Back>
  void for_each_run(std::uint64_t set, Back back) const {
    const int count = (depth.width + tile - 1) / tile;
    for (int first = std::countr_zero(set); first < count;) {
      const int last = std::min(count, first + std::countr_one(set >> first));
      back(first * tile, std::min(depth.width, last * tile));
      first = last == kMaxTiles ? kMaxTiles : last + std::countr_zero(set >> last);
    }
  }

  const DepthGrid& depth;
  PointCloud& out;
  static constexpr int kMaxTiles = 64;
  int tile;  ///< Pixels.
  int reach;
  bool rests;
  DepthUnit unit;
};

void CloudMaker::prepare(const DepthGrid& depth) {
  const auto size = static_cast<std::size_t>(depth.width) * static_cast<std::size_t>(depth.height);
  if (depth.width < 1 || depth.height < 1 || depth.values.size() != size || depth.x < 0 ||
      depth.y < 0 || depth.x + depth.width > depth.full_width ||
      depth.y + depth.height > depth.full_height || !(depth.mm_per_px > 0)) {
    throw std::invalid_argument("the depth map's sizes contradict each other");
  }
  const auto known = std::ranges::find_if(tables_, [&depth](const Numbered& one) {
    return one.table.width == depth.full_width && one.table.height == depth.full_height &&
           one.table.mm_per_px == depth.mm_per_px;
  });
  if (known != tables_.end()) {
    std::rotate(tables_.begin(), known, known + 1);
    return;
  }
  if (tables_.size() == kMaxTables) tables_.pop_back();
  SurfaceTable table{depth.full_width, depth.full_height, depth.mm_per_px, {}, {}, {}};
  if (!flat()) {
    table = make_surface_table(surface_, depth.full_width, depth.full_height, depth.mm_per_px);
  }
  tables_.insert(tables_.begin(), {std::move(table), next_number()});
}

Vector CloudMaker::point(const Work& work, int row, int column) const {
  const DepthGrid& depth = work.depth;
  if (!flat()) {
    return {work.part(PointCloud::kX, row)[column], work.part(PointCloud::kY, row)[column],
            work.part(PointCloud::kZ, row)[column]};
  }
  const int value = work.values(row)[column];
  const double down =
      value == depth.untrusted ? kNaN : double{static_cast<float>(value) * work.unit.metres};
  const recon::Point place =
      surface_.view.place({(depth.x + column - 0.5 * (depth.full_width - 1)) * depth.mm_per_px,
                           (depth.y + row - 0.5 * (depth.full_height - 1)) * depth.mm_per_px},
                          down / kMetre);
  return {place.x * kMetre, place.y * kMetre, -down};
}

/// One point and its normal where one of the four neighbours at `reach` is missing.
void CloudMaker::fix(const Work& work, int row, int column) {
  const auto trusted = [&](int r, int c) {
    return r >= 0 && r < work.depth.height && c >= 0 && c < work.depth.width &&
           !std::isnan(point(work, r, c)[2]);
  };
  // The farthest neighbour in one direction that is there, at most `reach` away.
  const auto far = [&](int down, int right) {
    int steps = work.reach;
    while (steps > 0 && !trusted(row + steps * down, column + steps * right)) --steps;
    return point(work, row + steps * down, column + steps * right);
  };
  const std::size_t index =
      static_cast<std::size_t>(row) * static_cast<std::size_t>(work.depth.width) +
      static_cast<std::size_t>(column);
  if (!trusted(row, column)) return lone_.push_back(index);
  const Vector left = far(0, -1);
  const Vector right = far(0, 1);
  const Vector above = far(-1, 0);
  const Vector below = far(1, 0);
  const Vector u{right[0] - left[0], right[1] - left[1], right[2] - left[2]};
  const Vector v{below[0] - above[0], below[1] - above[1], below[2] - above[2]};
  const Vector normal{u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                      u[0] * v[1] - u[1] * v[0]};
  const double length = std::hypot(normal[0], normal[1], normal[2]);
  for (std::size_t i = 0; i < 3; ++i) {
    work.part(static_cast<PointCloud::Part>(PointCloud::kNormalX + i), row)[column] =
        length > 0 ? static_cast<float>(normal[i] / length) : kNaN;
  }
  // Its point may still be another one's neighbour.
  if (!(length > 0)) lone_.push_back(index);
}

void CloudMaker::erase_lone(const Work& work) const {
  const auto width = static_cast<std::size_t>(work.depth.width);
  for (const std::size_t index : lone_) {
    for (std::size_t part = 0; part < 3; ++part) {
      work.out.values[part * work.out.size() + index] = kNaN;
    }
    const std::uint64_t tile = std::uint64_t{1}
                               << (index % width / static_cast<std::size_t>(work.tile));
    PointCloud::Drawn::Row& drawn = work.drawn(static_cast<int>(index / width));
    drawn.rest &= ~tile;
    drawn.placed &= ~tile;
  }
}

/// The points of a curved surface, where they are not the undeformed surface's now and before.
void CloudMaker::press_row(const Work& work, int row) const {
  const DepthGrid& depth = work.depth;
  const std::uint64_t pressed = pressed_[static_cast<std::size_t>(row)];
  std::uint64_t& placed = work.drawn(row).placed;
  const SurfaceTable& table = tables_.front().table;
  const std::size_t from =
      static_cast<std::size_t>(depth.y + row) * static_cast<std::size_t>(depth.full_width) +
      static_cast<std::size_t>(depth.x);
  work.for_each_run(pressed | ~placed, [&](int begin, int end) {
    const std::size_t at = from + static_cast<std::size_t>(begin);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      press(table.point[axis].data() + at, table.ray[axis].data() + at, work.values(row) + begin,
            work.unit, end - begin, work.part(static_cast<PointCloud::Part>(axis), row) + begin);
    }
  });
  placed = ~pressed;
}

/// Points of a plane, or the normals of points that are there, of a row's pixels.
void CloudMaker::make_part(const Work& work, int row, int begin, int end) {
  const DepthGrid& depth = work.depth;
  const std::ptrdiff_t width = depth.width;
  const RowPart part{.width = depth.width,
                     .reach = work.reach,
                     .above = (std::max(0, row - work.reach) - row) * width,
                     .below = (std::min(depth.height - 1, row + work.reach) - row) * width,
                     .begin = begin,
                     .end = end};
  float* nx = work.part(PointCloud::kNormalX, row);
  float* ny = work.part(PointCloud::kNormalY, row);
  float* nz = work.part(PointCloud::kNormalZ, row);
  if (flat()) {
    const auto metres = [](double mm) { return static_cast<float>(mm * kMetre); };
    const recon::Viewpoint& view = surface_.view;
    const FlatRow at{.x = metres((depth.x - 0.5 * (depth.full_width - 1)) * depth.mm_per_px),
                     .y = metres((depth.y + row - 0.5 * (depth.full_height - 1)) * depth.mm_per_px),
                     .step = metres(depth.mm_per_px),
                     .foot_x = metres(view.foot_mm.x),
                     .foot_y = metres(view.foot_mm.y),
                     .per_metre = static_cast<float>(view.per_mm / kMetre)};
    flat_points(work.values(row), work.unit, at, part,
                {work.part(PointCloud::kX, row), work.part(PointCloud::kY, row),
                 work.part(PointCloud::kZ, row), nx, ny, nz});
  } else {
    curved_normals(work.part(PointCloud::kX, row), work.out.size(), part, nx, ny, nz);
  }
  if (count_holes(nz + begin, end - begin) == 0) return;
  for (int column = begin; column < end; ++column) {
    if (std::isnan(nz[column])) fix(work, row, column);
  }
}

/// The tiles of a row in whose points' reach there is no contact.
std::uint64_t CloudMaker::resting(const Work& work, int row) const {
  if (!work.rests) return 0;
  std::uint64_t pressed = 0;
  const int end = std::min(work.depth.height, row + work.reach + 1);
  for (int i = std::max(0, row - work.reach); i < end; ++i) {
    pressed |= pressed_[static_cast<std::size_t>(i)];
  }
  for (int pixels = 0; pixels < work.reach; pixels += work.tile) {
    pressed |= pressed << 1U | pressed >> 1U;
  }
  return ~pressed;
}

void CloudMaker::make_row(const Work& work, int row) {
  const std::uint64_t rest = resting(work, row);
  std::uint64_t& drawn = work.drawn(row).rest;
  work.for_each_run(~(rest & drawn), [&](int begin, int end) { make_part(work, row, begin, end); });
  drawn = rest;
}

void CloudMaker::make_whole(const DepthGrid& depth, PointCloud& out) {
  const Work work(depth, out);
  const auto rows = static_cast<std::size_t>(depth.height);
  const std::uint64_t number = tables_.front().number;
  const bool same = out.drawn.tables == number && out.stride == 1 && out.x == depth.x &&
                    out.y == depth.y && out.width == depth.width && out.height == depth.height;
  if (!same) {
    out.drawn.tables = 0;
    out.width = depth.width;
    out.height = depth.height;
    out.x = depth.x;
    out.y = depth.y;
    out.stride = 1;
    out.values.resize(PointCloud::kParts * out.size());
    out.drawn.rows.assign(rows, {});
    out.drawn.tables = number;
  }
  pressed_.resize(rows);
  lone_.clear();
  int placed = 0;
  for (int row = 0; row < depth.height; ++row) {
    // What the row's normals look at.
    for (; placed <= row + work.reach && placed < depth.height; ++placed) {
      pressed_[static_cast<std::size_t>(placed)] =
          work.rests ? pressed_tiles(work.values(placed), depth.width, work.tile)
                     : ~std::uint64_t{0};
      if (!flat()) press_row(work, placed);
    }
    make_row(work, row);
  }
  erase_lone(work);
}

void CloudMaker::make(const DepthGrid& depth, int stride, PointCloud& out) {
  if (stride < 1) throw std::invalid_argument("a point cloud's stride is at least 1");
  prepare(depth);
  if (stride == 1) return make_whole(depth, out);
  make_whole(depth, whole_);
  const Taken columns = taken(depth.x, depth.width, depth.full_width, stride);
  const Taken rows = taken(depth.y, depth.height, depth.full_height, stride);
  out.drawn.tables = 0;
  out.width = columns.count;
  out.height = rows.count;
  out.x = columns.first;
  out.y = rows.first;
  out.stride = stride;
  out.values.resize(PointCloud::kParts * out.size());
  float* to = out.values.data();
  for (std::size_t part = 0; part < PointCloud::kParts; ++part) {
    const auto from = whole_.part(static_cast<PointCloud::Part>(part));
    for (int i = 0; i < rows.count; ++i) {
      const std::ptrdiff_t row = rows.first + i * stride - depth.y;
      const float* at = from.data() + row * depth.width + (columns.first - depth.x);
      for (int k = 0; k < columns.count; ++k) *to++ = at[std::ptrdiff_t{k} * stride];
    }
  }
}

}  // namespace dtact::perceive
