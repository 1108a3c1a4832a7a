#include "clients/perceive/cloud_message.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>

#include "proto/dtact.pb.h"

static_assert(std::endian::native == std::endian::little);

namespace dtact::perceive {
namespace {

constexpr float kMost = 32767;

/// A micrometre, or more where the cloud is too large for that.
double unit_of(const PointCloud& cloud) {
  float largest = 0;
  for (const float value : std::span(cloud.values).first(3 * cloud.size())) {
    if (std::abs(value) > largest) largest = std::abs(value);  // false for NaN
  }
  return std::max(1e-6, static_cast<double>(largest) / kMost);
}

void quantise(std::span<const float> values, float per_metre, std::string& out) {
  for (const float value : values) {
    std::int16_t unit = INT16_MIN;
    if (!std::isnan(value)) {
      unit = static_cast<std::int16_t>(std::clamp(std::round(value * per_metre), -kMost, kMost));
    }
    out.append(reinterpret_cast<const char*>(&unit), sizeof unit);
  }
}

}  // namespace

void fill(const PointCloud& cloud, int encoding, v1::PointCloud& out) {
  out.set_encoding(static_cast<v1::CloudEncoding>(encoding));
  out.set_width(static_cast<std::uint32_t>(cloud.width));
  out.set_height(static_cast<std::uint32_t>(cloud.height));
  std::uint32_t points = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) points += cloud.has(i) ? 1U : 0U;
  out.set_points(points);
  std::string& data = *out.mutable_data();
  if (encoding == v1::CLOUD_FLOAT32) {
    out.set_metres_per_unit(1);
    data.assign(reinterpret_cast<const char*>(cloud.values.data()),
                cloud.values.size() * sizeof(float));
    return;
  }
  const double unit = unit_of(cloud);
  out.set_metres_per_unit(unit);
  data.reserve(cloud.values.size() * sizeof(std::int16_t));
  const auto values = std::span(cloud.values);
  quantise(values.first(3 * cloud.size()), static_cast<float>(1 / unit), data);
  quantise(values.subspan(3 * cloud.size()), kMost, data);
}

}  // namespace dtact::perceive
