#include "clients/cpp/maps.hpp"

#include <algorithm>
#include <limits>

#include "clients/cpp/errors.hpp"
#include "proto/depth_encoding.hpp"

namespace dtact::client {
namespace {

[[noreturn]] void refuse(const char* kind) {
  throw ProtocolError(std::string("a ") + kind +
                      " map of the daemon is damaged or in an unknown encoding: install the same "
                      "release on both sides");
}

}  // namespace

std::vector<std::int16_t> values_of(const v1::DepthMap& map) {
  std::vector<std::int16_t> values;
  if (!wire::decode_depth(map.encoding(), map.data(), map.width(), map.height(), values)) {
    refuse("depth");
  }
  return values;
}

std::vector<float> millimetres_of(const v1::DepthMap& map) {
  const std::vector<std::int16_t> values = values_of(map);
  std::vector<float> mm(values.size());
  std::ranges::transform(values, mm.begin(), [&map](std::int16_t value) {
    return value == map.untrusted_value() ? std::numeric_limits<float>::quiet_NaN()
                                          : static_cast<float>(value * map.um_per_unit() * 1e-3);
  });
  return mm;
}

std::vector<std::uint8_t> pixels_of(const v1::LumaMap& map) {
  const auto pixels = std::uint64_t{map.width()} * map.height();
  if (map.encoding() != v1::LUMA_GREY8 || map.data().size() != pixels) refuse("luma");
  return {map.data().begin(), map.data().end()};
}

}  // namespace dtact::client
