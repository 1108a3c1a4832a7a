#include "clients/perceive/geometry/point_cloud.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "clients/perceive/geometry/rows.hpp"

namespace dtact::perceive {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr double kMetre = 1e-3;  // of a millimetre

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

/// Calls piece(begin, count, left, right) for pieces of a row whose neighbours lie equally far to
/// both sides: all that is `reach` from its ends, and each pixel nearer to them.
template <typename Piece>
void in_pieces(int width, int reach, Piece piece) {
  const auto single = [&](int i) {
    piece(i, 1, std::max(-i, -reach), std::min(width - 1 - i, reach));
  };
  const int inner = width - 2 * reach;
  for (int i = 0; i < std::min(reach, width); ++i) single(i);
  if (inner > 0) piece(reach, inner, -reach, reach);
  for (int i = std::max(reach, width - reach); i < width; ++i) single(i);
}

}  // namespace

void CloudMaker::read(const DepthGrid& depth) {
  const auto size = static_cast<std::size_t>(depth.width) * static_cast<std::size_t>(depth.height);
  if (depth.width < 1 || depth.height < 1 || depth.values.size() != size || depth.x < 0 ||
      depth.y < 0 || depth.x + depth.width > depth.full_width ||
      depth.y + depth.height > depth.full_height || !(depth.mm_per_px > 0)) {
    throw std::invalid_argument("the depth map's sizes contradict each other");
  }
  depth_.resize(size);
  to_metres(depth.values.data(), size, depth.untrusted,
            static_cast<float>(depth.um_per_unit * 1e-6), depth_.data());
  if (surface_.kind == recon::Surface::Kind::plane) return;
  if (table_.width != depth.full_width || table_.height != depth.full_height ||
      table_.mm_per_px != depth.mm_per_px) {
    table_ = make_surface_table(surface_, depth.full_width, depth.full_height, depth.mm_per_px);
  }
  points_.resize(3 * size);
  for (std::size_t part = 0; part < 3; ++part) {
    float* out = points_.data() + part * size;
    for (int row = 0; row < depth.height; ++row) {
      const std::size_t offset =
          static_cast<std::size_t>(depth.y + row) * static_cast<std::size_t>(depth.full_width) +
          static_cast<std::size_t>(depth.x);
      press(table_.point[part].data() + offset, table_.normal[part].data() + offset,
            depth_.data() + std::ptrdiff_t{row} * depth.width, depth.width, out);
      out += depth.width;
    }
  }
}

Vector CloudMaker::point(const DepthGrid& depth, int row, int column) const {
  if (surface_.kind == recon::Surface::Kind::plane) {
    return {(depth.x + column - 0.5 * (depth.full_width - 1)) * depth.mm_per_px * kMetre,
            (depth.y + row - 0.5 * (depth.full_height - 1)) * depth.mm_per_px * kMetre,
            -double{depth_at(depth, row, column)}};
  }
  const std::size_t size = depth_.size();
  const std::size_t i = static_cast<std::size_t>(row) * static_cast<std::size_t>(depth.width) +
                        static_cast<std::size_t>(column);
  return {points_[i], points_[size + i], points_[2 * size + i]};
}

/// One point and its normal where one of the four neighbours at `reach` is missing.
void CloudMaker::mend(const DepthGrid& depth, int row, int column, int reach,
                      const Row& out) const {
  const auto trusted = [&](int r, int c) {
    return r >= 0 && r < depth.height && c >= 0 && c < depth.width &&
           !std::isnan(point(depth, r, c)[2]);
  };
  // The farthest neighbour in one direction that is there, at most `reach` away.
  const auto far = [&](int down, int right) {
    int steps = reach;
    while (steps > 0 && !trusted(row + steps * down, column + steps * right)) --steps;
    return point(depth, row + steps * down, column + steps * right);
  };
  const Vector here = point(depth, row, column);
  Vector normal{};
  if (trusted(row, column)) {
    const Vector left = far(0, -1);
    const Vector right = far(0, 1);
    const Vector above = far(-1, 0);
    const Vector below = far(1, 0);
    const Vector u{right[0] - left[0], right[1] - left[1], right[2] - left[2]};
    const Vector v{below[0] - above[0], below[1] - above[1], below[2] - above[2]};
    normal = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
  }
  const double length = std::hypot(normal[0], normal[1], normal[2]);
  for (std::size_t i = 0; i < 3; ++i) {
    out[i][column] = length > 0 ? static_cast<float>(here[i]) : kNaN;
    out[3 + i][column] = length > 0 ? static_cast<float>(normal[i] / length) : kNaN;
  }
}

void CloudMaker::flat_row(const DepthGrid& depth, int row, int reach, const Row& out) const {
  const std::ptrdiff_t up = std::max(0, row - reach) - row;
  const std::ptrdiff_t down = std::min(depth.height - 1, row + reach) - row;
  const float* here = depth_.data() + std::ptrdiff_t{row} * depth.width;
  const double px = depth.mm_per_px * kMetre;
  const auto y = static_cast<float>((depth.y + row - 0.5 * (depth.full_height - 1)) * px);
  const auto origin = static_cast<float>((depth.x - 0.5 * (depth.full_width - 1)) * px);
  const auto step = static_cast<float>(px);
  for (int i = 0; i < depth.width; ++i)
    out[PointCloud::kX][i] = origin + step * static_cast<float>(i);
  std::fill_n(out[PointCloud::kY], depth.width, y);
  for (int i = 0; i < depth.width; ++i) out[PointCloud::kZ][i] = -here[i];
  const auto per_row = static_cast<float>(1 / (static_cast<double>(down - up) * px));
  in_pieces(depth.width, reach, [&](int i, int count, int left, int right) {
    const float* at = here + i;
    flat_normals(at, left, right, up * depth.width, down * depth.width, count,
                 static_cast<float>(1 / ((right - left) * px)), per_row,
                 out[PointCloud::kNormalX] + i, out[PointCloud::kNormalY] + i,
                 out[PointCloud::kNormalZ] + i);
  });
}

void CloudMaker::curved_row(const DepthGrid& depth, int row, int reach, const Row& out) const {
  const std::size_t size = depth_.size();
  const std::ptrdiff_t width = depth.width;
  const std::ptrdiff_t above = (std::max(0, row - reach) - row) * width;
  const std::ptrdiff_t below = (std::min(depth.height - 1, row + reach) - row) * width;
  const float* x = points_.data() + row * width;
  for (std::size_t part = 0; part < 3; ++part) {
    std::copy_n(x + part * size, depth.width, out[part]);
  }
  in_pieces(depth.width, reach, [&](int i, int count, int left, int right) {
    curved_normals(x + i, size, left, right, above, below, count, out[PointCloud::kNormalX] + i,
                   out[PointCloud::kNormalY] + i, out[PointCloud::kNormalZ] + i);
  });
}

void CloudMaker::make(const DepthGrid& depth, int stride, PointCloud& out) {
  if (stride < 1) throw std::invalid_argument("a point cloud's stride is at least 1");
  read(depth);
  const int reach = std::max(1, static_cast<int>(std::lround(kReachMm / depth.mm_per_px)));
  const Taken columns = taken(depth.x, depth.width, depth.full_width, stride);
  const Taken rows = taken(depth.y, depth.height, depth.full_height, stride);
  out.width = columns.count;
  out.height = rows.count;
  out.x = columns.first;
  out.y = rows.first;
  out.stride = stride;
  out.values.resize(PointCloud::kParts * out.size());
  // Whole rows go where they belong at once.
  const bool whole = stride == 1;
  if (!whole) row_.resize(PointCloud::kParts * static_cast<std::size_t>(depth.width));
  for (int i = 0; i < rows.count; ++i) {
    const int row = rows.first + i * stride - depth.y;
    Row to{};
    Row made{};
    for (std::size_t part = 0; part < PointCloud::kParts; ++part) {
      to[part] = out.values.data() + part * out.size() + std::ptrdiff_t{i} * out.width;
      made[part] = whole ? to[part] : row_.data() + part * static_cast<std::size_t>(depth.width);
    }
    if (surface_.kind == recon::Surface::Kind::plane) {
      flat_row(depth, row, reach, made);
    } else {
      curved_row(depth, row, reach, made);
    }
    const float* normals = made[PointCloud::kNormalZ];
    const int holes = count_holes(normals, depth.width);
    for (int column = 0; holes > 0 && column < depth.width; ++column) {
      if (std::isnan(normals[column])) mend(depth, row, column, reach, made);
    }
    if (whole) continue;
    for (std::size_t part = 0; part < PointCloud::kParts; ++part) {
      const float* from = made[part] + (columns.first - depth.x);
      for (int column = 0; column < out.width; ++column) {
        to[part][column] = from[std::ptrdiff_t{column} * stride];
      }
    }
  }
}

}  // namespace dtact::perceive
