#include "clients/cpp/features.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "clients/cpp/errors.hpp"

namespace dtact::client {

bool lists_feature(const v1::HelloReply& daemon, const std::string& feature) {
  return std::ranges::find(daemon.features(), feature) != daemon.features().end();
}

void require_feature(const v1::HelloReply& daemon, const std::string& feature) {
  if (lists_feature(daemon, feature)) return;
  throw Refused(v1::ERROR_UNSUPPORTED,
                fmt::format("this daemon ({}, wire {}.{}) does not know \"{}\": update dtactd",
                            daemon.program(), daemon.major(), daemon.minor(), feature));
}

void require_features(const v1::HelloReply& daemon, const v1::Subscribe& s) {
  const std::array<std::pair<const char*, bool>, 8> needs{{
      {"jpeg", s.jpeg()},
      {"rates", s.depth_hz() != 0 || s.luma_hz() != 0 || s.jpeg_hz() != 0 || s.summary_hz() != 0 ||
                    s.cloud_hz() != 0 || s.pose_hz() != 0},
      {"decimation", s.decimation() > 1},
      {"units", s.um_per_unit() > 1},
      {"region", s.region_case() != v1::Subscribe::REGION_NOT_SET},
      {"events", s.has_events() && !s.events()},
      {"cloud", s.cloud() != v1::CLOUD_NONE},
      {"pose", s.pose()},
  }};
  for (const auto& [feature, needed] : needs) {
    if (needed) require_feature(daemon, feature);
  }
}

}  // namespace dtact::client
