#include "clients/perceive/cloud_message.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <string>

#include "clients/geometry/rows.hpp"
#include "proto/dtact.pb.h"

static_assert(std::endian::native == std::endian::little);

namespace dtact::perceive {
namespace {

constexpr float kMax = 32767;

/// A micrometre, or more where the cloud is too large for that.
double unit_of(const PointCloud& cloud) {
  return std::max(1e-6, double{largest(cloud.values.data(), 3 * cloud.size())} / kMax);
}

}  // namespace

void fill(const PointCloud& cloud, int encoding, v1::PointCloud& out) {
  out.set_encoding(static_cast<v1::CloudEncoding>(encoding));
  out.set_width(static_cast<std::uint32_t>(cloud.width));
  out.set_height(static_cast<std::uint32_t>(cloud.height));
  const auto size = static_cast<int>(cloud.size());
  out.set_points(static_cast<std::uint32_t>(size - count_holes(cloud.values.data(), size)));
  std::string& data = *out.mutable_data();
  if (encoding == v1::CLOUD_FLOAT32) {
    out.set_metres_per_unit(1);
    data.assign(reinterpret_cast<const char*>(cloud.values.data()),
                cloud.values.size() * sizeof(float));
    return;
  }
  const double unit = unit_of(cloud);
  out.set_metres_per_unit(unit);
  data.resize(cloud.values.size() * sizeof(std::int16_t));
  auto* units = reinterpret_cast<std::int16_t*>(data.data());
  const std::size_t half = 3 * cloud.size();
  quantise(cloud.values.data(), half, static_cast<float>(1 / unit), units);
  quantise(cloud.values.data() + half, half, kMax, units + half);
}

}  // namespace dtact::perceive
